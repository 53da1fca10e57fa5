"""The open-loop optimal storage schedule for the longest survivable fault, by sequential convex programming.

The schedule of a fault that is survived is changed so that the rotors swing less: the excursion is linearized with the
exact derivatives of the simulated run, a convex program within a trust region gives the next orders, and a simulation
accepts or refuses them. The margin gained is spent on a longer fault, until no schedule found survives the next one.
The result is a local optimum: a better schedule far from it may exist.
"""

import math
import time
from collections.abc import Callable

import numpy as np

from stabctl.clearing.critical_time import critical
from stabctl.clearing.search import Search
from stabctl.clearing.trial import Trial
from stabctl.controllers import BangBang
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.units import megawatt_hours, seconds

from .optimum_result import Optimum
from .order_program import Bounds
from .schedule_search import Iteration, ScheduleSearch
from .scheduled import Scheduled

PAPER = BangBang()


def optimum(
    base: Case | OperatingPoint,
    contingency: Contingency | str,
    *,
    storage: "Fleet | None" = None,
    law: BangBang = PAPER,
    window: str | float = "3s",
    rate: int = 60,
    energy: str | float | None = None,
    resolution: str | float = "0.125cyc",
    limit: str | float = "60cyc",
    observe: str | float = "5s",
    longest: str | float = "20s",
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    iterations: int = 60,
    progress: Callable[[Iteration], None] | None = None,
) -> Optimum:
    """The schedule of storage orders with which a system survives the longest fault: a local optimum.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    contingency : Contingency or str
        The fault and the circuits opened to clear it, as in `clearing_time`.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    law : BangBang
        Law with which the search begins, and which takes over after the schedule; a device is idle below its lowest
        voltage, also under the schedule.
    window : str or float
        Length of the schedule from clearing on: "3s", or seconds.
    rate : int, 1/s
        Least number of orders per second and device; each is held. They are a little more frequent, so that one
        begins with the fault, and one at clearing.
    energy : str or float, optional
        Largest energy that a device absorbs or injects from the first order on, "50kWh" or MWh; besides its capacity.
    resolution, limit, observe, longest, step, criterion
        As in `clearing_time`: every schedule is judged as there.
    iterations : int
        Maximum number of convex programs.
    progress : callable, optional
        Called with each `Iteration`.

    Returns
    -------
    Optimum

    Raises
    ------
    StudyError
        If there is no storage, an argument is not allowed, or the fault is not survived, or survived up to the limit,
        under the law alone.
    """
    began, point = time.perf_counter(), operating_point(base, storage)
    case = point.case
    if not isinstance(law, BangBang):
        raise StudyError(f"law = {shown(law)} cannot take over after a schedule; give BangBang(min_voltage=0.5).")
    if isinstance(iterations, bool) or not isinstance(iterations, int) or iterations < 1:
        raise StudyError(f"iterations = {shown(iterations)} is not a number of convex programs; give at least 1.")
    if not case.storage:
        raise StudyError(f"{case.name} has no storage to schedule; give storage='50MW', for example.")
    contingency = contingency if isinstance(contingency, Contingency) else Contingency(contingency)
    length = seconds(window, case.frequency_hz)
    if isinstance(rate, bool) or not isinstance(rate, int) or not 1 <= rate <= 1000:
        raise StudyError(f"rate = {rate!r} orders per second is not allowed; give 1 to 1000.")
    if not 1 / rate <= length <= 60:
        raise StudyError(f"A schedule of {length:g} s is not allowed; give one frame to 60 s.")
    search = Search.of(
        case, resolution=resolution, limit=limit, observe=observe, step=step, criterion=criterion, longest=longest
    )
    trial = Trial(point, contingency, law, search)
    first = critical(trial)
    if first.status != "found" or not first.cycles:
        raise StudyError(f"There is no clearing time to increase: {first.brief()}; give another contingency or limit.")
    scheduled = Scheduled(trial, law, rate, max(1, round(length * rate)))
    most = math.inf if energy is None else megawatt_hours(energy)
    schedules = ScheduleSearch(scheduled, _bounds(point, most), progress)
    schedules.begin(round(first.cycles / search.resolution_cycles))
    schedules.go(iterations)
    plan = schedules.plan
    return Optimum(
        case.name,
        contingency,
        plan.k * search.resolution_cycles,
        trial.duration(plan.k),
        first,
        scheduled.schedule(plan),
        schedules.run,
        scheduled.proof(plan),
        plan.before,
        tuple(schedules.iterations),
        schedules.ended,
        search,
        schedules.bounds,
        schedules.simulations,
        time.perf_counter() - began,
    )


def _bounds(point: OperatingPoint, most: float) -> Bounds:
    """The limits of the devices, and that of the energy (MWh) per device."""
    fleet = point.case.storage
    capacity, charge, ramp, rating, loss = np.array(
        [(s.energy or math.inf, s.charge, s.ramp or math.inf, s.rating, math.sqrt(s.efficiency)) for s in fleet]
    ).T
    with np.errstate(invalid="ignore"):
        full = np.where(np.isfinite(capacity), capacity * (1 - charge) / loss, math.inf)
        empty = np.where(np.isfinite(capacity), capacity * charge * loss, math.inf)
    per_s = np.divide(ramp, rating, out=np.full(len(fleet), math.inf), where=rating > 0)
    return Bounds(rating, -np.minimum(empty, most), np.minimum(full, most), per_s)

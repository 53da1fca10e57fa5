"""The open-loop optimal storage schedule for the longest survivable fault, and its result.

The schedule of a fault that is survived is changed so that the rotors swing less: the excursion is linearized with the
exact derivatives of the simulated run, a convex program within a trust region gives the next orders, and a simulation
accepts or refuses them. The margin gained is spent on a longer fault, until no schedule found survives the next one.
The result is a local optimum: a better schedule far from it may exist.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.tabular import Tabular
from stabctl._util.units import megawatt_hours, seconds
from stabctl._util.validation import checks_arguments
from stabctl._util.verbs import verb
from stabctl.clearing.critical_time import critical
from stabctl.clearing.result import ClearingTime, watched
from stabctl.clearing.trial import Run, Search, Trial
from stabctl.controllers import BangBang
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.trajectory import Trajectory

from ._excursion import Scheduled
from ._schedule_search import Bounds, Iteration, ScheduleSearch

if TYPE_CHECKING:
    import pandas as pd

PAPER = BangBang()
FULL = 0.99  # of a limit counts as all of it
ENDS = {
    "converged": "no step of the convex program improves it",
    "iterations": "stopped at the allowed number of convex programs",
    "limit": "stopped at the search limit",
}


@dataclass(frozen=True, repr=False)
class Optimum(Tabular):
    """A schedule of storage orders for the longest fault found that a system survives: a local optimum.

    Attributes
    ----------
    case, contingency
        The system and the fault.
    cycles, seconds
        The longest fault that is survived with a schedule.
    start
        The clearing time with the law alone.
    schedule
        The orders, and the law that takes over after them.
    run
        The simulated run of the schedule.
    proof
        How the search of clearing times judges it.
    before
        Frames of the schedule before clearing.
    iterations
        The convex programs.
    ended
        "converged", "iterations" or "limit".
    search
        The grid of clearing times and the criterion.
    bounds
        Limits of the orders.
    simulations, wall_s
        Number of simulations, and computing time (s).

    Examples
    --------
    >>> options = {"resolution": "1cyc", "window": "1s", "rate": 20, "iterations": 3}
    >>> found = st.design.optimum(st.load("two_area"), "7-8@0.4", storage="50MW", **options)
    >>> found.start.cycles, found.cycles, found.ended
    (26.0, 28.0, 'iterations')
    """

    case: str
    contingency: Contingency
    cycles: float
    seconds: float
    start: ClearingTime
    schedule: Schedule
    run: Trajectory
    proof: Run
    before: int
    iterations: tuple[Iteration, ...]
    ended: str
    search: Search
    bounds: Bounds
    simulations: int
    wall_s: float

    plot = verb("stabctl.view.figures.storage_control:plot_optimum")
    report = verb("stabctl.view.pages.pattern:report")

    @property
    def time(self) -> np.ndarray:
        """Instants of the frames (frames), s after clearing."""
        return (np.arange(len(self.schedule.orders)) - self.before) / self.schedule.rate

    @property
    def cleared(self) -> float:
        """Instant of clearing in the run, s."""
        return self.schedule.start + self.before / self.schedule.rate

    @property
    def fault(self) -> Contingency:
        """The contingency as in the run: its fault at the instant for which the schedule was made, and its events."""
        one, case, at = self.contingency, self.run.point.case, self.schedule.start
        events = tuple(replace(e, at=e.at + at - one.starts(case)) for e in one.others(case))
        return replace(one, at=at, clear=self.seconds, events=events)

    @property
    def df(self) -> "pd.DataFrame":
        """The schedule: a row per frame, its time after clearing, and the power absorbed by every device, MW."""
        import pandas as pd

        power = self.schedule.orders * self.bounds.rating
        columns = {f"absorbed_mw:{name}": power[:, j] for j, name in enumerate(self.run.devices())}
        return pd.DataFrame({"time_s": self.time} | columns)

    @property
    def energy_kwh(self) -> np.ndarray:
        """Most energy that every device absorbed or injected since the first order (devices), kWh."""
        t, end = self.run.time, self.cleared + self.time[-1] + 1 / self.schedule.rate
        energy = self.run.arrays.energy[(t >= self.schedule.start - 1e-9) & (t <= end + 1e-9)]
        return 1e3 * np.abs(energy - energy[0]).max(axis=0)

    @property
    def peak(self) -> tuple[int | str, float, float]:
        """The rotor that swings most against the center of inertia, its angle (rad), and when (s after clearing)."""
        moves = np.abs(self.run.arrays.swing)
        row, rotor = np.unravel_index(int(moves.argmax()), moves.shape)
        return self.run.point.rotor_names[rotor], float(moves[row, rotor]), float(self.run.time[row] - self.cleared)

    @property
    def binding(self) -> tuple[str, ...]:
        """The limits that hold back the devices until the largest swing, as phrases."""
        until = self.cleared + self.peak[2]
        acting = (self.run.time >= self.schedule.start - 1e-9) & (self.run.time < until - 1e-9)
        faulted = self.run.time < self.cleared - 1e-9
        order = np.abs(self.run.arrays.order)
        out = []
        if (full := float((order[acting] >= FULL).mean())) > 0.01:
            out.append(f"the power ratings ({100 * full:.0f} % of the time of the devices until the largest swing)")
        bus = [self.run.point.net.place[s.bus] for s in self.run.point.case.storage]
        low = np.abs(self.run.arrays.V[:, bus]) < self.schedule.min_voltage
        for when, part in (("during the fault", acting & faulted), ("after clearing", acting & ~faulted)):
            if part.any() and (idle := float(low[part].mean())) > 0.01:
                out.append(f"low voltage {when} ({100 * idle:.0f} % of the time of the devices)")
        level = self.bounds.energy(self.schedule.orders, self.schedule.rate)
        if ((level >= FULL * self.bounds.full) | (level <= FULL * self.bounds.empty)).any():
            out.append("the energy of the devices")
        return tuple(out)

    def __str__(self) -> str:
        c, p = self.contingency, self.peak
        what = f"{self.case}, fault {c.fault}" + (f", trip {', '.join(map(str, c.trip))}" if c.trip else "")
        seen = watched(self.search, self.proof.observed_s, [c])
        gate = self.schedule.min_voltage
        idle = f", idle below {gate:g} pu" if gate else ""
        made = f"{len(self.iterations)} convex programs, {self.simulations} simulations"
        used, takes_over = self.energy_kwh, self.time[-1] + 1 / self.schedule.rate
        return (
            f"{what}: {self.cycles:g} cycles ({self.seconds:.4f} s) with the best schedule found, "
            f"{self.start.cycles:g} with the law alone{idle}. This is a local optimum: {ENDS[self.ended]} ({made}); "
            f"a better schedule far from it may exist. Verified by simulation, {seen}; the law takes "
            f"over {takes_over:.3g} s after clearing. Machine {p[0]} has the largest swing, "
            f"{np.rad2deg(p[1]):.0f} degrees against the center of inertia, {p[2]:.2f} s after clearing. Energy used: "
            f"{used.sum():.3g} kWh in total, {used.max():.3g} kWh by one device. Active limits: "
            f"{'; '.join(self.binding) or 'none'}."
        )

    __repr__ = __str__


@checks_arguments
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
    storage : str, float, mapping, or iterable of Storage, optional
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

    Examples
    --------
    >>> options = {"resolution": "1cyc", "window": "1s", "rate": 20, "iterations": 3}
    >>> st.design.optimum(st.load("two_area"), "7-8@0.4", storage="50MW", **options).cycles
    28.0
    """
    began, point = time.perf_counter(), operating_point(base, storage)
    case = point.case
    if isinstance(iterations, bool) or not isinstance(iterations, int) or iterations < 1:
        raise StudyError(f"iterations = {shown(iterations)} is not a number of convex programs; give at least 1.")
    if not case.storage:
        raise StudyError(f"{case.name} has no storage to schedule; give storage='50MW', for example.")
    contingency = (contingency if isinstance(contingency, Contingency) else Contingency(contingency)).placed(case)
    length = seconds(window, case.frequency_hz)
    if isinstance(rate, bool) or not isinstance(rate, int) or not 1 <= rate <= 1000:
        raise StudyError(f"rate = {rate!r} orders per second is not allowed; give 1 to 1000.")
    if not 1 / rate <= length <= 60:
        raise StudyError(f"A schedule of {length:g} s is not allowed; give one frame to 60 s.")
    limited = [str(key) for key, s in zip(naming.keys(case, "storage"), case.storage, strict=True) if s.ramp]
    if limited:
        raise StudyError(
            f"Schedules cannot be planned for devices with a ramp limit ({', '.join(limited)}); set their ramp to 0."
        )
    search = Search.of(
        case, resolution=resolution, limit=limit, observe=observe, step=step, criterion=criterion, longest=longest
    )
    trial = Trial(point, contingency, law, search)
    first = critical(trial)
    if first.status != "found" or not first.cycles:
        raise StudyError(f"There is no clearing time to increase: {first.brief()}; give another contingency or limit.")
    scheduled = Scheduled(trial, law, rate, length)
    most = math.inf if energy is None else megawatt_hours(energy)
    if not most > 0:
        raise StudyError(f"energy = {shown(energy)} is not allowed; give more than 0.")
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
    capacity, charge, rating, loss = np.array(
        [(s.energy or math.inf, s.charge, s.rating, math.sqrt(s.efficiency)) for s in fleet]
    ).T
    with np.errstate(invalid="ignore"):
        full = np.where(np.isfinite(capacity), capacity * (1 - charge) / loss, math.inf)
        empty = np.where(np.isfinite(capacity), capacity * charge * loss, math.inf)
    return Bounds(rating, -np.minimum(empty, most), np.minimum(full, most))

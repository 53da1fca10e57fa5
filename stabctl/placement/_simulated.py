"""A job of a siting study: a fleet simulated against one scenario, or its critical clearing time there."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from stabctl.clearing import Search, Trial
from stabctl.clearing.critical_time import last_stable
from stabctl.clearing.trial import observed
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.jobs import Found, Kind, Task
from stabctl.jobs.task import Base, sha256, text
from stabctl.model.fleet import extended
from stabctl.simulation.attached import attached, resized
from stabctl.simulation.contingency import Contingency, Disturbance
from stabctl.simulation.control import Control, acting
from stabctl.simulation.recording import Recorded
from stabctl.simulation.setup import setup
from stabctl.simulation.swings import Swings
from stabctl.simulation.trajectory import Trajectory

from .contingencies import target_cycles, without_fault
from .siting_rows import SAME

FORMAT = 12
GRID = 0.125  # cycles
What = Literal["outcome", "peak", "energy", "currents", "critical time"]


class Simulated(NamedTuple):
    """What is asked about a fleet in a scenario."""

    what: What
    contingency: Contingency
    ratings: tuple[float, ...]  # MW   of all devices, existing ones first
    built: bool  # without the devices of 0 MW, as in the system that is built
    search: Search
    control: str  # as text, empty if the key says nothing

    def given(self) -> dict[str, Any]:
        """Column -> value."""
        return {
            "what": self.what,
            "contingency": text(self.contingency),
            "ratings": json.dumps(self.ratings),
            "built": str(self.built),
            "search": text(self.search),
            "control": self.control,
        }


class Shared(NamedTuple):
    """What many simulations share."""

    base: Base
    control: Control


class Outcome(NamedTuple):
    """What a simulation of a fleet shows."""

    stable: bool
    machine: int | str | None  # that loses synchronism first
    peak: np.ndarray  # (rotors) rad   largest change of every angle from the center of inertia


class Peaks(NamedTuple):
    """The largest angles of a simulation of a fleet."""

    stable: bool
    angle: np.ndarray  # (rotors) rad   largest change of every angle from the center of inertia
    time: np.ndarray  # (rotors) s   its instant, from the last event on


class CriticalTime(NamedTuple):
    """The critical clearing time of a contingency with a fleet."""

    cycles: float | None  # on a grid of about 1/8 cycle that contains the target; None: no fault, or there is none
    stable: bool  # at the target
    machine: int | str | None  # loses synchronism first just beyond
    growing: bool = False  # the swings grow at the target
    longest: float | None = None  # cycles   of the faults tried, if that is stable and there is no critical time


def task(one: Simulated, shared: Shared, identified: bool) -> Task:
    """The task of a question; unless `identified`, its key says nothing."""
    if not identified:
        return Task("", one, shared, FLEET)
    one = one._replace(control=text(shared.control))
    key = sha256({"format": FORMAT, "job": one.given(), "case": shared.base.fingerprint})
    return Task(key, one, shared, FLEET)


def simulate(one: Simulated, shared: Shared, record: Recorded) -> tuple[Trajectory, bool]:
    """The simulation of a scenario with a fleet, and whether it is stable and keeps the criteria."""
    if one.contingency.fault is not None:
        asked = trial(one, shared)
        system, last = asked.setup, asked.last_event(1)
        events: Disturbance = asked.events(1)
    else:
        point, how = fleet_of(one, shared), one.search
        system = setup(point, shared.control, step=how.step, criterion=how.criterion)
        events, last = without_fault(one.contingency, point.case, shared.control)
    ran, judged = observed(system, events, last, one.search, True if one.search.criteria else record)
    return ran, judged.kept if judged else ran.outcome.stable


def trial(one: Simulated, shared: Shared, grid: float | None = None) -> Trial:
    """A scenario with a fault at multiples of `grid` (cycles), or of its clearing time."""
    target = target_cycles(one.contingency, shared.base.point.case) or 0.0
    limit = max(one.search.limit_cycles, 2 * target)
    search = replace(one.search, resolution_cycles=grid or target, limit_cycles=limit)
    return Trial(fleet_of(one, shared), one.contingency, shared.control, search)


def fleet_of(one: Simulated, shared: Shared) -> OperatingPoint:
    """The operating point with a fleet; with all devices if controllers may read or drive any of them."""
    point, ratings = shared.base.point, np.array(one.ratings)
    if one.built and not acting(shared.control).controllers:
        rows = tuple(np.flatnonzero(ratings).tolist())
        known = vars(point).setdefault("fleets", {})
        if rows not in known:
            case = extended(point.case, (point.case.storage[i] for i in rows))
            known[rows] = operating_point.solve(case, point.flow)
        point, ratings = known[rows], ratings[[*rows]]
    return resized(point, ratings)


def answer(task: Task) -> Found:
    """The answer to a question."""
    one, shared = task.job, task.shared
    attached(shared.base.point, acting(shared.control).controllers)  # once, for all fleets
    target = target_cycles(one.contingency, shared.base.point.case)
    if one.what == "critical time" and target is not None:
        return _critical_time(one, shared, target)
    asked = VALUES.get(one.what, VALUES["outcome"])  # without a fault there is no critical time
    ran, kept = simulate(one, shared, asked.record)
    values = asked.of(ran)
    if asked.per_device and values.shape[-1] < len(one.ratings):
        values, found = np.zeros((*values.shape[:-1], len(one.ratings))), values
        values[..., np.flatnonzero(one.ratings)] = found
    return _found(kept, ran.outcome.machine, 1, ran.outcome.swings, values=json.dumps(values.tolist()))


def _peaks(ran: Trajectory) -> np.ndarray:
    """Largest change of every angle from the center of inertia, rad, and its instant from the last event on, s."""
    at = ran.time[np.abs(ran.arrays.swing).argmax(axis=0)]
    return np.stack([ran.peak, at - ran.happened.last_event_s])


def _critical_time(one: Simulated, shared: Shared, target: float) -> Found:
    """The critical clearing time on a grid of about an eighth of a cycle that contains the target (cycles)."""
    count = max(1, round(target / GRID))
    tried = trial(one, shared, target / count)
    found = last_stable(tried.attempt, tried.search.last, count, 2, **tried.search.shorter())
    asked, last = found.runs[count], found.critical * target / count
    cycles = last if found.status == "found" else None
    longest = last if found.status == "stable_at_limit" else None
    return _found(asked.stable, found.machine, len(found.runs), asked.swings, cycles=cycles, longest=longest)


def _currents(ran: Trajectory) -> np.ndarray:
    """The largest current of every device (pu on its MVA), and the lowest voltage of its bus with it (pu)."""
    current, point = ran.arrays.storage_current, ran.point
    most = current.max(axis=0)
    voltage = np.abs(ran.arrays.V[:, [point.net.place[s.bus] for s in point.case.storage]])
    return np.array([most, np.where(current >= (1 - SAME) * most, voltage, np.inf).min(axis=0)])


class Values(NamedTuple):
    """What a simulation of a fleet is asked for, and what must be recorded for it."""

    of: Callable[[Trajectory], np.ndarray]
    record: Recorded
    per_device: bool = False


VALUES: dict[What, Values] = {
    "outcome": Values(lambda ran: ran.peak, False),
    "peak": Values(_peaks, "rotors"),
    "energy": Values(lambda ran: np.ptp(ran.arrays.energy, axis=0), True, per_device=True),  # MWh
    "currents": Values(_currents, True, per_device=True),
}


def _found(stable: bool, machine: int | str | None, simulations: int, swings: Swings | None, **more: Any) -> Found:
    growing = int(swings is not None and swings.growing)
    known = {"stable": int(stable), "machine": json.dumps(machine), "simulations": simulations, "growing": growing}
    return Found(known | more)


FLEET = Kind(
    "place",
    dict.fromkeys(Simulated._fields, str),
    {
        "stable": int,
        "machine": str,
        "simulations": int,
        "growing": int,
        "cycles": float,
        "longest": float,
        "values": str,
    },
    answer,
    FORMAT,
)

"""A job of a screen: the clearing times of faults at one bus, each cleared by opening another line there."""

import json
from typing import Any, NamedTuple

from stabctl.jobs import Found, Kind, Task
from stabctl.jobs.base import Base
from stabctl.jobs.key import sha256, text
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control

from .critical_time import critical, first_try
from .plain import as_plain, from_plain
from .result import ClearingTime
from .search import Search
from .trial import Trial

FORMAT = 1
NEAR = 0.5  # cycles   first stride from the answer of another line at the same bus


class Shared(NamedTuple):
    """What the faulted buses of a screen share."""

    base: Base
    search: Search
    control: Control


class FaultedBus(NamedTuple):
    """The lines that are opened, one after the other, to clear a fault at a bus."""

    case: str
    fault: str
    trip: tuple[str, ...]
    study: str  # search and control, as text

    def given(self) -> dict[str, Any]:
        """Column -> value."""
        return self._asdict() | {"trip": " ".join(self.trip)}


def tasks(by_bus: dict[str, list[str]], shared: Shared, identified: bool) -> list[Task]:
    """A task for every faulted bus, from the names of the lines that are opened there.

    Unless `identified`, its key says nothing about case, search and control. Raises StudyError if a control cannot be
    identified.
    """
    case, found = shared.base.point.case, []
    study = text([shared.search, shared.control]) if identified else ""
    content = shared.base.fingerprint if identified else ""
    for bus, names in by_bus.items():
        job = FaultedBus(case.name, bus, tuple(names), study)
        found.append(Task(sha256({"format": FORMAT, "job": job.given(), "case": content}), job, shared, BUS))
    return found


def run(task: Task) -> Found:
    """The clearing times of a faulted bus."""
    job, (base, search, control) = task.job, task.shared
    pairs = _pairs([Trial(base.point, Contingency(job.fault, trip=(name,)), control, search) for name in job.trip])
    shortest = min((p.cycles for p in pairs if p.cycles is not None), default=None)
    simulations = sum(len(p.runs) for p in pairs) + 1
    found = json.dumps([as_plain(pair) for pair in pairs])
    return Found({"simulations": simulations, "shortest_cycles": shortest, "pairs": found})


def pairs_of(row: dict[str, Any], search: Search) -> list[ClearingTime]:
    """The clearing times in a row."""
    return [from_plain(one, search) for one in json.loads(row["pairs"])]


def _pairs(trials: list[Trial]) -> list[ClearingTime]:
    """The clearing times of one faulted bus; the search of each begins at the longest answer so far."""
    start, longest, pairs = first_try(trials[0]), -1, []
    for trial in trials:
        pairs.append(critical(trial, start))
        if pairs[-1].status != "unstable_at_zero":
            found, search = pairs[-1].cycles, trial.search
            k = search.last if found is None else round(found / search.resolution_cycles)
            if k > longest:
                longest, start = k, (k + 1, search.points(NEAR))
    return pairs


BUS = Kind(
    "screen",
    {"case": str, "fault": str, "trip": str, "study": str},
    {"simulations": int, "shortest_cycles": float, "pairs": str},
    run,
    FORMAT,
)

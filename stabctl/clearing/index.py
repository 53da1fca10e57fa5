"""The severity of contingencies, from one short run each, so that a screen that is watched can begin with the worst.

Every fault is cleared after the same `CLEARED` s, by opening its circuits, and the run is watched for `WATCHED` s.
Contingencies that are unstable come first, by the time t at which the run ends; then the stable ones, by the largest
change of a rotor angle against the center of inertia of its island,

    d = max over machines i and times t of |delta_i(t) - delta_COI(t) - (delta_i(0) - delta_COI(0))|.

One run at one clearing time for all is the first step of FILTRA (Ernst, Ruiz-Vega, Pavella, Hirsch, Sobajic, "A unified
approach to transient stability contingency filtering, ranking and assessment", IEEE Trans. Power Systems 16, 2001);
angles against the center of inertia are among the indices that Fu and Bose compare ("Contingency ranking based on
severity indices in dynamic security analysis", IEEE Trans. Power Systems 14, 1999). `sims/screening_index.py` measures
the ranking.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.jobs import Found, Kind, Runner, Task
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control

from .trial import Search, Trial

CLEARED = 0.1  # s   clearing time of every run: six cycles of 60 Hz, five of 50 Hz
WATCHED = 2.0  # s   after clearing: swings between areas come to their first peak
FORMAT = 6


class Severity(NamedTuple):
    """What the short run of a contingency shows."""

    contingency: Contingency
    stable: bool
    time_s: float  # s   end of the run, from the fault on
    swing_deg: float  # degrees   largest change of a rotor angle against the center of inertia of its island

    @property
    def order(self) -> tuple[bool, float]:
        """By which the worst is the first."""
        return self.stable, -self.swing_deg if self.stable else self.time_s

    def __str__(self) -> str:
        return f"angles change by {self.swing_deg:.0f} degrees" if self.stable else f"lost after {self.time_s:.2f} s"


def severities(
    point: OperatingPoint, contingencies: Sequence[Contingency], control: Control, search: Search
) -> Iterator[Severity]:
    """The severity of every contingency. Only step, criterion and observation of the search matter."""
    cycles = CLEARED * point.case.frequency_hz
    observed = min(WATCHED, search.observed_s)
    short = replace(search, resolution_cycles=cycles, limit_cycles=cycles, observed_s=observed, longest_s=0.0)
    first = Trial(point, contingencies[0], control, short)
    for one in map(first.of, contingencies):
        ran = one.simulate(1)
        end = ran.outcome
        yield Severity(one.contingency, end.stable, end.time_s - one.at, ran.max_angle_from_coi_deg)


def ranked(
    tasks: Iterable[Task], *, store: str | Path | None, workers: int | None, scheduler: str | None
) -> tuple[list[Task], list[Severity]]:
    """The places of a screen and their contingencies, the worst first. A store keeps the runs in severity.db."""
    given, found = list(tasks), dict[str, list[Severity]]()
    with Runner(INDEX, store=store, workers=workers, scheduler=scheduler) as runner:
        for task, row in runner.rows(task._replace(kind=INDEX) for task in given):
            plain = json.loads(row["severities"])
            found[task.key] = [Severity(one, *of) for one, of in zip(task.job.contingencies, plain, strict=True)]
    places = sorted(given, key=lambda task: min(one.order for one in found[task.key]))
    return places, sorted((one for task in given for one in found[task.key]), key=lambda one: one.order)


def run(task: Task) -> Found:
    """The severities of the contingencies at one place."""
    base, search, control = task.shared
    found: list[Any] = [one[1:] for one in severities(base.point, task.job.contingencies, control, search)]
    return Found({"severities": json.dumps(found)})


INDEX = Kind("severity", {"case": str, "fault": str, "trip": str, "study": str}, {"severities": str}, run, FORMAT)

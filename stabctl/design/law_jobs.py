"""A job of the design of a storage law: a law is measured in one contingency."""

import json
from dataclasses import replace
from typing import Any, NamedTuple

from stabctl.clearing.critical_time import critical
from stabctl.clearing.last_stable import Status
from stabctl.clearing.search import Search
from stabctl.clearing.trial import Trial
from stabctl.controllers import Law, SampledLaw, StorageLaw
from stabctl.jobs import Found, Kind, Task
from stabctl.jobs.base import Base
from stabctl.jobs.key import sha256, text
from stabctl.simulation.contingency import Contingency

from .duty import Duty, Later, duty, later

FORMAT = 1
WATCHED = 10.0  # s   after clearing, in which the duty is measured


class Measured(NamedTuple):
    """What a law reaches in one contingency."""

    reach: float  # cycles   critical clearing time; 0 if unstable at once, the longest one tried if stable there
    status: Status
    machine: int | str | None  # that loses synchronism first just beyond
    runs: int
    duty: Duty  # cleared at the critical time
    later: Later | None  # the same, if the law returns the energy

    @property
    def energy_kwh(self) -> float:
        """Energy that the devices use."""
        return max(self.duty.energy_kwh, self.later.energy_kwh if self.later else 0.0)


class Measurement(NamedTuple):
    """What is measured: a law (None: idle devices) in a contingency, by a search that begins near a clearing time."""

    law: Law | None
    contingency: Contingency
    search: Search
    near: float | None  # cycles
    within_s: float  # s   after which the energy of the devices shall be back; 0: not watched

    def given(self) -> dict[str, Any]:
        """Column -> value."""
        study = text([self.search, self.near, self.within_s])
        return {"law": text(self.law), "contingency": text(self.contingency), "search": study}


def task(job: Measurement, base: Base, identified: bool) -> Task:
    """The task of a measurement; unless `identified`, its key says nothing about the case."""
    case = base.fingerprint if identified else ""
    return Task(sha256({"format": FORMAT, "job": job.given(), "case": case}), job, base, LAW)


def run(task: Task) -> Found:
    """Measure a law."""
    job, point = task.job, task.shared.point
    search = job.search
    start = None if job.near is None else (round(job.near / search.resolution_cycles) + 1, 1)
    found = critical(Trial(point, job.contingency, job.law, search), start)
    reach = {"unstable_at_zero": 0.0, "stable_at_limit": search.limit_cycles}.get(found.status, found.cycles or 0.0)
    k = min(round(reach / search.resolution_cycles), search.last)
    watched = Trial(point, job.contingency, job.law, replace(search, observed_s=WATCHED, longest_s=0.0))
    use = duty(watched.simulate(k, record=True))
    after = later(watched, k, job.within_s) if job.within_s and _returns(job.law) else None
    values = {"reach_cycles": reach, "outcome": found.status, "runs": len(found.runs)}
    return Found(values | {"rest": json.dumps([found.machine, use, after])})


def measured(row: dict[str, Any]) -> Measured:
    """What is in a row."""
    machine, use, after = json.loads(row["rest"])
    later = None if after is None else Later(*after)
    return Measured(row["reach_cycles"], row["outcome"], machine, row["runs"], Duty(*use), later)


def _returns(law: Law | None) -> bool:
    """Whether a law returns the energy of the devices."""
    inner = law.law if isinstance(law, SampledLaw) else law
    return isinstance(inner, StorageLaw) and inner.return_time > 0


LAW = Kind(
    "law",
    {"law": str, "contingency": str, "search": str},
    {"reach_cycles": float, "outcome": str, "runs": int, "rest": str},
    run,
    FORMAT,
)

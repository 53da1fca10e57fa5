"""A task: a job with its case, ready to be sent anywhere, and the key of what it will find."""

import hashlib
import json
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from stabctl import io
from stabctl.errors import CaseError, StudyError
from stabctl.estimation.pmu import Pmu
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.model.tables import TABLES
from stabctl.simulation import events
from stabctl.units import seconds

from .job import FORMAT, Job


class Task(NamedTuple):
    """A job, the case it is on, and the key that both determine."""

    key: str
    job: Job
    case: Case


def tasks(jobs: Iterable[Job], path: str | Path) -> tuple[Task, ...]:
    """The tasks of the jobs of a study file, each once.

    Folders are found from the file's own. Every case is loaded, and every place, size and time looked at, before the
    first job runs: `StudyError` names file, key and value.
    """
    path = Path(path)
    load = cache(lambda name: _case(path, name))
    plain = cache(lambda name, machines: load(name).classical() if machines == "classical" else load(name))
    print_of = cache(lambda name, machines: fingerprint(plain(name, machines)))
    looked: set[tuple[str, str, str]] = set()
    found: dict[str, Task] = {}
    for job in jobs:
        case = plain(job.case, job.machines)
        _look(path, job, case, looked)
        key = key_of(job, print_of(job.case, job.machines))
        found.setdefault(key, Task(key, job, case))
    return tuple(found.values())


def key_of(job: Job, case: str) -> str:
    """SHA-256 of all that determines the result: the job, its case by its fingerprint, the format of results."""
    content = job.given() | {"case": case}
    return hashlib.sha256(canonical({"format": FORMAT, "job": content}).encode()).hexdigest()


def fingerprint(case: Case) -> str:
    """SHA-256 of what a case holds, wherever it was read."""
    content = {name: [row._asdict() for row in getattr(case, name)] for name in TABLES}
    content |= {name: getattr(case, name) for name in ("name", "base_mva", "frequency_hz")}
    content["devices"] = {
        model: [[number, par._asdict()] for number, par in rows.items()] for model, rows in case.devices.items()
    }
    return hashlib.sha256(canonical(content).encode()).hexdigest()


def canonical(content: object) -> str:
    """The one JSON text of a content."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _case(path: Path, name: str) -> Case:
    try:
        return io.load(name if name in io.packaged() else path.parent / name)
    except CaseError as error:
        raise StudyError(f"{path}, case = {name!r}: {error}") from None


LOOK: dict[str, Callable[[Case, str], object]] = {
    "fault": events.locate,
    "trip": lambda case, text: [events.branch(case, name) for name in circuits(text)],
    "clear": lambda case, text: seconds(text, case.frequency_hz),
    "resolution": lambda case, text: seconds(text, case.frequency_hz),
    "limit": lambda case, text: seconds(text, case.frequency_hz),
    "storage": lambda case, text: fleet.devices(case, text.replace("%dispatch", "%mva")),
}


def circuits(text: str) -> tuple[str, ...]:
    """Circuits as a study names them, `83-33, 7-8#2`."""
    return tuple(text.replace(",", " ").split())


def _look(path: Path, job: Job, case: Case, looked: set[tuple[str, str, str]]) -> None:
    """Refuse what the case does not have; what was looked at before is not looked at again."""
    for name, look in LOOK.items():
        text = getattr(job, name)
        if not text or (job.case, name, text) in looked:
            continue
        try:
            look(case, text)
        except StudyError as error:
            raise StudyError(f"{path}, {name} = {text!r}: {error}") from None
        looked.add((job.case, name, text))
    try:
        pmu(job)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None


def pmu(job: Job) -> Pmu:
    """The PMUs of a job."""
    return Pmu.noisy(job.pmu_rate, job.pmu_noise, job.latency, job.loss)

"""A task: a job with its case, ready to be sent to any process, and the key of its result."""

import hashlib
import json
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from stabctl import devices, io
from stabctl.errors import StabctlError, StudyError
from stabctl.estimation.pmu import Pmu
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.model.tables import TABLES
from stabctl.simulation.contingency import Contingency
from stabctl.units import seconds

from .job import FORMAT, Job


class Task(NamedTuple):
    """A job, its case, and the key that both determine."""

    key: str
    job: Job
    case: Case


def tasks(jobs: Iterable[Job], path: str | Path) -> tuple[Task, ...]:
    """The tasks of the jobs of a study file, each once.

    Case folders are relative to the study file. Every case is loaded, and every job checked, before the first one runs.

    Raises
    ------
    StudyError
        With file, key and value.
    """
    path = Path(path)
    load = cache(lambda name: _case(path, name))
    checked: set[tuple[str, ...]] = set()

    @cache
    def changed(name: str, machines: str, changes: str) -> tuple[Case, str]:
        case = _changed(path, load(name), Job("simulate", name, set=changes))
        case = case.classical() if machines == "classical" else case
        return case, fingerprint(case)

    found: dict[str, Task] = {}
    for job in jobs:
        case, own = changed(job.case, job.machines, job.set)
        _check(path, job, case, checked)
        key = key_of(job, own)
        found.setdefault(key, Task(key, job, case))
    return tuple(found.values())


def key_of(job: Job, case: str) -> str:
    """SHA-256 of everything that determines the result: the job, the fingerprint of its case, the format of results."""
    content = job.given() | {"case": case, "set": ""}  # the changes of the case are in its fingerprint
    return hashlib.sha256(canonical({"format": FORMAT, "job": content}).encode()).hexdigest()


def fingerprint(case: Case) -> str:
    """SHA-256 of the content of a case, wherever it was read from, and of the user's own devices in it."""
    content: dict[str, Any] = {name: [row._asdict() for row in getattr(case, name)] for name in TABLES}
    content |= {name: getattr(case, name) for name in ("name", "base_mva", "frequency_hz")}
    content["devices"] = {
        model: [[number, par._asdict()] for number, par in rows.items()] for model, rows in case.devices.items()
    }
    files = {model: Path(str(devices.every()[model].__file__)) for model in case.devices}
    known = devices.registered()
    own = {model: file.read_text(encoding="utf-8") for model, file in files.items() if str(file) in known}
    content |= {"device_files": own} if own else {}
    return hashlib.sha256(canonical(content).encode()).hexdigest()


def canonical(content: object) -> str:
    """The unique JSON text of a content."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def contingency(job: Job) -> Contingency:
    """The contingency of a job; a clearing time has its own duration of the fault."""
    clear, at = (job.clear, job.at) if job.kind == "simulate" else (None, 0.0)
    impedance = complex(job.fault_r, job.fault_x)
    return Contingency(job.fault or None, clear or None, job.trip, at=at, impedance=impedance)


def pmu(job: Job) -> Pmu:
    """The PMUs of a job."""
    return Pmu.noisy(job.pmu_rate, job.pmu_noise, job.latency, job.loss)


def _case(path: Path, name: str) -> Case:
    try:
        return io.load(name if name in io.packaged() else path.parent / name)
    except StabctlError as error:
        raise StudyError(f"{path}, case = {name!r}: {error}") from None


def _changed(path: Path, case: Case, job: Job) -> Case:
    """The case with the changes of a job."""
    if not job.changes:
        return case
    try:
        return case.set(job.changes)
    except StabctlError as error:
        given = ", ".join(f"{key} = {value!r}" for key, value in job.changes.items())
        raise StudyError(f"{path}, set.{given}: {error}") from None


CHECKS: dict[str, Callable[[Case, str], object]] = {
    "fault": lambda case, text: Contingency(text, 1.0).check(case),
    "trip": lambda case, text: Contingency(trip=text).check(case),
    "clear": lambda case, text: seconds(text, case.frequency_hz),
    "resolution": lambda case, text: seconds(text, case.frequency_hz),
    "limit": lambda case, text: seconds(text, case.frequency_hz),
    "scan": lambda case, text: seconds(text, case.frequency_hz),
    "storage": lambda case, text: fleet.devices(case, text.replace("%dispatch", "%mva")),
}


def _check(path: Path, job: Job, case: Case, checked: set[tuple[str, ...]]) -> None:
    """Reject what the case does not have; a value is checked once."""
    for name, check in CHECKS.items():
        text = getattr(job, name)
        if not text or (job.case, job.set, name, text) in checked:
            continue
        try:
            check(case, text)
        except StudyError as error:
            raise StudyError(f"{path}, {name} = {text!r}: {error}") from None
        checked.add((job.case, job.set, name, text))
    try:
        pmu(job)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None

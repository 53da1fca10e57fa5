"""The tasks of a study: its jobs, each with its case and the key of its result."""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from stabctl import io
from stabctl.errors import StabctlError, StudyError
from stabctl.jobs import Task
from stabctl.jobs.key import fingerprint, sha256
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency
from stabctl.units import seconds

from .job import FORMAT, Job
from .kind import SWEEP


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
        found.setdefault(key, Task(key, job, case, SWEEP))
    return tuple(found.values())


def key_of(job: Job, case: str) -> str:
    """SHA-256 of everything that determines the result: the job, the fingerprint of its case, the format of results."""
    content = job.given() | {"case": case, "set": ""}  # the changes of the case are in its fingerprint
    return sha256({"format": FORMAT, "job": content})


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
        _ = job.pmu
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None

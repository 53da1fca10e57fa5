"""The tasks of a study: its jobs, each with its case and the key of its result."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from stabctl import io
from stabctl.clearing.search import AUTO
from stabctl.controllers import file
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.signal_kinds import INPUTS, OUTPUTS
from stabctl.dynamics.signals import chosen
from stabctl.errors import StabctlError, StudyError
from stabctl.jobs import Task
from stabctl.jobs.key import fingerprint, sha256, text
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency
from stabctl.units import seconds

from .job import FORMAT, Job
from .kind import SWEEP


class Shared(NamedTuple):
    """What jobs share: a case, and controllers."""

    case: Case
    controllers: tuple[Controller | Law, ...] = ()


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
    controllers = cache(lambda names: _controllers(path, names))
    checked: set[tuple[str, ...]] = set()

    @cache
    def changed(name: str, machines: str, share: float, changes: str) -> tuple[Case, str]:
        case = load(name).with_motors(share) if share else load(name)
        case = _changed(path, case, Job("simulate", name, set=changes))
        case = case.classical() if machines == "classical" else case
        return case, fingerprint(case)

    found: dict[str, Task] = {}
    for job in jobs:
        case, own = changed(job.case, job.machines, job.motor_share, job.set)
        _check(path, job, case, checked)
        acting = controllers(job.controller)
        _signals(path, job, case, acting)
        key = key_of(job, own, acting)
        found.setdefault(key, Task(key, job, Shared(case, acting), SWEEP))
    return tuple(found.values())


def key_of(job: Job, case: str, controllers: Sequence[Controller | Law] = ()) -> str:
    """SHA-256 of what determines the result: the job, the fingerprint of its case, controllers, format of results."""
    content = job.given() | {"case": case, "set": ""}  # the changes of the case are in its fingerprint
    content |= {"controller": text(controllers)}
    return sha256({"format": FORMAT, "job": content})


def _case(path: Path, name: str) -> Case:
    try:
        return io.load(name if name in io.packaged() else path.parent / name)
    except StabctlError as error:
        raise StudyError(f"{path}, case = {name!r}: {error}") from None


def _controllers(path: Path, names: str) -> tuple[Controller | Law, ...]:
    """The controllers and laws in the files of a job."""
    try:
        return tuple(file.load(path.parent / name.strip()) for name in names.split(",") if name.strip())
    except StabctlError as error:
        raise StudyError(f"{path}, controller = {names!r}: {error}") from None


def _signals(path: Path, job: Job, case: Case, controllers: Sequence[Controller | Law]) -> None:
    """Reject controllers of signals that the case does not have with the storage of the job."""
    if controllers and job.storage:
        case = case.with_storage(job.storage.replace("%dispatch", "%mva"))
    try:
        for one in (c for c in controllers if isinstance(c, Controller)):
            chosen(case, one.inputs, OUTPUTS)
            chosen(case, one.outputs, INPUTS)
    except StudyError as error:
        raise StudyError(f"{path}, controller = {job.controller!r}: {error}") from None


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
    "scan": lambda case, text: text if text == AUTO else seconds(text, case.frequency_hz),
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
    key = (job.case, job.set, job.storage, *map(str, job.devices.values()))
    if job.storage and key not in checked:
        try:
            case.with_storage(job.storage.replace("%dispatch", "%mva"), **job.devices)
        except StabctlError as error:
            raise StudyError(f"{path}, storage = {job.storage!r}: {error}") from None
        checked.add(key)
    try:
        _ = job.pmu
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None

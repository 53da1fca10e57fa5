"""A sweep: the tasks of a study that the results file does not have, run and stored one by one.

A task is a job of the study with its case, its controllers and the key of its result.
"""

import shlex
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from stabctl import io
from stabctl._util import process
from stabctl._util.errors import StabctlError, StudyError
from stabctl._util.schema import fields
from stabctl._util.units import seconds
from stabctl._util.validation import checks_arguments
from stabctl._util.wording import counted
from stabctl.clearing.trial import AUTO
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen
from stabctl.io import control_files
from stabctl.jobs import Row, Task
from stabctl.jobs.cluster import Cluster
from stabctl.jobs.store import Store
from stabctl.jobs.task import fingerprint, sha256, stored, text
from stabctl.model import unusual
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency

from . import pool, results, study_file
from .job import FORMAT, OF_DEVICES, SWEEP, Job, acting, control_of

if TYPE_CHECKING:
    import pandas as pd

OF_LAWS = "deadband", "min_voltage"
OF_PMUS = "pmu_rate", "pmu_noise", "latency", "loss", "seed"


@dataclass(frozen=True)
class Sweep:
    """Summary of a sweep; the results are in its file."""

    path: Path
    own: frozenset[tuple[str, ...]]  # what tells its rows there from others: key and labels
    jobs: int  # of the study
    before: int  # that were in the file already
    done: int  # by this sweep
    errors: int  # jobs of the study that ended in an error
    interrupted: bool
    warnings: tuple[str, ...]  # about the cases
    wall_s: float

    @property
    def results(self) -> results.Results:
        """The rows of its jobs; the file may have others."""
        return results.of(results.rows(self.path, self.own))

    @property
    def df(self) -> "pd.DataFrame":
        """Every column of these rows."""
        return self.results.df

    def __str__(self) -> str:
        earlier = f" ({self.before} of them earlier)" if self.before else ""
        done = f"{self.before + self.done} of {counted(self.jobs, 'job')} done{earlier}"
        text = f"{self.path}: {done} in {self.wall_s:.1f} s"
        if self.errors:
            text += f"; {self.errors} ended in an error, which --retry runs again"
        return text + ("; interrupted: run the same command again to continue." if self.interrupted else ".")


@checks_arguments
def run_sweep(
    study: str | Path,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    controllers: Iterable[str | Path] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Sweep:
    """Run the jobs of a study file that the results file does not have.

    Ctrl-C ends it cleanly; calling it again continues.

    Parameters
    ----------
    study : str or Path
        The study file (TOML).
    out : str or Path
        The results file (SQLite), created if missing.
    workers : int, optional
        Processes on this machine, one per core by default.
    scheduler : str, optional
        Scheduler of a Dask cluster instead: "tcp://host:8786".
    retry : bool
        Run jobs again that ended in an error.
    controllers : iterable of str or Path
        Files of controllers that act in every job, beside those that the study names.
    progress : callable, optional
        Called with the number of jobs done and of all jobs.

    Returns
    -------
    Sweep

    Raises
    ------
    StudyError
        For a study, a results file or a cluster that cannot be used; every row up to then is kept.

    Examples
    --------
    >>> done = st.run_sweep("places.toml", "places.db", workers=1)
    >>> done.jobs, done.errors
    (6, 0)
    """
    if workers is not None and scheduler is not None:
        raise StudyError("workers and scheduler cannot be used together; give one of them.")
    began, workers = time.perf_counter(), process.used(workers)
    more = [str(Path(one).resolve()) for one in controllers]
    if comma := next((one for one in more if "," in one), None):
        raise StudyError(
            f"The file of a controller has a comma in its path, {comma}, which separates files; rename it."
        )
    jobs = (job._replace(controller=", ".join(filter(None, [job.controller, *more]))) for job in study_file.read(study))
    wanted = tasks(jobs, study)
    with Store(out, SWEEP) as store:
        before = store.statuses()
        missing = [t for t in wanted if t.row not in before or (retry and before[t.row] != "ok")]
        there, ended, interrupted = len(wanted) - len(missing), 0, False
        try:
            if progress:
                progress(there, len(wanted))
            with closing(_rows(store.rows(), missing, workers, scheduler)) as rows:
                for ended, row in enumerate(rows, 1):
                    store.add(row)
                    if progress:
                        progress(there + ended, len(wanted))
        except KeyboardInterrupt:
            interrupted = True
        after = store.statuses()
    found = [after[t.row] for t in wanted if t.row in after]
    return Sweep(
        Path(out),
        frozenset(t.row for t in wanted),
        len(wanted),
        there,
        ended,
        sum(status != "ok" for status in found),
        interrupted,
        _warnings(wanted),
        time.perf_counter() - began,
    )


def _rows(
    known: Mapping[str, Mapping[str, Any]], missing: list[Task], workers: int, scheduler: str | None
) -> Generator[Row, None, None]:
    """The rows of the tasks. Those of one key have one result, which the file may know from other labels."""
    same: dict[str, list[Task]] = {}
    for t in missing:
        if t.key in known:
            yield stored(t, known[t.key])
        else:
            same.setdefault(t.key, []).append(t)
    with closing(_run([first for first, *_ in same.values()], workers, scheduler)) as rows:
        for row in rows:
            yield from (row._replace(given=t.job.given()) for t in same[row.key])


def _run(missing: list[Task], workers: int, scheduler: str | None) -> Generator[Row, None, None]:
    if not missing:
        return
    if scheduler is None:
        yield from pool.rows(missing, workers)
    else:
        with closing(Cluster(scheduler)) as cluster:
            yield from cluster.rows(missing)


def _warnings(wanted: Iterable[Task]) -> tuple[str, ...]:
    """What the readers of the cases noted, and the changes of each case with the most unusual values."""
    notes = dict.fromkeys(note for t in wanted for note in t.shared.case.notes)
    worst: dict[str, tuple[int, str]] = {}
    for job, case in {(t.job.case, t.job.set): (t.job, t.shared.case) for t in wanted}.values():
        found = unusual.check(case, balance=False)
        options = (word for change in job.changes.items() for word in ("--set", "{}={}".format(*change)))
        told = len(found.findings), found.told(shlex.join([str(job.case), *options]))
        worst[job.case] = max(worst.get(job.case, told), told, key=lambda one: one[0])
    return *notes, *(told for _, told in worst.values() if told)


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
    def changed(name: str, machines: str, share: float | None, changes: str) -> tuple[Case, str]:
        given = load(name) if share is None else load(name).with_motors(share)
        job = Job("simulate", name, set=changes)
        case = _changed(path, given, job)
        if machines == "classical":
            usual = fingerprint(given.classical())
            for key, value in job.changes.items():
                one = given.set({key: value})
                if one != given and fingerprint(one.classical()) == usual:
                    raise StudyError(f"{path}, set.{key} = {value!r}: it has no effect with machines = 'classical'.")
            case = case.classical()
        return case, fingerprint(case)

    found: dict[tuple[str, ...], Task] = {}
    _idle(path, jobs := tuple(jobs), load, controllers)
    for job in jobs:
        case, content = changed(job.case, job.machines, job.motor_share, job.set)
        own = controllers(job.controller)
        _check(path, job, case, checked)
        _possible(path, job, case, own)
        _signals(path, job, case, own)
        task = Task(key_of(job, content, own), job, Shared(case, own), SWEEP)
        found.setdefault(task.row, task)
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
        return tuple(control_files.load(path.parent / name.strip()) for name in names.split(",") if name.strip())
    except StabctlError as error:
        raise StudyError(f"{path}, controller = {names!r}: {error}") from None


def _changed(path: Path, case: Case, job: Job) -> Case:
    """The case with the changes of a job."""
    if not job.changes:
        return case
    try:
        return case.set(job.changes)
    except StabctlError as error:
        given = ", ".join(f"{key} = {value!r}" for key, value in job.changes.items())
        raise StudyError(f"{path}, set.{given}: {error}") from None


def _idle(path: Path, jobs: Sequence[Job], load: Callable[[str], Case], controllers: Callable[[str], Any]) -> None:
    """Reject options that act in no job of the study: of storage, of a law that is not in use, of PMUs."""

    def lawful(job: Job) -> bool:
        return job.law in acting(job, _stored(job, load(job.case)), controllers(job.controller))

    usual = Job("simulate", "")
    uses: tuple[tuple[Iterable[str], Callable[[Job], bool], str], ...] = (
        (OF_DEVICES, lambda job: job.storage not in ("", "none"), "devices given with the key storage"),
        (OF_LAWS, lawful, "storage under the bang-bang law"),
        (OF_PMUS, lambda job: job.estimator != "ideal", "an estimator"),
    )
    for names, used, lacks in uses:
        for name in names:
            given = [job for job in jobs if getattr(job, name) != getattr(usual, name)]
            if given and not any(map(used, given)):
                raise StudyError(f"{path}, {fields(Job)[name].column}: it has no effect without {lacks}; leave it out.")


def _stored(job: Job, case: Case) -> bool:
    """Whether a job has storage devices, its own or those of its case."""
    return job.storage != "none" if job.storage else bool(case.storage)


CHECKS: dict[str, Callable[[Case, str], object]] = {
    "fault": lambda case, text: Contingency(text, 1.0).check(case),
    "trip": lambda case, text: Contingency(trip=text).check(case),
    "clear": lambda case, text: seconds(text, case.frequency_hz),
    "resolution": lambda case, text: seconds(text, case.frequency_hz),
    "limit": lambda case, text: seconds(text, case.frequency_hz),
    "scan": lambda case, text: text if text == AUTO else seconds(text, case.frequency_hz),
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
    key = (job.case, job.set, job.storage, str(job.devices))
    if job.storage and key not in checked:
        try:
            _with_storage(case, job, **job.devices)
        except StabctlError as error:
            raise StudyError(f"{path}, storage = {job.storage!r}: {error}") from None
        checked.add(key)


def _possible(path: Path, job: Job, case: Case, own: Sequence[Controller | Law]) -> None:
    """Reject a job in which nothing happens, or whose options exclude each other."""
    simulated, hz = job.kind == "simulate", case.frequency_hz
    if not (job.fault or (job.trip and simulated)):
        also = " or a trip" if simulated else ""
        raise StudyError(f"{path}: a job needs a fault{also}; give a location such as fault = '83' or '7-8@0.4'.")
    try:
        contingency, _ = job.contingency, control_of(job, _stored(job, case), own)
        cleared = contingency.cleared(case) if simulated else 0.0
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
    if simulated and cleared >= job.until:
        raise StudyError(f"{path}, until_s = {job.until:g}: the fault is not cleared before that; give a later end.")
    if not simulated and seconds(job.limit, hz) < seconds(job.resolution, hz):
        raise StudyError(f"{path}, limit = {job.limit!r}: it is below the resolution of {job.resolution}.")


def _with_storage(case: Case, job: Job, **options: Any) -> Case:
    """The case with the storage of a job; no size matters here, so that no dispatch needs a power flow."""
    return case.with_storage(job.storage.replace("%dispatch", "%mva"), **options)


def _signals(path: Path, job: Job, case: Case, controllers: Sequence[Controller | Law]) -> None:
    """Reject controllers of signals that the case does not have with the storage of the job."""
    if controllers and job.storage:
        case = _with_storage(case, job)
    try:
        for one in (c for c in controllers if isinstance(c, Controller)):
            chosen(case, one.inputs, OUTPUTS)
            chosen(case, one.outputs, INPUTS)
    except StudyError as error:
        raise StudyError(f"{path}, controller = {job.controller!r}: {error}") from None

"""A sweep: the tasks of a study that the results file does not have, run and stored one by one."""

import time
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from stabctl import io
from stabctl._util import cores
from stabctl._util.wording import counted
from stabctl.errors import StudyError
from stabctl.jobs import Row, Task, pool
from stabctl.jobs.cluster import Cluster
from stabctl.jobs.store import Store

from . import results, study_file
from .kind import SWEEP
from .task import tasks

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Sweep:
    """Summary of a sweep; the results are in its file."""

    path: Path
    jobs: int  # of the study
    before: int  # that were in the file already
    done: int  # by this sweep
    errors: int  # jobs of the study that ended in an error
    interrupted: bool
    warnings: tuple[str, ...]  # about the cases
    wall_s: float

    @property
    def results(self) -> results.Results:
        """Every row of the results file."""
        return results.read(self.path)

    @property
    def df(self) -> "pd.DataFrame":
        """Every column of every row of the results file."""
        return self.results.df

    def __str__(self) -> str:
        earlier = f" ({self.before} of them earlier)" if self.before else ""
        done = f"{self.before + self.done} of {counted(self.jobs, 'job')} done{earlier}"
        text = f"{self.path}: {done} in {self.wall_s:.1f} s"
        if self.errors:
            text += f"; {self.errors} ended in an error, which --retry runs again"
        return text + ("; interrupted: run the same command again to continue." if self.interrupted else ".")


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
    """
    if workers is not None and scheduler is not None:
        raise StudyError("workers and scheduler cannot be used together; give one of them.")
    began, workers = time.perf_counter(), cores.used(workers)
    more = [str(Path(one).resolve()) for one in controllers]
    jobs = (job._replace(controller=", ".join(filter(None, [job.controller, *more]))) for job in study_file.read(study))
    wanted = tasks(jobs, study)
    with Store(out, SWEEP) as store:
        before = store.statuses()
        missing = [t for t in wanted if t.key not in before or (retry and before[t.key] != "ok")]
        there, interrupted = len(wanted) - len(missing), False
        try:
            if progress:
                progress(there, len(wanted))
            with closing(_rows(missing, workers, scheduler)) as rows:
                for done, row in enumerate(rows, 1):
                    store.add(row)
                    if progress:
                        progress(there + done, len(wanted))
        except KeyboardInterrupt:
            interrupted = True
        after = store.statuses()
    found = [after[t.key] for t in wanted if t.key in after]
    return Sweep(
        Path(out),
        len(wanted),
        there,
        len(found) - there,
        sum(status != "ok" for status in found),
        interrupted,
        _warnings(wanted),
        time.perf_counter() - began,
    )


def _warnings(wanted: Iterable[Task]) -> tuple[str, ...]:
    """The warnings about the cases, each once, without those of packaged cases as they are."""
    known = cache(lambda name: io.load(name).warnings if name in io.packaged() else ())
    return tuple(dict.fromkeys(s for t in wanted for s in t.shared.case.warnings if s not in known(t.job.case)))


def _rows(missing: list[Task], workers: int, scheduler: str | None) -> Generator[Row, None, None]:
    if missing and scheduler is None:
        yield from pool.rows(missing, workers)
    elif missing and scheduler is not None:
        with closing(Cluster(scheduler)) as cluster:
            yield from cluster.rows(missing)

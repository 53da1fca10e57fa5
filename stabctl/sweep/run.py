"""A sweep: the tasks of a study that the results file does not have, done and kept one by one."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from stabctl._util import cores

from . import pool, study
from .result import Row
from .store import Store
from .task import Task, tasks


@dataclass(frozen=True)
class Summary:
    """What a sweep left."""

    path: Path
    jobs: int  # of the study
    before: int  # that were in the file already
    done: int  # by this sweep
    errors: int  # of the study's rows in the file that are no result
    interrupted: bool
    warnings: tuple[str, ...]  # on what is unusual in the cases
    wall_s: float

    def __str__(self) -> str:
        there = f", {self.before} of them from before" if self.before else ""
        text = f"{self.path}: {self.before + self.done} of {self.jobs} jobs done{there}, in {self.wall_s:.1f} s"
        if self.errors:
            text += f"; {self.errors} ended in an error: --retry does them again"
        return text + ("; interrupted: run the same command again to go on." if self.interrupted else ".")


def run(
    path: str | Path,
    out: str | Path,
    workers: int | None = None,
    dask: str | None = None,
    retry: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Summary:
    """Do the jobs of a study file that the results file `out` does not have; `Summary` at the end or at Ctrl-C.

    Args: study file; results file, made where there is none; processes (one a core) or the address of a Dask
    scheduler; whether jobs that ended in an error are done again; what is told the jobs done and of how many. Raises
    `StudyError` for a study, a results file or a cluster that cannot be used; every row up to then is kept.
    """
    began, workers = time.perf_counter(), cores.used(workers)
    wanted = tasks(study.read(path), path)
    with Store(out) as store:
        before = store.statuses()
        missing = [t for t in wanted if t.key not in before or (retry and before[t.key] != "ok")]
        there, interrupted = len(wanted) - len(missing), False
        try:
            if progress:
                progress(there, len(wanted))
            with closing(_rows(missing, workers, dask)) as rows:
                for done, row in enumerate(rows, 1):
                    store.add(row)
                    if progress:
                        progress(there + done, len(wanted))
        except KeyboardInterrupt:
            interrupted = True
        after = store.statuses()
    found = [after[t.key] for t in wanted if t.key in after]
    errors = sum(status != "ok" for status in found)
    return Summary(
        Path(out),
        len(wanted),
        there,
        len(found) - there,
        errors,
        interrupted,
        tuple(dict.fromkeys(sentence for t in wanted for sentence in t.case.warnings)),
        time.perf_counter() - began,
    )


def _rows(missing: list[Task], workers: int, dask: str | None) -> Iterator[Row]:
    if missing and dask is None:
        yield from pool.rows(missing, workers)
    elif missing:
        from . import cluster

        yield from cluster.rows(missing, dask)

"""Runner of the jobs of a study: threads, processes or a cluster, and the file with their rows."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any

from stabctl._util import files, process
from stabctl._util.errors import StudyError

from .cluster import Cluster
from .store import Store
from .task import Kind, Row, Task, completed


class Runner(AbstractContextManager["Runner"]):
    """Runs jobs in threads of this process, or on a Dask cluster, and keeps their rows.

    Parameters
    ----------
    kind : Kind
        The kind of the jobs.
    store : str or Path, optional
        Folder for the file of the rows, created if missing. A job whose row it has is not run again.
    workers : int, optional
        Threads, one per core by default.
    scheduler : str, optional
        Scheduler of a Dask cluster instead: "tcp://host:8786".

    Raises
    ------
    StudyError
        For a folder or a cluster that cannot be used.
    """

    def __init__(
        self, kind: Kind, *, store: str | Path | None = None, workers: int | None = None, scheduler: str | None = None
    ) -> None:
        if workers is not None and scheduler is not None:
            raise StudyError("workers and scheduler cannot be used together; give one of them.")
        self.workers = process.used(workers)
        self.store = None if store is None else Store(_folder(store) / f"{kind.table}.db", kind)
        self._known = {} if self.store is None else self.store.rows()
        self.before = 0  # rows asked for that the store had
        self.cluster = None if scheduler is None else Cluster(scheduler)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.cluster:
            self.cluster.close()
        if self.store:
            self.store.__exit__()
        if isinstance(error, KeyboardInterrupt):
            error.add_note(
                f"The jobs done are kept in {self.store.path}; the same command continues."
                if self.store
                else "Nothing is kept; with --store FOLDER the same command continues an interrupted study."
            )

    @property
    def threads(self) -> int:
        """Jobs that run at the same time."""
        return max(1, self.cluster.threads) if self.cluster else self.workers

    @property
    def remote(self) -> bool:
        """Whether jobs are kept or leave this process, so that their keys must identify them."""
        return self.store is not None or self.cluster is not None

    def rows(self, tasks: Iterable[Task]) -> Iterator[tuple[Task, dict[str, Any]]]:
        """The tasks with their rows (column -> value): those of the store first, the others as they are finished.

        Raises StudyError if a job ends in an error, once the others have ended.
        """
        missing: dict[str, Task] = {}
        for task in tasks:
            if task.key in self._known:
                self.before += 1
                yield task, self._known[task.key]
            else:
                missing[task.key] = task
        failed: list[str] = []
        for row in self._rows(list(missing.values())):
            if row.about.status == "ok":
                self._keep(row)
                yield missing[row.key], row.values
            else:
                failed.append(row.about.message or "")
        if failed:
            raise StudyError(failed[0])

    def ask(self, task: Task) -> dict[str, Any]:
        """The row (column -> value) of one job, from any thread. Raises StudyError if it ends in an error."""
        if task.key in self._known:
            self.before += 1
            return self._known[task.key]
        if not self.remote:
            return dict(task.kind.run(task).values)
        row = self.cluster.ask(task) if self.cluster else completed(task)
        if row.about.status != "ok":
            raise StudyError(row.about.message or "")
        self._keep(row)
        return row.values

    def _keep(self, row: Row) -> None:
        if self.store:
            self.store.add(row)

    def _rows(self, tasks: list[Task]) -> Iterator[Row]:
        if self.cluster:
            yield from self.cluster.rows(tasks)
            return
        pool = ThreadPoolExecutor(self.workers)
        with process.one_thread():
            waits = True
            try:
                for done in as_completed([pool.submit(completed, task) for task in tasks]):
                    yield done.result()
            except (KeyboardInterrupt, GeneratorExit):
                waits = False  # a job may take a minute
                raise
            finally:
                pool.shutdown(wait=waits, cancel_futures=True)


def _folder(path: str | Path) -> Path:
    path = files.path_of(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"The folder {path} cannot be created ({error.strerror}); choose another one.") from None
    return path

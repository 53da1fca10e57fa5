"""A task: one job of a study, ready to be sent to any process; and its row."""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Annotated, Any, Literal, NamedTuple, Protocol

from stabctl.schema import fields

Status = Literal["ok", "error", "bug"]


class Job(Protocol):
    """What is computed."""

    def given(self) -> dict[str, Any]:
        """Column -> plain value."""
        ...


class Found(NamedTuple):
    """What a job has found."""

    values: Mapping[str, Any]  # column -> value; None, or left out, if not applicable
    message: str | None = None  # in a sentence


class Kind(NamedTuple):
    """A kind of study: its table, and the function that runs a job."""

    table: str  # in the file of its rows
    given: Mapping[str, Any]  # column -> type, of the jobs
    found: Mapping[str, Any]  # column -> type, of what they find
    run: Callable[["Task"], Found]  # a function of a module, as other processes import it
    format: int  # raised when a column changes its meaning

    @property
    def columns(self) -> dict[str, Any]:
        """Column -> type, of the rows."""
        first, *last = ((f.column, f.kind) for f in fields(About).values())
        return {"key": str, **self.given, **dict([first]), **self.found, **dict(last)}


class Task(NamedTuple):
    """A job, the data that it shares with other jobs, and the key that both determine."""

    key: str  # SHA-256
    job: Any
    shared: Any  # such as the case; a cluster gets it once
    kind: Kind


class About(NamedTuple):
    """How, where and when a job ran."""

    status: Annotated[Status, "-", "ok; error: not possible, see message; bug: an error in stabctl"]
    message: Annotated[str | None, "-", "the result in a sentence"] = None
    wall: Annotated[float | None, "s", "computing time"] = None
    worker: Annotated[str | None, "-", "host:process"] = None
    finished: Annotated[str | None, "-", "time of completion, UTC"] = None
    version: Annotated[str | None, "-", "of stabctl"] = None


COMPUTED = ("wall_s", "worker", "finished", "version")  # columns about the computation, not the system


class Row(NamedTuple):
    """A job that has ended."""

    key: str
    given: Mapping[str, Any]  # column -> value
    found: Mapping[str, Any]  # column -> value
    about: About

    @property
    def values(self) -> dict[str, Any]:
        """Column -> value."""
        about = {f.column: value for f, value in zip(fields(About).values(), self.about, strict=True)}
        return {"key": self.key, **self.given, **self.found, **about}


def row(task: Task, found: Mapping[str, Any], status: Status, message: str | None, **about: Any) -> Row:
    """The row of a task, with its time of completion and the version of the package."""
    finished = datetime.now(UTC).isoformat(timespec="milliseconds")
    how = About(status, message, finished=finished, version=_version(), **about)
    return Row(task.key, task.job.given(), found, how)


@cache
def _version() -> str:
    return version("stabctl")

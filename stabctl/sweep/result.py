"""What a job gave: a row of the results file."""

from datetime import UTC, datetime
from importlib.metadata import version
from typing import Annotated, Any, Literal, NamedTuple

from .job import Job

Status = Literal["ok", "error", "bug"]


class Result(NamedTuple):
    """Findings, how the job went, and where; None where there is nothing to tell."""

    status: Annotated[Status, "-", "error: refused with a sentence; bug: failed in a way it must not"]
    outcome: Annotated[str | None, "-", "how the run or the search ended"] = None
    cycles: Annotated[float | None, "-", "critical clearing time in cycles"] = None
    seconds: Annotated[float | None, "-", "critical clearing time in seconds"] = None
    monotone: Annotated[int | None, "-", "1: no longer fault that was tried was survived"] = None
    runs: Annotated[int | None, "-", "simulations of the search"] = None
    machine: Annotated[int | None, "-", "machine that goes first"] = None
    bus: Annotated[int | None, "-", "bus whose voltage collapsed"] = None
    time: Annotated[float | None, "s", "when the run ended"] = None
    max_angle_from_coi: Annotated[float | None, "deg", "largest change of an angle against the COI"] = None
    energy: Annotated[float | None, "MWh", "highest less lowest charge, summed over the devices"] = None
    rmse: Annotated[float | None, "mHz", "root mean square error of the estimated deviations"] = None
    p99: Annotated[float | None, "mHz", "99th percentile of the size of that error"] = None
    delay: Annotated[float | None, "ms", "of the estimates"] = None
    wrong_command_share: Annotated[float | None, "-", "of machine-frames"] = None
    opposite_command_share: Annotated[float | None, "-", "of machine-frames"] = None
    message: Annotated[str | None, "-", "the same in a sentence"] = None
    wall: Annotated[float | None, "s", "time the job took"] = None
    worker: Annotated[str | None, "-", "host:process"] = None
    finished: Annotated[str | None, "-", "instant, UTC"] = None
    version: Annotated[str | None, "-", "of stabctl"] = None


ABOUT = ("wall_s", "worker", "finished", "version")  # columns that tell of the work, not of the system


class Row(NamedTuple):
    """A job with its key and its result."""

    key: str
    job: Job
    result: Result


def signed(result: Result, **about: Any) -> Result:
    """The result with its instant and the version of the package."""
    return result._replace(
        finished=datetime.now(UTC).isoformat(timespec="milliseconds"), version=version("stabctl"), **about
    )

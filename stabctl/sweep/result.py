"""The result of a job: a row of the results file."""

from datetime import UTC, datetime
from importlib.metadata import version
from typing import Annotated, Any, Literal, NamedTuple

from .job import Job

Status = Literal["ok", "error", "bug"]


class Result(NamedTuple):
    """What was found, and how, where and when the job ran; None if not applicable."""

    status: Annotated[Status, "-", "ok; error: not possible, see message; bug: an error in stabctl"]
    outcome: Annotated[str | None, "-", "how the simulation or the search ended"] = None
    cycles: Annotated[float | None, "-", "critical clearing time in cycles"] = None
    seconds: Annotated[float | None, "-", "critical clearing time in seconds"] = None
    monotone: Annotated[int | None, "-", "1: no longer fault that was tried was stable"] = None
    runs: Annotated[int | None, "-", "simulations of the search"] = None
    machine: Annotated[int | None, "-", "machine that loses synchronism first"] = None
    bus: Annotated[int | None, "-", "bus whose voltage collapsed"] = None
    time: Annotated[float | None, "s", "end of the simulation"] = None
    max_angle_from_coi: Annotated[float | None, "deg", "largest change of an angle relative to the COI"] = None
    energy: Annotated[float | None, "MWh", "range of the charge, summed over the devices"] = None
    rmse: Annotated[float | None, "mHz", "rms error of the estimated deviations"] = None
    p99: Annotated[float | None, "mHz", "99th percentile of the absolute error"] = None
    delay: Annotated[float | None, "ms", "of the estimates"] = None
    wrong_command_share: Annotated[float | None, "-", "of machine-frames"] = None
    opposite_command_share: Annotated[float | None, "-", "of machine-frames"] = None
    message: Annotated[str | None, "-", "the result in a sentence"] = None
    wall: Annotated[float | None, "s", "computing time"] = None
    worker: Annotated[str | None, "-", "host:process"] = None
    finished: Annotated[str | None, "-", "time of completion, UTC"] = None
    version: Annotated[str | None, "-", "of stabctl"] = None


ABOUT = ("wall_s", "worker", "finished", "version")  # columns about the computation, not the system


class Row(NamedTuple):
    """A job with its key and its result."""

    key: str
    job: Job
    result: Result


def signed(result: Result, **about: Any) -> Result:
    """The result with its time of completion and the version of the package."""
    return result._replace(
        finished=datetime.now(UTC).isoformat(timespec="milliseconds"), version=version("stabctl"), **about
    )

"""What a job of a sweep finds: columns of the results file."""

from typing import Annotated, NamedTuple


class Result(NamedTuple):
    """What was found; None if not applicable."""

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

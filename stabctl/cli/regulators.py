"""stabctl design lqr and lqg."""

from typing import Annotated, Any

import typer

from . import designed, groups, options
from .grouped import grouped

Speed = Annotated[
    float,
    typer.Option(
        "--speed",
        metavar="FREQUENCY",
        parser=options.in_unit("Hz"),
        help="Speed deviation that weighs as much as one --effort.",
    ),
]
Effort = Annotated[float, typer.Option("--effort", help="Size of an output, in the unit of the input that it drives.")]
Angle = Annotated[
    float | None,
    typer.Option(
        "--angle",
        metavar="ANGLE",
        parser=options.in_unit("rad"),
        help="Angle relative to the COI that weighs as much as one --effort.",
    ),
]
Reads = Annotated[
    str | None, typer.Option("--input", help="Signals that the regulator reads: 'angle, speed' (LQR: all states).")
]
FrameRate = Annotated[int, typer.Option("--rate", min=1, help="Frames per second.")]
Disturbance = Annotated[
    float,
    typer.Option(
        "--disturbance", metavar="POWER", parser=options.in_unit("MW"), help="Load change within one second, MW."
    ),
]
Noise = Annotated[float, typer.Option("--noise", min=1e-6, help="Noise of the measurements, of 5 mHz and 2 mrad.")]
States = Annotated[int | None, typer.Option("--order", min=1, help="Number of states of the reduced plant model.")]
Driven = Annotated[str, typer.Option("--output", help="Inputs of the system that the regulator drives: order, vref.")]


@grouped
def lqr(
    *,
    driven: Driven = "order",
    read: Reads = None,
    speed: Speed = 0.1,
    angle: Angle = None,
    effort: Effort = 1.0,
    files: designed.Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a linear-quadratic regulator, which reads all states or the given signals."""
    from stabctl.design import lqr

    files.check()
    point = storage.initialize(case.load())
    designed.show(lqr(point, driven, read, speed=speed, angle=angle, effort=effort), files, as_json)


@grouped
def lqg(
    *,
    driven: Driven = "order",
    read: Reads = "deviation",
    rate: FrameRate = 60,
    delay: designed.Delay = "0",
    speed: Speed = 0.1,
    angle: Angle = None,
    effort: Effort = 1.0,
    disturbance: Disturbance = 10.0,
    noise: Noise = 1.0,
    order: States = None,
    files: designed.Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a linear-quadratic-Gaussian regulator, which estimates the states from measurements."""
    from stabctl.design import lqg

    files.check()
    point, reads = storage.initialize(case.load()), read or "deviation"
    given: dict[str, Any] = {"rate": rate, "delay": float(delay), "speed": speed, "angle": angle, "effort": effort}
    found = lqg(point, driven, reads, disturbance=disturbance, noise=noise, order=order, **given)
    designed.show(found, files, as_json)

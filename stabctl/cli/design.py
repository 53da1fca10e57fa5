"""stabctl design pod, lqr, lqg: oscillation dampers, regulators."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.design import Design, Pairs


SHOWN = 8  # modes in the table without and with the controllers: those with the least damping
ROWS = 20  # pairs in the table
Out = Annotated[
    Path | None,
    Option(
        "--out",
        help="Write the controller to FILE.toml, or several to FILE-1.toml and so on, to be given with --controller.",
    ),
]
Report = Annotated[Path | None, Option("--report", help="Write an HTML page on the design to this folder.")]
Faults = Annotated[
    list[str] | None, Option("--fault", help="Fault for the clearing times in the report: 7-8@0.4. Repeatable.")
]
Delay = Annotated[
    str,
    Option("--delay", metavar="TIME", parser=options.in_unit("s"), help="Time from measurement to output, s."),
]


class Files(NamedTuple):
    """What is written: the controllers, and the page with its faults."""

    out: Out = None
    report: Report = None
    fault: Faults = None

    def check(self) -> None:
        """Raise `StudyError` if the files cannot be written, before anything is computed."""
        from stabctl._util.errors import StudyError

        shared.file(self.out, ".toml")
        shared.folder(self.report)
        if self.fault and not self.report:
            raise StudyError("--fault is used only for the report; give --report FOLDER, too.")

    def write(self, found: "Design") -> tuple[Path, ...]:
        """Write them, and return their paths."""
        written = found.save(self.out) if self.out else ()
        return (*written, found.report(self.report, self.fault or ())) if self.report else written


Input = Annotated[
    str | None,
    Option("--input", help="Signals that the damper reads: deviation:1, flow:7-8 (default: the best one)."),
]
Output = Annotated[
    str | None,
    Option("--output", help="Input of the system that the damper drives: order:1@5, vs:2 (default: the best one)."),
]
Rank = Annotated[bool, Option("--rank", help="Only rank the pairs of a signal and an input.")]
Spread = Annotated[
    float,
    Option(
        "--spread",
        metavar="SHARE",
        parser=options.in_unit("-"),
        help="Gain variation for which the damping is also reached: 50%.",
    ),
]
Mode = Annotated[
    float | None,
    Option(
        "--mode",
        metavar="FREQUENCY",
        parser=options.in_unit("Hz"),
        help="Frequency of the mode to damp, Hz (default: the least damped).",
    ),
]
Order = Annotated[int | None, Option("--order", min=1, max=8, help="Lags in the tuned filter of every input.")]
Rate = Annotated[int | None, Option("--rate", min=1, help="Frames per second (default: continuous).")]


def pod(
    *,
    read: Input = None,
    driven: Output = None,
    rank: Rank = False,
    damping: options.Ratio = 0.1,
    spread: Spread = 0.0,
    mode: Mode = None,
    order: Order = None,
    rate: Rate = None,
    delay: Delay = "0",
    files: Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a power-oscillation damper by the residue method, or with tuned filters of several inputs."""
    from stabctl.design import pairs, pod
    from stabctl.design.pairs import SIGNALS

    files.check()
    if rank and (files != Files() or (damping, spread, order, rate) != (0.1, 0.0, None, None)):
        from stabctl._util.errors import StudyError

        raise StudyError("--rank only ranks pairs; leave out what a design is made with, or where it is written.")
    point = storage.initialize(case.load())
    if rank:
        _rank(pairs(point, read or SIGNALS, driven, mode=mode, delay=float(delay)), as_json)
        return
    found = pod(
        point, read, driven, damping=damping, spread=spread, mode=mode, order=order, rate=rate, delay=float(delay)
    )
    show(found, files, as_json)


def _rank(found: "Pairs", as_json: bool) -> None:
    if as_json:
        shared.print_json({"case": found.case, "mode_hz": found.mode_hz, "pairs": found.df.to_dict("records")})
        return
    from rich.table import Table

    table = Table("input", "output", "residue", "angle (deg)", "score (1/s)")
    for read, driven, residue, angle, _, score in found.df.head(ROWS).to_numpy().tolist():
        table.add_row(read, driven, f"{residue:.4g}", f"{angle:.1f}", f"{score:.4g}")
    out = shared.console()
    out.print(table)
    out.print(str(found))


Speed = Annotated[
    float,
    Option(
        "--speed",
        metavar="FREQUENCY",
        parser=options.in_unit("Hz"),
        help="Speed deviation that weighs as much as one --effort.",
    ),
]
Effort = Annotated[float, Option("--effort", help="Size of an output, in the unit of the input that it drives.")]
Angle = Annotated[
    float | None,
    Option(
        "--angle",
        metavar="ANGLE",
        parser=options.in_unit("rad"),
        help="Angle relative to the COI that weighs as much as one --effort.",
    ),
]
Reads = Annotated[
    str | None, Option("--input", help="Signals that the regulator reads: 'angle, speed' (LQR: all states).")
]
Driven = Annotated[str, Option("--output", help="Inputs of the system that the regulator drives: order, vref.")]


def lqr(
    *,
    driven: Driven = "order",
    read: Reads = None,
    speed: Speed = 0.1,
    angle: Angle = None,
    effort: Effort = 1.0,
    files: Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a linear-quadratic regulator, which reads all states or the given signals."""
    from stabctl.design import lqr

    files.check()
    point = storage.initialize(case.load())
    show(lqr(point, driven, read, speed=speed, angle=angle, effort=effort), files, as_json)


FrameRate = Annotated[int, Option("--rate", min=1, help="Frames per second.")]
Disturbance = Annotated[
    float,
    Option("--disturbance", metavar="POWER", parser=options.in_unit("MW"), help="Load change within one second, MW."),
]
Noise = Annotated[float, Option("--noise", min=1e-6, help="Noise of the measurements, of 5 mHz and 2 mrad.")]
States = Annotated[int | None, Option("--order", min=1, help="Number of states of the reduced plant model.")]


def lqg(
    *,
    driven: Driven = "order",
    read: Reads = "deviation",
    rate: FrameRate = 60,
    delay: Delay = "0",
    speed: Speed = 0.1,
    angle: Angle = None,
    effort: Effort = 1.0,
    disturbance: Disturbance = 10.0,
    noise: Noise = 1.0,
    order: States = None,
    files: Files,
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
    show(found, files, as_json)


def show(found: "Design", files: Files, as_json: bool) -> None:
    """Write the files, and print the modes before and after."""
    written = files.write(found)
    if as_json:
        from stabctl.design.result import least

        worst = min(found.before, key=lambda m: least(m)[0])
        shared.print_json(
            {
                "worst_damping_before": found.worst_before,
                "worst_damping_after": found.worst_after,
                "mode_hz": float(worst.frequency_hz[least(worst)[1]]),
                "reached": found.reached,
                "remarks": list(found.remarks),
                "controllers": [c.name for c in found.controllers],
                "largest_gains": found.largest_gains,
                "files": [str(path) for path in written],
                **_margins(found),
            }
        )
        return
    from rich.table import Table

    from stabctl._util.wording import counted

    out_console, table, modes = shared.console(), Table("controllers", "Hz", "damping ratio", "mode"), found.df
    few = modes.groupby("controllers")["damping_ratio"].rank(method="first") <= SHOWN
    left = int((~few).sum())
    for what, _, hz, ratio, mode in modes[few].to_numpy().tolist():
        table.add_row(what, f"{hz:.4f}", f"{ratio:z.4f}", mode)
    out_console.print(table)
    if left:
        out_console.print(f"{counted(left, 'mode')} with more damping left out; --report shows all.")
    out_console.print(str(found))
    for path in written:
        out_console.print(f"written: {path}")


def _margins(found: "Design") -> dict[str, Any]:
    """Margins of a regulator, and those with all states."""
    from stabctl.design import Regulator

    if not isinstance(found, Regulator) or found.full is None or found.own is None:
        return {}
    return {"margins": asdict(found.own), "margins_all_states": asdict(found.full)}

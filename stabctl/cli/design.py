"""stabctl design: stabilizers, oscillation dampers and regulators."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import groups, options, shared
from .design_optimum import optimum
from .grouped import grouped

if TYPE_CHECKING:
    from stabctl.design import Design, Pairs
    from stabctl.design import Outages as OutageSet

ROWS = 20  # pairs in the table
app = typer.Typer(no_args_is_help=True, help="Design controllers: stabilizers, oscillation dampers, regulators.")
app.command("optimum")(optimum)

Damping = Annotated[float, typer.Option("--damping", min=0.0, max=0.9, help="Damping ratio to reach.")]
Out = Annotated[Path | None, typer.Option("--out", help="Write the controllers to FILE.toml, for --controller.")]
Machine = Annotated[list[int] | None, typer.Option("--machine", help="Machine that gets a stabilizer. Repeatable.")]
Spread = Annotated[
    float,
    typer.Option(
        "--spread", metavar="SHARE", parser=options.in_unit("-"), help="Hold with 50 to 150 % of the gain: 50%."
    ),
]
Order = Annotated[int | None, typer.Option("--order", min=1, max=8, help="Lags in the tuned filter of every input.")]
Outages = Annotated[bool, typer.Option("--n-1", help="Serve the system without any one branch, too.")]
Input = Annotated[
    str | None, typer.Option("--input", help="Signals that are read: deviation:1, flow:7-8 (default: the best one).")
]
Output = Annotated[
    str | None, typer.Option("--output", help="Input that is driven: order:1@5, vs:2 (default: the best one).")
]
Rank = Annotated[bool, typer.Option("--rank", help="Only rank the pairs of a signal and an input.")]
Rate = Annotated[int | None, typer.Option("--rate", min=1, help="Frames per second (default: continuous).")]
Delay = Annotated[
    str,
    typer.Option("--delay", metavar="TIME", parser=options.in_unit("s"), help="From reading to action, s."),
]
Mode = Annotated[
    float | None,
    typer.Option("--mode", metavar="FREQUENCY", parser=options.in_unit("Hz"), help="Mode to damp (the least damped)."),
]
Speed = Annotated[
    float,
    typer.Option("--speed", metavar="FREQUENCY", parser=options.in_unit("Hz"), help="Deviation worth one --effort."),
]
Effort = Annotated[float, typer.Option("--effort", help="Size of an output, in the unit of the input driven.")]
Driven = Annotated[str, typer.Option("--output", help="Inputs that are driven: order, vref.")]


@app.command("pss")
@grouped
def pss(
    *,
    machine: Machine = None,
    damping: Damping = 0.1,
    outages: Outages = False,
    out: Out = None,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design power system stabilizers by phase compensation, in place of those of the case."""
    from stabctl import design

    shared.file(out, ".toml")
    point = storage.initialize(case.load())
    points = design.outages(point) if outages else point
    found = design.pss(points, machine or None, damping=damping)
    _show(found, out, as_json, points if isinstance(points, design.Outages) else None)


@app.command("pod")
@grouped
def pod(
    *,
    read: Input = None,
    driven: Output = None,
    rank: Rank = False,
    damping: Damping = 0.1,
    spread: Spread = 0.0,
    mode: Mode = None,
    order: Order = None,
    rate: Rate = None,
    delay: Delay = "0",
    out: Out = None,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a power-oscillation damper: by the residue method, or with tuned filters of several inputs."""
    from stabctl.design import pairs, pod
    from stabctl.design.pairs import SIGNALS

    shared.file(out, ".toml")
    point = storage.initialize(case.load())
    if rank:
        _rank(pairs(point, read or SIGNALS, driven, mode=mode, delay=float(delay)), as_json)
        return
    found = pod(
        point, read, driven, damping=damping, spread=spread, mode=mode, order=order, rate=rate, delay=float(delay)
    )
    _show(found, out, as_json)


@app.command("lqr")
@grouped
def lqr(
    *,
    driven: Driven = "order",
    speed: Speed = 0.1,
    effort: Effort = 1.0,
    out: Out = None,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a linear-quadratic regulator, which reads all states."""
    from stabctl.design import lqr

    shared.file(out, ".toml")
    _show(lqr(storage.initialize(case.load()), driven, speed=speed, effort=effort), out, as_json)


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


def _show(found: "Design", out: Path | None, as_json: bool, points: "OutageSet | None" = None) -> None:
    from stabctl.design.result import least

    written = found.save(out) if out else ()
    if as_json:
        worst = min(found.before, key=lambda m: least(m)[0])
        shared.print_json(
            {
                "worst_damping_before": found.worst_before,
                "worst_damping_after": found.worst_after,
                "mode_hz": float(worst.frequency_hz[least(worst)[1]]),
                "reached": found.reached,
                "controllers": [c.name for c in found.controllers],
                "files": [str(path) for path in written],
                "operating_points": len(found.before),
                "left_out": dict(points.left_out) if points else {},
            }
        )
        return
    from rich.table import Table

    out_console = shared.console()
    if len(found.before) > 1:
        table = Table("operating point", "without", "with", "Hz", "mode")
        for point, before, after, hz, mode in found.worst.to_numpy().tolist():
            table.add_row(point, f"{before:.4f}", f"{after:.4f}", f"{hz:.4f}", mode)
    else:
        table = Table("controllers", "Hz", "damping ratio", "mode")
        for what, _, hz, ratio, mode in found.df.to_numpy().tolist():
            table.add_row(what, f"{hz:.4f}", f"{ratio:.4f}", mode)
    out_console.print(table)
    if points:
        out_console.print(str(points))
    out_console.print(str(found))
    for path in written:
        out_console.print(f"written: {path}")

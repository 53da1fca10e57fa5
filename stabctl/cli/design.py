"""stabctl design: stabilizers, oscillation dampers, regulators, storage laws."""

from typing import TYPE_CHECKING, Annotated

import typer

from . import designed, groups, options, regulators, shared
from .design_law import law
from .design_optimum import optimum
from .grouped import grouped

if TYPE_CHECKING:
    from stabctl.design import Pairs

ROWS = 20  # pairs in the table
app = typer.Typer(
    no_args_is_help=True, help="Design controllers: stabilizers, oscillation dampers, regulators, storage laws."
)
app.command("optimum")(optimum)
app.command("law")(law)

Damping = Annotated[float, typer.Option("--damping", min=0.0, max=0.9, help="Damping ratio to reach.")]
Machine = Annotated[list[int] | None, typer.Option("--machine", help="Machine that gets a stabilizer. Repeatable.")]
Spread = Annotated[
    float,
    typer.Option(
        "--spread",
        metavar="SHARE",
        parser=options.in_unit("-"),
        help="Gain variation for which the damping is also reached: 50%.",
    ),
]
Order = Annotated[int | None, typer.Option("--order", min=1, max=8, help="Lags in the tuned filter of every input.")]
MaxGain = Annotated[
    float,
    typer.Option("--max-gain", help="Largest gain of a stabilizer at any frequency, pu of voltage per pu of speed."),
]
NoiseFilter = Annotated[
    str,
    typer.Option(
        "--noise-filter",
        metavar="TIME",
        parser=options.in_unit("s"),
        help="Time constant of the lag that filters the speed, s; 0: none.",
    ),
]
Outages = Annotated[bool, typer.Option("--n-1", help="Also design for the outage of each branch.")]
Input = Annotated[
    str | None,
    typer.Option("--input", help="Signals that the damper reads: deviation:1, flow:7-8 (default: the best one)."),
]
Output = Annotated[
    str | None,
    typer.Option(
        "--output", help="Input of the system that the damper drives: order:1@5, vs:2 (default: the best one)."
    ),
]
Rank = Annotated[bool, typer.Option("--rank", help="Only rank the pairs of a signal and an input.")]
Rate = Annotated[int | None, typer.Option("--rate", min=1, help="Frames per second (default: continuous).")]
Mode = Annotated[
    float | None,
    typer.Option(
        "--mode",
        metavar="FREQUENCY",
        parser=options.in_unit("Hz"),
        help="Frequency of the mode to damp, Hz (default: the least damped).",
    ),
]


@app.command("pss")
@grouped
def pss(
    *,
    machine: Machine = None,
    damping: Damping = 0.1,
    max_gain: MaxGain = 200.0,
    noise_filter: NoiseFilter = "20ms",
    outages: Outages = False,
    files: designed.Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design power system stabilizers by phase compensation, in place of those of the case."""
    from stabctl import design

    files.check()
    point = storage.initialize(case.load())
    points = design.outages(point) if outages else point
    found = design.pss(points, machine or None, damping=damping, max_gain=max_gain, noise_filter=float(noise_filter))
    designed.show(found, files, as_json, points if isinstance(points, design.Outages) else None)


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
    delay: designed.Delay = "0",
    files: designed.Files,
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Design a power-oscillation damper by the residue method, or with tuned filters of several inputs."""
    from stabctl.design import pairs, pod
    from stabctl.design.pairs import SIGNALS

    files.check()
    point = storage.initialize(case.load())
    if rank:
        _rank(pairs(point, read or SIGNALS, driven, mode=mode, delay=float(delay)), as_json)
        return
    found = pod(
        point, read, driven, damping=damping, spread=spread, mode=mode, order=order, rate=rate, delay=float(delay)
    )
    designed.show(found, files, as_json)


app.command("lqr")(regulators.lqr)
app.command("lqg")(regulators.lqg)


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

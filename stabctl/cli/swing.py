"""`stabctl swing`: the theory on one and two machines, with the values of the paper's tables as defaults."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from .options import Json
from .parameters import Option
from .shared import console, file, print_json

Plot = Annotated[Path | None, Option("--plot", metavar="FILE", help="Write the figure to FILE.png or .svg.")]
Inertia = Annotated[float, Option("--H", help="Inertia constant, s.")]
Mechanical = Annotated[float, Option("--Pm", help="Mechanical power, pu.")]
Reactance = Annotated[float, Option("--X", help="Reactance between the two voltages, pu.")]
Cycles = Annotated[float, Option("--cycles", help="Duration of the fault, cycles.")]
FaultShown = Annotated[float | None, Option("--cycles", help="Fault to show, cycles (default: critical).")]
SmallestPower = Annotated[float | None, Option("--Pc-min", help="Smallest absorbed power, pu (default: -Pc).")]


def table1(
    H: Inertia = 3.0,
    Pm: Mechanical = 0.5,
    X: Reactance = 0.95,
    cycles: Annotated[list[float] | None, Option("--cycles", help="Duration of the fault, cycles. Repeatable.")] = None,
    as_json: Json = False,
    plot: Plot = None,
) -> None:
    """Compute angle and speed when a bolted fault is cleared; the figure shows the phase plane."""
    from stabctl.theory.omib import OMIB, table1
    from stabctl.theory.phase_plane import portrait

    file(plot, ".png", ".svg", ".pdf")
    m, lengths = OMIB(H, Pm, X), tuple(cycles or (6.0, 12.0, 15.0))
    rows = table1(m, lengths)
    if plot:
        portrait(m, lengths).save(plot)
    if as_json:
        print_json({"rows": [{"cycles": r.cycles, "angle_rad": r.angle, "speed_rad_s": r.speed} for r in rows]})
        return
    lines = [(f"{r.cycles:g}", f"{r.angle:.4f}", f"{r.speed:.4f}") for r in rows]
    _print_table(f"State at clearing, from {m.start:.4f} rad", ("cycles", "angle (rad)", "speed (rad/s)"), lines)


def equal_area(
    H: Inertia = 3.0,
    Pm: Mechanical = 0.5,
    X: Reactance = 0.95,
    Pc: Annotated[float, Option("--Pc", help="Power absorbed after clearing, pu.")] = 0.0,
    cycles: FaultShown = None,
    as_json: Json = False,
    plot: Plot = None,
) -> None:
    """Find the critical clearing angle and time by the equal-area criterion; the figure shows the areas."""
    from stabctl.theory.equal_area import critical_clearing, equal_area
    from stabctl.theory.omib import OMIB, during_fault

    file(plot, ".png", ".svg", ".pdf")
    m = OMIB(H, Pm, X)
    found = critical_clearing(m, Pc)
    area = equal_area(m, found.angle if cycles is None else during_fault(m, m.seconds(cycles))[0], Pc)
    if plot:
        area.save(plot)
    if as_json:
        critical = {"critical_angle_rad": found.angle, "critical_time_s": found.time, "critical_cycles": found.cycles}
        shown = {"clearing_angle_rad": area.clearing, "unstable_angle_rad": area.unstable}
        print_json(critical | shown | {"a1_pu_rad": area.A1, "a2_pu_rad": area.A2})
        return
    lines = [
        ("critical clearing angle", f"{found.angle:.6f} rad"),
        ("critical clearing time", f"{found.time:.6f} s"),
        ("", f"{found.cycles:.3f} cycles"),
        ("shown: clearing angle", f"{area.clearing:.4f} rad"),
        ("accelerating area A1", f"{area.A1:.4f} pu rad"),
        ("decelerating area A2", f"{area.A2:.4f} pu rad"),
        ("unstable equilibrium", f"{area.unstable:.4f} rad"),
    ]
    _print_table("Equal area", ("", ""), lines)


def feedback(
    H: Inertia = 3.0,
    Pm: Mechanical = 0.5,
    X: Reactance = 0.95,
    cycles: Cycles = 15,
    Kv: Annotated[float, Option("--Kv", help="Speed gain in (13), pu/(rad/s).")] = 0.02,
    Ka: Annotated[float, Option("--Ka", help="Acceleration gain in (13), pu/(rad/s^2).")] = -0.004,
    Ka_size: Annotated[float, Option("--Ka-size", help="Gain of law (14), pu/(rad/s^2).")] = 0.007,
    as_json: Json = False,
    plot: Plot = None,
) -> None:
    """Compare four speed and acceleration feedback laws for one fault; the figure shows the phase plane."""
    from stabctl.theory.feedback_laws import compare, paper_laws
    from stabctl.theory.omib import OMIB

    file(plot, ".png", ".svg", ".pdf")
    found = compare(OMIB(H, Pm, X), cycles, paper_laws(Kv, Ka, Ka_size))
    if plot:
        found.save(plot)
    if as_json:
        laws = [
            {
                "name": r.name,
                "stable": r.stable,
                "peak_angle_rad": r.peak_angle,
                "min_angle_rad": r.min_angle,
                "max_speed_rad_s": r.max_speed,
                "min_speed_rad_s": r.min_speed,
            }
            for r in found.responses
        ]
        print_json({"laws": laws})
        return
    heads = ("law", "", "angle (rad)", "speed (rad/s)", "damping ratio")
    lines = [
        (
            r.name,
            "stable" if r.stable else "unstable",
            f"{r.min_angle:.3f} to {r.peak_angle:.3f}",
            f"{r.min_speed:.3f} to {r.max_speed:.3f}",
            "-" if math.isnan(r.damping) else f"{r.damping:z.3f}",
        )
        for r in found.responses
    ]
    _print_table(f"Feedback laws after a fault of {cycles:g} cycles", heads, lines)


def minimum_time(
    H1: Annotated[float, Option("--H1", help="Inertia constant of machine 1, s.")] = 1.0,
    HCOI: Annotated[float, Option("--HCOI", help="Inertia constant of all others, s.")] = 6.0,
    Pm: Mechanical = 0.5,
    X: Reactance = 1.0,
    cycles: Cycles = 6,
    Pc: Annotated[float, Option("--Pc", help="Largest absorbed power, pu.")] = 0.5,
    Pc_min: SmallestPower = None,
    as_json: Json = False,
    plot: Plot = None,
) -> None:
    """Find the minimum-time control of two machines; the figure shows states, co-states and absorbed power."""
    from stabctl._util.errors import StudyError
    from stabctl.theory.minimum_time import by_collocation, by_shooting
    from stabctl.theory.two_machine import Equivalent

    file(plot, ".png", ".svg", ".pdf")
    problem = Equivalent(H1, HCOI, X=X, Pm1=Pm).minimum_time_problem(cycles, -Pc if Pc_min is None else Pc_min, Pc)
    found = by_shooting(problem)
    if plot:
        found.save(plot)
    if as_json:
        record: dict[str, Any] = dict.fromkeys(
            ("duration_s", "lambda1_start", "lambda2_start", "angle_end_rad", "switches")
        )
        if found.feasible:
            values = (found.duration, found.lambda1[0], found.lambda2[0], found.x1[-1], len(found.switches))
            record = dict(zip(record, values, strict=True))
        else:
            record["outcome"] = found.outcome
        print_json(record)
        return
    if not found.feasible:
        print(found.outcome)
        return
    try:
        difference = f"{by_collocation(problem).duration - found.duration:.1e} s"
    except StudyError:
        difference = "not converged"
    lines = [
        ("at clearing", f"{problem.x1:.6f} rad, {problem.x2:.6f} rad/s"),
        ("duration T", f"{found.duration:.6f} s"),
        ("co-states at clearing", f"{found.lambda1[0]:.6f} s/rad, {found.lambda2[0]:.7f} s^2/rad"),
        ("angle at the end", f"{found.x1[-1]:.6f} rad"),
        ("switches", ", ".join(f"{t:.6f} s" for t in found.switches) or "none"),
        ("largest Hamiltonian", f"{abs(found.hamiltonian).max():.1e}"),
        ("T by collocation differs by", difference),
    ]
    _print_table("Minimum-time control", ("", ""), lines)


def _print_table(title: str, heads: tuple[str, ...], lines: Sequence[tuple[str, ...]]) -> None:
    from rich.table import Table

    table = Table(title=title, show_header=any(heads))
    for i, head in enumerate(heads):
        table.add_column(head, justify="left" if i == 0 else "right")
    for line in lines:
        table.add_row(*line)
    console().print(table)

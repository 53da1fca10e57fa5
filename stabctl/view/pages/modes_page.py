"""The page of the modes of a case."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stabctl._util.wording import number
from stabctl.model import naming
from stabctl.smallsignal import Areas, Mode, Modes
from stabctl.smallsignal.eigen import ZERO

from ..figures import modes as figures
from ..figures import one_line
from . import pattern
from .document import svg
from .pattern import Figure, Page, Part, Section, Text, figure, table

BARS = 5
HEADS = (
    "mode", "frequency (Hz)", "damping ratio (%)", "real part (1/s)", "imaginary part (rad/s)", "dominant state",
)  # fmt: skip


def page(modes: Modes, areas: Areas | None, band: tuple[float, float]) -> Page:
    """Return the page.

    Parameters
    ----------
    modes
        All modes of the case, or those of a band.
    areas
        Its coherent areas, if known.
    band
        Lowest and highest frequency (Hz) of the table and the mode shapes; what grows or is least damped is shown, too.
    """
    case = modes.linear.point.case
    worst, grow = modes.least_damped(), modes.unstable
    inside = modes.within(*band)
    rows = [modes.mode(k) for k in sorted({*inside, *worst, *grow}, key=lambda k: (modes.frequency_hz[k], k))]
    least, arrows = (modes.mode(worst[i]) if worst else None for i in (0, -1))
    swings = [m for m in sorted(rows, key=lambda m: m != least) if m.electromechanical or m == least]
    others = (grow, ", and those that grow"), (worst, ", and the least damped one")
    beyond = next((said for few, said in others if not {*few} <= {*inside}), "")
    also = ", and the least damped mode" if least and not least.electromechanical else ""
    return Page(
        f"{case.name}_modes",
        f"Modes of {case.name}",
        [*pattern.about(case), str(modes)],
        [],
        [
            Section("Eigenvalues", [*_drawn(modes, arrows, areas), *_zeros(modes)]),
            Section(
                f"Electromechanical modes{also}",
                [
                    Text(
                        "Arrows show the speeds of the machines in each mode, scaled to 1 for the largest. The two "
                        "colors are the two sides of the oscillation; the four largest arrows on each side are labeled "
                        "with machine numbers. Bars show the largest participation factors, in percent of the sum of "
                        "all.",
                        soft=True,
                    ),
                    pattern.made("swings.html", swings=map(_swing, swings)),
                ]
                if swings
                else [],
            ),
            Section("Coherent areas", [pattern.made("areas.html", areas=_areas(areas))] if areas else []),
            Section(
                f"Oscillatory modes from {band[0]:g} to {band[1]:g} Hz{beyond}",
                [
                    table(
                        HEADS,
                        map(_row, rows),
                        "Electromechanical modes are in bold. The other modes are named after their dominant state.",
                        classes=[_kind(m) for m in rows],
                    )
                    if rows
                    else Text("There are no oscillatory modes in this range."),
                    *([Text(f"Data: {case.source}", soft=True)] if case.source else []),
                ],
            ),
        ],
    )


def write(folder: str | Path, modes: Modes, areas: Areas | None, band: tuple[float, float]) -> Path:
    """Write the page into a folder as CASE_modes.html and return its path; errors as in `document.write`."""
    return pattern.write(page(modes, areas, band), folder)


def _drawn(modes: Modes, arrows: Mode | None, areas: Areas | None) -> Iterator[Figure]:
    """The eigenvalues, and on the one-line diagram the shape of the least damped mode and the areas."""
    yield figure(
        figures.plot_modes(modes),
        "Eigenvalues in the complex plane.",
        "Dashed lines mark constant damping ratios. Modes that are better damped or faster are not shown.",
    )
    parts = [part for part in (arrows, areas) if part is not None]
    if not parts:
        return
    told = []
    if arrows:
        kind = "electromechanical " if arrows.electromechanical else ""
        told.append(
            f"Shape of the least damped {kind}mode, {arrows.label}: speeds as arrows at the machines, blue and orange "
            "against each other."
        )
    told += ["Disks behind the machines are the coherent areas."] * bool(areas)
    yield figure(one_line.plot(modes.linear.point, *parts), "One-line diagram.", " ".join(told))


def _zeros(modes: Modes) -> list[Part]:
    """The zero eigenvalues, if there are any."""
    labels = [modes.label(k) for k in range(len(modes)) if modes.eigenvalues[k] == 0]
    return [Text(f"Zero eigenvalues, which do not make the system unstable: {'; '.join(labels)}.")] if labels else []


def _kind(m: Mode) -> str:
    """How a mode is set apart in the table."""
    return "unstable" if m.eigenvalue.real > ZERO else "swing" if m.electromechanical else ""


def _row(m: Mode) -> tuple[str, ...]:
    """A mode in the table."""
    s = m.eigenvalue
    numbers = number(m.frequency_hz, 3), number(100 * m.damping_ratio, 2), number(s.real, 4), number(s.imag, 4)
    return m.label, *numbers, m.participation[0].state


def _swing(m: Mode) -> dict[str, Any]:
    """An electromechanical mode with its shape and its largest participation factors."""
    largest = m.participation[0].share or 1.0
    return {
        "mode": m,
        "frequency": number(m.frequency_hz, 3),
        "damping": number(100 * m.damping_ratio, 2),
        "shape": svg(figures.plot_mode_shape(m), f"Mode shape: {m.label}"),
        "bars": [
            {"state": p.state, "width": f"{100 * p.share / largest:.1f}", "percent": f"{100 * p.share:.1f}"}
            for p in m.participation[:BARS]
        ],
    }


def _areas(areas: Areas) -> dict[str, Any]:
    """Coherent areas: machines and reference machine of each."""
    return {
        "frequencies": ", ".join(f"{f:.3f}" for f in areas.frequencies_hz) or "none",
        "agreement": f"{areas.agreement:.2f}",
        "groups": [(sorted(group, key=naming.order), group[0]) for group in areas.groups],
    }

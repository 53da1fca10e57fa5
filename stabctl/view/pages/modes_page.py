"""The page of the modes of a case, and its table for the terminal and for `--json`."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stabctl.smallsignal import Areas, Mode, Modes, Selected
from stabctl.smallsignal.eigen import ZERO

from ..figures import modes as figures
from ..figures import one_line
from . import document
from .document import svg

if TYPE_CHECKING:
    from rich.table import Table


BARS = 5


def page(modes: Modes, areas: Areas | None, band: tuple[float, float]) -> str:
    """Return the page.

    Parameters
    ----------
    modes
        All modes of the case, or those of a band.
    areas
        Its coherent areas, if known.
    band
        Lowest and highest frequency (Hz) of the table and the mode shapes.
    """
    case = modes.linear.point.case
    inside = [modes.mode(k) for k in modes.within(*band)]
    least = min((m for m in inside if m.electromechanical), key=lambda m: m.damping_ratio, default=None)
    drawn = [part for part in (least, areas) if part is not None]
    return (
        document.environment()
        .get_template("modes.html")
        .render(
            title=f"Modes of {case.name}",
            case=case,
            summary=str(modes),
            eigenvalues=svg(figures.plot_modes(modes), "Eigenvalues in the complex plane"),
            diagram=svg(one_line.plot(modes.linear.point, *drawn), "One-line diagram") if drawn else None,
            least=least,
            zeros=[modes.mode(k) for k in range(len(modes)) if modes.eigenvalues[k] == 0],
            swings=[_swing(m) for m in inside if m.electromechanical],
            areas=_areas(areas) if areas else None,
            band=[f"{edge:g}" for edge in band],
            rows=[_row(m) for m in inside],
        )
    )


def write(folder: str | Path, modes: Modes, areas: Areas | None, band: tuple[float, float]) -> Path:
    """Write the page into a folder as CASE_modes.html and return its path; errors as in `document.write`."""
    return document.write(folder, f"{modes.linear.point.case.name}_modes", page(modes, areas, band))


def _row(m: Mode) -> dict[str, Any]:
    """A mode in the table."""
    s = m.eigenvalue
    numbers = number(m.frequency_hz, 3), number(100 * m.damping_ratio, 2), number(s.real, 4), number(s.imag, 4)
    kind = "unstable" if s.real > ZERO else "swing" if m.electromechanical else ""
    return {"kind": kind, "label": m.label, "numbers": numbers, "state": m.participation[0].state}


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
        "groups": [(sorted(group), group[0]) for group in areas.groups],
    }


def record(modes: Modes) -> dict[str, Any]:
    """Return the eigenvalues with frequency, damping, label, ten largest participation factors and mode shape."""
    rows = []
    for k in range(len(modes)):
        m = modes.mode(k)
        rows.append(
            {
                "real": m.eigenvalue.real,
                "imag": m.eigenvalue.imag,
                "frequency_hz": m.frequency_hz,
                "damping_ratio": m.damping_ratio,
                "electromechanical": m.electromechanical,
                "label": m.label,
                "participation": [{"state": p.state, "share": p.share} for p in m.participation],
                "shape": [{"machine": p.machine, "magnitude": p.magnitude, "angle_deg": p.angle_deg} for p in m.shape],
            }
        )
    record = {"states": len(modes.linear.states), "modes": rows}
    if isinstance(modes, Selected):
        record |= {"certified": modes.certified, "counted": modes.counted, "proof": modes.proof()}
    return record


def table(modes: Modes, chosen: Iterable[int]) -> "Table":
    """Return a table with a row for each of the chosen modes."""
    from rich.table import Table

    out = Table("Hz", "damping ratio", "real (1/s)", "imag (rad/s)", "swing", "mode")
    for column in out.columns[:5]:
        column.no_wrap = True
        column.justify = "right"
    for k in chosen:
        m = modes.mode(k)
        swing = "yes" if m.electromechanical else ""
        s = m.eigenvalue
        ratio, real = number(m.damping_ratio, 4), number(s.real, 4)
        out.add_row(f"{m.frequency_hz:.4f}", ratio, real, f"{s.imag:.4f}", swing, m.label)
    return out


def number(value: float, digits: int) -> str:
    """Format a number with so many decimals; zero has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"

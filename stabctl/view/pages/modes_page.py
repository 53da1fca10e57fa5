"""The page of the modes of a case."""

from pathlib import Path
from typing import Any

from stabctl._util.wording import number
from stabctl.smallsignal import Areas, Mode, Modes
from stabctl.smallsignal.eigen import ZERO

from ..figures import modes as figures
from ..figures import one_line
from . import document
from .document import svg

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
        Lowest and highest frequency (Hz) of the table and the mode shapes; the least damped mode is always shown.
    """
    case = modes.linear.point.case
    worst = modes.least_damped()
    inside = modes.within(*band)
    rows = [modes.mode(k) for k in sorted({*inside, *worst}, key=lambda k: (modes.frequency_hz[k], k))]
    least, arrows = (modes.mode(worst[i]) if worst else None for i in (0, -1))
    drawn = [part for part in (arrows, areas) if part is not None]
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
            arrows=arrows,
            zeros=[modes.mode(k) for k in range(len(modes)) if modes.eigenvalues[k] == 0],
            swings=[_swing(m) for m in sorted(rows, key=lambda m: m != least) if m.electromechanical or m == least],
            areas=_areas(areas) if areas else None,
            band=[f"{edge:g}" for edge in band],
            rows=[_row(m) for m in rows],
            beyond=not {*worst} <= {*inside},
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

"""Modes as a table for the terminal and as the record that `--json` prints."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from stabctl.smallsignal import Modes, Selected

if TYPE_CHECKING:
    from rich.table import Table


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

"""Modes of every packaged case: a page each in reports/, and a table of the least damped swing."""

from pathlib import Path

from reproduction.console import present
from reproduction.study import Study, Table
from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.report import modes_page
from stabctl.report.modes_table import number
from stabctl.smallsignal import Modes, analyze, areas, linearize

BAND = 0.1, 2.5  # Hz
HEADS = "case", "states", "swings", "slowest, Hz", "least damped, Hz", "damping ratio", "who", "areas"


def study(reports: Path) -> Study:
    """The modes of all cases; the pages are written beside."""
    rows, pages = [], {}
    for name in io.packaged():
        modes = analyze(linearize(operating_point.solve(io.load(name))))
        groups = areas(modes)
        pages[f"modes of {name}"] = modes_page.write(reports, modes, groups, BAND).name
        rows.append(row(name, modes, len(groups.groups)))
    text = (
        "All eigenvalues of every packaged case by exact linearization at its operating point, and its coherent areas."
    )
    return Study(
        "Eigenvalues", text=(text,), tables=(Table("Swings of the packaged cases", HEADS, tuple(rows)),), pages=pages
    )


def row(name: str, modes: Modes, split: int) -> tuple[str, ...]:
    """One case in the table."""
    swings = modes.swings()
    worst = min(swings, key=lambda k: modes.damping_ratio[k])
    frequencies = (f"{modes.frequency_hz[k]:.3f}" for k in (swings[0], worst))
    ratio = number(modes.damping_ratio[worst], 4)
    return name, str(len(modes)), str(len(swings)), *frequencies, ratio, modes.label(worst), str(split)


if __name__ == "__main__":
    present(study)

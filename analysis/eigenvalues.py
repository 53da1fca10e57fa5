"""Modes of every packaged case: a page for each, and a table of the electromechanical modes."""

from pathlib import Path

import stabctl as st
from reproduction.study import Study, Table, present
from stabctl.smallsignal import Modes, areas
from stabctl.view.pages import modes_page
from stabctl.view.pages.modes_page import number

BAND = 0.1, 2.5  # Hz
HEADS = (
    "case",
    "states",
    "electromechanical modes",
    "slowest (Hz)",
    "least damped (Hz)",
    "its damping ratio",
    "its machines",
    "areas",
)
TEXT = "Eigenvalues of all packaged cases, by exact linearization at the operating point, and their coherent areas."


def study(reports: Path) -> Study:
    """The modes of all packaged cases."""
    rows, pages = [], {}
    for name in st.cases():
        modes = st.load(name).modes()
        groups = areas(modes)
        pages[f"modes of {name}"] = modes_page.write(reports, modes, groups, BAND).name
        rows.append(row(name, modes, len(groups.groups)))
    table = Table("Electromechanical modes of the packaged cases", HEADS, tuple(rows))
    return Study("Eigenvalues", text=(TEXT,), tables=(table,), pages=pages)


def row(name: str, modes: Modes, split: int) -> tuple[str, ...]:
    """One case in the table."""
    swings = modes.swings()
    worst = min(swings, key=lambda k: modes.damping_ratio[k])
    frequencies = (f"{modes.frequency_hz[k]:.3f}" for k in (swings[0], worst))
    ratio = number(modes.damping_ratio[worst], 4)
    return name, str(len(modes)), str(len(swings)), *frequencies, ratio, modes.label(worst), str(split)


if __name__ == "__main__":
    present(study)

"""Modes of every packaged case: a page each in reports/, and a table of the least damped swing."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from stabctl import equilibrium, read
from stabctl.linear import linearise
from stabctl.modes import analyse, areas
from stabctl.report import modes_page
from stabctl.report.modes_table import number

REPORTS = Path("reports")
BAND = 0.1, 2.5  # Hz


def main() -> None:
    """Analyse, write the pages, print the summary."""
    console = Console(highlight=False)
    table = Table("case", "states", "swings", "slowest, Hz", "least damped, Hz", "damping ratio", "who", "areas")
    for name in read.packaged():
        modes = analyse(linearise(equilibrium.solve(read.load(name))))
        groups = areas(modes)
        modes_page.write(REPORTS, modes, groups, BAND)
        swings = modes.swings()
        worst = min(swings, key=lambda k: modes.damping_ratio[k])
        frequencies = (f"{modes.frequency_hz[k]:.3f}" for k in (swings[0], worst))
        ratio = number(modes.damping_ratio[worst], 4)
        split = str(len(groups.groups))
        table.add_row(name, str(len(modes)), str(len(swings)), *frequencies, ratio, modes.label(worst), split)
    console.print(table)
    console.print(f"pages: {REPORTS}/CASE_modes.html")


if __name__ == "__main__":
    main()

"""The sweeps of this folder: the jobs of each TOML file, with the results kept in the folder of the reports."""

from collections.abc import Iterator
from pathlib import Path

from reproduction.study import Study, Table, present
from stabctl.sweep.results import cell
from stabctl.sweep.sweep import run_sweep

FULL = True


def study(reports: Path) -> Iterator[Study]:
    """A study for each sweep; jobs that are done already are read from the results file."""
    for path in sorted(Path(__file__).parent.glob("*.toml")):
        sweep = run_sweep(path, reports / f"{path.stem}.db")
        found = sweep.results
        cells = tuple(tuple(map(cell, found.columns, row)) for row in found.cells)
        common = ", ".join(f"{column} {value}" for column, value in found.common.items())
        errors = (f"{what}: {sentence}" for what, sentence in found.errors)
        table = Table(f"{sweep.done + sweep.before} jobs", found.columns, cells)
        yield Study(f"Sweep {path.stem.replace('_', ' ')}", text=(f"{common}.", *errors), tables=(table,))


if __name__ == "__main__":
    present(study)

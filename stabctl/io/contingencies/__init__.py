"""Contingencies as planners write them: TOML files, and the CON, SUB and MON files of PSS/E."""

from pathlib import Path

from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency

from . import toml


def read(path: str | Path, case: Case) -> tuple[Contingency, ...]:
    """The contingencies of a file."""
    return toml.read(path, case)

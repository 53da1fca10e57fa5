"""Contingencies as planners write them: TOML files, and the CON, SUB and MON files of PSS/E."""

from pathlib import Path

from stabctl._util.errors import StudyError
from stabctl._util.files import path_of
from stabctl.model.case import Case, as_case

from . import toml
from .con import Contingencies, read_con
from .monitored import Monitored, read_mon
from .subsystems import Subsystems

__all__ = ["Contingencies", "Monitored", "monitored", "read_contingencies"]


def read_contingencies(path: str | Path, case: Case, subsystems: str | Path | None = None) -> Contingencies:
    """The contingencies of a file.

    Parameters
    ----------
    path : str or Path
        A file ending in .con, of PSS/E; any other is TOML.
    case : Case
        The system.
    subsystems : str or Path, optional
        The SUB file of PSS/E with the subsystems that a CON file names.

    Returns
    -------
    Contingencies
        A tuple of `Contingency`; those of a CON file are without clearing times. Its `left_out` has a sentence about
        each that names something out of service.

    Raises
    ------
    StudyError
        For the first mistake, with file, line or row, text, and what is expected.

    Examples
    --------
    >>> import pathlib
    >>> text = "CONTINGENCY 'north'\\nOPEN BRANCH FROM BUS 7 TO BUS 8 CKT 1\\nEND\\nEND\\n"
    >>> _ = pathlib.Path("north.con").write_text(text)
    >>> for one in st.read_contingencies("north.con", st.load("two_area")):
    ...     print(f"{one.name}: {one}")
    north, fault at bus 7: fault 7, to be cleared by opening 7-8
    north, fault at bus 8: fault 8, to be cleared by opening 7-8
    """
    case = as_case(case)
    if path_of(path).suffix.lower() == ".con":
        return read_con(path, case, None if subsystems is None else Subsystems(path_of(subsystems), case))
    if subsystems is not None:
        raise StudyError(
            f"The subsystems {subsystems} belong to contingencies in a file ending in .con, not to {path}."
        )
    return Contingencies(toml.read(path, case))


def monitored(path: str | Path, case: Case, subsystems: str | Path | None = None) -> Monitored:
    """What a MON file of PSS/E monitors: the voltage range of every bus. Raises `StudyError`."""
    return read_mon(path_of(path), case, None if subsystems is None else Subsystems(path_of(subsystems), case))

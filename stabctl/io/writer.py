"""Writing a case to a folder."""

from collections import Counter
from pathlib import Path

from stabctl._util import files
from stabctl.errors import CaseError, StudyError
from stabctl.model import catalog
from stabctl.model.case import Case, as_case
from stabctl.model.tables import TABLES
from stabctl.schema import fields

from .folder import ABOUT, NEEDED
from .table import text_from


def write(case: Case, folder: str | Path) -> Path:
    """Write a case to a folder that `load` can read.

    Parameters
    ----------
    case : Case
        The system.
    folder : str or Path
        The folder, created if it does not exist.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    CaseError
        If the folder contains tables that the case does not have, which `load` would read as well.
    StudyError
        If a file cannot be written; files written before are complete.
    """
    case, folder = as_case(case), files.path_of(folder)
    texts = {}
    equal = Counter(case.loads).items()  # equal loads at a bus become one row, as a copy of a row is refused
    rows = {name: getattr(case, name) for name in TABLES}
    rows["loads"] = tuple(load._replace(p=count * load.p, q=count * load.q) for load, count in equal)
    for name, record in TABLES.items():
        if rows[name] or name in NEEDED:
            texts[f"{name}.csv"] = text_from(fields(record), rows[name])
    for name, devices in case.devices.items():
        columns = catalog.columns(name)
        names = list(columns)[1:]
        texts[f"{name}.csv"] = text_from(
            columns, [[key, *(getattr(par, c) for c in names)] for key, par in devices.items()]
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"The folder {folder} cannot be created: {error.strerror or error}.") from None
    other = sorted(path.name for path in folder.glob("*.csv") if path.name not in texts)
    if other:
        raise CaseError(
            f"{folder} contains {', '.join(other)}, which {case.name} does not have; choose an empty folder."
        )
    for name, text in texts.items():
        files.replace(folder / name, text)
    about = {key: getattr(case, key) for key in ABOUT if key != "extends"}
    files.replace(folder / "case.toml", "".join(f"{key} = {_toml(value)}\n" for key, value in about.items()))
    return folder


def _toml(value: str | float) -> str:
    """A value as TOML."""
    if not isinstance(value, str):
        return repr(float(value))
    for plain, escaped in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        value = value.replace(plain, escaped)
    return f'"{value}"'

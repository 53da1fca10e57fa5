"""Loading a case by its name: a packaged case, a folder, a PSS/E RAW file, a MATPOWER or PST file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from stabctl._util.errors import StudyError, shown
from stabctl.model.case import Case

from . import folder
from ._matlab import assigns

if TYPE_CHECKING:
    from stabctl.model.conventions import Conventions
    from stabctl.model.loads import Loads

    from .psse.to_case import Missing, MissingControls


def load(
    name: str | Path,
    *,
    dyr: str | Path | None = None,
    loads: "Loads | None" = None,
    machines: Literal["typical"] | None = None,
    frequency: float | str | None = None,
    conventions: "Conventions | None" = None,
    missing: "Missing" = "refuse",
    missing_controls: "MissingControls" = "refuse",
) -> Case:
    """Read a case.

    Parameters
    ----------
    name : str or Path
        A packaged case by its name, a folder, a PSS/E file ending in .raw, or a file of MATPOWER or of the Power
        System Toolbox (PST, PSTess) ending in .m.
    dyr : str or Path, optional
        The DYR file of a RAW file; by default the one with the same name in the same folder.
    loads : {"impedance", "current", "power"}, optional
        What all loads keep constant when the voltage changes; by default what the case says.
    machines : {"typical"}, optional
        Typical machines, exciters and governors for a case without dynamic data.
    frequency : float or str, Hz, optional
        Rated frequency of a file ending in .m, which may not hold it: 50 or "50Hz"; 60 Hz by default.
    conventions : {"pst", "psse", "andes", "book"}, optional
        Equations of the machines, as of a program or of textbooks; by default what the case says, for PST files "pst".
    missing, missing_controls : str
        What to do with machines and controls without a model; see `read_psse`.

    Returns
    -------
    Case

    Raises
    ------
    CaseError
        For the first error, with file, row or line, column or field, value and what is allowed.
    StudyError
        If an argument does not apply.

    Examples
    --------
    >>> case = st.load("two_area", loads="impedance")
    >>> len(case.buses), case.frequency_hz
    (11, 60.0)
    """
    ending = Path(name).suffix.lower() if isinstance(name, str | Path) and "\0" not in str(name) else ""
    given: dict[str, Any] = {"dyr": dyr}
    given |= {"missing": missing if missing != "refuse" else None}
    given |= {"missing_controls": missing_controls if missing_controls != "refuse" else None}
    if ending == ".m":
        refuse(name, given, "a PSS/E file ending in .raw")
        if assigns(Path(name), "mac_con"):
            from . import pst

            case = pst.read_pst(name, frequency=frequency)
        else:
            from . import matpower

            case = matpower.read_matpower(
                name, frequency=matpower.FREQUENCY if frequency is None else frequency, machines=machines
            )
    elif ending == ".raw":
        from . import psse

        refuse(name, {"frequency": frequency}, "a file ending in .m")
        dynamic = matching_dyr(Path(name)) if dyr is None else dyr
        case = psse.read_psse(name, dynamic, missing=missing, missing_controls=missing_controls)
    else:
        refuse(name, given, "a PSS/E file ending in .raw")
        refuse(name, {"frequency": frequency}, "a file ending in .m")
        case = folder.load(name)
    if machines not in (None, "typical"):
        raise StudyError(f"machines = {shown(machines)} is not allowed; the only choice is typical.")
    if machines is not None and ending != ".m":
        case = case.with_typical_machines()
    case = case.with_conventions(conventions) if conventions is not None else case
    return case.with_loads(loads) if loads is not None else case


def refuse(name: str | Path, given: dict[str, Any], files: str) -> None:
    """Raise `StudyError` for an argument that is given but applies to other files."""
    for option, value in given.items():
        if value is not None:
            raise StudyError(f"{option} applies only to {files}, not to {name}.")


def matching_dyr(raw: Path) -> Path | None:
    """The DYR file with the name of a RAW file, in small or capital letters, if there is one."""
    exact = raw.parent / f"{raw.stem}.dyr"
    try:
        found = [p for p in raw.parent.iterdir() if p.name.lower() == exact.name.lower() and p.is_file()]
    except OSError:
        return None
    return exact if exact in found else min(found, default=None)

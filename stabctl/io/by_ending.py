"""Loading a case by what its name says: a packaged case, a folder, a PSS/E RAW file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from stabctl.errors import StudyError
from stabctl.model.case import Case

from . import folder

if TYPE_CHECKING:
    from stabctl.model.characteristic import Loads

    from .psse.to_case import Missing, MissingControls


def load(
    name: str | Path,
    *,
    dyr: str | Path | None = None,
    loads: "Loads | None" = None,
    machines: Literal["typical"] | None = None,
    missing: "Missing" = "refuse",
    missing_controls: "MissingControls" = "refuse",
) -> Case:
    """Read a case.

    Parameters
    ----------
    name : str or Path
        A packaged case by its name, a folder, or a PSS/E file ending in .raw.
    dyr : str or Path, optional
        The DYR file of a RAW file; by default the one beside it with the same name.
    loads : {"impedance", "current", "power"}, optional
        What all loads keep constant when the voltage changes; by default what the case says.
    missing, missing_controls : str
        What to do with machines and controls without a model; see `read_psse`.

    Raises
    ------
    CaseError
        For the first error, with file, row or line, column or field, value and what is allowed.
    StudyError
        If an argument does not apply.
    """
    ending = Path(name).suffix.lower() if isinstance(name, str | Path) and "\0" not in str(name) else ""
    if ending == ".raw":
        from . import psse

        beside = _beside(Path(name)) if dyr is None else dyr
        case = psse.read_psse(name, beside, missing=missing, missing_controls=missing_controls)
    else:
        given: dict[str, Any] = {"dyr": dyr}
        given |= {"missing": missing if missing != "refuse" else None}
        given |= {"missing_controls": missing_controls if missing_controls != "refuse" else None}
        for option, value in given.items():
            if value is not None:
                raise StudyError(f"{option} applies only to a PSS/E file ending in .raw, and {name} is none.")
        case = folder.load(name)
    return case.with_loads(loads) if loads is not None else case


def _beside(raw: Path) -> Path | None:
    """The DYR file with the name of a RAW file, if there is one."""
    return next((path for path in (raw.with_suffix(".dyr"), raw.with_suffix(".DYR")) if path.is_file()), None)

"""Cases in which motors draw a share of the loads."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from stabctl.errors import StudyError, shown
from stabctl.units import quantity

from . import catalog, keys
from .case import Case, as_case
from .device_edit import with_device

MODEL = "cim"


def with_motors(
    case: Case, share: str | float, at: int | str | Iterable[int | str] | None = None, **values: Any
) -> Case:
    """The case with induction motors (CIM) that draw a share of its loads.

    The motor at a load draws this share of its active power; its reactive power beyond the same share is made up by a
    constant susceptance, so the power flow does not change. The rest of the load keeps its dependence on the voltage.

    Parameters
    ----------
    case : Case
        The system.
    share : str or float
        Share of p and q: "40%" or 0.4; 0 turns the motors off.
    at : int, str or iterable, optional
        Bus number, or key of a load such as "7#2" (the second at bus 7), or several. By default every load that
        draws active power and has no other load model.
    **values : float, int or str
        Parameters of the motors, per unit on their own MVA: `H=1.5, Pmult=1.2, A=1, C0=0`; see `stabctl models cim`.

    Raises
    ------
    StudyError
        If the share is not from 0 to 1, or the case has no such load or the model no such parameter.

    Examples
    --------
    >>> case.with_motors("40%")
    >>> case.with_motors(0.6, at=(7, 8), H=0.3)
    """
    case = as_case(case)
    number = quantity(share, "-") if isinstance(share, str) else share
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number <= 1:
        raise StudyError(f"The motor share {shown(share)} is not allowed; give one from 0 to 1, such as 40% or 0.4.")
    places = _loads(case) if at is None else [at] if isinstance(at, int | str) else list(at)
    equipped = with_device(case, MODEL, places, **values) if places else case
    rows = {keys.row(case, "loads", place) for place in places}
    loads = [x._replace(model_share=float(number)) if i in rows else x for i, x in enumerate(equipped.loads)]
    return replace(equipped, loads=tuple(loads))


def _loads(case: Case) -> list[keys.Key]:
    """Keys of the loads that draw active power and have no load model, or motors already."""
    others = {key for model in catalog.of_role("load") if model != MODEL for key in case.devices.get(model, ())}
    rows = zip(keys.keys(case, "loads"), case.loads, strict=True)
    return [key for key, load in rows if load.kind == "load" and load.p > 0 and key not in others]

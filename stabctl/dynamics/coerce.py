"""The operating point that a study starts from, given a case or an operating point, and other storage if wanted."""

from stabctl.errors import StudyError, shown
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .operating_point import OperatingPoint, solve


def operating_point(base: Case | OperatingPoint, storage: Fleet | None = None) -> OperatingPoint:
    """The operating point of a case, or the point itself, with other storage devices if given.

    Parameters
    ----------
    base : Case or OperatingPoint
    storage : str, mapping, or iterable of Storage, optional
        Devices in place of the case's own: a rating at every machine ("50MW", "5%mva", "5%dispatch"), ratings at
        some ("14=50MW,13@33=20MW" or {14: "50MW"}; numbers are MW), rows, or "none".

    Raises
    ------
    StudyError
        If `base` or `storage` is anything else.
    """
    if isinstance(base, Case):
        flow = powerflow.solve(base)
        return solve(base if storage is None else base.with_storage(storage, flow), flow)
    if not isinstance(base, OperatingPoint):
        raise StudyError(
            f"{shown(base)} is not a system; give a Case, such as st.load('two_area'), or its OperatingPoint."
        )
    return base if storage is None else solve(base.case.with_storage(storage, base.flow), base.flow)


def initialize(case: Case, storage: Fleet | None = None) -> OperatingPoint:
    """The operating point of a case: its power flow, and the states at which all devices are in equilibrium.

    Parameters
    ----------
    case : Case
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own; see `operating_point`.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    PowerFlowError, EquilibriumError
        If the power flow has no solution, or a device has no equilibrium there.
    """
    if not isinstance(case, Case):
        raise StudyError(f"{shown(case)} is not a case; give one, such as st.load('two_area').")
    return operating_point(case, storage)

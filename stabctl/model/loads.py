"""Cases with other loads: another level, voltage dependence, or share of motors."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import quantity
from stabctl.devices.loads import zip_load

from . import naming, powerflow, tables
from .case import Case, as_case
from .edit import with_device
from .tables import Load

Loads = Literal["impedance", "current", "power"]
HIGHEST = 10.0  # load level
LOW: Mapping[str, float] = MappingProxyType({"impedance": 0.5, "current": 0.5, "power": 0.7})  # pu   v_low of a load
_SHARES = MappingProxyType({"impedance": (0.0, 0.0), "current": (0.0, 1.0), "power": (1.0, 0.0)})
MODEL = "cim"  # of the motors
TYPICAL = "constant current for active, constant admittance for reactive power"  # in the note of typical loads


def with_load_level(case: Case, level: float) -> Case:
    """The case with every load and the dispatch of every machine multiplied by a level.

    The swing machine covers what the losses change; voltages, shunts, HVDC links and DC lines stay as they are.

    Parameters
    ----------
    case : Case
        The system.
    level : float
        Share of the present load: 0.9 for 90 %.

    Raises
    ------
    StudyError
        For a level that is not above 0, or above 10.

    Examples
    --------
    >>> [round(load.p) for load in st.load("two_area").with_load_level(0.9).loads]
    [870, 1590]
    """
    if isinstance(level, bool) or not isinstance(level, int | float) or not 0 < level <= HIGHEST:
        raise StudyError(f"The load level {level!r} is not allowed; give a number above 0, such as 0.9 for 90 %.")
    loads = tuple(x if x.kind == "hvdc" else x._replace(p=level * x.p, q=level * x.q) for x in case.loads)
    machines = tuple(m._replace(p=level * m.p) for m in case.machines)
    return replace(case, loads=loads, machines=machines)


def with_loads(case: Case, kind: Loads) -> Case:
    """The case with every load of one kind; the power that each draws at its power-flow voltage stays the same.

    A load of this kind stays as it is. The others have the usual `v_low` of their new kind, 0.7 pu for constant power
    and 0.5 pu otherwise, unless theirs is neither of the two.

    Parameters
    ----------
    case : Case
        The system. Its load models and other injections, such as DC lines, stay as they are.
    kind : {"impedance", "current", "power"}
        What stays constant when the voltage changes.

    Raises
    ------
    StudyError
        If the kind is none of these.
    PowerFlowError
        If loads depend on the voltage in the power flow, and it has no solution.

    Examples
    --------
    >>> st.load("two_area").with_loads("power").loads[0].p_power
    1.0
    """
    case = as_case(case)
    if not isinstance(kind, str) or kind not in LOW:
        raise StudyError(f"Loads of kind {shown(kind)} are not known; choose one of {', '.join(LOW)}.")
    own = any(load.v for load in case.loads)
    size = dict(zip((b.bus for b in case.buses), abs(powerflow.solve(case).V).tolist(), strict=True)) if own else {}
    power, current = _SHARES[kind]

    def changed(load: Load) -> Load:
        of_kind = load._replace(p_power=power, q_power=power, p_current=current, q_current=current, v=0.0)
        if load.kind != "load" or load == of_kind:
            return load
        S = zip_load.drawn(load, size.get(load.bus, 1.0))
        low = LOW[kind] if load.v_low in LOW.values() else load.v_low
        return of_kind._replace(p=S.real, q=S.imag, v_low=low)

    notes = tuple(note for note in case.notes if TYPICAL not in note)
    return replace(case, loads=tuple(map(changed, case.loads)), notes=notes)


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
    >>> case = st.load("two_area").with_motors(0.6, at=7, H=0.3)
    >>> case.devices["cim"][7].H
    0.3
    """
    case = as_case(case)
    number = quantity(share, "-") if isinstance(share, str) else share
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number <= 1:
        raise StudyError(f"The motor share {shown(share)} is not allowed; give one from 0 to 1, such as 40% or 0.4.")
    places = _loads(case) if at is None else [at] if isinstance(at, int | str) else list(at)
    equipped = with_device(case, MODEL, places, **values) if places else case
    rows = {naming.row(case, "loads", place) for place in places}
    loads = [x._replace(model_share=float(number)) if i in rows else x for i, x in enumerate(equipped.loads)]
    return replace(equipped, loads=tuple(loads))


def _loads(case: Case) -> list[naming.Key]:
    """Keys of the loads that draw active power and have no load model, or motors already."""
    others = {key for model in tables.of_role("load") if model != MODEL for key in case.devices.get(model, ())}
    rows = zip(naming.keys(case, "loads"), case.loads, strict=True)
    return [key for key, load in rows if load.kind == "load" and load.p > 0 and key not in others]

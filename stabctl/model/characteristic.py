"""Cases whose loads have another voltage dependence."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from stabctl.devices.loads import zip_load
from stabctl.errors import StudyError, shown

from . import powerflow
from .case import Case, as_case
from .tables import Load

Loads = Literal["impedance", "current", "power"]
LOW: Mapping[str, float] = MappingProxyType({"impedance": 0.5, "current": 0.5, "power": 0.7})  # pu   v_low of a load
_SHARES = MappingProxyType({"impedance": (0.0, 0.0), "current": (0.0, 1.0), "power": (1.0, 0.0)})


def with_loads(case: Case, kind: Loads) -> Case:
    """The case with every load of one kind; the power that each draws at its power-flow voltage stays the same.

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
    """
    case = as_case(case)
    if kind not in LOW:
        raise StudyError(f"Loads of kind {shown(kind)} are not known; choose one of {', '.join(LOW)}.")
    own = any(load.v for load in case.loads)
    size = dict(zip((b.bus for b in case.buses), abs(powerflow.solve(case).V).tolist(), strict=True)) if own else {}
    power, current = _SHARES[kind]

    def changed(load: Load) -> Load:
        if load.kind != "load":
            return load
        S = zip_load.drawn(load, size.get(load.bus, 1.0))
        return load._replace(
            p=S.real,
            q=S.imag,
            p_power=power,
            q_power=power,
            p_current=current,
            q_current=current,
            v_low=LOW[kind],
            v=0.0,
        )

    return replace(case, loads=tuple(changed(load) for load in case.loads))

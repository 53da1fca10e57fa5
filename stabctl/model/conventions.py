"""Conventions of machine equations, with which published results were computed: of a program or of textbooks.

            speed in the stator voltage    mechanical input
    pst     yes                            power, Pm/omega
    psse    no                             power, Pm/omega
    andes   no                             torque
    book    no                             torque

They differ in the damping of a mode: a power over the speed adds about Pm/(4H) 1/s. GENROU and GENROE have both
choices, GENSAL, GENSAE and GENTPJ1 that of the mechanical input; the others have neither.
Source: Power System Toolbox 3; PSS/E Model Library; ANDES, GENROU; G. Rogers, Power System Oscillations (2025).
"""

from dataclasses import replace
from typing import Any, Literal, NamedTuple

from stabctl._util.errors import StudyError, shown

from . import tables
from .case import Case, as_case

Conventions = Literal["pst", "psse", "andes", "book"]


class Convention(NamedTuple):
    """Values of the parameters that select the equations of a machine."""

    speed_factor: int  # 1: the voltage of the stator is multiplied by the speed
    torque: int  # 1: the mechanical input is a torque


KNOWN = {"pst": Convention(1, 0), "psse": Convention(0, 0), "andes": Convention(0, 1), "book": Convention(0, 1)}


def of(case: Case) -> str:
    """Conventions that all machines of a case have, with their meaning; "" if no machine has such a choice."""
    found: dict[str, set[Any]] = {field: set() for field in Convention._fields}
    for model, rows in case.devices.items():
        for field in found.keys() & tables.device_columns(model).keys() if tables.role(model) == "machine" else ():
            found[field] |= {getattr(par, field) for par in rows.values()}
    if not any(found.values()):
        return ""
    fits = [name for name, own in KNOWN.items() if all(v <= {own[i]} for i, v in enumerate(found.values()))]
    power = {(1,): "torque", (0,): "power"}.get(tuple(found["torque"]), "power at some and torque at other machines")
    speed = {(1,): ", speed in the stator voltage", (0,): ", no speed in the stator voltage"}
    stator = speed.get(tuple(found["speed_factor"]), "")
    return f"{' or '.join(fits) or 'of several programs'} ({power} as mechanical input{stator})"


def with_conventions(case: Case, name: Conventions) -> Case:
    """The case with the machine equations of a program, or of textbooks.

    Parameters
    ----------
    case : Case
        The system.
    name : {"pst", "psse", "andes", "book"}
        The Power System Toolbox, PSS/E, ANDES, or textbooks such as Rogers, Power System Oscillations.

    Returns
    -------
    Case
        With the columns `speed_factor` and `torque` of its machines changed, where their models have them.

    Raises
    ------
    StudyError
        If the name is none of these.

    Examples
    --------
    >>> st.load("two_area").with_conventions("book").devices["genrou"][1].speed_factor
    0
    """
    case = as_case(case)
    if not isinstance(name, str) or name not in KNOWN:
        raise StudyError(f"The conventions {shown(name)} are not known; choose one of {', '.join(KNOWN)}.")
    values, devices = KNOWN[name]._asdict(), {}
    for model, rows in case.devices.items():
        columns = tables.device_columns(model) if tables.role(model) == "machine" else ()
        chosen = {field: value for field, value in values.items() if field in columns}
        devices[model] = {key: par._replace(**chosen) for key, par in rows.items()}
    return replace(case, devices=devices)

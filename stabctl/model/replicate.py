"""Large test systems: copies of a case, tied into one network."""

from cmath import phase
from dataclasses import replace
from math import degrees
from typing import Any, TypeVar

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.process import paused
from stabctl._util.units import quantity

from . import naming, network, powerflow, tables
from .case import Case, as_case
from .tables import Branch, Bus, Machine

Row = TypeVar("Row", bound=Any)


@paused()
def replicate(case: Case, copies: int, *, tie_bus: int | None = None, x: float = 0.01, spread: float = 0.0) -> Case:
    """Copies of a case in one network; a line ties each copy to the one with half its number.

    Copy k (from 0) has the bus and machine numbers of the case plus k times the smallest power of ten above both. Every
    copy has the operating point of the case, its bus table the voltages solved, and the ties carry no power. Only the
    first copy keeps the swing bus of the tied island; in the others, its machines are scheduled at their present power.

    Parameters
    ----------
    case : Case
        The system.
    copies : int
        Number of copies.
    tie_bus : int, optional
        Bus of every copy at which the ties end; by default the high-voltage bus of the swing machine.
    x : float, pu
        Reactance of a tie on the system base.
    spread : float
        Relative increase of the inertias from the first copy to the last, which separates the modes of the copies.

    Returns
    -------
    Case

    Raises
    ------
    StudyError
        For fewer than one copy, a bus that does not exist, or a reactance that is not positive.

    Examples
    --------
    >>> [row.machine for row in st.replicate(st.load("two_area"), 2).machines]
    [1, 2, 3, 4, 101, 102, 103, 104]
    """
    case = as_case(case)
    if not isinstance(copies, int) or isinstance(copies, bool) or copies < 1:
        raise StudyError(f"{shown(copies)} copies of {case.name} are not possible; give a whole number of at least 1.")
    swing = next(b.bus for b in case.buses if b.kind == "swing")
    if tie_bus is None:
        tie_bus = next(m.storage_bus for m in case.machines if m.bus == swing)
    tied = naming.row(case, "buses", tie_bus)
    x, spread = quantity(x, "pu"), quantity(spread, "-")
    if not 0 < x < np.inf:
        raise StudyError(f"A tie of {x:g} pu is not possible; its reactance must be above 0.")
    if not -0.9 <= spread <= 9:
        raise StudyError(f"A spread of {spread:g} is not possible; give one from -0.9 to 9.")
    flow = powerflow.solve(case)
    scheduled = [m._replace(p=float(S.real) * case.base_mva) for m, S in zip(case.machines, flow.S, strict=True)]
    island = network.islands(network.build(case))
    solved = [b._replace(v=abs(V), angle=degrees(phase(V))) for b, V in zip(case.buses, flow.V.tolist(), strict=True)]
    step = 10 ** len(str(max([b.bus for b in case.buses] + [m.machine for m in case.machines])))
    shifts = [k * step for k in range(copies)]
    ties = [Branch(tie_bus + shifts[k // 2], tie_bus + shifts[k], 0.0, x) for k in range(1, copies)]
    growth = np.linspace(1, 1 + spread, copies)
    return replace(
        case,
        name=f"{case.name}_x{copies}",
        title=f"{copies} times {case.title}",
        buses=tuple(_bus(b, s, of) for s in shifts for b, of in zip(solved, island == island[tied], strict=True)),
        branches=(*(_moved(k, s) for s in shifts for k in case.branches), *ties),
        machines=tuple(_machine(m, s) for s in shifts for m in scheduled),
        loads=tuple(_moved(load, s) for s in shifts for load in case.loads),
        links=tuple(_moved(k, s)._replace(link=_copied(k.link, s)) for s in shifts for k in case.links),
        storage=tuple(_moved(d, s) for s in shifts for d in case.storage),
        devices={
            model: {
                naming.moved(key, s): _heavier(model, par, float(g))
                for s, g in zip(shifts, growth, strict=True)
                for key, par in rows.items()
            }
            for model, rows in case.devices.items()
        },
    )


def _heavier(model: str, par: Any, factor: float) -> Any:
    """The parameters of a machine with its inertia multiplied; of other devices as they are."""
    machine = tables.role(model) == "machine" and "H" in par._fields
    return par._replace(H=par.H * factor) if machine else par


def _moved(row: Row, shift: int) -> Row:
    """A row with every bus and machine number increased."""
    numbers = {name: getattr(row, name) + shift for name in row._fields if name == "machine" or name.endswith("bus")}
    return row._replace(**numbers)


def _machine(machine: Machine, shift: int) -> Machine:
    """A machine of a copy; the bus in a name such as 30/1 is that of the copy."""
    bus, slash, id = machine.name.partition("/")
    name = f"{int(bus) + shift}/{id}" if slash and bus.isdecimal() else _copied(machine.name, shift)
    return _moved(machine, shift)._replace(name=name)


def _copied(name: str, shift: int) -> str:
    """A name in a copy."""
    return f"{name} {shift}" if name and shift else name


def _bus(bus: Bus, shift: int, tied: bool) -> Bus:
    """A bus of a copy; of an island that is tied, only the first copy has a swing bus."""
    moved = _moved(bus, shift)._replace(name=_copied(bus.name, shift))
    return moved._replace(kind="pv") if shift and tied and bus.kind == "swing" else moved

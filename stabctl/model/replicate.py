"""Large systems out of small ones: copies of a case, tied into one network."""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from stabctl.errors import StudyError

from . import powerflow
from .case import Branch, Bus, Case

Row = TypeVar("Row", bound=Any)


def replicate(case: Case, copies: int, tie_bus: int | None = None, x: float = 0.01, spread: float = 0.0) -> Case:
    """`copies` of a case as one, each after the first tied by a line of reactance `x` (pu) to that of half its number.

    The ties run between the `tie_bus`es, the high-voltage bus of the swing machine unless given. Copy k (from 0) has
    the bus and machine numbers of the original plus k times the least power of ten above both. The ties carry nothing
    at the operating point, which is that of the case in every copy: only the first keeps its swing bus, the machines
    of the others give its load-flow power. Inertias grow evenly from the first copy to the last by the share `spread`,
    which tells the modes of the copies apart. `StudyError` for fewer than one copy, a bus that is not there, a line
    without reactance.
    """
    if copies < 1:
        raise StudyError(f"{copies} copies of {case.name} are not possible; ask for at least 1.")
    swing = next(b.bus for b in case.buses if b.kind == "swing")
    if tie_bus is None:
        tie_bus = next(m.storage_bus for m in case.machines if m.bus == swing)
    if tie_bus not in {b.bus for b in case.buses}:
        raise StudyError(f"There is no bus {tie_bus} in {case.name} to tie its copies at.")
    if not 0 < x < np.inf:
        raise StudyError(f"A tie of {x:g} pu is not possible; its reactance must be above 0.")
    flow = powerflow.solve(case)
    given = [m._replace(p=float(S.real) * case.base_mva) for m, S in zip(case.machines, flow.S, strict=True)]
    step = 10 ** len(str(max([b.bus for b in case.buses] + [m.machine for m in case.machines])))
    shifts = [k * step for k in range(copies)]
    ties = [Branch(tie_bus + shifts[k // 2], tie_bus + shifts[k], 0.0, x) for k in range(1, copies)]
    growth = np.linspace(1, 1 + spread, copies)
    devices = {
        model: {
            number + s: par._replace(H=par.H * float(g)) if "H" in par._fields else par
            for s, g in zip(shifts, growth, strict=True)
            for number, par in table.items()
        }
        for model, table in case.devices.items()
    }
    return replace(
        case,
        name=f"{case.name}_x{copies}",
        title=f"{copies} times {case.title}",
        buses=tuple(_bus(b, s) for s in shifts for b in case.buses),
        branches=(*(_moved(k, s) for s in shifts for k in case.branches), *ties),
        machines=tuple(_moved(m, s) for s in shifts for m in given),
        loads=tuple(_moved(load, s) for s in shifts for load in case.loads),
        links=tuple(_moved(k, s)._replace(link=f"{k.link} {s}" if s else k.link) for s in shifts for k in case.links),
        storage=tuple(_moved(d, s) for s in shifts for d in case.storage),
        devices=devices,
    )


def _moved(row: Row, shift: int) -> Row:
    """A row with every bus and machine number moved."""
    numbers = {name: getattr(row, name) + shift for name in row._fields if name == "machine" or name.endswith("bus")}
    return row._replace(**numbers)


def _bus(bus: Bus, shift: int) -> Bus:
    moved = _moved(bus, shift)
    return moved._replace(kind="pv") if shift and bus.kind == "swing" else moved

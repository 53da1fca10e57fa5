"""Where there is nothing to linearize: a point that moves, and one that rests on a limit."""

import numpy as np

from stabctl.devices import models
from stabctl.dynamics import assembly, layout
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.system import Buffers, Plant, first_state
from stabctl.errors import LinearizationError

from . import local
from .local import Private

STILL = 1e-8  # 1/s and pu   largest rate and current mismatch of an equilibrium
NUDGE = 1e-8  # of every place of z: moves a value off the limit it rests on
JUMP = 1e-3  # change of a slope between both sides, relative to the largest of its row


def moving(point: OperatingPoint, alone: Private, b: Buffers) -> None:
    """`LinearizationError` unless every rate and every bus's current balance is zero; names the worst."""
    f = b.f.real.copy()
    nx = len(f) - 2 * len(alone.bus)
    V = point.z[nx : nx + 2 * len(point.V)].copy().view(complex)
    miss = np.abs(local.currents(alone, f, len(V)) - point.admittance() @ V)
    k, bus = int(np.abs(f[:nx]).argmax()), int(miss.argmax())
    if not abs(f[k]) < STILL:
        state = layout.label(point.case, layout.states(point.plant)[k])
        raise LinearizationError(
            f"The point of {point.case.name} is no equilibrium: {state} moves at {f[k]:.3g} per second, more than any "
            f"other state; linearize a point that equilibrium.solve gave."
        )
    if not miss[bus] < STILL:
        raise LinearizationError(
            f"The point of {point.case.name} is no equilibrium: the currents at bus {point.case.buses[bus].bus} "
            f"miss by {miss[bus]:.3g} pu; linearize a point that equilibrium.solve gave."
        )


def limited(point: OperatingPoint, alone: Private) -> None:
    """`LinearizationError` where a limiter rests on its limit, so that both sides have different slopes; names it."""
    for j, s in enumerate(point.case.storage):
        held = point.plant.storage[j].capacity
        energy = point.z[first_state(point.plant, "storage") + 2 * j + 1]
        if held > 0 and not 0 < energy < held:
            what = "full" if energy >= held else "empty"
            raise LinearizationError(
                f"The store of ESD {s.machine}@{s.bus} is {what}: only one side has a derivative there; "
                f"start it between empty and full."
            )
    rows = _jumps(point, alone)
    if not len(rows):
        return
    owner = alone.owner[rows[0]]
    m = len(point.case.machines)
    if owner < m:
        for family, j, name in _limits(alone.plant, owner):
            opened = _open(alone.plant, family, j, name)
            if rows[0] not in _jumps(point, alone._replace(plant=opened)):
                machine, limit = point.case.machines[owner], float(getattr(alone.plant, family)[name][j])
                raise LinearizationError(
                    f"{models()[family].NAME} of machine {machine.machine} at bus {machine.bus} rests on its limit {name} = "
                    f"{limit:g} pu: only one side has a derivative there; widen {name} in {family}.csv, or move the "
                    f"operating point off it."
                )
    where = f"machine {point.case.machines[owner].machine}" if owner < m else f"bus {_bus(point, alone, owner)}"
    raise LinearizationError(f"The equations at {where} have different slopes on both sides of the operating point.")


def _bus(point: OperatingPoint, alone: Private, owner: int) -> int:
    return point.case.buses[alone.bus[owner]].bus


def _jumps(point: OperatingPoint, alone: Private) -> np.ndarray:
    """Rows of f whose slopes differ between both sides of the point, along one direction that moves everything."""
    step = NUDGE * np.random.default_rng(0).choice([-1, 1], len(point.z)) * np.linspace(0.5, 1, len(point.z))
    sides = [local.derivatives(alone, local.at(alone, point.z + s)) for s in (step, -step)]
    energy = first_state(alone.plant, "storage") + 1 + 2 * np.arange(len(alone.plant.storage))
    for J in sides:
        J[:, energy] = 0
    scale = np.maximum(*(np.abs(J).max(axis=0) for J in sides))
    return np.flatnonzero(np.abs(sides[0] - sides[1]).max(axis=0) > JUMP * scale + STILL)


def _limits(plant: Plant, machine: int) -> list[tuple[str, int, str]]:
    """Table, row and name of every limit of a machine's devices."""
    return [
        (family, int(j), name)
        for family, device in models().items()
        for j in np.flatnonzero(getattr(plant, f"{family}_machine") == machine)
        for name in device.Par._fields
        if name.endswith(("max", "min"))
    ]


def _open(plant: Plant, family: str, row: int, name: str) -> Plant:
    table = getattr(plant, family).copy()
    table[name][row] = 1e9 if name.endswith("max") else -1e9
    opened = plant._replace(**{family: table})
    return opened._replace(**assembly.held(opened))

"""Where there is nothing to linearize: a point that moves, and one that rests on a limit."""

import numpy as np

from stabctl.dynamics import family
from stabctl.dynamics.jacobian import Derivatives
from stabctl.dynamics.limits import limits
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.program import Family
from stabctl.dynamics.start import FAR
from stabctl.errors import LinearizationError

STILL = 1e-8  # 1/s and pu   largest rate and current mismatch of an equilibrium
NUDGE = 1e-8  # of every signal: moves a value off the limit it rests on
JUMP = 1e-3  # change of a slope between both sides, relative to the largest of its row


def moving(point: OperatingPoint, d: Derivatives) -> None:
    """`LinearizationError` unless every rate and every bus's current balance is zero; names the worst."""
    miss = np.abs(d.currents - point.admittance() @ point.s[point.layout.voltages].copy().view(complex))
    k, bus = int(np.abs(d.rates).argmax()), int(miss.argmax())
    if not abs(d.rates[k]) < STILL:
        raise LinearizationError(
            f"The point of {point.case.name} is no equilibrium: {point.layout.states[k].label} moves at "
            f"{d.rates[k]:.3g} per second, more than any other state; linearize a point that initialize() gave."
        )
    if not miss[bus] < STILL:
        raise LinearizationError(
            f"The point of {point.case.name} is no equilibrium: the currents at bus {point.case.buses[bus].bus} "
            f"miss by {miss[bus]:.3g} pu; linearize a point that initialize() gave."
        )


def limited(point: OperatingPoint) -> None:
    """`LinearizationError` where a limiter rests on its limit, so that both sides have different slopes; names it."""
    for j, device in enumerate(point.case.storage):
        esd = point.system.family("esd")
        par = esd.device.Par(*esd.k[j])
        if not par.floor < par.stored < par.capacity:
            what = "full" if par.stored >= par.capacity else "empty"
            raise LinearizationError(
                f"The store of ESD {device.machine}@{device.bus} is {what}: only one side has a derivative there; "
                f"start it between empty and full."
            )
    rows = _jumps(point, None)
    if not len(rows):
        return
    unit = _unit(point, rows[0])
    for name, j, column in _limits(point, unit):
        f = point.system.family(name)
        k = f.k.copy()
        limit, parameter = f.k[j, column], f.device.Par._fields[column]
        k[j, column] = family.side(f.device, parameter) * FAR
        if rows[0] not in _jumps(point, (name, k)):
            where = (
                f"machine {point.case.machines[unit].machine} at bus {point.case.machines[unit].bus}"
                if unit >= 0
                else f.keys[j]
            )
            raise LinearizationError(
                f"{f.device.NAME} of {where} rests on its limit {parameter} = {limit:g} pu: only one side has a "
                f"derivative there; widen {parameter} in {name}.csv, or move the operating point off it."
            )
    raise LinearizationError(
        f"The equations at {_where(point, rows[0])} have different slopes on both sides of the operating point."
    )


def _jumps(point: OperatingPoint, changed: tuple[str, np.ndarray] | None) -> np.ndarray:
    """Rows of [rates | outputs | currents] whose slopes differ between both sides of the point.

    The sides lie along one direction that moves every signal; `changed` gives other constants to one family.
    """
    equations, lay = point.equations, point.layout
    k = None
    if changed is not None:
        k = np.concatenate([(changed[1] if f.name == changed[0] else f.k).ravel() for f in equations.families])
    free = np.arange(lay.step)
    step = np.zeros(lay.size)
    step[free] = NUDGE * np.random.default_rng(0).choice([-1, 1], len(free)) * np.linspace(0.5, 1, len(free))
    sides = []
    lim = point.system.limits if changed is None else limits(_replaced(point, changed), lay.one)
    for s in (point.s + step, point.s - step):
        J, rates = equations.direct(s, k)
        held = equations.held(s, rates, lim)
        J = J.multiply((~np.r_[held, np.zeros(J.shape[0] - lay.nx, bool)])[:, None]).tocsr()
        sides.append(J)
    energy = [i for i, p in enumerate(lay.states) if (p.table, p.name) == ("esd", "energy")]
    keep = np.setdiff1d(np.arange(sides[0].shape[0]), energy)
    scale = np.maximum(*(abs(J).max(axis=1).toarray().ravel() for J in sides))
    jump = abs(sides[0] - sides[1]).max(axis=1).toarray().ravel()
    return keep[(jump > JUMP * scale + STILL)[keep]]


def _replaced(point: OperatingPoint, changed: tuple[str, np.ndarray]) -> list[Family]:
    return [f._replace(k=changed[1]) if f.name == changed[0] else f for f in point.system.families]


def _unit(point: OperatingPoint, row: int) -> int:
    """Row of the unit whose state, output or current a row belongs to; -1 where it is none's."""
    lay = point.layout
    if row < lay.nx:
        return lay.states[row].unit
    if row < lay.nx + lay.outputs:
        return int(lay.owner[lay.first_output + row - lay.nx])
    return -1


def _where(point: OperatingPoint, row: int) -> str:
    unit = _unit(point, row)
    if unit >= 0:
        return f"machine {point.case.machines[unit].machine}"
    lay = point.layout
    at = (row - lay.nx - lay.outputs) // 2
    bus = point.equations.injecting[at] if row >= lay.nx + lay.outputs else 0
    return f"bus {point.case.buses[(bus - lay.nx) // 2].bus}"


def _limits(point: OperatingPoint, unit: int) -> list[tuple[str, int, int]]:
    """Table, row and column of every limit of a unit's devices."""
    return [
        (f.name, int(j), c)
        for f in point.system.families
        for j in np.flatnonzero(f.w[:, family.UNIT] == unit)
        for c, name in enumerate(family.fields(f.device, "Par"))
        if family.side(f.device, name)
    ]

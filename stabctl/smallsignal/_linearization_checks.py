"""Checks before linearization: the operating point must be in equilibrium, and no device exactly at a limit."""

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from stabctl._util.errors import LinearizationError
from stabctl.dynamics import family, outputs, storage
from stabctl.dynamics.family import Family, Limits, limits
from stabctl.dynamics.jacobian import Derivatives, Matrix
from stabctl.dynamics.newton import FAR
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal
from stabctl.dynamics.violations import widen
from stabctl.model import naming

STILL = 1e-8  # 1/s and pu on 100 MVA   largest state derivative and current mismatch of an equilibrium
NUDGE = 1e-8  # perturbation of every signal, which moves a value off a limit
SMOOTH = 10 * NUDGE  # change of a derivative without a kink, by curvature
JUMP = 1e-3  # change of a derivative between the two sides, relative to the largest in its row


def moving(point: OperatingPoint, d: Derivatives, Y: Matrix) -> None:
    """Raise `LinearizationError`, naming the largest residual, unless the operating point is an equilibrium."""
    miss = np.abs(d.currents - (Y @ point.s[point.layout.voltages]).view(complex))
    k, bus = int(np.abs(d.rates).argmax()), int(miss.argmax())
    if not abs(d.rates[k]) < STILL:
        raise LinearizationError(
            f"The operating point of {point.case.name} is not an equilibrium: {point.layout.states[k].label} changes "
            f"at {d.rates[k]:.3g} per second, faster than any other state; use the result of initialize()."
        )
    if not miss[bus] < STILL * 100 / point.case.base_mva:
        raise LinearizationError(
            f"The operating point of {point.case.name} is not an equilibrium: the current mismatch at bus "
            f"{point.case.buses[bus].bus} is {miss[bus]:.3g} pu; use the result of initialize()."
        )


def limited(point: OperatingPoint) -> None:
    """Raise `LinearizationError`, naming the limit, if a device is exactly at a limit: the derivative jumps there."""
    for device, (f, j) in zip(point.case.storage, storage.members(point.system, point.case), strict=True):
        par = f.device.Par(*f.k[j])
        if not par.floor < par.stored < par.capacity:
            what = "full" if par.stored >= par.capacity else "empty"
            raise LinearizationError(
                f"The storage device {naming.device(point.case, device.machine, device.bus)} of {point.case.name} is "
                f"{what}, so its power has no derivative; set its initial charge between 0 and 1."
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
                f"machine {point.case.machines[unit].called} at bus {point.case.machines[unit].bus}"
                if unit >= 0
                else f.keys[j]
            )
            at = f"{parameter} = {limit:g}{family.suffix(f.device.Par, parameter)}"
            raise LinearizationError(
                f"{f.device.name} of {where} is exactly at its limit {at}, where its derivative is discontinuous; "
                f"{widen(point.case, name, unit, parameter)}, or choose another operating point."
            )
    raise LinearizationError(
        f"The equations at {_where(point, rows[0])} are not differentiable at the operating point of "
        f"{point.case.name}; choose another operating point. A signal is exactly at a level in its data, a deadband of "
        "no width with two slopes (Ddn and Dup) bends there, or a converter that can only deliver power has none: "
        "give it some."
    )


def energies(point: OperatingPoint, signals: Iterable[Signal]) -> set[int]:
    """Places of the energies of storage devices that outputs read.

    Raises `LinearizationError` if a device has losses: its energy then falls faster than it rises.
    """
    found = set()
    for signal in signals:
        if signal.kind in ("energy", "charge"):
            found.add(outputs.place(point, signal._replace(kind="energy")))
        elif signal.kind == "state":
            found.add(outputs.state(point, signal))
    energy = {k for k in found if storage.is_energy(point.layout.states[k].table, point.layout.states[k].name)}
    devices = storage.places(point.system, point.case).energy.tolist()
    for k in energy:
        device = point.case.storage[devices.index(k)]
        if device.efficiency < 1:
            raise LinearizationError(
                f"The storage device {naming.device(point.case, device.machine, device.bus)} of {point.case.name} has "
                "losses, so its energy has no derivative at rest; set its efficiency to 1, or read its power: absorbed."
            )
    return energy


def _jumps(point: OperatingPoint, changed: tuple[str, np.ndarray] | None) -> np.ndarray:
    """Rows of [rates | outputs | currents] whose derivatives differ between the two sides of the operating point.

    The two sides are reached by a small perturbation of every signal; `changed` gives other parameters to one family.
    """
    equations, lay = point.equations, point.layout
    k = None
    if changed is not None:
        k = np.concatenate([(changed[1] if f.name == changed[0] else f.k).ravel() for f in equations.families])
    lim = point.system.limits if changed is None else limits(_replaced(point, changed), lay.one)
    step = nudges(point, k, lim)
    rows, sides = equations.pattern.total, []
    for s in (point.s + step, point.s - step):
        slopes, values = equations.entries(s, k)
        held = np.zeros(rows, bool)
        held[: lay.nx] = equations.held(s, values[: lay.nx], lim)
        sides.append(np.where(held[equations.rows], 0.0, slopes))
    scale, jump = np.zeros((2, rows))
    np.maximum.at(scale, equations.rows, np.maximum(np.abs(sides[0]), np.abs(sides[1])))
    np.maximum.at(jump, equations.rows, np.abs(sides[0] - sides[1]))
    jump[[i for i, p in enumerate(lay.states) if storage.is_energy(p.table, p.name)]] = 0.0
    return np.flatnonzero(jump > JUMP * scale + SMOOTH)


def nudges(point: OperatingPoint, k: np.ndarray | None = None, lim: Limits | None = None) -> np.ndarray:
    """A small perturbation of all signals (layout.size) but those that no small disturbance moves; outputs follow."""
    step = np.zeros(point.layout.size)
    step[: point.layout.step] = _nudges(point.layout.step)
    step[kept(point, k, lim)] = 0.0
    return step


@lru_cache
def _nudges(count: int) -> np.ndarray:
    """A small perturbation of each of some signals, upwards or downwards."""
    return NUDGE * np.random.default_rng(0).choice([-1, 1], count) * np.linspace(0.5, 1, count)


def kept(point: OperatingPoint, k: np.ndarray | None = None, lim: Limits | None = None) -> np.ndarray:
    """Places of the states that no small disturbance moves: their non-windup limits are equal, or they would return.

    So rests the integral of a controller that acts beyond a limit only. A rate that no perturbation reverses exceeds
    the largest derivative of its equation times the perturbation.
    """
    lim = lim or point.system.limits
    s, per = point.s.copy(), point.s[lim.scale]
    low, high = lim.low * per, lim.high * per
    s[lim.state] = np.clip(s[lim.state], low + NUDGE, high - NUDGE)
    slopes, values = point.equations.entries(s, k)
    slope = np.zeros(point.equations.pattern.total)
    np.maximum.at(slope, point.equations.rows, np.abs(slopes))
    rate, least, x = values[lim.state], SMOOTH * slope[lim.state], point.s[lim.state]
    return lim.state[(low >= high) | ((x >= high) & (rate > least)) | ((x <= low) & (rate < -least))]


def _replaced(point: OperatingPoint, changed: tuple[str, np.ndarray]) -> list[Family]:
    return [f._replace(k=changed[1]) if f.name == changed[0] else f for f in point.system.families]


def _unit(point: OperatingPoint, row: int) -> int:
    """Row of the unit whose state, output or current a row belongs to; -1 if it belongs to no unit."""
    lay = point.layout
    if row < lay.nx:
        return lay.states[row].unit
    if row < lay.nx + lay.outputs:
        return int(lay.owner[lay.first_output + row - lay.nx])
    return -1


def _where(point: OperatingPoint, row: int) -> str:
    unit, lay = _unit(point, row), point.layout
    if unit >= 0:
        state = f", {lay.states[row].label}," if row < lay.nx else ""
        return f"machine {point.case.machines[unit].called}{state}"
    at = (row - lay.nx - lay.outputs) // 2
    bus = point.equations.injecting[at] if row >= lay.nx + lay.outputs else 0
    return f"bus {point.case.buses[(bus - lay.nx) // 2].bus}"


def _limits(point: OperatingPoint, unit: int) -> list[tuple[str, int, int]]:
    """Table, row and column of every limit of a unit's devices."""
    return [
        (f.name, int(j), c)
        for f in point.system.families
        for j in np.flatnonzero(f.w[:, family.UNIT] == unit)
        for c, _, _ in family.given_limits(f.device)
    ]

"""Families: the devices of one model in a system as flat tables of places and parameters, their operations and limits.

A family is evaluated by one compiled loop, `family(op, n, w, k, s, f, on)`; see `_codegen`.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.schema import fields
from stabctl.devices.device import Device

SOURCE, CURRENT, OUTPUT, RATES, BOTH, STEP, LOCAL, FRAME = range(8)  # operations
STATE, BUS, BUS2, UNIT, INPUTS = range(5)  # columns of w; inputs follow, and the first output
EQUATIONS = {SOURCE: "source", CURRENT: "current", OUTPUT: "output", RATES: "derivatives"}
TINY = 1e-30  # complex step


class Family(NamedTuple):
    """The devices of one model in a system."""

    name: str
    device: Device
    w: np.ndarray  # (devices, width) i64   places of the columns above
    k: np.ndarray  # (devices, constants)
    keys: tuple[Any, ...]  # name of each, such as "machine 3", or its circuit


def width(device: Device) -> int:
    """Columns of w."""
    return INPUTS + len(device.Input._fields) + 1


def stride(device: Device) -> int:
    """Places of one device among the outputs: Output, then Internal."""
    return len(device.Output._fields) + len(device.Internal._fields)


def size(f: Family) -> tuple[int, int, int, int]:
    """Numbers of states, inputs and outputs of each device of a family, and of its buses.

    A device without the records State, Input and Output tells the numbers itself, from the constants.
    """
    return f.device.sizes(f.k[0]) if f.device.sizes is not None else shape(f.device)


@cache
def shape(device: Device) -> tuple[int, int, int, int]:
    """Numbers of states, inputs and outputs of a device, and of its buses."""
    names = {a for equation in ("current", "equations", "output", "derivatives") for a in device.arguments(equation)}
    buses = 2 if "v2" in names else 1 if device.injects or "v" in names else 0
    states, inputs, outputs = (len(device.fields(record)) for record in ("State", "Input", "Output"))
    return states, inputs, outputs, buses


def operations(f: Family) -> dict[int, tuple[str, ...]]:
    """Operations of the devices of a family in a simulation, each with its equations."""
    return f.device.operations(f.k[0]) if f.device.operations is not None else equations(f.device)


@cache
def equations(device: Device) -> dict[int, tuple[str, ...]]:
    """Operations of the device in a simulation, each with its equations."""
    if device.step is not None:
        return {STEP: ("step",)}
    found: dict[int, tuple[str, ...]] = {op: (name,) for op, name in EQUATIONS.items() if device.has(name)}
    if device.internal is not None:
        found.setdefault(SOURCE, ())  # computed there once, before the voltages are iterated
    if fused(device):
        found.pop(OUTPUT, None), found.pop(RATES, None)
        found[BOTH] = both(device)
    return found


@cache
def fused(device: Device) -> bool:
    """Whether the output is computed together with the derivatives, because it needs all inputs."""
    return device.has("equations") or (device.has("derivatives") and "u" in device.arguments("output"))


def both(device: Device) -> tuple[str, ...]:
    """Equations that give the outputs and the derivatives of a fused device."""
    return ("equations",) if device.has("equations") else ("output", "derivatives")


def read(f: Family, op: int, rows: Sequence[int]) -> np.ndarray:
    """Places that an operation of these devices reads."""
    if f.device.read is not None:
        return np.concatenate([f.device.read(op, f.w[row], f.k[row]) for row in rows])
    names = [name for equation in equations(f.device)[op] for name in reads(f.device, equation)]
    at = [INPUTS + f.device.Input._fields.index(name) for name in dict.fromkeys(names)]
    return f.w[np.ix_(list(rows), at)].ravel()


@cache
def reads(device: Device, equation: str) -> tuple[str, ...]:
    """Inputs that an equation of the device reads."""
    names = device.arguments(equation)
    return device.Input._fields if "u" in names else tuple(n for n in device.Input._fields if n in names)


def side(device: Device, name: str) -> int:
    """1 for an upper limit (...max, or in UPPER) and a parameter in LEVELS, -1 for a lower limit (...min), else 0."""
    if name.endswith("max") or name in (*device.upper, *device.levels):
        return 1
    return -1 if name.endswith("min") else 0


@cache
def given_limits(device: Device) -> tuple[tuple[int, str, int], ...]:
    """Column, name and `side` of the limits that a table gives, without those computed from other parameters."""
    sides = ((c, name, side(device, name)) for c, name in enumerate(device.Par._fields) if name in fields(device.Par))
    return tuple(one for one in sides if one[2])


def suffix(record: type, name: str) -> str:
    """The unit of a field after a space; empty if it has none."""
    unit = fields(record)[name].unit
    return "" if unit == "-" else f" {unit}"


class Limits(NamedTuple):
    """States with non-windup limits: low * scale <= state <= high * scale."""

    state: np.ndarray  # places
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray  # places of the signals that multiply the limits; the constant 1 if there is none
    names: tuple[tuple[str | float, str | float], ...]  # parameters (low, high), or numbers
    stops: np.ndarray  # which of them stop their device at once, so that its power jumps


def limits(families: Iterable[Family], one: int) -> Limits:
    """The states that models list in LIMITS, with those also in STOPS; `one` is the place of the constant 1."""
    state, scale, stops = [], [], []
    low: list[np.ndarray] = []
    high: list[np.ndarray] = []
    names: list[tuple[str | float, str | float]] = []
    for f in families:
        constants, states = f.device.Par._fields, f.device.State._fields
        inputs = f.device.Input._fields
        for name, (least, most, *per) in f.device.limits.items():
            state.append(f.w[:, STATE] + states.index(name))
            for values, limit in ((low, least), (high, most)):
                values.append(np.full(len(f.w), limit) if isinstance(limit, float) else f.k[:, constants.index(limit)])
            scale.append(f.w[:, INPUTS + inputs.index(per[0])] if per else np.full(len(f.w), one))
            stops.append(np.full(len(f.w), name in f.device.stops))
            names += [(least, most)] * len(f.w)
    none = np.zeros(0, np.int64)
    if not state:
        return Limits(none, np.zeros(0), np.zeros(0), none, (), none)
    places, lows, highs, scales = (np.concatenate(column) for column in (state, low, high, scale))
    return Limits(places, lows, highs, scales, tuple(names), np.flatnonzero(np.concatenate(stops)))

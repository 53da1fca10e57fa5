"""The devices of one model: inputs and outputs of their equations, and the columns of their table of places.

A family is evaluated by one compiled loop, `family(op, n, w, k, s, f, on)`; see `loop_text`.
"""

import inspect
from collections.abc import Sequence
from functools import cache
from types import ModuleType

import numpy as np

from .tables import Family

SOURCE, CURRENT, OUTPUT, RATES, BOTH, STEP, LOCAL, FRAME = range(8)
STATE, BUS, BUS2, UNIT, INPUTS = range(5)  # columns of w; inputs follow, and the first output
EQUATIONS: dict[int, tuple[str, ...]] = {
    SOURCE: ("source",),
    CURRENT: ("current",),
    OUTPUT: ("output",),
    RATES: ("derivatives",),
}
TINY = 1e-30


@cache
def fields(device: ModuleType, record: str) -> tuple[str, ...]:
    """Field names of a record of the device; empty if it has no such record."""
    return getattr(getattr(device, record, None), "_fields", ())


@cache
def arguments(device: ModuleType, equation: str) -> tuple[str, ...]:
    """Argument names of an equation of the device; empty if it has no such equation."""
    return tuple(inspect.signature(getattr(device, equation)).parameters) if hasattr(device, equation) else ()


@cache
def reads(device: ModuleType, equation: str) -> tuple[str, ...]:
    """Inputs that an equation of the device reads."""
    names = arguments(device, equation)
    return fields(device, "Input") if "u" in names else tuple(n for n in fields(device, "Input") if n in names)


@cache
def fused(device: ModuleType) -> bool:
    """Whether the output is computed together with the derivatives, because it needs all inputs."""
    return hasattr(device, "derivatives") and "u" in arguments(device, "output")


@cache
def equations(device: ModuleType) -> dict[int, tuple[str, ...]]:
    """Operations of the device in a simulation, each with its equations."""
    if hasattr(device, "step"):
        return {STEP: ("step",)}
    found = {op: names for op, names in EQUATIONS.items() if hasattr(device, names[0])}
    if hasattr(device, "internal"):
        found.setdefault(SOURCE, ())  # computed there once, before the voltages are iterated
    if fused(device):
        del found[OUTPUT], found[RATES]
        found[BOTH] = ("output", "derivatives")
    return found


def side(device: ModuleType, name: str) -> int:
    """1 for a parameter that is an upper limit (...max, or listed in UPPER), -1 for a lower limit (...min), else 0."""
    if name.endswith("max") or name in getattr(device, "UPPER", ()):
        return 1
    return -1 if name.endswith("min") else 0


def width(device: ModuleType) -> int:
    """Columns of w."""
    return INPUTS + len(fields(device, "Input")) + 1


def stride(device: ModuleType) -> int:
    """Places of one device among the outputs: Output, then Internal."""
    return len(fields(device, "Output")) + len(fields(device, "Internal"))


@cache
def shape(device: ModuleType) -> tuple[int, int, int, int]:
    """Numbers of states, inputs and outputs of a device, and of its buses."""
    names = {a for equation in ("current", "output", "derivatives") for a in arguments(device, equation)}
    injects = hasattr(device, "source") or hasattr(device, "current")
    buses = 2 if "v2" in names else 1 if injects or "v" in names else 0
    states, inputs, outputs = (len(fields(device, record)) for record in ("State", "Input", "Output"))
    return states, inputs, outputs, buses


def size(f: Family) -> tuple[int, int, int, int]:
    """Numbers of states, inputs and outputs of each device of a family, and of its buses.

    A device without the records State, Input and Output tells the numbers itself, from the constants.
    """
    return f.device.sizes(f.k[0]) if hasattr(f.device, "sizes") else shape(f.device)


def operations(f: Family) -> dict[int, tuple[str, ...]]:
    """Operations of the devices of a family in a simulation, each with its equations."""
    return f.device.operations(f.k[0]) if hasattr(f.device, "operations") else equations(f.device)


def read(f: Family, op: int, rows: Sequence[int]) -> np.ndarray:
    """Places that an operation of these devices reads."""
    if hasattr(f.device, "read"):
        return np.concatenate([f.device.read(op, f.w[row], f.k[row]) for row in rows])
    names = [name for equation in equations(f.device)[op] for name in reads(f.device, equation)]
    at = [INPUTS + fields(f.device, "Input").index(name) for name in dict.fromkeys(names)]
    return f.w[np.ix_(list(rows), at)].ravel()

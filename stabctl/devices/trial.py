"""Trial run of a user's device in plain Python when it is registered, so that errors are reported with their line."""

import inspect
import numbers
import traceback
from collections.abc import Iterable
from contextlib import suppress
from itertools import islice
from types import ModuleType
from typing import Any

import numpy as np

from stabctl._util.schema import fields, hints

from .device import AT_BUS, RECORDS, Device, Empty

_GIVES = {  # equation -> the records that it returns
    "internal": ("Internal",),
    "equations": ("Output", "State"),
    "output": ("Output",),
    "derivatives": ("State",),
    "source": (),
    "current": (),
    "step": ("State", "Output"),
}
_ROLE_GIVES = {"exciter": "Efd", "governor": "Pm"}  # what machines read; a stabilizer may drive any port
_READ = {"x": "State", "u": "Input", "i": "Internal", "y": "Output", "p": "Par"}
POINTS = 4  # at which derivatives are compared
_NOT_ANALYTIC = {"abs", "min", "max", "sign", "conj", "conjugate", "fabs", "maximum", "minimum", "absolute"}


def unreadable(module: ModuleType) -> str | None:
    """What is wrong with the records of a device file, without a final period; None if nothing is."""
    try:
        for name in RECORDS:
            hints(vars(module).get(name, Empty))
    except (TypeError, AttributeError, NameError, ValueError) as error:
        return f"{error}; write every field as name: Annotated[float, unit, meaning]"
    return None


def mistake(device: Device) -> str | None:
    """What is wrong with the equations of a device, without a final period; None if nothing is."""
    if (output := _ROLE_GIVES.get(device.role)) and output not in device.fields("Output"):
        return (
            f"the role {device.role} gives {output}, but Output has no such field; without it the device has no effect"
        )
    if (key := "bus" if device.role in AT_BUS else "machine") in fields(device.Par):
        return f"{key} is the column that says what a row belongs to; give this field of Par another name"
    return _forbidden(device) or _fails(device) or _unmarked(device) or _lost(device)


def _unmarked(device: Device) -> str | None:
    """An equation, or a function used in one, that is not marked to be compiled."""
    own = {f.__name__: f for _, f in inspect.getmembers(device.module, inspect.isfunction)}
    own = {name: f for name, f in own.items() if f.__module__ == device.module.__name__}
    used = {name for f in own.values() if "inlined" in vars(f) for name in f.__code__.co_names}
    bare = [name for name in own if name in {*_GIVES, *used} and "inlined" not in vars(own[name])]
    return f"{bare[0]} is not compiled; write @inline, from stabctl._util.jit, in the line above it" if bare else None


def _forbidden(device: Device) -> str | None:
    """A function used in an equation that complex-step differentiation does not allow."""
    if device.step is not None:
        return None  # never differentiated
    for name, function in inspect.getmembers(device.module, inspect.isfunction):
        used = sorted(_NOT_ANALYTIC.intersection(function.__code__.co_names))
        if function.__module__ == device.module.__name__ and "inlined" in vars(function) and used:
            return f"{name} uses {used[0]}, which cannot be differentiated; use a block of stabctl.devices.blocks"
    return None


def _fails(device: Device) -> str | None:
    """The first equation that fails when evaluated at arbitrary numbers: complex ones, if it is differentiated."""
    number = 0.5 if device.step else 0.5 + 0j
    given = _given(device, [1.0 if name.startswith("p.") else number for name in _names(device)])
    return next(filter(None, (_tried(device, equation, given) for equation in _GIVES if device.has(equation))), None)


def _lost(device: Device) -> str | None:
    """An equation whose derivatives by complex steps are not those of its values."""
    if device.step is not None:
        return None  # never differentiated
    names = _names(device)
    points = np.random.default_rng(1).uniform(0.1, 1.1, (POINTS, len(names)))
    for equation in filter(device.has, _GIVES):
        arguments = device.arguments(equation)
        for e, name in zip(np.eye(len(names)), names, strict=True):
            record, _, field = name.replace("[", ".").partition(".")
            if record == "p" or (record not in arguments and field not in arguments):
                continue
            if sum(_differ(device, equation, z, e) for z in points) > 1:  # one may be at a jump
                return (
                    f"{equation} loses the derivative by {name}: something that it uses, perhaps from another file, "
                    "drops imaginary parts, as abs, round and .real do; use .real only in conditions, and a block of "
                    "stabctl.devices.blocks for the rest"
                )
    return None


def _differ(device: Device, equation: str, z: np.ndarray, e: np.ndarray) -> bool:
    """Whether derivatives at z in the direction e differ: by a complex step, and by central differences."""
    with np.errstate(all="ignore"), suppress(ArithmeticError, ValueError):  # the numbers are arbitrary
        above, below, aside = (
            np.hstack(device.evaluate(equation, _given(device, (z + step * e).tolist())))
            for step in (1e-4 + 0j, -1e-4 + 0j, 1e-20j)
        )
        slope = (above - below).real / 2e-4
        return bool((np.abs(aside.imag / 1e-20 - slope) > 1e-3 * (1 + np.abs(slope))).any())
    return False


def _names(device: Device) -> list[str]:
    """The numbers that equations may read, as they are written there."""
    voltages = [f"{name}[{part}]" for name in ("v", "v1", "v2") for part in (0, 1)]
    return voltages + [f"{name}.{field}" for name, record in _READ.items() for field in device.fields(record)]


def _given(device: Device, values: Iterable[Any]) -> dict[str, Any]:
    """Arguments of the equations, from values in the order of `_names`; parameters keep a default other than 0.0."""
    rest = iter(values)
    given: dict[str, Any] = {name: (next(rest), next(rest)) for name in ("v", "v1", "v2")}
    for name, record in _READ.items():
        given[name] = vars(device)[record](*islice(rest, len(device.fields(record))))
    par = {name: value.real for name, value in given["p"]._asdict().items()}
    for name, f in hints(device.Par).items():
        if f and (f.kind is not float or f.default not in (NotImplemented, 0.0)):
            par[name] = 1 if f.required else f.default
    return given | given["u"]._asdict() | {"p": device.Par(**par)}


def _tried(device: Device, equation: str, given: dict[str, Any]) -> str | None:
    """What is wrong with one equation."""
    try:
        with np.errstate(all="ignore"):
            result = device.evaluate(equation, given)
    except (AttributeError, TypeError, NameError, IndexError) as error:
        lines = [at.lineno for at in traceback.extract_tb(error.__traceback__) if at.filename == device.file]
        return f"line {lines[-1]}, {equation}: {error}"
    except (ArithmeticError, ValueError):  # the numbers are arbitrary
        return None
    kinds: list[Any] = [vars(device)[name] for name in _GIVES[equation]] or [tuple]
    if equation == "step":
        kinds = [kind for kind in kinds if kind._fields]  # laws without memory have no State
    parts = result if len(kinds) > 1 and type(result) is tuple else (result,)
    if len(parts) != len(kinds) or not all(map(isinstance, parts, kinds)):
        wanted = ", ".join(kind.__name__ for kind in kinds)
        return f"{equation} returns {', '.join(type(part).__name__ for part in parts)} instead of {wanted}"
    wrong = [v for part in parts for v in part if not isinstance(v, numbers.Number)]
    return f"{equation} returns {type(wrong[0]).__name__} instead of a number" if wrong else None

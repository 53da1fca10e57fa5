"""Trial run of a user's device in plain Python when it is registered, so that errors are reported with their line."""

import inspect
import numbers
import traceback
from types import ModuleType
from typing import Any

import numpy as np

from stabctl._util.schema import hints

from .device import RECORDS, Device, Empty

_GIVES = {  # equation -> the records that it returns
    "internal": ("Internal",),
    "equations": ("Output", "State"),
    "output": ("Output",),
    "derivatives": ("State",),
    "source": (),
    "current": (),
}
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
    return _forbidden(device) or _fails(device) or _unmarked(device)


def _unmarked(device: Device) -> str | None:
    """An equation, or a function used in one, that is not marked to be compiled."""
    own = {f.__name__: f for _, f in inspect.getmembers(device.module, inspect.isfunction)}
    own = {name: f for name, f in own.items() if f.__module__ == device.module.__name__}
    used = {name for f in own.values() if "inlined" in vars(f) for name in f.__code__.co_names}
    bare = [name for name in own if name in {*_GIVES, "step", *used} and "inlined" not in vars(own[name])]
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
    """The first equation that fails when evaluated at arbitrary complex numbers."""
    given: dict[str, Any] = {"v": (1 + 0j, 0.1 + 0j), "v1": (1 + 0j, 0.1 + 0j), "v2": (1 + 0j, 0.2 + 0j)}
    for name, record in (("p", "Par"), ("x", "State"), ("u", "Input"), ("y", "Output")):
        made = vars(device)[record]
        given[name] = made(**{k: _value(f, name) for k, f in hints(made).items()})
    given |= given["u"]._asdict()
    given["i"] = device.Internal(*[0.5 + 0j for _ in device.Internal._fields])
    for equation in _GIVES:
        if device.has(equation) and device.step is None:
            wrong = _tried(device, equation, given)
            if wrong:
                return wrong
    return None


def _value(f: Any, kind: str) -> Any:
    if kind != "p":
        return 0.5 + 0j
    return 1.0 if f is None or f.required else f.default


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
    parts = result if len(kinds) > 1 and type(result) is tuple else (result,)
    if len(parts) != len(kinds) or not all(map(isinstance, parts, kinds)):
        wanted = ", ".join(kind.__name__ for kind in kinds)
        return f"{equation} returns {', '.join(type(part).__name__ for part in parts)} instead of {wanted}"
    wrong = [v for part in parts for v in part if not isinstance(v, numbers.Number)]
    return f"{equation} returns {type(wrong[0]).__name__} instead of a number" if wrong else None

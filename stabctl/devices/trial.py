"""Trial run of a user's device in plain Python when it is registered, so that errors are reported with their line."""

import inspect
import numbers
import traceback
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from stabctl.schema import hints

_GIVES = {"internal": "Internal", "output": "Output", "derivatives": "State", "source": None, "current": None}
_NOT_ANALYTIC = {"abs", "min", "max", "sign", "conj", "conjugate", "fabs", "maximum", "minimum", "absolute"}


def mistake(device: ModuleType) -> str | None:
    """What is wrong with a device, without a final period; None if nothing is."""
    try:
        records = {
            name: hints(getattr(device, name)) for name in ("Par", "State", "Input", "Output") if hasattr(device, name)
        }
    except (TypeError, AttributeError, NameError, ValueError) as error:
        return f"{error}; write every field as name: Annotated[float, unit, meaning]"
    return _lacks(device) or _limits(device, records) or _forbidden(device) or _fails(device, records)


def _lacks(device: ModuleType) -> str | None:
    """An equation that is missing for a record, or the other way around."""
    if hasattr(device, "step") or hasattr(device, "family"):
        return None
    for record, equation in (("State", "derivatives"), ("Output", "output")):
        if hasattr(device, record) != hasattr(device, equation):
            there, missing = (record, equation) if hasattr(device, record) else (equation, record)
            return f"it defines {there} but not {missing}"
    return None


def _limits(device: ModuleType, records: dict[str, Any]) -> str | None:
    """A name in LIMITS that is not a field of State or Par."""
    for state, (low, high, *_) in getattr(device, "LIMITS", {}).items():
        for name, record in ((state, "State"), (low, "Par"), (high, "Par")):
            if not isinstance(name, float) and name not in records.get(record, ()):
                return f"LIMITS contains {name!r}, which is not a field of {record}"
    return None


def _forbidden(device: ModuleType) -> str | None:
    """A function used in an equation that complex-step differentiation does not allow."""
    if hasattr(device, "step"):
        return None  # never differentiated
    for name, function in inspect.getmembers(device, inspect.isfunction):
        used = sorted(_NOT_ANALYTIC.intersection(function.__code__.co_names))
        if function.__module__ == device.__name__ and hasattr(function, "inlined") and used:
            return f"{name} uses {used[0]}, which cannot be differentiated; use a block of stabctl.devices.blocks"
    return None


def _fails(device: ModuleType, records: dict[str, Any]) -> str | None:
    """The first equation that fails when evaluated at arbitrary complex numbers."""
    given: dict[str, Any] = {"v": (1 + 0j, 0.1 + 0j), "v1": (1 + 0j, 0.1 + 0j), "v2": (1 + 0j, 0.2 + 0j)}
    for name, record in (("p", "Par"), ("x", "State"), ("u", "Input"), ("y", "Output")):
        if record in records:
            given[name] = getattr(device, record)(**{k: _value(f, name) for k, f in records[record].items()})
    given |= given["u"]._asdict() if "u" in given else {}
    if hasattr(device, "Internal"):
        given["i"] = device.Internal(*[0.5 + 0j for _ in device.Internal._fields])
    for equation, result in _GIVES.items():
        if hasattr(device, equation) and not hasattr(device, "step"):
            wrong = _tried(device, getattr(device, equation), given, getattr(device, result) if result else tuple)
            if wrong:
                return wrong
    return None


def _value(f: Any, kind: str) -> Any:
    if kind != "p":
        return 0.5 + 0j
    return 1.0 if f is None or f.required else f.default


def _tried(
    device: ModuleType, equation: Callable[..., Any], given: dict[str, Any], kind: type[tuple[Any, ...]]
) -> str | None:
    """What is wrong with one equation."""
    names = list(inspect.signature(equation).parameters)
    strange = [name for name in names if name not in given]
    if strange:
        return f"{equation.__name__} has an unknown argument {strange[0]!r}; it may take {', '.join(given)}"
    try:
        with np.errstate(all="ignore"):
            result = equation(*(given[name] for name in names))
    except (AttributeError, TypeError, NameError, IndexError) as error:
        lines = [at.lineno for at in traceback.extract_tb(error.__traceback__) if at.filename == device.__file__]
        return f"line {lines[-1]}, {equation.__name__}: {error}"
    except (ArithmeticError, ValueError):  # the numbers are arbitrary
        return None
    if not isinstance(result, kind):
        return f"{equation.__name__} returns {type(result).__name__} instead of {kind.__name__}"
    wrong = [v for v in result if not isinstance(v, numbers.Number)]
    return f"{equation.__name__} returns {type(wrong[0]).__name__} instead of a number" if wrong else None

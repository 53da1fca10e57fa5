"""Quantities as planners write them: `6cyc`, `0.1s`, `100ms`; `100mHz`; `5%mva`, `5%dispatch`, `50MW`."""

import math
import re
from numbers import Real

from .errors import StudyError

_QUANTITY = re.compile(r"^\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*([a-zA-Z%]*)\s*$")


def seconds(text: str | float, frequency_hz: float) -> float:
    """A duration in seconds, from text or a number of seconds; cycles are those of the case's frequency."""
    value, unit = (_finite(text), "s") if _is_number(text) else _split(text)
    unit = unit.lower()
    scale = {"cyc": 1 / frequency_hz, "cycles": 1 / frequency_hz, "s": 1.0, "ms": 1e-3}
    if math.isnan(value) or unit not in scale:
        raise StudyError(f"{text!r} is not a time; write it as 6cyc, 0.1s or 100ms.")
    return value * scale[unit]


def cycles(text: str | float, frequency_hz: float) -> float:
    """A duration in cycles of a frequency (Hz), from text or a number of seconds."""
    value, unit = (math.nan, "") if _is_number(text) else _split(text)
    exact = unit.lower() in ("cyc", "cycles") and not math.isnan(value)
    return value if exact else seconds(text, frequency_hz) * frequency_hz


def hertz(text: str | float) -> float:
    """A frequency in Hz, from text (100mHz, 0.1Hz) or a number of Hz."""
    if _is_number(text):
        return float(text)
    value, unit = _split(text)
    scale = {"hz": 1.0, "mhz": 1e-3}  # no one means megahertz here
    if math.isnan(value) or unit.lower() not in scale:
        raise StudyError(f"{text!r} is not a frequency; write it as 100mHz or 0.1Hz.")
    return value * scale[unit.lower()]


def size(text: str) -> tuple[float, str]:
    """A storage size: its number and what it is of, "mw", "%mva" or "%dispatch"."""
    value, unit = _split(text)
    if math.isnan(value) or unit.lower() not in ("mw", "%mva", "%dispatch"):
        raise StudyError(f"{text!r} is not a storage size; write it as 50MW, 5%mva or 5%dispatch.")
    return value, unit.lower()


def _split(text: str) -> tuple[float, str]:
    match = _QUANTITY.match(str(text))
    try:
        value = float(match[1]) if match else math.nan
    except ValueError:
        value = math.nan
    return _finite(value), match[2] if match else ""


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _finite(value: float) -> float:
    """The value, or NaN where it is infinite."""
    return float(value) if math.isfinite(value) else math.nan

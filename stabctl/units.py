"""Quantities as text with a unit, or as plain numbers.

    times 6cyc 0.1s 100ms · frequencies 0.5Hz 100mHz · powers 50MW 0.2GW 300kW 5%mva 5%dispatch · energies 10MWh 500kWh
    angles 120deg 3.5rad · bands 0.1..2Hz

A plain number is in seconds, Hz, MW, MWh or radians. Text needs its unit (is "6" in cycles or seconds?); only
`quantity`, which is told the unit, takes text without one. A library of units (pint) costs 0.4 s to import and knows
neither cycles nor shares of a machine's rating.
"""

import math
import re
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import NamedTuple

from .errors import StudyError, shown

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*([a-zA-Z/%]*)\s*")

# How many of each unit make the first one.
_FAMILIES: tuple[dict[str, float], ...] = (
    {"s": 1, "ms": 1e3, "us": 1e6, "min": 1 / 60, "h": 1 / 3600},
    {"Hz": 1, "mHz": 1e3},
    {"MW": 1, "kW": 1e3, "GW": 1e-3},
    {"Mvar": 1, "MVAr": 1, "MVAR": 1, "kvar": 1e3, "Gvar": 1e-3},
    {"MVA": 1, "kVA": 1e3, "GVA": 1e-3},
    {"MWh": 1, "kWh": 1e3, "GWh": 1e-3},
    {"MW/s": 1, "kW/s": 1e3, "MW/min": 60, "GW/s": 1e-3},
    {"kV": 1, "V": 1e3},
    {"rad": 1, "mrad": 1e3, "deg": 180 / math.pi},
    {"-": 1, "%": 100},
)
_CYCLES = ("cyc", "cycles")
_TIME = ("time", "6cyc, 0.1s or 100ms")


class Rating(NamedTuple):
    """A size of a storage device: a value in MW, or in percent of a machine's MVA or dispatch."""

    value: float
    unit: str  # "MW", "%mva" or "%dispatch"


def seconds(x: str | float, frequency_hz: float) -> float:
    """A time in seconds.

    Parameters
    ----------
    x : str or float
        "6cyc", "0.1s", "100ms", or a number of seconds.
    frequency_hz : float
        Frequency of the case, whose cycles are meant.

    Raises
    ------
    StudyError
        If it is not a time, or text with a sign.
    """
    if isinstance(x, str) and x.strip()[:1] in ("+", "-"):
        raise _not(x, *_TIME)
    return _read(x, _FAMILIES[0] | dict.fromkeys(_CYCLES, frequency_hz), "s", _TIME)


def cycles(x: str | float, frequency_hz: float) -> float:
    """A time in cycles of the case's frequency: as `seconds`, with whole cycles exact. Raises `StudyError`."""
    value, unit = _split(x, "s", _TIME)
    return value if unit.lower() in _CYCLES and value >= 0 else seconds(x, frequency_hz) * frequency_hz


def hertz(x: str | float) -> float:
    """A frequency in Hz: "0.5Hz", "100mHz", or a number of Hz. Raises `StudyError` where it is none."""
    return _read(x, _FAMILIES[1], "Hz", ("frequency", "0.5Hz or 100mHz"))


def megawatts(x: str | float) -> float:
    """A power in MW: "50MW", "0.2GW", "300kW", or a number of MW. Raises `StudyError` where it is none."""
    return _read(x, _FAMILIES[2], "MW", ("power", "50MW, 0.2GW or 300kW"))


def megavars(x: str | float) -> float:
    """A reactive power in Mvar: "20Mvar", "300kvar", or a number of Mvar. Raises `StudyError` where it is none."""
    return _read(x, _FAMILIES[3], "Mvar", ("reactive power", "20Mvar or 300kvar"))


def megawatt_hours(x: str | float) -> float:
    """An energy in MWh: "10MWh", "500kWh", or a number of MWh. Raises `StudyError` where it is none."""
    return _read(x, _FAMILIES[5], "MWh", ("energy", "10MWh or 500kWh"))


def radians(x: str | float) -> float:
    """An angle in radians: "120deg", "3.5rad", or a number of radians. Raises `StudyError` where it is none."""
    return _read(x, _FAMILIES[8], "rad", ("angle", "120deg or 3.5rad"))


def rating(x: str | float) -> Rating:
    """A storage size: "50MW", "5%mva", "5%dispatch", or a number of MW. Raises `StudyError` where it is none."""
    what = ("storage size", "50MW, 5%mva or 5%dispatch")
    value, unit = _split(x, "MW", what)
    share = unit.lower() if unit.lower() in ("%mva", "%dispatch") else ""
    value = value if share else _read(x, _FAMILIES[2], "MW", what)
    if value < 0:
        raise _not(x, *what)
    return Rating(value, share or "MW")


def band(x: str | Sequence[str | float]) -> tuple[float, float]:
    """A band of frequencies, its lower and upper end in Hz.

    Parameters
    ----------
    x : str or two values
        "0.1..2Hz", "100mHz..2Hz", or a pair of values as `hertz` takes them.

    Raises
    ------
    StudyError
        If it is not a band, or does not rise from at least 0.
    """
    what = ("band of frequencies", "0.1..2Hz, or as two numbers in Hz")
    ends = x.split("..") if isinstance(x, str) else list(x) if isinstance(x, Sequence) else []
    if len(ends) != 2:
        raise _not(x, *what)
    if isinstance(x, str) and re.fullmatch(rf"\s*{_NUMBER}\s*", ends[0]):
        ends[0] += _split(ends[1], "Hz", what)[1]
    low, high = map(hertz, ends)
    if not 0 <= low < high:
        raise StudyError(f"The band from {low:g} to {high:g} Hz is empty or negative; give the lower frequency first.")
    return low, high


def quantity(x: str | float, unit: str, *, bare: bool = True) -> float:
    """A value in a given unit, such as that of a table's column.

    Parameters
    ----------
    x : str or float
        A number in that unit, or text with any unit of the same kind.
    unit : str
        Unit of the result.
    bare : bool
        Text without a unit is in `unit` too.

    Raises
    ------
    StudyError
        If it is not a number, or one of another kind.
    """
    family = next((f for f in _FAMILIES if unit in f), {unit: 1})
    units = " or ".join(u for u in family if u != "-")
    what = ("number" if unit == "-" else f"number in {unit}", f"5, or with a unit ({units})" if units else "5")
    value, given = _split(x, unit, what)
    return _read(value if bare and not given else x, family, unit, what)


def _read(x: object, family: Mapping[str, float], unit: str, what: tuple[str, str]) -> float:
    """The value in `unit`; `what` says what it should be and how it is written."""
    value, given = _split(x, unit, what)
    known = next((u for u in family if given == u or given.lower() in (u, u.lower() if given.islower() else u)), None)
    if known is None:
        raise _not(x, *what)
    return value * family[unit] / family[known]


def _split(x: object, unit: str, what: tuple[str, str]) -> tuple[float, str]:
    """Number and unit of a text; a number has the unit given."""
    if isinstance(x, Real) and not isinstance(x, bool):
        value, found = x, unit
    elif isinstance(x, str) and (match := _QUANTITY.fullmatch(x)):
        value, found = match[1], match[2]
    else:
        raise _not(x, *what)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise _not(x, *what)
    return number, found


def _not(x: object, noun: str, examples: str) -> StudyError:
    article = "an" if noun[0] in "aeiou" else "a"
    return StudyError(f"{shown(x, 60)} is not {article} {noun}; write it as {examples}.")

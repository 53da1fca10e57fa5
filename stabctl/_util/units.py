"""Quantities as text with a unit, or as plain numbers.

    times 6cyc 0.1s 100ms · frequencies 0.5Hz 100mHz · powers 50MW 0.2GW 300kW 5%mva 5%dispatch · energies 10MWh 500kWh
    angles 120deg 3.5rad · bands 0.1..2Hz

A plain number is in seconds, Hz, MW, MWh or radians. Text needs a unit ("6" could be cycles or seconds); only
`quantity`, whose unit is known, accepts text without one. A unit library (pint) would take 0.4 s to import and knows
neither cycles nor percentages of a machine's rating.
"""

import math
import re
from collections.abc import Sequence
from numbers import Real
from typing import NamedTuple

from .errors import StudyError, shown

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*([a-zA-Z/%]*)\s*")


class Kind(NamedTuple):
    """A kind of quantity: its noun, how it is written, and how many of each unit make one of the first."""

    noun: str
    examples: str
    per: dict[str, float]


TIME = Kind("time", "0.1s or 100ms", {"s": 1, "ms": 1e3, "us": 1e6, "min": 1 / 60, "h": 1 / 3600})
FREQUENCY = Kind("frequency", "0.5Hz or 100mHz", {"Hz": 1, "mHz": 1e3})
POWER = Kind("power", "50MW, 0.2GW or 300kW", {"MW": 1, "kW": 1e3, "GW": 1e-3})
REACTIVE = Kind("reactive power", "20Mvar or 300kvar", {"Mvar": 1, "MVAr": 1, "MVAR": 1, "kvar": 1e3, "Gvar": 1e-3})
APPARENT = Kind("apparent power", "900MVA or 1.2GVA", {"MVA": 1, "kVA": 1e3, "GVA": 1e-3})
ENERGY = Kind("energy", "10MWh or 500kWh", {"MWh": 1, "kWh": 1e3, "GWh": 1e-3})
RAMP = Kind("ramp rate", "5MW/s or 60MW/min", {"MW/s": 1, "kW/s": 1e3, "MW/min": 60, "GW/s": 1e-3})
VOLTAGE = Kind("voltage", "230kV", {"kV": 1, "V": 1e3})
ANGLE = Kind("angle", "120deg or 3.5rad", {"rad": 1, "mrad": 1e3, "deg": 180 / math.pi})
CHANGE = Kind("rate of frequency", "2Hz/s or 500mHz/s", {"Hz/s": 1, "mHz/s": 1e3})
NUMBER = Kind("number", "0.05 or 5%", {"-": 1, "%": 100})
KINDS = (TIME, FREQUENCY, POWER, REACTIVE, APPARENT, ENERGY, RAMP, VOLTAGE, ANGLE, CHANGE, NUMBER)
LOWEST, HIGHEST = 1e-6, 1e6  # Hz   of a band
_CYCLES = ("cyc", "cycles")
_SIZE = ("storage size", "50MW, 5%mva or 5%dispatch")
_BAND = ("band of frequencies", "0.1..2Hz, or as two numbers in Hz")


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
        Frequency of the case, which defines a cycle.

    Raises
    ------
    StudyError
        If it is not a time, or text with a sign.
    """
    with_cycles = Kind(TIME.noun, f"6cyc, {TIME.examples}", TIME.per | dict.fromkeys(_CYCLES, frequency_hz))
    if isinstance(x, str) and x.strip()[:1] in ("+", "-"):
        raise _not(x, with_cycles.noun, with_cycles.examples)
    return _read(x, with_cycles, "s")


def cycles(x: str | float, frequency_hz: float) -> float:
    """A time in cycles of the case's frequency: as `seconds`, with whole cycles exact. Raises `StudyError`."""
    in_seconds = seconds(x, frequency_hz)
    value, unit = _split(x, "s", TIME)
    return value if unit.lower() in _CYCLES else in_seconds * frequency_hz


def hertz(x: str | float) -> float:
    """A frequency in Hz: "0.5Hz", "100mHz", or a number of Hz. Raises `StudyError` if it is not one."""
    return _read(x, FREQUENCY, "Hz")


def megawatts(x: str | float) -> float:
    """A power in MW: "50MW", "0.2GW", "300kW", or a number of MW. Raises `StudyError` if it is not one."""
    return _read(x, POWER, "MW")


def megavars(x: str | float) -> float:
    """A reactive power in Mvar: "20Mvar", "300kvar", or a number of Mvar. Raises `StudyError` if it is not one."""
    return _read(x, REACTIVE, "Mvar")


def megawatt_hours(x: str | float) -> float:
    """An energy in MWh: "10MWh", "500kWh", or a number of MWh. Raises `StudyError` if it is not one."""
    return _read(x, ENERGY, "MWh")


def radians(x: str | float) -> float:
    """An angle in radians: "120deg", "3.5rad", or a number of radians. Raises `StudyError` if it is not one."""
    return _read(x, ANGLE, "rad")


def rating(x: str | float) -> Rating:
    """A storage size: "50MW", "5%mva", "5%dispatch", or a number of MW. Raises `StudyError` if it is not one."""
    value, unit = _split(x, "MW", Kind(*_SIZE, {}))
    share = unit.lower() if unit.lower() in ("%mva", "%dispatch") else ""
    value = value if share else _read(x, Kind(*_SIZE, POWER.per), "MW")
    if value < 0:
        raise _not(x, *_SIZE)
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
        If it is not a band, is negative or outside `LOWEST` to `HIGHEST`, or its ends are not in ascending order.
    """
    ends = x.split("..") if isinstance(x, str) else x if isinstance(x, Sequence) else ()
    if len(ends) != 2:
        raise _not(x, *_BAND)
    first, last = ends
    if isinstance(x, str) and re.fullmatch(rf"\s*{_NUMBER}\s*", str(first)):
        first = f"{first}{_split(last, 'Hz', Kind(*_BAND, {}))[1]}"
    low, high = hertz(first), hertz(last)
    if not 0 <= low < high:
        raise StudyError(f"The band from {low:g} to {high:g} Hz is empty or negative; give the lower frequency first.")
    if high > HIGHEST or 0 < low < LOWEST:
        raise StudyError(
            f"The band from {low:g} to {high:g} Hz is too wide; give frequencies from {LOWEST:g} to {HIGHEST:g} Hz."
        )
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
    kind = kind_of(unit) or Kind(f"number in {unit}", f"5, or 5{unit}", {unit: 1})
    value, given = _split(x, unit, kind)
    return _read(value if bare and not given else x, kind, unit)


def kind_of(unit: str) -> Kind | None:
    """The kind of quantity that a unit belongs to; None if it is the only unit of its kind (pu)."""
    return next((kind for kind in KINDS if unit in kind.per), None)


def _read(x: object, kind: Kind, unit: str) -> float:
    """The value of a quantity in `unit`."""
    value, given = _split(x, unit, kind)
    for known in kind.per:
        if given == known or given.lower() == known or (given.islower() and given == known.lower()):
            return value * kind.per[unit] / kind.per[known]
    raise _not(x, kind.noun, kind.examples)


def _split(x: object, unit: str, kind: Kind) -> tuple[float, str]:
    """Number and unit of a text; a number has the unit given."""
    if isinstance(x, Real) and not isinstance(x, bool):
        value: Real | str = x
        found = unit
    elif isinstance(x, str) and (match := _QUANTITY.fullmatch(x)):
        value, found = match[1], match[2]
    else:
        raise _not(x, kind.noun, kind.examples)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise _not(x, kind.noun, kind.examples)
    return number, found


def _not(x: object, noun: str, examples: str) -> StudyError:
    article = "an" if noun[0] in "aeiou" else "a"
    return StudyError(f"{shown(x, 60)} is not {article} {noun}; write it as {examples}.")

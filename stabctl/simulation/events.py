"""Events in the network: faults, openings, trips, steps. Their locations are written as in `model.location`.

As text, `7-8@1s` opens a circuit, `14@2s` trips a machine, and `7:+50MW@1s` adds to a load.
"""

import cmath
import re
from dataclasses import dataclass, replace
from numbers import Complex, Integral, Real
from typing import Any, Literal

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import megavars, megawatts, seconds
from stabctl.model.location import Place, written
from stabctl.model.naming import parse_circuit

SHOWN = "7-8@1s (a line opens), 14@2s (a machine trips) or 7:+50MW@1s (a load changes)"
_MACHINE = re.compile(r"(?:machine\s+)?(\d{1,18}|(?!\d+\s*-\s*\d).+/.*)", re.ASCII)
_POWER = r"[+-]\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"
_LOAD = re.compile(rf"([^:]+):(?:({_POWER})\s*MW)?\s*(?:({_POWER})\s*Mvar)?", re.ASCII | re.IGNORECASE)


class _Timed:
    """An event at an instant, in seconds or as text ("1s", "60cyc")."""

    at: float  # s, or text

    def __post_init__(self) -> None:
        for name in {"place", "branch"} & vars(self).keys():
            given = getattr(self, name)
            place = str(int(given)) if isinstance(given, Integral) and not isinstance(given, bool) else given
            if not isinstance(place, Place):
                raise StudyError(f"{shown(given)} is not a location; write 83 for a bus, 7-8 or 7-8@0.4 for a line.")
            object.__setattr__(self, name, written(place))
        if not isinstance(self.at, Real) or isinstance(self.at, bool):
            seconds(self.at, 60.0)


@dataclass(frozen=True)
class Fault(_Timed):
    """A three-phase fault.

    Parameters
    ----------
    place : str or Circuit
        A bus "83", or a point on a circuit "7-8@0.4" ("7-8" is its middle).
    at : float or str, s
        Instant; text such as "1s" or "60cyc".
    impedance : complex, pu
        Fault impedance on the system base; 0 is a bolted fault.

    Examples
    --------
    >>> fault = [st.Fault("7-8@0.4", "1s", impedance=0.01j), st.Open("7-8", "1.1s")]
    >>> st.load("two_area").simulate(fault, until="3s").outcome.stable
    True
    """

    place: Place
    at: float
    impedance: complex = 0j

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_impedance(self.impedance)


def checked_impedance(Z: object) -> None:
    """Raise `StudyError` unless a fault impedance is a finite number."""
    if isinstance(Z, bool) or not isinstance(Z, Complex) or not cmath.isfinite(Z):
        raise StudyError(f"The fault impedance {shown(Z)} is not a finite number; give it in pu, such as 0.01+0.05j.")


@dataclass(frozen=True)
class Clear(_Timed):
    """Removal of a fault without opening a circuit.

    Parameters
    ----------
    place : str or Circuit
        Location of the fault.
    at : float or str, s
        Instant; text such as "1.1s".

    Examples
    --------
    >>> fault = [st.Fault("7", "1s"), st.Clear("7", "66cyc")]
    >>> st.load("two_area").simulate(fault, until="3s").outcome.stable
    True
    """

    place: Place
    at: float


@dataclass(frozen=True)
class Open(_Timed):
    """Opening of a circuit, which stays open.

    Parameters
    ----------
    branch : str or Circuit
        The circuit, "7-8" or "7-8#2".
    at : float or str, s
        Instant; text such as "1s".
    end : "both" or int
        Both ends, or the number of the bus whose breaker opens.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Open("7-8", "1s", end=8), until="3s")
    >>> run.outcome.stable
    True
    """

    branch: Place
    at: float
    end: Literal["both"] | int = "both"


@dataclass(frozen=True)
class TripMachine(_Timed):
    """Disconnection of a machine.

    Parameters
    ----------
    machine : int or str
        Its number, or its name such as 30/1.
    at : float or str, s
        Instant; text such as "1s".

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.TripMachine(2, "1s"), until="3s")
    >>> [bool(on) for on in run.on[-1]]
    [True, False, True, True]
    """

    machine: int | str
    at: float


@dataclass(frozen=True)
class LoadStep(_Timed):
    """Load added at a bus, with the voltage dependence of the load there (constant admittance if there is none).

    Several loads change in proportion to what they draw. A motor load is given more motors, or fewer, like its own.

    Parameters
    ----------
    bus : int or str
        Its number or name.
    at : float or str, s
        Instant; text such as "1s".
    p : float or str, MW
        Active power at the power-flow voltage; text such as "50MW".
    q : float or str, Mvar
        Reactive power at the power-flow voltage; text such as "20Mvar".
    id : str
        Identifier of the load, if only this one of the bus changes.

    Raises
    ------
    StudyError
        If both powers are 0, or text cannot be parsed.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.LoadStep(7, "1s", p="100MW", q="20Mvar"), until="5s")
    >>> print(f"{60 * float(run.speed[-1].mean()):.2f} Hz")
    59.92 Hz
    """

    bus: int | str
    at: float
    p: float = 0.0
    q: float = 0.0
    id: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        _read_powers(self, "p", "q")


@dataclass(frozen=True)
class SwitchShunt(_Timed):
    """Connection of a shunt at a bus.

    Parameters
    ----------
    bus : int or str
        Its number or name.
    at : float or str, s
        Instant; text such as "1s".
    g : float, MW
        Active power consumed at 1 pu.
    b : float, Mvar
        Reactive power produced at 1 pu.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.SwitchShunt(7, "1s", b=100), until="5s")
    >>> print(f"{float(run.voltage.sel(bus=7)[-1]):.3f} pu")
    0.980 pu
    """

    bus: int | str
    at: float
    g: float = 0.0
    b: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _read_powers(self, "g", "b")


def _read_powers(event: "LoadStep | SwitchShunt", active: str, reactive: str) -> None:
    """Read active and reactive power of an event that are text; one of them must not be 0."""
    for name, read in ((active, megawatts), (reactive, megavars)):
        power = getattr(event, name)
        if not isinstance(power, Real) or isinstance(power, bool):
            object.__setattr__(event, name, read(power))
    if getattr(event, active) == getattr(event, reactive) == 0:
        raise StudyError(f"The {described(event)} has no power; give {active}=50 (MW) or {reactive}=20 (Mvar).")


Event = Fault | Clear | Open | TripMachine | LoadStep | SwitchShunt


def described(event: Event) -> str:
    """An event in words, without its instant."""
    match event:
        case Fault(place) | Clear(place):
            return f"fault at {place}"
        case Open(name, end=end):
            return f"opening of {name}" + (f" at bus {end}" if end != "both" else "")
        case TripMachine(number):
            return f"trip of machine {number}"
        case LoadStep(bus):
            return f"load step at bus {bus}"
        case SwitchShunt(bus):
            return f"shunt switching at bus {bus}"


_FORMS = {
    Open: "a line trip; write it as 7-8@1s, or 7-8#2@1s for the second circuit",
    TripMachine: "a machine trip; write it as 14@2s",
    LoadStep: "a load step; write what is added, with its sign, as 7:+50MW@1s or 7:-50MW-10Mvar@1s",
}


def event(text: str | Event, frequency_hz: float, kind: Any = None) -> Event:
    """The event, of that kind, that a text describes, or a record with its instant in s. `StudyError` if it is none."""
    if not isinstance(text, str):
        return replace(text, at=seconds(text.at, frequency_hz)) if isinstance(text.at, str) else text
    found = _event(*_split(text, frequency_hz))
    if not isinstance(found, kind or Event):
        raise StudyError(f"{text!r} is not {_FORMS.get(kind, f'an event; write {SHOWN}')}.")
    return found


def _event(what: str, at: float) -> Event | None:
    """`7:-50MW-10Mvar` changes a load, `14` and `30/1` trip a machine, `7-8#2` and `7-8 ckt 2` open a circuit."""
    load = _LOAD.fullmatch(what)
    if load and (load[2] or load[3]):
        bus = int(load[1]) if load[1].isdecimal() and len(load[1]) < 19 else load[1]
        return LoadStep(bus, at, float(load[2] or 0), float(load[3] or 0))
    if machine := _MACHINE.fullmatch(what):
        return TripMachine(int(machine[1]) if machine[1].isdecimal() else machine[1], at)
    named = "-" in what and any(c.isalpha() for c in what)
    return Open(what, at) if named or parse_circuit(None, what) else None


def _split(text: str, frequency_hz: float) -> tuple[str, float]:
    """What happens, and when (s)."""
    what, at, when = text.rpartition("@")
    what, when = what.strip(), when.replace(" ", "")
    if not any(c.isalpha() or c in "/'" for c in what.rpartition(":")[0] or what):
        what = what.replace(" ", "")
    if not at:
        raise StudyError(f"{text!r} has no time; write {SHOWN}.")
    try:
        return what, seconds(when, frequency_hz)
    except StudyError:
        raise StudyError(f"{text!r} is not an event, because {when!r} is not a time; write {SHOWN}.") from None

"""Events in the network: faults, openings, trips, steps. Their locations are written as in `model.location`."""

from dataclasses import dataclass
from numbers import Real
from typing import Literal

from stabctl.errors import StudyError
from stabctl.units import megavars, megawatts, seconds


class _Timed:
    """An event at an instant, in seconds or as text ("1s", "60cyc")."""

    at: float  # s, or text

    def __post_init__(self) -> None:
        if not isinstance(self.at, Real) or isinstance(self.at, bool):
            seconds(self.at, 60.0)


@dataclass(frozen=True)
class Fault(_Timed):
    """A three-phase fault.

    Parameters
    ----------
    place : str
        A bus "83", or a point on a circuit "7-8@0.4" ("7-8" is its middle).
    at : float or str, s
        Instant; text such as "1s" or "60cyc".
    impedance : complex, pu
        Fault impedance on the system base; 0 is a bolted fault.
    """

    place: str
    at: float
    impedance: complex = 0j


@dataclass(frozen=True)
class Clear(_Timed):
    """Removal of a fault without opening a circuit.

    Parameters
    ----------
    place : str
        Location of the fault.
    at : float or str, s
        Instant; text such as "1.1s".
    """

    place: str
    at: float


@dataclass(frozen=True)
class Open(_Timed):
    """Opening of a circuit, which stays open.

    Parameters
    ----------
    branch : str
        The circuit, "7-8" or "7-8#2".
    at : float or str, s
        Instant; text such as "1s".
    end : "both" or int
        Both ends, or the number of the bus whose breaker opens.
    """

    branch: str
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
    """

    machine: int | str
    at: float


@dataclass(frozen=True)
class LoadStep(_Timed):
    """Load added at a bus, with the voltage dependence of the load there (constant admittance if there is none).

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

    Raises
    ------
    StudyError
        If both powers are 0, or text cannot be parsed.
    """

    bus: int | str
    at: float
    p: float = 0.0
    q: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, power, read in (("p", self.p, megawatts), ("q", self.q, megavars)):
            if not isinstance(power, Real) or isinstance(power, bool):
                object.__setattr__(self, name, read(power))
        if self.p == self.q == 0:
            raise StudyError(f"The load step at bus {self.bus} has no power; give p=50 (MW) or q=20 (Mvar).")


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
    """

    bus: int | str
    at: float
    g: float = 0.0
    b: float = 0.0


Event = Fault | Clear | Open | TripMachine | LoadStep | SwitchShunt


def described(event: Event) -> str:
    """An event in words, without its instant."""
    match event:
        case Fault(place) | Clear(place):
            return f"fault at {place}"
        case Open(name):
            return f"opening of {name}"
        case TripMachine(number):
            return f"trip of machine {number}"
        case LoadStep(bus):
            return f"load step at bus {bus}"
        case SwitchShunt(bus):
            return f"shunt switching at bus {bus}"

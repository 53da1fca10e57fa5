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
    """A three-phase fault at a bus or on a branch (in its middle unless a point is given)."""

    place: str
    at: float  # s
    impedance: complex = 0j  # pu


@dataclass(frozen=True)
class Clear(_Timed):
    """The fault at a location is removed without opening any circuit."""

    place: str
    at: float  # s


@dataclass(frozen=True)
class Open(_Timed):
    """A circuit is opened at both ends, or at one bus only, and stays open."""

    branch: str
    at: float  # s
    end: Literal["both"] | int = "both"  # "both", or the number of the bus whose breaker opens


@dataclass(frozen=True)
class TripMachine(_Timed):
    """A machine is disconnected."""

    machine: int | str  # its number, or its name such as 30/1
    at: float  # s


@dataclass(frozen=True)
class LoadStep(_Timed):
    """Load is added at a bus, with the voltage dependence of its present load (constant admittance if it has none)."""

    bus: int | str  # its number or name
    at: float  # s
    p: float = 0.0  # MW    at power-flow voltage; text such as "50MW" too
    q: float = 0.0  # Mvar  at power-flow voltage; text such as "20Mvar" too

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, power, read in (("p", self.p, megawatts), ("q", self.q, megavars)):
            if not isinstance(power, Real) or isinstance(power, bool):
                object.__setattr__(self, name, read(power))
        if self.p == self.q == 0:
            raise StudyError(f"The load step at bus {self.bus} has no power; give p=50 (MW) or q=20 (Mvar).")


@dataclass(frozen=True)
class SwitchShunt(_Timed):
    """A shunt is switched in at a bus."""

    bus: int | str  # its number or name
    at: float  # s
    g: float = 0.0  # MW    consumed at 1 pu
    b: float = 0.0  # Mvar  produced at 1 pu


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

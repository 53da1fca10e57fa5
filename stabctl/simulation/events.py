"""Events in the network: faults, openings, trips, steps. Their locations are written as in `model.location`."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Fault:
    """A three-phase fault at a bus or on a branch (in its middle unless a point is given)."""

    place: str
    at: float  # s
    impedance: complex = 0j  # pu


@dataclass(frozen=True)
class Clear:
    """The fault at a location is removed without opening any circuit."""

    place: str
    at: float  # s


@dataclass(frozen=True)
class Open:
    """A circuit is opened at both ends, or at one bus only, and stays open."""

    branch: str
    at: float  # s
    end: Literal["both"] | int = "both"  # "both", or the number of the bus whose breaker opens


@dataclass(frozen=True)
class TripMachine:
    """A machine is disconnected."""

    machine: int
    at: float  # s


@dataclass(frozen=True)
class LoadStep:
    """Load is added at a bus, with the voltage dependence of its present load (constant admittance if it has none)."""

    bus: int
    at: float  # s
    p: float = 0.0  # MW    at power-flow voltage
    q: float = 0.0  # Mvar  at power-flow voltage


@dataclass(frozen=True)
class SwitchShunt:
    """A shunt is switched in at a bus."""

    bus: int
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

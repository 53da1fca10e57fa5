"""What happens to the network, as data: faults, openings, trips, steps; and the switching they add up to.

Places are written as planners write them: `83` a bus, `7-8` the first circuit between two buses, `7-8#2` the second,
`7-8@0.4` a place along it, measured from the first bus named.
"""

import cmath
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.network import BOLTED, BranchState, Switching


@dataclass(frozen=True)
class Fault:
    """A three-phase fault at a bus or along a branch (half-way where no place on it is named)."""

    place: str
    at: float  # s
    impedance: complex = 0j  # pu


@dataclass(frozen=True)
class Clear:
    """The fault at a place goes out by itself."""

    place: str
    at: float  # s


@dataclass(frozen=True)
class Open:
    """A circuit is opened at both ends, or only at the end of one bus; what is open stays open."""

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
    """Power is added to a bus, with the voltage dependence of its load (constant admittance where it has none)."""

    bus: int
    at: float  # s
    p: float = 0.0  # MW    at load-flow voltage
    q: float = 0.0  # Mvar  at load-flow voltage


@dataclass(frozen=True)
class SwitchShunt:
    """A shunt is switched in at a bus."""

    bus: int
    at: float  # s
    g: float = 0.0  # MW    consumed at 1 pu
    b: float = 0.0  # Mvar  produced at 1 pu


Event = Fault | Clear | Open | TripMachine | LoadStep | SwitchShunt


class Place(NamedTuple):
    """A resolved place: the row of a bus, or of a branch with the fraction from its from end."""

    bus: int | None
    branch: int | None = None
    fraction: float | None = None


@dataclass(frozen=True)
class Change:
    """The network from one instant on."""

    at: float  # s
    switching: Switching = field(default_factory=Switching)


_NUMBER = r"([0-9]{1,18})"
_LINE = re.compile(rf"^{_NUMBER}-{_NUMBER}(?:#{_NUMBER})?(?:@([0-9.eE+-]+))?$")


def branch(case: Case, text: str) -> tuple[int, bool]:
    """Row of the circuit named `7-8` or `7-8#2`, and whether it is named against its direction in the table."""
    place = locate(case, text)
    if place.branch is None or place.fraction is not None:
        raise StudyError(f"{text!r} does not name a circuit; write it as 7-8, or 7-8#2 for the second one.")
    named = _LINE.match(text.strip())
    return place.branch, named is not None and int(named[1]) != case.branches[place.branch].from_bus


def _no_bus(case: Case, bus: int) -> str:
    return f"There is no bus {bus} in {case.name}; {_near(case, bus)}."


def _near(case: Case, bus: int) -> str:
    numbers = sorted((b.bus for b in case.buses), key=lambda other: abs(other - bus))[:3]
    return f"the nearest numbers are {', '.join(map(str, sorted(numbers)))}"


def _no_branch(case: Case, a: int, b: int) -> str:
    missing = {a, b} - {k.bus for k in case.buses}
    if missing:
        bus = min(missing)
        return f"There is no branch {a}-{b} in {case.name}, since there is no bus {bus}; {_near(case, bus)}."
    ends = {k.from_bus + k.to_bus - a for k in case.branches if a in (k.from_bus, k.to_bus)}
    others = ", ".join(f"{a}-{other}" for other in sorted(ends))
    return f"There is no branch {a}-{b} in {case.name}; those of bus {a} are {others}."


def locate(case: Case, text: str) -> Place:
    """The place a text names in the case; `StudyError` says what is wrong with it."""
    text = str(text).strip()
    if re.fullmatch(_NUMBER, text):
        for i, b in enumerate(case.buses):
            if b.bus == int(text):
                return Place(i)
        raise StudyError(_no_bus(case, int(text)))
    match = _LINE.match(text)
    if not match:
        raise StudyError(
            f"{text!r} is not a place; write a bus as 83, a circuit as 7-8 or 7-8#2, a point on it as 7-8@0.4."
        )
    a, b, circuit = int(match[1]), int(match[2]), int(match[3] or 1)
    rows = [i for i, k in enumerate(case.branches) if {k.from_bus, k.to_bus} == {a, b}]
    if not rows:
        raise StudyError(_no_branch(case, a, b))
    if not 1 <= circuit <= len(rows):
        raise StudyError(
            f"Branch {a}-{b} of {case.name} has {len(rows)} circuit{'s' * (len(rows) > 1)}, not a number {circuit}."
        )
    row = rows[circuit - 1]
    if match[4] is None:
        return Place(None, row)
    try:
        along = float(match[4])
    except ValueError:
        along = -1.0
    if not 0 <= along <= 1:
        raise StudyError(f"The place {match[4]} along {a}-{b} must be a number from 0 (at bus {a}) to 1 (at bus {b}).")
    return Place(None, row, along if case.branches[row].from_bus == a else 1 - along)


def timeline(case: Case, events: Iterable[Event]) -> tuple[Change, ...]:
    """The network after each instant at which something happens, in order of time; the first is the intact one at 0."""
    changes, now = [Change(0.0)], _State(case)
    for event in sorted(events, key=lambda e: e.at):
        if not 0 <= event.at < float("inf"):
            raise StudyError(f"The time {event.at:g} s of the {described(event)} is not allowed; give at least 0.")
        for name, value in vars(event).items():
            if isinstance(value, int | float | complex) and not cmath.isfinite(value):
                raise StudyError(f"The {name} {value} of the {described(event)} is not allowed; it must be finite.")
        now.apply(event)
        if event.at - changes[-1].at < 1e-9 and len(changes) > 1:
            changes.pop()
        changes.append(Change(event.at, now.switching()))
    return tuple(changes)


def described(event: Event) -> str:
    """An event in words, without its instant."""
    match event:
        case Fault(place) | Clear(place):
            return f"fault at {place}"
        case Open(name):
            return f"opening of {name}"
        case TripMachine(number):
            return f"trip of machine {number}"
        case LoadStep(bus) | SwitchShunt(bus):
            return f"step at bus {bus}"


class _State:
    """What has happened so far."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.branches: dict[int, BranchState] = {}
        self.faults: dict[int, complex] = {}
        self.shunts: dict[int, complex] = {}
        self.loads: dict[int, complex] = {}
        self.tripped: set[int] = set()

    def switching(self) -> Switching:
        return Switching(
            tuple(sorted(self.branches.items())),
            tuple(sorted(self.faults.items())),
            tuple(sorted(self.shunts.items())),
            frozenset(self.tripped),
            tuple(sorted(self.loads.items())),
        )

    def apply(self, event: Event) -> None:
        match event:
            case Fault(place, _, impedance):
                if complex(impedance).real < 0:
                    raise StudyError(
                        f"The impedance {impedance} pu of the fault at {place} is not allowed; its resistance must be "
                        "at least 0."
                    )
                bolted = BOLTED / self.case.base_mva
                self._fault(place, 1 / impedance if abs(impedance) * bolted > 1 else bolted + 0j)
            case Clear(place):
                self._clear(place)
            case Open(name, _, end):
                self._open(name, end)
            case TripMachine(number):
                row = self.case.machines.index(self.case.machine(number))
                if row in self.tripped:
                    raise StudyError(f"Machine {number} is tripped twice; trip it once.")
                self.tripped.add(row)
            case LoadStep(bus, _, p, q):
                row = self._bus(bus)
                self.loads[row] = self.loads.get(row, 0j) + (p + 1j * q) / self.case.base_mva
            case SwitchShunt(bus, _, g, b):
                row = self._bus(bus)
                self.shunts[row] = self.shunts.get(row, 0j) + (g + 1j * b) / self.case.base_mva

    def _bus(self, number: int) -> int:
        place = locate(self.case, str(number))
        if place.bus is None:
            raise StudyError(f"{number!r} is not a bus of {self.case.name}; give a bus number.")
        return place.bus

    def _fault(self, text: str, admittance: complex) -> None:
        place = locate(self.case, text)
        if place.bus is not None:
            if place.bus in self.faults:
                raise StudyError(f"Bus {text} is faulted twice; clear the first fault before the second.")
            self.faults[place.bus] = admittance
            return
        before = self.branches.get(place.branch, BranchState())
        if before.fault_at is not None:
            raise StudyError(f"Branch {text} is faulted twice; one fault at a time is possible on a circuit.")
        along = 0.5 if place.fraction is None else place.fraction
        self.branches[place.branch] = before._replace(fault_at=along, fault_admittance=admittance)

    def _clear(self, text: str) -> None:
        place = locate(self.case, text)
        if place.bus is not None and place.bus in self.faults:
            del self.faults[place.bus]
        elif place.branch is not None and self.branches.get(place.branch, BranchState()).fault_at is not None:
            self.branches[place.branch] = self.branches[place.branch]._replace(fault_at=None)
        else:
            raise StudyError(f"There is no fault at {text} to clear at that time.")

    def _open(self, name: str, end: str | int) -> None:
        row, _ = branch(self.case, name)
        k, before = self.case.branches[row], self.branches.get(row, BranchState())
        if end != "both" and end not in (k.from_bus, k.to_bus):
            raise StudyError(f"Circuit {name} does not end at bus {end}; it ends at {k.from_bus} and {k.to_bus}.")
        from_closed = before.from_closed and end not in ("both", k.from_bus)
        to_closed = before.to_closed and end not in ("both", k.to_bus)
        self.branches[row] = before._replace(from_closed=from_closed, to_closed=to_closed)

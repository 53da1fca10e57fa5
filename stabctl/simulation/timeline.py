"""The switching state of the network after each event."""

import cmath
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby

from stabctl._util.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.location import Place, circuit, locate
from stabctl.model.naming import loads_at
from stabctl.model.network import BOLTED, BranchState, Switching

from .events import Clear, Event, Fault, LoadStep, Open, SwitchShunt, TripMachine, described


@dataclass(frozen=True)
class Change:
    """The network from a given time on."""

    at: float  # s
    switching: Switching = field(default_factory=Switching)
    automatic: bool = False  # the trip of a unit alone in its island


def timeline(case: Case, events: Iterable[Event]) -> tuple[Change, ...]:
    """The state of the network after each event, in order of time; the first is the intact network at time 0."""
    changes, now = [Change(0.0)], _State(case)
    for event in _in_order(events, now):
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


def _in_order(events: Iterable[Event], now: "_State") -> Iterator[Event]:
    """The events in order of time; of those at one instant, a fault that was there is cleared first."""
    for _, several in groupby(sorted(events, key=lambda e: e.at), key=lambda e: round(e.at, 9)):
        yield from sorted(several, key=lambda e: not (isinstance(e, Clear) and now.faulted(e.place)))


class _State:
    """What has happened so far."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.branches: dict[int, BranchState] = {}
        self.faults: dict[int, complex] = {}
        self.shunts: dict[int, complex] = {}
        self.loads: dict[tuple[int, str], complex] = {}
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
                    raise StudyError(f"Machine {self.case.machines[row].called} is tripped twice; remove one trip.")
                self.tripped.add(row)
            case LoadStep(bus, _, p, q, id):
                row = self._bus(bus)
                known = dict.fromkeys(name for _, name in loads_at(self.case, self.case.buses[row].bus))
                if id and id not in known:
                    raise StudyError(
                        f"{self.case.name} has no load {id} at bus {bus}; it has {', '.join(known) or 'none there'}."
                    )
                self.loads[row, id] = self.loads.get((row, id), 0j) + (p + 1j * q) / self.case.base_mva
            case SwitchShunt(bus, _, g, b):
                row = self._bus(bus)
                self.shunts[row] = self.shunts.get(row, 0j) + (g + 1j * b) / self.case.base_mva

    def _bus(self, number: int | str) -> int:
        place = locate(self.case, str(number))
        if place.bus is None:
            raise StudyError(f"{number!r} is not a bus of {self.case.name}; give a bus number.")
        return place.bus

    def _fault(self, text: Place, admittance: complex) -> None:
        place = locate(self.case, text)
        if place.bus is not None:
            if place.bus in self.faults:
                raise StudyError(f"Bus {text} is faulted twice; clear the first fault before the second.")
            self.faults[place.bus] = admittance
            return
        assert place.branch is not None
        before = self.branches.get(place.branch, BranchState())
        if before.fault_at is not None:
            raise StudyError(f"Branch {text} is faulted twice; a circuit can have only one fault at a time.")
        along = 0.5 if place.fraction is None else place.fraction
        self.branches[place.branch] = before._replace(fault_at=along, fault_admittance=admittance)

    def faulted(self, text: Place) -> bool:
        """Whether there is a fault at a place."""
        place = locate(self.case, text)
        branch = self.branches.get(place.branch, BranchState()) if place.branch is not None else BranchState()
        return place.bus in self.faults or branch.fault_at is not None

    def _clear(self, text: Place) -> None:
        if not self.faulted(text):
            raise StudyError(f"There is no fault at {text} to clear at that time.")
        place = locate(self.case, text)
        if place.bus is not None:
            del self.faults[place.bus]
        elif place.branch is not None:
            self.branches[place.branch] = self.branches[place.branch]._replace(fault_at=None)

    def _open(self, name: Place, end: str | int) -> None:
        row, _ = circuit(self.case, name)
        k, before = self.case.branches[row], self.branches.get(row, BranchState())
        end = int(end) if isinstance(end, str) and end.isdecimal() else end
        if end != "both" and end not in (k.from_bus, k.to_bus):
            raise StudyError(f"Circuit {name} does not end at bus {end}; it ends at {k.from_bus} and {k.to_bus}.")
        from_closed = before.from_closed and end not in ("both", k.from_bus)
        to_closed = before.to_closed and end not in ("both", k.to_bus)
        self.branches[row] = before._replace(from_closed=from_closed, to_closed=to_closed)

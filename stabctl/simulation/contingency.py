"""A contingency: a fault, its clearing, and other events."""

import math
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING

from stabctl._util.errors import StudyError, check_line, shown
from stabctl._util.units import seconds
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.location import Circuit, Place, circuit, placed, written

from .events import SHOWN, Clear, Event, Fault, Open, TripMachine, checked_impedance, described, event
from .timeline import timeline

SHORTEST = 1e-6  # s   of a run after its last event


@dataclass(frozen=True, repr=False)
class Contingency:
    """A fault, cleared by opening circuits, and other events.

    Parameters
    ----------
    fault : str or int, optional
        Location of a three-phase fault: a bus `83`, a point of a circuit `7-8@0.4` (measured from the first bus named),
        or `7-8` for its middle.
    clear : str or float, optional
        How long the fault lasts: "6cyc", "0.1s", "100ms", or seconds. A fault on a circuit is cleared by opening it.
    trip : str or iterable of str
        Circuits opened when the fault is cleared; the circuit with the fault may be among them. Without a fault they
        open `clear` (default 0) after `at`.
    at : str or float
        Instant of the fault: "1s", "60cyc", or seconds.
    impedance : complex, pu
        Fault impedance on the system base; 0 is a bolted fault.
    events : event, str, or iterable of them
        Other events, as records (`LoadStep(7, 1.0, p=50)`) or text (`"7-8@1s"`, `"14@2s"`, `"7:+50MW@1s"`).
    after : event, str, or iterable of them
        Events whose instants count from the clearing and move with it: `"9@0s"` trips machine 9 when the fault is
        cleared, `"7-8@6cyc"` opens a circuit 6 cycles later.
    name : str, optional
        What the contingency is called in tables.

    Raises
    ------
    StudyError
        For text that cannot be parsed. Names are checked against the case by `check` and by every study.

    Examples
    --------
    >>> fault = st.Contingency("7-8@0.4", clear="6cyc", events=["2@3s"])
    >>> st.load("two_area").simulate(fault, until="5s").outcome.stable
    True
    """

    fault: Place | None = None
    clear: str | float | None = None
    trip: tuple[Place, ...] = ()
    _: KW_ONLY
    at: str | float = "1s"
    impedance: complex = 0j
    events: tuple[Event | str, ...] = ()
    after: tuple[Event | str, ...] = ()
    name: str | None = None

    if TYPE_CHECKING:  # what may be given is more than what is kept

        def __init__(
            self,
            fault: Place | int | None = None,
            clear: str | float | None = None,
            trip: Place | Iterable[Place] = (),
            *,
            at: str | float = "1s",
            impedance: complex = 0j,
            events: Event | str | Iterable[Event | str] = (),
            after: Event | str | Iterable[Event | str] = (),
            name: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        fault = str(self.fault) if isinstance(self.fault, int) and not isinstance(self.fault, bool) else self.fault
        if fault is not None and not isinstance(fault, Place):
            raise StudyError(f"{fault!r} is not a fault location; write 83 for a bus, 7-8 or 7-8@0.4 for a line.")
        if self.name is not None:
            check_line("name", self.name)
        checked_impedance(self.impedance)
        if self.impedance and fault is None:
            raise StudyError("The impedance is that of a fault, and there is none; give one, or leave impedance out.")
        for name, time in (("clear", self.clear), ("at", self.at)):
            if not (name == "clear" and time is None) and seconds(time, 60.0) < 0:  # type: ignore[arg-type]
                raise StudyError(f"{name} = {time:g} s is negative; give a time of at least 0.")
        object.__setattr__(self, "fault", written(fault))
        object.__setattr__(self, "trip", _circuits(self.trip))
        object.__setattr__(self, "events", _events(self.events))
        object.__setattr__(self, "after", _events(self.after, "after"))
        if early := [one for one in self.after if event(one, 60.0).at < 0]:
            raise StudyError(f"after = {early[0]} is before the clearing; count its instant from the clearing.")

    def placed(self, case: Case) -> "Contingency":
        """The same with records of the case's buses and circuits, and of the events after clearing, instead of text.

        Parameters
        ----------
        case : Case
            The system, which tells a circuit from a bus with a dash in its name.

        Returns
        -------
        Contingency

        Raises
        ------
        StudyError
            If the case has no such fault location or circuit.

        Examples
        --------
        >>> st.Contingency("8-7#2").placed(st.load("two_area")).fault
        '7-8#2'
        """
        fault = None if self.fault is None else placed(case, self.fault)
        trip = tuple(naming.circuit(case, circuit(case, k)[0]) for k in self.trip)
        after = tuple(_called(case, event(e, case.frequency_hz)) for e in self.after)
        return replace(self, fault=fault, trip=trip, after=after)

    @property
    def opened(self) -> tuple[Place, ...]:
        """The circuits opened at clearing: the faulted one first."""
        own = (self.fault._replace(at=None),) if isinstance(self.fault, Circuit) else ()
        return tuple(dict.fromkeys((*own, *self.trip)))

    @property
    def tripped(self) -> tuple[str, ...]:
        """What happens at clearing and after it, as text: the circuits of `trip`, machines, other events."""
        return *map(str, self.trip), *map(_tripped, self.after)

    @property
    def label(self) -> str:
        """Its name, or its fault and trip: `16 trip 16-21, machine 9`."""
        trip = f"trip {', '.join(self.tripped)}" if self.tripped else ""
        return self.name or " ".join(str(part) for part in (self.fault, trip) if part) or str(self)

    def starts(self, case: Case) -> float:
        """Instant of the fault.

        Parameters
        ----------
        case : Case
            The system, whose frequency converts cycles.

        Returns
        -------
        float, s

        Examples
        --------
        >>> st.Contingency("7", clear="6cyc", at="30cyc").starts(st.load("two_area"))
        0.5
        """
        return seconds(self.at, case.frequency_hz)

    def cleared(self, case: Case) -> float:
        """Instant at which the fault is cleared.

        Parameters
        ----------
        case : Case
            The system, whose frequency converts cycles.

        Returns
        -------
        float, s

        Raises
        ------
        StudyError
            If there is a fault without a clearing time.

        Examples
        --------
        >>> st.Contingency("7", clear="6cyc").cleared(st.load("two_area"))
        1.1
        """
        return self.starts(case) + self._duration(case)

    def _duration(self, case: Case) -> float:
        """How long the fault lasts, s."""
        if self.clear is None and self.fault is not None:
            raise StudyError(f"The fault at {self.fault} is never cleared; give a clearing time, such as clear='6cyc'.")
        return seconds(self.clear or 0.0, case.frequency_hz)

    def others(self, case: Case) -> tuple[Event, ...]:
        """The events other than the fault and its clearing.

        Parameters
        ----------
        case : Case
            The system, whose frequency converts cycles.

        Returns
        -------
        tuple of event
            With their instants in seconds.

        Examples
        --------
        >>> st.Contingency("7", clear="6cyc", events="2@120cyc").others(st.load("two_area"))
        (TripMachine(machine=2, at=2.0),)
        """
        return tuple(event(e, case.frequency_hz) for e in self.events)

    def timed(self, case: Case) -> tuple[Event, ...]:
        """Every event: the fault, its clearing, and the others.

        Parameters
        ----------
        case : Case
            The system, whose frequency converts cycles.

        Returns
        -------
        tuple of event
            With their instants in seconds.

        Examples
        --------
        >>> st.Contingency("7", clear="6cyc").timed(st.load("two_area"))
        (Fault(place='7', at=1.0, impedance=0j), Clear(place='7', at=1.1))
        """
        events = list(self.others(case))
        if self.fault is None and not self.trip and not self.after:
            return tuple(events)
        duration = self._duration(case)
        return *events, *self.placed(case).lasting(duration, self.starts(case))

    def lasting(self, duration: float, begin: float) -> tuple[Event, ...]:
        """The fault, its clearing, the circuits opened then, and the events after it, which are records.

        Parameters
        ----------
        duration : float, s
            How long the fault lasts.
        begin : float, s
            Instant of the fault.

        Returns
        -------
        tuple of event

        Examples
        --------
        >>> st.Contingency("7", trip="7-8").lasting(0.1, begin=1.0)
        (Fault(place='7', at=1.0, impedance=0j), Clear(place='7', at=1.1), Open(branch='7-8', at=1.1, end='both'))
        """
        events: list[Event] = []
        end = begin + duration
        if self.fault is not None and duration > 1e-9:
            events.append(Fault(self.fault, begin, self.impedance))
            if isinstance(self.fault, str):
                events.append(Clear(self.fault, end))
        events += (Open(k, end) for k in self.opened)
        return *events, *(replace(e, at=end + e.at) for e in self.after if not isinstance(e, str))

    def check(self, case: Case, until: float | None = None) -> None:
        """Check the contingency against a case.

        Parameters
        ----------
        case : Case
            The system.
        until : float, s, optional
            End of the run, which must be after the last event.

        Raises
        ------
        StudyError
            If a bus, circuit or machine does not exist, or an event is later than `until`.

        Examples
        --------
        >>> st.Contingency("7-8@0.4", clear="6cyc").check(st.load("two_area"), until=5.0)
        """
        timeline(case, timed_events(case, self, until))

    def with_clear(self, clear: str | float, at: str | float | None = None) -> "Contingency":
        """The same contingency with another clearing time.

        Parameters
        ----------
        clear : str or float
            How long the fault lasts: "6cyc", or seconds.
        at : str or float, optional
            Instant of the fault; unchanged by default.

        Returns
        -------
        Contingency

        Examples
        --------
        >>> st.Contingency("7", clear="6cyc").with_clear("8cyc", at="2s").clear
        '8cyc'
        """
        return replace(self, clear=clear, at=self.at if at is None else at)

    def described(self, case: Case) -> str:
        """In words; a clearing time without a unit is in seconds, and is given in cycles, too.

        Parameters
        ----------
        case : Case
            The system, whose frequency converts cycles.

        Returns
        -------
        str

        Examples
        --------
        >>> st.Contingency("7", clear=0.1, trip="7-8").described(st.load("two_area"))
        'fault 7, cleared after 0.1 s (6 cycles) by opening 7-8'
        """
        return self.placed(case)._in_words(case.frequency_hz)

    def __str__(self) -> str:
        return self._in_words()

    def _in_words(self, frequency_hz: float | None = None) -> str:
        parts = []
        if self.fault is not None:
            parts.append(f"fault {self.fault}" + (f" through {self.impedance} pu" if self.impedance else ""))
        opened = f"opening {', '.join(map(str, self.opened))}" if self.opened else ""
        if self.clear is not None and self.fault is not None:
            parts.append(f"cleared after {_said(self.clear, frequency_hz)}" + (f" by {opened}" if opened else ""))
        elif opened:
            parts.append(opened if self.fault is None else f"to be cleared by {opened}")
        parts += [f"then {_tripped(one)}" for one in self.after]
        parts += [one if isinstance(one, str) else f"{described(one)} at {_said(one.at)}" for one in self.events]
        return ", ".join(parts) or "no event"

    __repr__ = __str__


Disturbance = Contingency | Event | str | Iterable[Contingency | Event | str]


def timed_events(
    case: Case, what: Disturbance | None, until: float | None = None, start: float = 0.0
) -> tuple[Event, ...]:
    """The events of a run, with their instants in seconds.

    Parameters
    ----------
    case : Case
        The system, for its frequency.
    what : Contingency, event, str, iterable of them, or None
        What happens; a text is an event as in `events`.
    until, start : float, s
        End and start of the run; without an end it is not checked.

    Raises
    ------
    StudyError
        If an item is not an event, or the run ends before its last event.
    """
    if until is not None and not start < until < math.inf:
        raise StudyError(f"The run ends at {until:g} s; it must end after its start at {start:g} s.")
    if what is None:
        return ()
    items = (what,) if isinstance(what, str | Contingency | Event) else what
    if not isinstance(items, Iterable):
        raise _not_an_event(what)
    events: list[Event] = []
    for item in items:
        if isinstance(item, Contingency):
            events += item.timed(case)
        elif isinstance(item, str | Event):
            events.append(event(item, case.frequency_hz))
        else:
            raise _not_an_event(item)
    latest = max((event.at for event in events if math.isfinite(event.at)), default=start)
    if until is not None and until - latest < SHORTEST:
        raise StudyError(f"The run ends at {until:g} s; it must end after its last event at {latest:g} s.")
    return tuple(events)


def _not_an_event(item: object) -> StudyError:
    return StudyError(
        f"{shown(item)} is not a contingency; give Contingency('7-8@0.4', clear='6cyc'), an event, or a list of them."
    )


def _circuits(trip: Place | Iterable[Place]) -> tuple[Place, ...]:
    given = [name for part in naming.listed(trip) for name in _names(part)] if isinstance(trip, str) else trip
    given = (given,) if isinstance(given, Circuit) or not isinstance(given, Iterable) else tuple(given)
    if not all(isinstance(one, Place) for one in given):
        raise StudyError(f"trip = {trip!r} does not name circuits; write trip='7-8' or trip=['7-8', '8-9#2'].")
    return tuple(map(written, given))


def _names(part: str) -> list[str]:
    """Circuits separated by blanks; one with a letter, such as 7-8 ckt 2, may hold blanks itself."""
    return [part] if any(c.isalpha() for c in part) else part.split()


def _events(events: Event | str | Iterable[Event | str], name: str = "events") -> tuple[Event | str, ...]:
    items = (events,) if isinstance(events, str | Event) else events
    if not isinstance(items, Iterable):
        raise StudyError(f"{name} = {events!r} is not a list of events; write {SHOWN}.")
    for item in (items := tuple(items)):
        if isinstance(item, str):
            event(item, 60.0)
        elif not isinstance(item, Event):
            raise StudyError(f"{item!r} is not an event; write {SHOWN}, or give a record such as LoadStep.")
    return items


def _called(case: Case, one: Event) -> Event:
    """The event with what its machine is called."""
    return replace(one, machine=case.machine(one.machine).called) if isinstance(one, TripMachine) else one


def _tripped(one: Event | str) -> str:
    """An event after clearing, in words, with its time as given: only a case has a frequency."""
    what = event(one, 60.0)
    time = one.rpartition("@")[2].strip() if isinstance(one, str) else _said(one.at)
    told = f"machine {what.machine}" if isinstance(what, TripMachine) else described(what)
    return told + (f" {time} later" if what.at else "")


def _said(time: str | float, frequency_hz: float | None = None) -> str:
    if isinstance(time, str):
        return time
    return f"{time:g} s" + (f" ({time * frequency_hz:.6g} cycles)" if frequency_hz else "")

"""The scenarios that a fleet must survive: contingencies from a list, a screen or a file, at operating points.

A scenario is a contingency at one operating point, with or without a storage device out of service.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from stabctl._util import toml_file
from stabctl._util.errors import StudyError, shown
from stabctl._util.units import seconds
from stabctl.clearing import Screen
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model import naming
from stabctl.model.case import Case, as_case
from stabctl.simulation import events
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Event

Base = Case | OperatingPoint
Bases = Base | Iterable[Base] | Mapping[str, Base]
Contingencies = Iterable[Contingency] | Contingency | Screen | str | Path
COUNT, LONGER = 8, 1.2
AT = 1.0  # s   instant of the fault of a contingency, by default
LONGEST = 10.0  # s   clearing time; in practice a few cycles
EXAMPLE = 'write [[contingency]] with fault = "16", trip = "16-21", clear = "8.2cyc"'


def contingencies(case: Case, given: Contingencies) -> tuple[Contingency, ...]:
    """The contingencies to be survived, checked against the case and without duplicates.

    Parameters
    ----------
    case : Case
        The system.
    given : Contingency, iterable of Contingency, Screen, str or Path
        A list, a screen (its most critical contingencies are taken), or a TOML file.

    Raises
    ------
    StudyError
        If it is none of these, or a contingency is not possible in the case or listed twice.
    """
    if isinstance(given, Screen):
        return checked(case, from_screen(given, case.frequency_hz))
    if isinstance(given, str | Path):
        return read(given, case)
    if isinstance(given, Contingency):
        return checked(case, (given,))
    if not isinstance(given, Iterable):
        raise StudyError(f"{given!r} is not a list of contingencies; give [Contingency('16', clear='6cyc'), ...].")
    return checked(case, given)


def from_screen(found: Screen, hz: float, *, count: int = COUNT, longer: float = LONGER) -> tuple[Contingency, ...]:
    """The most critical contingencies of a screen, one for each machine that loses synchronism first.

    Parameters
    ----------
    found : Screen
        A screen without storage.
    hz : float
        Frequency of the system.
    count : int
        Largest number of contingencies.
    longer : float
        Clearing time to be survived, relative to that of the screen (1.2: 20 % longer).
    """
    chosen: dict[int | str | None, Contingency] = {}
    for pair in found.pairs:
        if pair.cycles and pair.machine not in chosen:
            chosen[pair.machine] = Contingency(pair.fault, longer * pair.cycles / hz, pair.trip)
    return tuple(chosen.values())[:count]


def packaged(case: str, classical: bool = False) -> Path | None:
    """The contingency file of a packaged case; None if it has none."""
    file = resources.files("stabctl") / "model" / "cases" / case / f"contingencies{'_classical' * classical}.toml"
    return Path(str(file)) if file.is_file() else None


def read(path: str | Path, case: Case) -> tuple[Contingency, ...]:
    """The contingencies of a TOML file. Raises StudyError with file, row, key and value of the first error."""
    path = Path(path)
    content = toml_file.read(path, "contingency file")
    rows = content.pop("contingency", None)
    if content:
        raise StudyError(f"{path}: {toml_file.unknown(next(iter(content)), ['contingency'])}")
    if not isinstance(rows, list) or not rows:
        raise StudyError(f"{path} has no contingencies; {EXAMPLE}.")
    try:
        named = ((f"{path}, contingency {i}", row) for i, row in enumerate(rows, start=1))
        return checked(case, [_contingency(where, row, case) for where, row in named])
    except StudyError as error:
        text = str(error)
        raise StudyError(text if text.startswith(str(path)) else f"{path}: {text}") from None


def _contingency(where: str, row: object, case: Case) -> Contingency:
    if not isinstance(row, dict):
        raise StudyError(f"{where} is not a table; {EXAMPLE}.")
    found = toml_file.validated(_Row, row, where)
    trip = (found.trip,) if isinstance(found.trip, str) else tuple(found.trip)
    if found.clear is None and found.fault is not None:
        raise StudyError(f"{where}: clear is missing; it must be {_Row.model_fields['clear'].description}.")
    if found.fault is None and (found.clear is not None or not (trip or found.trip_machine)):
        raise StudyError(f"{where}: fault is missing; it must be {_Row.model_fields['fault'].description}.")
    machines = (found.trip_machine,) if isinstance(found.trip_machine, str) else tuple(found.trip_machine)
    try:
        trips = tuple(_machine_trip(text, found.clear, case) for text in machines)
        impedance = _impedance(found.impedance)
        return Contingency(found.fault, found.clear, trip, impedance=impedance, events=trips, name=found.name)
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None


def _bus(value: object) -> object:
    """The number of a bus as text."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


class _Row(BaseModel):
    """A [[contingency]] of a file."""

    model_config = ConfigDict(extra="forbid", strict=True)

    fault: Annotated[str | None, BeforeValidator(_bus)] = Field(
        None, description='a bus or a point on a circuit, such as "16"'
    )
    clear: str | None = Field(None, description='a clearing time, such as "8.2cyc" or "0.14s"')
    impedance: str = Field("0,0", description='a fault impedance R,X in pu, such as "0.01,0.05"')
    trip_machine: Annotated[str | list[str], BeforeValidator(_bus)] = Field(
        [], description='a machine or a list of machines, such as "9" (when the fault is cleared) or "9@0.5s" after it'
    )
    trip: str | list[str] = Field([], description='a circuit or a list of circuits, such as "16-21"')
    name: str | None = Field(None, description='text, such as "line 16-21"')


def _impedance(text: str) -> complex:
    """A fault impedance written as R,X (pu)."""
    try:
        r, x = map(float, text.split(","))
    except ValueError:
        raise StudyError(f"impedance = {text!r} is not allowed; write R,X in pu, such as '0.01,0.05'.") from None
    return complex(r, x)


def _machine_trip(text: str, clear: str | None, case: Case) -> Event:
    """The trip of a machine: `9` when the fault is cleared, `9@0.5s` so long after the instant of the fault."""
    if naming.machine_number(case, text) is not None or "@" not in text:
        text = f"{text}@{seconds(clear or 0.0, case.frequency_hz)!r}s"
    trip = events.event(text, case.frequency_hz, events.TripMachine)
    return replace(trip, at=AT + trip.at)


def checked(case: Case, given: Iterable[Contingency]) -> tuple[Contingency, ...]:
    """The contingencies, each with a fault and its clearing time or other events, possible, and each different."""
    out = tuple(given)
    if not out:
        raise StudyError("There are no contingencies to survive; give at least one.")
    met: dict[Any, int] = {}
    for i, one in enumerate(out, start=1):
        if not isinstance(one, Contingency):
            raise StudyError(f"Contingency {i} is {one!r}; write Contingency('16', clear='6cyc', trip='16-21').")
        where = f"Contingency {i} ({one.label})"
        if one.fault is None and not (one.trip or one.events):
            raise StudyError(f"{where} has no fault and no event; write Contingency('16', clear='6cyc', trip='16-21').")
        if one.fault is not None and one.clear is None:
            raise StudyError(f"{where} has no clearing time; write Contingency('16', clear='6cyc', trip='16-21').")
        clear = clearing_s(one, case)
        if one.fault is not None and not 0 < clear <= LONGEST:
            raise StudyError(
                f"{where} is cleared after {clear:g} s; give a clearing time above 0 and at most {LONGEST:g} s."
            )
        try:
            one.check(case)
            one = one.placed(case)
        except StudyError as error:
            raise StudyError(f"{where}: {error}") from None
        first = met.setdefault((one.fault, one.trip, clear, one.impedance, one.events), i)
        if first != i:
            raise StudyError(f"{where} is the same as contingency {first}; remove one of them.")
    return tuple(one.placed(case) for one in out)


def clearing_s(one: Contingency, case: Case) -> float:
    """Duration of the fault, s."""
    return seconds(one.clear or 0.0, case.frequency_hz)


def target_cycles(one: Contingency, case: Case) -> float | None:
    """Duration of the fault to be survived, in cycles of the case's frequency; None without a fault."""
    return None if one.fault is None else clearing_s(one, case) * case.frequency_hz


def without_fault(one: Contingency, case: Case) -> tuple[Contingency, float]:
    """A contingency without a fault, its first event at 0, and the instant (s) of its last event."""
    timed = one.timed(case)
    first = min(event.at for event in timed)
    moved = tuple(replace(event, at=event.at - first) for event in timed)
    return Contingency(events=moved, name=one.name), max(event.at for event in moved)


def operating_points(bases: Bases) -> dict[str, Case]:
    """The cases of a study by name: those of a mapping, of a list by the names of the cases, or a single one.

    Raises `StudyError` if there is none, or they differ in buses' numbers, machines' numbers, frequency or storage.
    """
    if isinstance(bases, Case | OperatingPoint):
        case = as_case(bases)
        return {case.name: case}
    if not isinstance(bases, Iterable) or isinstance(bases, str):
        raise StudyError(f"{shown(bases)} is not a system; give a case, a list of cases, or cases by name.")
    found: dict[str, Case] = {}
    named = bases.items() if isinstance(bases, Mapping) else (("", base) for base in bases)
    for name, base in named:
        case = as_case(base)
        name = str(name or case.name)
        count = sum(known.split("#")[0] == name for known in found) + 1
        found[name if count == 1 else f"{name}#{count}"] = case
    if not found:
        raise StudyError("There is no operating point; give at least one case.")
    (first_name, first), *others = found.items()
    for name, case in others:
        for what, of in _SAME.items():
            if of(case) != of(first):
                raise StudyError(
                    f"The operating points {first_name} and {name} differ in {what}; all of them need the same."
                )
    return found


_SAME = {
    "their buses": lambda case: [b.bus for b in case.buses],
    "their machines": lambda case: [(m.machine, m.bus) for m in case.machines],
    "their existing storage": lambda case: case.storage,
    "frequency": lambda case: case.frequency_hz,
}


class Scenario(NamedTuple):
    """A contingency at one of the operating points."""

    contingency: Contingency
    point: int = 0  # number of the operating point
    out: int | None = None  # row of the storage device out of service, the existing ones first
    scaled: tuple[int, float] | None = None  # row of a storage device, and the multiple of its rating


def scenarios(contingencies: Sequence[Contingency], points: int, devices: int | None = None) -> tuple[Scenario, ...]:
    """Every contingency at every operating point, and, given the number of devices, without each of them."""
    out = (None,) if devices is None else (None, *range(devices))
    return tuple(Scenario(one, point, row) for point in range(points) for one in contingencies for row in out)


def scaled(scenarios: Iterable[Scenario], device: int, multiple: float) -> tuple[Scenario, ...]:
    """The scenarios with the rating of one device (its row, existing ones first) multiplied."""
    return tuple(one._replace(scaled=(device, multiple)) for one in scenarios)

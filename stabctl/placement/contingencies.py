"""The scenarios that a fleet must survive: contingencies from a list, a screen or a file, at operating points.

A scenario is a contingency at one operating point, with or without a storage device out of service.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import StudyError, shown
from stabctl.clearing import Screen
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.io.contingencies import read_contingencies
from stabctl.io.contingencies.toml import checked, clearing_s
from stabctl.model.case import Case, as_case
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control, acting

Base = Case | OperatingPoint
Bases = Base | Iterable[Base] | Mapping[str, Base]
Contingencies = Iterable[Contingency] | Contingency | Screen | str | Path
COUNT, LONGER = 8, 1.2


def contingencies(case: Case, given: Contingencies, control: Control = None) -> tuple[Contingency, ...]:
    """The contingencies to be survived, checked against the case and without duplicates.

    Parameters
    ----------
    case : Case
        The system.
    given : Contingency, iterable of Contingency, Screen, str or Path
        A list, a screen (its most critical contingencies are taken), or a file.
    control : control law, Controller, sequence of them, or None
        What acts; under some, contingencies at other instants are others.

    Raises
    ------
    StudyError
        If it is none of these, or a contingency is not possible in the case or listed twice.
    """
    if isinstance(given, Screen):
        given = from_screen(given, case.frequency_hz)
    elif isinstance(given, str | Path):
        given = read_contingencies(given, case)
    elif isinstance(given, Contingency):
        given = (given,)
    elif not isinstance(given, Iterable):
        raise StudyError(f"{given!r} is not a list of contingencies; give [Contingency('16', clear='6cyc'), ...].")
    return checked(case, given, acting(control).timed)


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
            chosen[pair.machine] = pair.contingency.with_clear(longer * pair.cycles / hz)
    return tuple(chosen.values())[:count]


def packaged(case: str, classical: bool = False) -> Path | None:
    """The contingency file of a packaged case; None if it has none."""
    file = resources.files("stabctl") / "model" / "cases" / case / f"contingencies{'_classical' * classical}.toml"
    return Path(str(file)) if file.is_file() else None


def target_cycles(one: Contingency, case: Case) -> float | None:
    """Duration of the fault to be survived, in cycles of the case's frequency; None without a fault."""
    return None if one.fault is None else clearing_s(one, case) * case.frequency_hz


def without_fault(one: Contingency, case: Case, control: Control) -> tuple[Contingency, float]:
    """A contingency without a fault, and the instant (s) of its last event.

    Its first event is at 0, unless the control has instants of its own.
    """
    timed = one.timed(case)
    first = 0.0 if acting(control).timed else min(event.at for event in timed)
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

"""Scenarios that a fleet must survive: a contingency at an operating point, with or without a device out of service."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case, as_case
from stabctl.simulation.contingency import Contingency

Base = Case | OperatingPoint
Bases = Base | Iterable[Base] | Mapping[str, Base]


class Scenario(NamedTuple):
    """A contingency at one of the operating points."""

    contingency: Contingency
    point: int = 0  # number of the operating point
    out: int | None = None  # row of the storage device out of service, the existing ones first
    scaled: tuple[int, float] | None = None  # row of a storage device, and the multiple of its rating


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


def scenarios(contingencies: Sequence[Contingency], points: int, devices: int | None = None) -> tuple[Scenario, ...]:
    """Every contingency at every operating point, and, given the number of devices, without each of them."""
    out = (None,) if devices is None else (None, *range(devices))
    return tuple(Scenario(one, point, row) for point in range(points) for one in contingencies for row in out)


def scaled(scenarios: Iterable[Scenario], device: int, multiple: float) -> tuple[Scenario, ...]:
    """The scenarios with the rating of one device (its row, existing ones first) multiplied."""
    return tuple(one._replace(scaled=(device, multiple)) for one in scenarios)


def without_fault(one: Contingency, case: Case) -> tuple[Contingency, float]:
    """A contingency without a fault, its first event at 0, and the instant (s) of its last event."""
    timed = one.timed(case)
    first = min(event.at for event in timed)
    moved = tuple(replace(event, at=event.at - first) for event in timed)
    return Contingency(events=moved, name=one.name), max(event.at for event in moved)

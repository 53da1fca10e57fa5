"""How a run ended: one of four kinds, with a sentence a planner understands."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from stabctl.equilibrium import Point

from . import stepper
from .nets import Stage


class Kind(StrEnum):
    """What became of the system."""

    STABLE = "stable"
    LOST_SYNCHRONISM = "lost_synchronism"
    VOLTAGE_COLLAPSE = "voltage_collapse"
    ISLANDED = "islanded"


@dataclass(frozen=True)
class Outcome:
    """The end of a run."""

    kind: Kind
    message: str
    time_s: float  # s   when it ended
    machine: int | None = None  # number of the machine that went first
    bus: int | None = None  # number of the bus whose voltage collapsed

    @property
    def stable(self) -> bool:
        """Did every island stay in synchronism, with voltage?"""
        return self.kind in (Kind.STABLE, Kind.ISLANDED) and self.machine is None

    def __str__(self) -> str:
        return self.message


def outcome(point: Point, verdict: int, t: float, now: Stage, blame: stepper.Scratch, rules: stepper.Rules) -> Outcome:
    """The outcome of a run that ended at t (s) with a verdict of the stepper."""
    case = point.case
    number = case.machines[blame.rotor[0]].machine
    bus = case.buses[blame.bus[0]].bus
    cut = _cut_off(point, now)
    match verdict:
        case stepper.SLIPPED:
            where = " in its island" if cut else ""
            text = (
                f"Machine {number} lost synchronism at {t:.3f} s: its angle moved {np.rad2deg(rules.slip):.0f} degrees "
                f"against the centre of inertia{where}."
            )
            return Outcome(Kind.LOST_SYNCHRONISM, f"{text} {cut}".strip(), t, machine=number)
        case stepper.RUNAWAY:
            text = f"Machine {number} left {rules.slowest:g} to {rules.fastest:g} pu of speed at {t:.3f} s."
            kind = Kind.ISLANDED if cut else Kind.LOST_SYNCHRONISM
            return Outcome(kind, f"{text} {cut}".strip(), t, machine=number)
        case stepper.NO_VOLTAGE:
            text = f"Voltage collapse at bus {bus} at {t:.3f} s: no voltages carry the loads and storage."
            return Outcome(Kind.VOLTAGE_COLLAPSE, f"{text} {cut}".strip(), t, bus=bus)
        case stepper.LOW_VOLTAGE:
            text = (
                f"Voltage collapse at bus {bus} at {t:.3f} s: its voltage stayed below what its load needs "
                f"for {rules.low_voltage_s:g} s without a fault."
            )
            return Outcome(Kind.VOLTAGE_COLLAPSE, f"{text} {cut}".strip(), t, bus=bus)
    if cut:
        return Outcome(Kind.ISLANDED, f"{cut} Every island stayed in synchronism until {t:.3f} s.", t)
    return Outcome(Kind.STABLE, f"All machines stayed in synchronism until {t:.3f} s.", t)


def _cut_off(point: Point, now: Stage) -> str:
    """What the switching has cut off from the island of the largest inertia; empty where nothing."""
    where = now.island_of_bus
    if where.max() == 0:
        return ""
    on = now.net.island >= 0
    weight = np.bincount(where[point.net.machine_bus], point.plant.inertia * on, minlength=where.max() + 1)
    main = int(weight.argmax())
    parts = []
    for k in (k for k in range(where.max() + 1) if k != main):
        buses = [b.bus for b, island in zip(point.case.buses, where, strict=True) if island == k]
        places = zip(point.case.machines, point.net.machine_bus, on, strict=True)
        machines = [m.machine for m, at, runs in places if where[at] == k and runs]
        rest = f"with {_listed('machine', machines)}" if machines else "without a machine: dead, its load lost"
        parts.append(f"{_listed('bus', buses)} {rest}")
    return f"The switching cut off {'; and '.join(parts)}."


def _listed(noun: str, numbers: list[int]) -> str:
    plural = {"bus": "buses"}.get(noun, noun + "s")
    shown = ", ".join(map(str, numbers[:8])) + (f" and {len(numbers) - 8} more" if len(numbers) > 8 else "")
    return f"{noun if len(numbers) == 1 else plural} {shown}"


__all__ = ["Kind", "Outcome", "outcome"]

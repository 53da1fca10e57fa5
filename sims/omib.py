"""Section 2: one machine on an infinite bus (Table 1, Figures 3 to 5). Phase plane, equal area, loss of synchronism."""

import math
from collections.abc import Iterator
from pathlib import Path

from reproduction import paper
from reproduction.comparison import Comparison
from reproduction.study import Picture, Study, draw, present
from stabctl.theory.equal_area import EqualArea, critical_clearing, equal_area, simulated_critical_time
from stabctl.theory.omib import OMIB, during_fault, swing_curve, table1
from stabctl.theory.phase_plane import PhasePortrait, portrait
from stabctl.view.figures import one_machine
from stabctl.view.figures import one_machine as areas

REACTANCE = "The printed angle and speeds need 0.95 pu: the lines and 0.20 pu more, which the text does not mention."
SPEED = "Ours is the closed form, speed wb Pm t/(2H). The paper's speeds are 0.14 % lower, its angles accordingly."


def study(reports: Path) -> Study:
    """Faults of 6, 12 and 15 cycles, the critical clearing time, and the areas of two of the faults."""
    machine = OMIB()
    faults, critical = portrait(machine), critical_clearing(machine)
    stable, unstable = (area(machine, cycles) for cycles in (12, 15))
    _, speed = during_fault(machine, machine.seconds(12))
    equal = math.isclose(stable.A1, machine.M * speed**2 / 2)
    simulated = simulated_critical_time(machine)
    comparisons = (
        paper.OMIB_INERTIA.compare(machine.H),
        paper.OMIB_POWER.compare(machine.Pm),
        paper.OMIB_REACTANCE.compare(machine.X, REACTANCE),
        paper.OMIB_START.compare(machine.start),
        *table_1(machine, faults),
        paper.AREA.compare("equal" if equal else "different"),
        paper.AREAS_15.compare("sufficient" if unstable.stable else "too small"),
    )
    text = f"Equal area: {critical}. By simulation: {simulated:.6f} s. The {faults.separatrix}."
    return Study(
        "One machine on an infinite bus",
        "2",
        (text, paper.ERRATA["2"]),
        comparisons,
        pictures=tuple(pictures(reports, machine, faults, (stable, unstable))),
    )


def area(machine: OMIB, cycles: float) -> EqualArea:
    """The areas of a fault of so many cycles."""
    angle, _ = during_fault(machine, machine.seconds(cycles))
    return equal_area(machine, angle)


def table_1(machine: OMIB, faults: PhasePortrait) -> Iterator[Comparison]:
    """Table 1, and whether the faults of Figure 3 are stable."""
    outcomes = {
        state.cycles: "stable" if curve.stable else "unstable"
        for state, curve in zip(faults.cleared, faults.curves, strict=True)
    }
    for state in table1(machine, tuple(paper.TABLE_1)):
        angle, speed, *outcome = paper.TABLE_1[state.cycles]
        remark = SPEED if outcome else ""
        yield angle.compare(state.angle, remark)
        yield speed.compare(state.speed, remark)
        yield from (printed.compare(outcomes[state.cycles]) for printed in outcome)


def pictures(
    reports: Path, machine: OMIB, faults: PhasePortrait, fault_areas: tuple[EqualArea, EqualArea]
) -> Iterator[Picture]:
    """Figures 3, 4 and 5."""
    stable, unstable = fault_areas
    yield draw(
        one_machine.plot_phase_plane(faults),
        reports / "figure03_phase_plane.png",
        "Phase plane",
        alt="Speed against angle. After 6 and 12 cycles the machine circles inside the stability region; after 15 "
        "cycles it leaves the region.",
        caption="Dotted: the boundary of the stability region. Thick: the motion during the fault, A to B, C and D.",
        of="3",
    )
    yield draw(
        areas.plot_equal_area(stable),
        reports / "figure04_equal_area.png",
        "Equal areas",
        alt="Power against angle. Area A1 lies below the mechanical power up to clearing; A2, above it, is as large.",
        caption="A fault of 12 cycles. The paper draws its figure for a general fault.",
        of="4",
    )
    yield draw(
        areas.in_time(unstable, swing_curve(machine, machine.seconds(15), until=0.8)),
        reports / "figure05_unstable.png",
        "Loss of synchronism",
        alt="Left: area A2 is smaller than A1. Right: speed and acceleration fall after clearing and rise again.",
        caption="A fault of 15 cycles. The speed does not reach zero before the unstable equilibrium.",
        of="5a, 5b",
    )


if __name__ == "__main__":
    present(study)

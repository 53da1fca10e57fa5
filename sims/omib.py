"""Section 2 on one machine (Table 1, Figures 3 to 5): phase plane, equal area, a lost fault in time."""

import math
from collections.abc import Iterator
from pathlib import Path

from stabctl.plotting import equal_area as areas
from stabctl.plotting import phase_plane
from stabctl.report import paper
from stabctl.report.study import Comparison, Study, draw
from stabctl.report.study_console import present
from stabctl.theory.equal_area import critical_clearing, equal_area, simulated_critical_time
from stabctl.theory.omib import OMIB, during_fault, table1
from stabctl.theory.phase import PhasePortrait, portrait
from stabctl.theory.swing_curve import swing_curve

REACTANCE = "The printed angle and speeds need 0.95 pu: the lines and 0.20 pu more, which the text does not mention."
FAULT = "Ours is the closed form, speed wb Pm t/(2H); the paper's speeds are 0.14 % below it, the angles accordingly."


def study(reports: Path) -> Study:
    """Faults of 6, 12 and 15 cycles, the longest one that is survived, and the areas of two of them."""
    m = OMIB()
    faults, longest = portrait(m), critical_clearing(m)
    survived, lost = (equal_area(m, during_fault(m, m.seconds(cycles))[0]) for cycles in (12, 15))
    same = math.isclose(survived.A1, m.M * during_fault(m, m.seconds(12))[1] ** 2 / 2)
    figures = (
        draw(
            phase_plane.plot(faults),
            reports,
            "figure03_phase_plane.png",
            "Phase plane",
            "Speed against angle: inside a dotted drop, faults of 6 and 12 cycles circle; that of 15 cycles leaves it.",
            "Dotted the stability region; thick the motion in the fault, from A to B, C and D.",
            "3",
        ),
        draw(
            areas.plot(survived),
            reports,
            "figure04_equal_area.png",
            "Equal areas",
            "Power against angle: below the mechanical power area A1 up to clearing, above it A2 of the same size.",
            "The fault of 12 cycles; the paper draws its picture for a fault in general.",
            "4",
        ),
        draw(
            areas.in_time(lost, swing_curve(m, m.seconds(15), until=0.8)),
            reports,
            "figure05_lost.png",
            "A lost fault",
            "Left: area A2 is smaller than A1. Right: angle, speed and acceleration dip after clearing and grow again.",
            "The fault of 15 cycles: the speed does not reach zero before the unstable equilibrium.",
            "5a, 5b",
        ),
    )
    text = f"Longest fault: {longest}; by simulations {simulated_critical_time(m):.6f} s. A {faults.separatrix}."
    rows = (
        paper.OMIB_INERTIA.beside(m.H),
        paper.OMIB_POWER.beside(m.Pm),
        paper.OMIB_REACTANCE.beside(m.X, REACTANCE),
        paper.OMIB_START.beside(m.start),
        *table_1(m, faults),
        paper.AREA.beside("equal" if same else "different"),
        paper.AREAS_15.beside("enough" if lost.stable else "too small"),
    )
    return Study("One machine on an infinite bus", "2", (text, paper.ERRATA["2"]), rows, pictures=figures)


def table_1(m: OMIB, faults: PhasePortrait) -> Iterator[Comparison]:
    """Table 1, and what becomes of the faults in Figure 3."""
    fates = {c.cycles: "stable" if r.stable else "lost" for c, r in zip(faults.cleared, faults.curves, strict=True)}
    for c in table1(m, tuple(paper.TABLE_1)):
        angle, speed, *fate = paper.TABLE_1[c.cycles]
        why = FAULT if fate else ""
        yield from (angle.beside(c.angle, why), speed.beside(c.speed, why), *(f.beside(fates[c.cycles]) for f in fate))


if __name__ == "__main__":
    present(study)

"""Section 4 on two machines: equal area with absorbed power, and the control that stops the machine soonest."""

from pathlib import Path

from stabctl.plotting import equal_area, minimum_time
from stabctl.report import paper
from stabctl.report.study import Comparison, Study, Table, draw
from stabctl.report.study_console import present
from stabctl.theory.collocation import by_collocation
from stabctl.theory.convex_program import by_convex_program
from stabctl.theory.minimum_time import MinimumTime, MinimumTimeProblem
from stabctl.theory.shooting import by_shooting
from stabctl.theory.two_machine import Equivalent

POWERS = 0.0, 0.1, 0.2, 0.3, 0.4, 0.5


def study(reports: Path) -> Study:
    """Table 2 and Figures 9 to 11; the minimum time by three methods."""
    pair = Equivalent()
    without, absorbing = pair.equal_area(8), pair.equal_area(8, Pc=0.5)
    problem = pair.minimum_time_problem(6)
    control = by_shooting(problem)
    from_guess, convex = by_collocation(problem, paper.GUESS), by_convex_program(problem)
    longest = tuple(
        (f"{power:g}", f"{c.time:.6f}", f"{c.cycles:.3f}") for power in POWERS for c in [pair.critical(power)]
    )
    figures = (
        draw(
            equal_area.compare({"(a) ": without, "(b) ": absorbing}),
            reports,
            "figure09_two_machine.png",
            "Equal areas of two machines",
            "Power against angle: (a) area A2 is too small; (b) the absorbed power lifts the curve and A2 suffices.",
            "An eight-cycle fault, lost without the device and survived with it. Of P_C = 0.5 pu the share M/M1 = 6/7 "
            "acts on the angle between the machines.",
            "9",
        ),
        draw(
            minimum_time.states(control),
            reports,
            "figure10_states.png",
            "States and co-states",
            "The angle rises and levels off, the speed falls to zero; lambda1 rises to zero, lambda2 stays positive.",
            "From the release, at 0.60 s of the paper's time, to rest.",
            "10",
        ),
        draw(
            minimum_time.power(control),
            reports,
            "figure11_power.png",
            "Absorbed power",
            "Full power from release to rest.",
            "",
            "11",
        ),
    )
    text = (
        f"Shooting: {control}. Collocation, from the paper's first guess of the co-states {paper.GUESS}: {from_guess}. "
        f"Convex program: {convex}. The co-states at release are "
        f"{control.lambda1[0]:.5f} s/rad and {control.lambda2[0]:.6f} s²/rad.",
        paper.ERRATA["4"],
    )
    tables = (Table("Critical clearing with absorbed power", ("P_C, pu", "s", "cycles"), longest),)
    return Study("Two machines and minimum time", "4", text, rows(pair, problem, control), tables, figures)


def rows(pair: Equivalent, problem: MinimumTimeProblem, control: MinimumTime) -> tuple[Comparison, ...]:
    """Table 2, and the shape of the control."""
    values = vars(pair) | vars(problem) | {"start": pair.omib.start}
    pulse = control.feasible and not control.switches and (control.Pc == problem.Pc_max).all()
    return (
        *(printed.beside(values[key]) for key, printed in paper.TABLE_2.items()),
        paper.PULSE.beside("absorbs P_Cmax throughout" if pulse else "switches"),
        paper.CO_STATE.beside("positive" if (control.lambda2 > 0).all() else "changes"),
    )


if __name__ == "__main__":
    present(study)

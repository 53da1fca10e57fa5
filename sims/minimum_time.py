"""Section 4: two machines (Table 2, Figures 9 to 11). Equal area with absorbed power, and minimum-time control."""

from collections.abc import Iterator
from pathlib import Path

from reproduction import paper
from reproduction.comparison import Comparison
from reproduction.study import Picture, Study, Table, draw, present
from stabctl.theory.convex_program import by_convex_program
from stabctl.theory.minimum_time import MinimumTime, MinimumTimeProblem, by_collocation, by_shooting
from stabctl.theory.two_machine import Equivalent
from stabctl.view.figures import one_machine

POWERS = 0.0, 0.1, 0.2, 0.3, 0.4, 0.5  # pu
HEADS = "P_C (pu)", "critical clearing time (s)", "(cycles)"


def study(reports: Path) -> Study:
    """Table 2 and Figures 9 to 11, and the minimum time by three methods."""
    pair = Equivalent()
    problem = pair.minimum_time_problem(6)
    control = by_shooting(problem)
    collocation, convex = by_collocation(problem, paper.GUESS), by_convex_program(problem)
    text = (
        f"Shooting: {control} Collocation, from the paper's first guess {paper.GUESS} of the co-states: "
        f"{collocation} Convex program: {convex} The co-states at clearing are {control.lambda1[0]:.5f} s/rad and "
        f"{control.lambda2[0]:.6f} s²/rad."
    )
    critical = {power: pair.critical(power) for power in POWERS}
    rows = tuple((f"{power:g}", f"{c.time:.6f}", f"{c.cycles:.3f}") for power, c in critical.items())
    return Study(
        "Two machines and minimum time",
        "4",
        (text, paper.ERRATA["4"]),
        tuple(comparisons(pair, problem, control)),
        (Table("Critical clearing with absorbed power", HEADS, rows),),
        tuple(pictures(reports, pair, control)),
    )


def comparisons(pair: Equivalent, problem: MinimumTimeProblem, control: MinimumTime) -> Iterator[Comparison]:
    """Table 2, and the shape of the control."""
    values = vars(pair) | vars(problem) | {"start": pair.omib.start}
    yield from (printed.compare(values[key]) for key, printed in paper.TABLE_2.items())
    full_power = control.feasible and not control.switches and (control.Pc == problem.Pc_max).all()
    yield paper.PULSE.compare("absorbs P_Cmax throughout" if full_power else "switches")
    yield paper.CO_STATE.compare("positive" if (control.lambda2 > 0).all() else "changes")


def pictures(reports: Path, pair: Equivalent, control: MinimumTime) -> Iterator[Picture]:
    """Figures 9, 10 and 11."""
    yield draw(
        one_machine.compare({"(a) ": pair.equal_area(8), "(b) ": pair.equal_area(8, Pc=0.5)}),
        reports / "figure09_two_machine.png",
        "Equal areas of two machines",
        alt="Power against angle. (a) Area A2 is too small. (b) The absorbed power lifts the curve; A2 is sufficient.",
        caption="A fault of eight cycles, unstable without the device (a) and stable with it (b). Of P_C = 0.5 pu, the "
        "share M/M1 = 6/7 acts on the angle between the machines.",
        of="9",
    )
    yield draw(
        one_machine.states(control),
        reports / "figure10_states.png",
        "States and co-states",
        alt="The angle levels off and the speed falls to zero; lambda1 rises to zero and lambda2 stays positive.",
        caption="From clearing, at 0.60 s of the paper's time, to rest.",
        of="10",
    )
    yield draw(
        one_machine.power(control),
        reports / "figure11_power.png",
        "Absorbed power",
        alt="Full power from clearing to rest.",
        of="11",
    )


if __name__ == "__main__":
    present(study)

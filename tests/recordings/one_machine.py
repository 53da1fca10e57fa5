"""Studies of one machine against a bus in other ways, of figures and pages, and of reference systems."""

from dataclasses import replace
from functools import cache

import matplotlib.pyplot as plt
import numpy as np
from described import drawn
from mixed import mixed, mixed_point, second
from recordings.answers import refused
from recordings.features import FAULT, SHORT, run_of_every_event
from recordings.studies import recorded, second_point
from systems import CLASSICAL, small

import stabctl as st
from stabctl.theory import convex_program, equal_area, feedback_laws, minimum_time, omib, phase_plane, two_machine
from stabctl.verification import systems, traces
from stabctl.view.diagram import _layout
from stabctl.view.figures import clearing, one_line, one_machine, style, trajectory
from stabctl.view.figures import verification as figure_of_verification

UNEVEN = omib.OMIB(H=3.7, Pm=0.62, X=0.81, V0=1.02, V1=1.09, Xpost=0.94, Xfault=2.6, fb=50.0)
PROBLEM = two_machine.Equivalent().minimum_time_problem(6)
SWITCHED = replace(PROBLEM, x1=-1.5, x2=2.0)
AT_LIMIT = replace(PROBLEM, x1=-2.102, x2=6.7687, Pm=0.8359, Pc_min=-1.083, Pc_max=1.008)
BACK = SWITCHED.mirrored()
HOPELESS = replace(PROBLEM, x2=40.0)


@recorded("an uneven machine", loose=1e-5)
def _():
    area = equal_area.equal_area(UNEVEN, 1.05, 0.09)
    curve = omib.swing_curve(UNEVEN, 0.11, omib.against_speed(0.13), until=2.3)
    lost = omib.swing_curve(UNEVEN, 0.9, until=3.0)
    angle, speed = np.array([0.3, 1.1, 2.4]), np.array([-2.0, 1.0, 6.5])
    laws = (
        feedback_laws.FeedbackLaw("speed", 0.03, 0.0, False),
        feedback_laws.FeedbackLaw("both", 0.011, -0.003, False),
        feedback_laws.FeedbackLaw("size", 0.0, 0.006, True),
    )
    feedback = feedback_laws.compare(UNEVEN, 4.3, laws, until=2.0)
    return {
        "machine": UNEVEN,
        "table": omib.table1(UNEVEN, (0, 4, 7.5)),
        "area": area,
        "critical": [equal_area.critical_clearing(UNEVEN, p) for p in (0.0, 0.21)],
        "simulated": [equal_area.simulated_critical_time(UNEVEN, p, 1e-6) for p in (0.0, 0.21)],
        "curves": [curve, str(lost)],
        "inside": [phase_plane.inside(UNEVEN, angle, speed), phase_plane.energy(UNEVEN, angle, speed)],
        "laws": [str(feedback), feedback.df],
        "figures": [
            drawn(one_machine.in_time(area, curve)),
            drawn(one_machine.plot_swing_curve(curve)),
            drawn(one_machine.compare({"one": area, "other": equal_area.equal_area(UNEVEN, 0.93)})),
            drawn(one_machine.feedback(feedback)),
        ],
    }


def told(found):
    """What a control in the shortest time says, and some of its numbers."""
    ends = [found.x1[-1], found.x2[0], found.Pc[0], found.Pc[-1]] if found.feasible else []
    return [str(found) if not ends or found.x2[0] > 0 else "", found.duration, found.switches, ends]


PROBLEMS = {"plain": PROBLEM, "switched": SWITCHED, "at the limit": AT_LIMIT, "back": BACK, "hopeless": HOPELESS}


@recorded("the shortest time as a convex program", slow=True, loose=1e-4)
def _():
    found = {name: convex_program.by_convex_program(p, 14, 1e-5) for name, p in PROBLEMS.items() if name != "plain"}
    return {name: [str(one), one.duration, one.Pc] for name, one in found.items()}


@recorded("the shortest time in other ways", slow=True, loose=1e-4)
def _():
    hopeless = HOPELESS.mirrored()
    return {
        "shooting": {name: told(minimum_time.by_shooting(p)) for name, p in PROBLEMS.items()},
        "collocation": {name: told(minimum_time.by_collocation(p)) for name, p in PROBLEMS.items()},
        "guess": told(minimum_time.by_collocation(BACK, (-0.1, -0.2))),
        "mirrored": [str(minimum_time.by_shooting(hopeless)), minimum_time.stop_angle(BACK)],
        "figure": drawn(one_machine.states(minimum_time.by_shooting(SWITCHED))),
    }


@cache
def no_field():
    return small({"gencls": CLASSICAL})


WRONG = {
    "no equilibrium": lambda: omib.OMIB(Pm=1.2),
    "none afterwards": lambda: omib.OMIB(Pm=0.9, Xpost=1.2),
    "lost at once": lambda: equal_area.critical_clearing(omib.OMIB(Pm=0.9, X=0.5, Xpost=1.1)),
    "always stable": lambda: equal_area.critical_clearing(omib.OMIB(Pm=0.1, Xfault=1.1)),
    "angle": lambda: equal_area.equal_area(UNEVEN, 3.0),
    "angle not reached": lambda: equal_area.equal_area(omib.OMIB(Xfault=1.3), 1.4),
    "absorbed": lambda: equal_area.critical_clearing(UNEVEN, -1.0),
    "long fault": lambda: omib.table1(UNEVEN, (1e9,)),
    "late clearing": lambda: omib.swing_curve(UNEVEN, 3.0, until=2.0),
    "gain": lambda: feedback_laws.respond(UNEVEN, 0.1, feedback_laws.FeedbackLaw("high", 1e9, 0.0, False)),
    "acceleration": lambda: feedback_laws.respond(UNEVEN, 0.1, feedback_laws.FeedbackLaw("low", 0.01, -1.0, False)),
    "size": lambda: feedback_laws.respond(UNEVEN, 0.1, feedback_laws.FeedbackLaw("size", 0.0, 1.0, True)),
    "growing": lambda: feedback_laws.respond(UNEVEN, 0.1, feedback_laws.FeedbackLaw("wrong", -0.2, 0.0, False)),
    "powers": lambda: replace(PROBLEM, Pc_min=0.7, Pc_max=0.1),
    "no rest": lambda: replace(PROBLEM, Pm=5.0),
    "at rest": lambda: replace(PROBLEM, x2=0.0),
    "alone": lambda: two_machine.equivalent(replace(no_field(), machines=no_field().machines[1:]), 2),
    "system": lambda: st.verify("wscc9_sauer"),
    "figure": lambda: one_line.plot(second(), 3),
    "axes": lambda: second().plot(ax=3),
    "file": lambda: style.save(second().plot(), "one.xyz"),
}


@recorded("wrong machines and figures")
def _():
    found = {name: refused(lambda _, call=call: call(), None) for name, call in WRONG.items()}
    plt.close("all")
    return found


@cache
def of_many():
    """A run in which more machines are lost than there are colors, or none of many."""
    case = st.replicate(st.load("wscc9"), 3, x=0.02, spread=0.03)
    return case.initialize().simulate(st.Contingency("7", clear="3cyc", at=0.05), "0.4s", every="40ms")


@recorded("figures of several", loose=1e-5)
def _():
    run, many = run_of_every_event(), of_many()
    times = {"one": [5.2, 6.1, 7.7], "other": [3.9, 4.4, 6.6]}
    screened = second_point().screen(faults=["2-3#1@0.3", "2-3#2@0.7", "5-2@0.2", "5"], workers=1, **SHORT)
    return {
        "runs": drawn(trajectory.compare({"first": run, "second": mixed_point().simulate(FAULT, "0.3s")}, "speed")),
        "many": drawn(many.plot("speed")),
        "buses of many": drawn(many.plot("voltage")),
        "times": drawn(clearing.compare([0, 10, 20], times, xlabel="delay (ms)", reference={"one": 8.1, "other": 7.3})),
        "panels": drawn(
            clearing.panels(
                {"noise (deg)": ([0.1, 1], {"a": [6, 5], "b": [4, 3]}), "loss": ([2, 3], {"a": [5, 4], "b": [3, 2]})},
                {"a": 6.5, "b": 4.5},
            )
        ),
        "circuits": drawn(one_line.plot(second(), screened)),
    }


def spaced(positions):
    """Distances between all nodes, which no turning or mirroring changes."""
    return np.abs(positions[:, None] - positions).sum(axis=2)


@recorded("places of a diagram", loose=1e-2)
def _():
    case, plain = mixed(), second()
    some = replace(
        plain, buses=tuple(b._replace(x=2.0 * k, y=1.0 - k) if k % 2 else b for k, b in enumerate(plain.buses))
    )
    g = _layout.graph(plain)
    return {
        "nodes": [g.nodes, g.ends, g.length, g.neighbors(), g.lengths(), g.distances(_layout.backbone(g.neighbors()))],
        "backbone": [_layout.backbone(_layout.graph(one).neighbors()) for one in (case, st.load("ieee39"))],
        "apart": _layout.graph(case).distances(np.arange(0, 18, 3)),
        "second": spaced(_layout.node_positions(plain)),
        "both": spaced(_layout.node_positions(case)),
        "given": _layout.node_positions(some),
    }


@recorded("reference systems", loose=1e-5)
def _():
    names = "wscc9_classical", "pst_d2asb_exc1", "kundur_two_area_manual", "wscc9_sauer_pai"
    found = {name: st.verify(name) for name in names}
    every = systems.systems()
    run = next(s for s in every.values() if s.run and not s.files)
    every_trace = traces.traces(run, run.read(None))
    return {
        **{name: [str(one), list(one.largest())] for name, one in found.items()},
        "figure": drawn(figure_of_verification.plot(found["pst_d2asb_exc1"])),
        "sentences": [list(one.sentences()) for one in every.values()][::7],
        "traces": [[t.signal, t.unit, t.worst, t.ours[t.worst], t.theirs[t.worst]] for t in every_trace],
        "missing": str(replace(found["wscc9_classical"], missing=("a", "b"))),
    }

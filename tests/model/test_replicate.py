"""Copies of a case: the same operating point in each, and nothing in the ties."""

from dataclasses import replace

import numpy as np
import pytest
from islands import SHIFT, joined, single

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.model import fleet, powerflow
from stabctl.model.replicate import replicate
from stabctl.model.tables import Link
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run
from stabctl.smallsignal import analyze, linearize


@pytest.mark.parametrize("name", ["two_area", "wnaps"])
def test_every_copy_has_the_operating_point_of_the_case(name):
    case = io.load(name)
    alone, flow = powerflow.solve(case), powerflow.solve(replicate(case, 4))
    V, S = flow.V.reshape(4, -1), flow.S.reshape(4, -1)
    assert np.abs(V - alone.V).max() < 1e-9  # 3e-14
    assert np.abs(S - alone.S).max() < 1e-8  # 9e-13
    assert [b.kind for b in flow.case.buses].count("swing") == 1


@pytest.mark.parametrize("tie_bus", [None, SHIFT + 2])
def test_islands_that_are_not_tied_keep_their_swing_buses(cases, tie_bus):
    two_area = cases("two_area")
    case = joined(two_area, single(two_area, 300.0))
    alone, flow = powerflow.solve(case), powerflow.solve(replicate(case, 3, tie_bus=tie_bus))
    assert np.abs(flow.V.reshape(3, -1) - alone.V).max() < 1e-9
    assert np.abs(flow.S.reshape(3, -1) - alone.S).max() < 1e-8
    swings = [b.bus for b in flow.case.buses if b.kind == "swing"]
    tied, other = (3, SHIFT + 1) if tie_bus is None else (SHIFT + 1, 3)
    assert sorted(swings) == sorted([tied, *(other + k * 10_000 for k in range(3))])


def test_numbers_say_which_copy():
    case = io.load("two_area")
    case = replace(case.with_storage(fleet.everywhere(case, "50MW")), links=(Link("dc", 7, 9, 0.0),))
    three = replicate(case, 3)
    assert [m.machine for m in three.machines] == [k + i for k in (0, 100, 200) for i in (1, 2, 3, 4)]
    assert [(s.machine, s.bus) for s in three.storage][-1] == (204, 210)
    assert set(three.devices["sexs"]) == {m.machine for m in three.machines}
    assert [k.link for k in three.links] == ["dc", "dc 100", "dc 200"]
    ties = three.branches[-2:]
    assert [(k.from_bus, k.to_bus) for k in ties] == [(11, 111), (111, 211)]


def test_buses_have_the_voltages_solved_so_that_the_flow_of_any_number_is_known():
    """From those of the case's table, the power flow of 100 copies ended in another solution: 0.83 pu at bus 18."""
    case = io.load("wnaps")
    flow = powerflow.solve(replicate(case, 100))
    assert flow.iterations == 0
    assert np.abs(flow.V.reshape(100, -1) - powerflow.solve(case).V).max() < 1e-12  # 4e-16


def test_a_copy_far_from_the_fault_hardly_moves():
    point = operating_point.solve(replicate(io.load("two_area"), 2, x=1e4))
    motion = run(point, Contingency("7", 0.1, ["7-8"]), 2.0)
    alone = run(operating_point.solve(io.load("two_area")), Contingency("7", 0.1, ["7-8"]), 2.0)
    assert np.abs(motion.speed[:, :4] - alone.speed).max() < 1e-6  # 9e-8
    assert np.abs(motion.speed[:, 4:] - 1).max() < 1e-6  # 8e-8


def test_ties_add_the_swings_between_copies():
    modes = analyze(linearize(operating_point.solve(replicate(io.load("two_area_manual"), 2, spread=0.1))))
    assert len(modes.swings()) == 7
    H = modes.linear.point.inertia
    assert H[4:] == pytest.approx(1.1 * H[:4])


def test_what_is_not_possible_is_said():
    case = io.load("two_area")
    for copies, options, what in (
        (0, {}, "at least 1"),
        (2, {"tie_bus": 99}, "has no bus 99"),
        (2, {"x": 0.0}, "above 0"),
    ):
        with pytest.raises(StudyError, match=what):
            replicate(case, copies, **options)


def test_names_in_copies_are_their_own(cases):
    """Machine 1/1 of the second copy is 101/1, and a bus name has the number that is added."""
    case = cases("two_area")
    named = replace(
        case,
        machines=tuple(m._replace(name=f"{m.bus}/1") for m in case.machines),
        buses=tuple(b._replace(name=f"bus {b.bus}") for b in case.buses),
    )
    twice = replicate(named, 2)
    assert [m.name for m in twice.machines[4:]] == [f"{m.bus}/1" for m in twice.machines[4:]]
    assert len({b.name for b in twice.buses}) == len(twice.buses)

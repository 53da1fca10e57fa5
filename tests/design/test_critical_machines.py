"""The machines that leave together."""

from types import SimpleNamespace

import numpy as np
import pytest

from stabctl.clearing.trial import Search, Trial
from stabctl.design.critical_machines import Group, critical_machines, disjoint, slow_areas
from stabctl.simulation.contingency import Contingency


@pytest.mark.parametrize(
    ("name", "fault", "trip", "machines"),
    [
        ("two_area", "7-8@0.4", (), {3, 4}),
        ("two_area", "9", "9-8", {3, 4}),
        ("wnaps_paper", "83", "83-33", {13, 14}),
    ],
)
def test_the_group_is_found_from_the_run_that_is_lost(points, name, fault, trip, machines):
    point = points(name)
    group = critical_machines(Trial(point, Contingency(fault, trip=trip), None, Search()), slow_areas(point.modes()))
    assert set(group.machines) == machines
    assert group.coherent
    assert group.first in group.unstable


def test_a_machine_that_just_held_belongs_to_the_group(points):
    """At clearing machine 13 has 0.61 times the speed of machine 14, which loses synchronism alone."""
    point = points("wnaps_paper")
    group = critical_machines(
        Trial(point, Contingency("83", trip="83-33"), None, Search()), slow_areas(point.modes()), 5.25
    )
    assert group.unstable == (14,)
    assert str(group) == "machine 14 loses synchronism with 13 (one coherent area)"
    assert group.cycles == 5.25


def test_no_group_if_nothing_is_lost(points):
    point = points("two_area")
    search = Search(limit_cycles=2.0, resolution_cycles=1.0)
    assert critical_machines(Trial(point, Contingency("7-8@0.4"), None, search), slow_areas(point.modes())) is None


def test_groups_of_a_law_have_no_common_machine():
    found = [Group(m, m[0], m, m, 1.0) for m in ((1, 2), (3,), (2, 3), (4, 5))]
    assert disjoint(found) == ((1, 2), (4, 5))


@pytest.mark.parametrize(("name", "one", "cycles"), [("ieee39", "21", 30.0), ("ieee39", "2", 20.0)])
def test_a_group_is_at_least_half_as_fast_at_clearing_as_the_first_machine(points, name, one, cycles):
    """Relative to the center of inertia, in the same direction; here all machines are in one area."""
    point, search = points(name), Search(0.25, 60.0, observed_s=3.0)
    all_of = tuple(m.machine for m in point.case.machines)
    group = critical_machines(
        Trial(point, Contingency(one), None, search), SimpleNamespace(groups=(all_of,), of=lambda _: 0), cycles
    )
    run = point.simulate(Contingency(one, clear=f"{cycles}cyc", at=0.0), "0.6s")
    w = run.arrays.speed[np.searchsorted(run.time, cycles / point.case.frequency_hz - 1e-9)] - 1
    w = w - w @ point.inertia / point.inertia.sum()
    lead = w[all_of.index(group.first)]
    assert set(group.machines) == {m for m, x in zip(all_of, w, strict=True) if x * np.sign(lead) >= 0.5 * abs(lead)}
    assert 1 <= len(group.machines) < len(all_of)

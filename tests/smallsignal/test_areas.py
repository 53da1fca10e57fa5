"""Coherent areas: Kundur's two, and what a topology change does to them."""

from dataclasses import replace

import pytest

from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, areas, linearize, opened


def test_the_two_areas(modes):
    for name in ("two_area", "two_area_manual", "two_area_pss"):
        found = areas(modes(name))
        assert {frozenset(g) for g in found.groups} == {frozenset({1, 2}), frozenset({3, 4})}
        assert found.agreement > 0.95  # 0.99


def test_the_number_of_areas_may_be_chosen(modes):
    assert areas(modes("two_area"), 1).groups == ((1, 2, 3, 4),)
    assert sorted(map(len, areas(modes("two_area"), 4).groups)) == [1, 1, 1, 1]
    with pytest.raises(StudyError, match=r"into 5 areas: .* choose 1 to 4"):
        areas(modes("two_area"), 5)


def test_neighbors_stay_together_in_the_western_system(modes):
    found = areas(modes("wnaps"), 8)
    assert found.of(13) == found.of(14)
    assert found.of(1) == found.of(2) == found.of(3)
    assert found.of(34) != found.of(1)
    assert sorted(m for g in found.groups for m in g) == list(range(1, 35))
    point = modes("wnaps").linear.point
    inertia = [sum(point.inertia[point.rotor_names.index(m)] for m in g) for g in found.groups]
    assert inertia == sorted(inertia, reverse=True)


def test_long_areas_are_cut_where_they_are_printed(modes):
    found = areas(modes("two_area"))
    wide = replace(found, groups=(tuple(range(1, 101)), *((k,) for k in range(101, 200))))
    assert "100 areas: 1, 2, 3, " in str(wide)
    assert " 40 and 60 more; 101; " in str(wide)
    assert str(wide).endswith("; 139; and 60 more")


def test_areas_after_a_topology_change(modes):
    """The line that the study trips, 83-33, parts machine 13 from 14."""
    case, before = modes("wnaps").linear.point.case, areas(modes("wnaps"), 8)
    assert before.moved(before) == ()
    after = areas(analyze(linearize(operating_point.solve(opened(case, ["83-33"])))), 8)
    assert before.moved(after) == (13,)
    assert after.of(13) == after.of(15) != after.of(14)


def test_opening_the_only_way_is_refused(modes):
    with pytest.raises(StudyError, match=r"Without 7-8 .* bus 8 is not connected"):
        opened(modes("wnaps").linear.point.case, ["7-8"])


def test_an_unknown_circuit_is_refused(modes):
    with pytest.raises(StudyError, match="There is no branch 1-2"):
        opened(modes("two_area").linear.point.case, ["1-2"])


@pytest.mark.parametrize("count", [2.0, True, "2"])
def test_a_count_that_is_no_number_is_refused(modes, count):
    with pytest.raises(StudyError, match="not a number of areas"):
        areas(modes("two_area"), count)

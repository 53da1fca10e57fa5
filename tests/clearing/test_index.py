"""The order of a screen: severities are those of single runs, the worst come first, and no answer depends on them."""

import pytest

from stabctl.clearing import Trial, screen
from stabctl.clearing.index import CLEARED, INDEX, WATCHED, severities
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.jobs.store import rows

QUICK = {"resolution": "1cyc", "limit": "20cyc", "longest": "0s", "scan": "0s", "faults": "lines, buses"}


def answers(found):
    """All of a screen's pairs but the computing times."""
    return [vars(pair) | {"wall_s": 0.0} for pair in found.pairs]


def watched(point, **how):
    """A screen, what it says of the order, and the pairs place by place as they are found."""
    told, places = [], []
    found = screen(point, **how, workers=1, ranking=told.append, each=places.append)
    (severities,) = told
    return found, severities, places


@pytest.fixture(scope="module")
def ieee39(points):
    return watched(points("ieee39"), **QUICK)


@pytest.mark.slow
def test_the_worst_places_come_first(ieee39):
    found, severities, places = ieee39
    assert {one.contingency for one in severities} == {p.contingency for p in found.pairs}
    assert [one.order for one in severities] == sorted(one.order for one in severities)
    assert {one.stable for one in severities[:4]} == {False}
    assert severities[-1].stable
    seen = dict.fromkeys(one.contingency.fault for one in severities)
    assert [here[0].contingency.fault for here in places] == list(seen)


def test_a_severity_is_that_of_a_single_run(ieee39, points):
    _, severities, _ = ieee39
    for one in severities[::26]:
        run = points("ieee39").simulate(one.contingency.with_clear(CLEARED, 0.0), until=CLEARED + WATCHED)
        assert (run.outcome.stable, run.outcome.time_s) == (one.stable, pytest.approx(one.time_s))
        assert run.max_angle_from_coi_deg == pytest.approx(one.swing_deg)
    assert str(severities[0]).startswith("lost after 0.")
    assert str(severities[-1]) == f"angles change by {severities[-1].swing_deg:.0f} degrees"


@pytest.mark.slow
def test_the_order_is_that_with_the_control(cases, tmp_path):
    """A store keeps it apart from that without. A run ends when the screen no longer observes."""
    point, orders = operating_point.operating_point(cases("two_area"), "400MW"), []
    for control in (None, BangBang()):
        found, told, _ = watched(point, **QUICK, observe="1.3s", control=control, store=tmp_path)
        wanted = list(severities(point, [p.contingency for p in found.pairs], control, found.search))
        assert told == sorted(wanted, key=lambda one: one.order)
        assert [one.time_s for one in told if one.stable] == pytest.approx([CLEARED + 1.3] * len(told), abs=1e-6)
        orders.append([one.contingency for one in told])
    assert orders[0] != orders[1]


@pytest.mark.slow
def test_no_answer_depends_on_the_order(ieee39, points):
    alone = screen(points("ieee39"), **QUICK)
    assert answers(ieee39[0]) == answers(alone)
    assert ieee39[0].simulations == alone.simulations


@pytest.mark.slow
@pytest.mark.parametrize("storage", [None, "5%mva"])
def test_no_answer_of_the_usual_search_depends_on_the_order(cases, storage):
    point = operating_point.operating_point(cases("ieee39"), storage)
    how = {"faults": "lines, buses", "control": BangBang() if storage else None}
    found, _, _ = watched(point, **how)
    assert answers(found) == answers(screen(point, **how))


@pytest.mark.slow
def test_a_store_keeps_the_order(points, tmp_path, monkeypatch):
    """An interrupted screen continues in the same order without a run for it; only the places left are searched."""
    point, how = points("two_area"), QUICK | {"store": tmp_path}

    def interrupt(_pairs):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        screen(point, **how, workers=1, each=interrupt)
    assert len(rows(tmp_path / "severity.db", INDEX)) == 11
    judged, limits = Trial.judged, []

    def counted(trial, k):
        limits.append(trial.search.limit_cycles)
        return judged(trial, k)

    monkeypatch.setattr(Trial, "judged", counted)
    again, severities, _ = watched(point, **how)
    assert len(severities) == 15
    assert set(limits) == {20.0}  # cycles; one of 6 is that of the order
    assert len(limits) < sum(len(p.runs) for p in again.pairs)
    assert answers(again) == answers(screen(point, **QUICK))


def test_without_anybody_watching_there_is_no_run_for_the_order(points, tmp_path):
    screen(points("two_area"), **QUICK, store=tmp_path)
    assert [path.name for path in tmp_path.glob("*.db")] == ["screen.db"]

"""The last swings of a run: laws of the ratio, what unstable and undamped systems say, and continued runs."""

import numpy as np
import pytest

from stabctl.controllers import BangBang, Controller
from stabctl.dynamics import operating_point
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.simulation import run
from stabctl.simulation.swings import judged

AT_7 = Contingency("7", "6cyc", ["7-8"])
t = np.linspace(0, 5, 601)
H, TOGETHER = np.array([2.0, 1.0, 1.0]), np.zeros(3, int)


def swings(sigma, amplitude=1.0, drift=0.0, island=TOGETHER, limit=0.7):
    """The swings of three rotors against each other, of 1.6 Hz and one growth rate (1/s)."""
    wave = amplitude * np.exp(sigma * t) * np.cos(3.2 * np.pi * t)
    angle = np.stack([-0.5 * wave, 0.6 * wave, 0.4 * wave], 1) + drift * t[:, None] ** 2
    return judged(angle, 300, island, H, ("A", "B", "C"), 2.5, limit)


@pytest.mark.parametrize("sigma", [-0.5, -0.1, 0.0, 0.03, 0.3])
def test_the_ratio_is_that_of_the_envelope_and_no_common_motion_matters(sigma):
    found, moved = swings(sigma), swings(sigma, drift=40.0)
    assert found.last / found.before == pytest.approx(np.exp(2.5 * sigma), rel=1e-6)
    assert moved[4:6] == pytest.approx(found[4:6], rel=1e-6)
    assert found.decaying == (sigma < np.log(0.7) / 2.5)
    assert found.growing == (sigma > np.log(1.05) / 2.5)
    assert found.lasting == (sigma == 0)
    assert swings(sigma, limit=0.2).decaying is False


def test_what_swings_little_is_settled_unless_it_grows():
    assert not swings(0.0).settled
    assert swings(0.0, amplitude=0.3).settled
    assert not swings(0.3, amplitude=0.05).settled
    assert swings(0.3, amplitude=1e-3).decaying


def test_machines_that_are_alone_or_off_are_not_judged():
    assert swings(0.0, island=np.array([-1, -1, 0])) is None
    assert swings(0.0, limit=0.0) is None
    assert swings(0.0, island=np.array([0, 1, 1])).largest == pytest.approx(swings(0.0).largest / 6, rel=1e-6)


def beside_a_heavy_one(*swinging):
    """The swings of B and C, with their amplitudes and growth rates, against a machine A that does not move."""
    wave = np.cos(3.2 * np.pi * t)
    angle = np.stack([0 * t, *(size * np.exp(sigma * t) * wave for size, sigma in swinging)], 1)
    return judged(angle, 300, TOGETHER, np.array([1e9, 1.0, 1.0]), ("A", "B", "C"), 2.5, 0.7)


def test_a_swing_that_lasts_is_said_beside_a_larger_one_that_decays():
    found = beside_a_heavy_one((1.0, -0.1), (0.6, 0.0))
    assert (found.machine, found.decaying, found.growing, found.lasting) == ("C", False, False, True)
    assert "machine C swings by 68.7 degrees in the last 2.5 s, by 68.7 before" in str(found)


def test_a_machine_that_swings_less_than_half_as_much_is_not_judged():
    less, more = (beside_a_heavy_one((1.0, -0.5), (size, 0.0)) for size in (0.12, 0.2))  # B swings by 0.43 at last
    assert (less.machine, less.decaying) == ("B", True)
    assert (more.machine, more.decaying) == ("C", False)


def test_a_growing_oscillation_is_said(points):
    """Without stabilizers, 2.5 s multiply the swings of `two_area_thyristor` by 1.09: exp(2.5 * 0.033)."""
    point = points("two_area_thyristor")
    for record in (True, False):
        outcome = run(point, Contingency("7", "1cyc"), 10.0, record=record).outcome
        assert outcome.stable
        assert outcome.swings.growing
        assert ("until 10.000 s; frequency " in outcome.message) is record
        assert ". The swings grow: the largest is " in outcome.message
    assert outcome.swings.last / outcome.swings.before == pytest.approx(np.exp(2.5 * 0.0331), rel=0.02)
    assert run(point, Contingency("7", "1cyc"), 10.0, criterion=Criterion(decay=0)).outcome.swings is None


def test_an_undamped_system_is_said_to_be_one_and_a_damped_one_is_not(cases, points):
    undamped = run(operating_point.solve(cases("two_area").classical()), AT_7.with_clear("2cyc"), 11.0).outcome
    assert not undamped.swings.decaying
    assert undamped.message.endswith(f". {undamped.swings}")
    assert str(undamped.swings).startswith("The swings do not decay: machine ")
    damped = run(points("two_area"), AT_7, 11.0).outcome
    assert damped.swings.decaying
    assert "swings" not in damped.message


def test_nothing_is_said_soon_after_the_last_event_or_of_unstable_runs(points):
    assert run(points("two_area"), AT_7, 3.5).outcome.swings is None
    assert run(points("two_area"), AT_7, 3.7).outcome.swings is not None
    assert run(points("two_area"), AT_7.with_clear("20cyc"), 10.0).outcome.swings is None


@pytest.mark.parametrize("name", ["two_area", "ieee39"])
def test_a_longer_run_is_stable_if_the_swings_decay(points, name):
    judgments = []
    for bus in (points(name).case.buses[k].bus for k in (3, 6)):
        for cycles in (1, 5):
            fault = Contingency(str(bus), f"{cycles}cyc", at=0.0)
            judgments.append(run(points(name), fault, 5 + cycles / 60, record=False).outcome.swings.decaying)
            assert run(points(name), fault, 30.0, record=False).outcome.stable
    assert all(judgments)


@pytest.mark.parametrize("law", [BangBang(0.0, 0.0), None])
def test_a_continued_run_is_that_of_one_piece(cases, law):
    """The first ends too soon after clearing to be judged; a sampled controller keeps its frames all the same."""
    seen = []

    def push(now):
        seen.append(now.time)
        return 0.2 * np.sign(now["deviation"])

    point = operating_point.solve(cases("two_area").classical().with_storage("20MW"))
    pieces = [
        run(
            point,
            AT_7,
            until,
            control=law or Controller.from_function(push, "deviation", "order", rate=50),
            longest=longest,
        )
        for until, longest in ((3.013, 8.013), (8.013, 0.0))
    ]
    assert pieces[0].outcome.time_s == pytest.approx(8.013)
    ends = [p.arrays.angle[-1] - p.arrays.angle[-1, 0] for p in pieces]
    assert ends[0] == pytest.approx(ends[1], abs=5e-3)  # 1e-3   the steps are not the same
    if law is None:
        assert seen[: len(seen) // 2] == pytest.approx(seen[len(seen) // 2 :])
        assert seen[: len(seen) // 2] == pytest.approx(np.arange(len(seen) // 2) / 50)


def test_a_run_that_has_settled_is_not_continued(points):
    assert run(points("two_area"), AT_7, 6.1, longest=21.1).outcome.time_s == pytest.approx(6.1)

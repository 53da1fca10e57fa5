"""Stabilizers: the phase of GEP(s) is compensated, and one design serves a network that changes."""

from pathlib import Path

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.design import gep, outages, pss
from stabctl.design._phase_compensation import fitted


@pytest.fixture(scope="module")
def ieee39(cases):
    return outages(cases("ieee39"))


def test_a_stabilizer_has_the_opposite_phase_of_the_gep(cases):
    """From 0.3 to 2 Hz the torque is within 15 deg (10.3) of the speed, with the washout."""
    hz = np.geomspace(0.3, 2, 9)
    for machine in (1, 4):
        phase = np.angle(gep(cases("two_area_thyristor"), machine).response(hz)[:, 0, 0])
        H = fitted(hz, -phase, 10.0)
        total = np.rad2deg(np.angle(H(2j * np.pi * hz)) + phase)
        assert np.abs(total).max() < 15
        assert abs(complex(H(1e-6j)) / (10.0 * 1e-6j) - 1) < 1e-3  # gain 1 of the stages at rest


def test_outages_are_solved_again_and_those_that_split_the_network_are_named(cases, ieee39):
    """Each point is the case without that branch; machines and transformers in series with them are bridges."""
    case = cases("ieee39")
    assert len(ieee39) == 36
    assert len(ieee39.points) - 1 + len(ieee39.left_out) == len(case.branches)
    assert {"16-19", "2-30", "29-38"} < dict(ieee39.left_out).keys()
    at = ieee39.names.index("16-17")
    without = ieee39.points[at].case
    assert len(without.branches) == len(case.branches) - 1
    assert {(16, 17), (17, 16)}.isdisjoint((k.from_bus, k.to_bus) for k in without.branches)
    assert "without 16-17" in without.name
    assert np.abs(ieee39.points[at].V - ieee39.points[0].V).max() > 0.01


def test_equal_circuits_side_by_side_count_once(cases):
    assert outages(cases("two_area_thyristor")).names == ("", "7-8", "8-9")


@pytest.mark.slow
def test_one_design_serves_all_outages(ieee39):
    """Every mode of 0.1 to 3 Hz of the 36 systems, electromechanical or not."""
    found = pss(ieee39, damping=0.05, max_gain=700)
    assert found.reached
    assert found.worst_before == pytest.approx(-0.0461, abs=1e-4)
    for point in ieee39:
        own = point.case.without_device("pss")
        modes = own.closed_loop(*found.controllers).modes()
        assert modes.stable
        assert modes.damping_ratio[modes.swings()].min() >= 0.05
    assert all(c.limits == (-0.1, 0.1) for c in found.controllers)
    shown = {}
    for line in (Path(__file__).parents[2] / "docs" / "design.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 8 and cells[1].lstrip("-").startswith("0."):
            shown |= {part[0]: list(map(float, part[1:])) for part in (cells[:4], cells[4:]) if part[0]}
    assert shown.keys() == {name or "none" for name in ieee39.names}
    table = np.array([shown[name or "none"] for name in ieee39.names])
    assert np.abs(table - found.worst[["before", "after", "frequency_hz"]].to_numpy()).max() < 1e-3


def test_gains_of_their_own_reach_what_a_common_gain_does_not(cases):
    """Two stabilizers of four: the best common gain gives a worst damping of 0.1775, two gains 0.179."""
    case = cases("two_area_thyristor")
    found = pss(case, [1, 3], damping=0.178, noise_filter=0, max_gain=1000)
    assert found.reached
    gains = [abs(complex(np.ravel(c.to_control()(1e-6j))[0])) for c in found.controllers]
    assert max(gains) > 1.1 * min(gains)  # 1.15
    first, second = found.controllers
    alike = second.scaled(gains[0] / gains[1])
    for k in np.geomspace(0.3, 3, 15):
        modes = case.closed_loop(first.scaled(k), alike.scaled(k)).modes()
        assert modes.damping_ratio[modes.within(0.1, 3)].min() < 0.178


def test_what_cannot_be_reached_is_said_with_the_mode(cases):
    found = pss(cases("two_area_thyristor"), [1, 2], damping=0.1)
    assert not found.reached
    assert "the required damping is not reached: 0.0860 at 1.15" in str(found)
    assert "Hz (3 against 4), short by up to 0.0140." in str(found)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda c: pss(c, [9]), "There is no machine 9"),
        (lambda c: pss(c.classical()), "no machine with an exciter"),
        (lambda c: pss([]), "no operating point to design for"),
        (lambda c: gep(c, 2, others="fixed"), "choose 'held' or 'free'"),
    ],
)
def test_mistakes(cases, call, says):
    with pytest.raises(StudyError, match=says):
        call(cases("two_area_thyristor"))


def gains(found, *hz):
    """Gain of every stabilizer (stabilizers, frequencies)."""
    return np.array([np.abs(np.ravel(c.to_control()(2j * np.pi * np.array(hz)))) for c in found.controllers])


def test_no_gain_exceeds_its_bound_and_what_is_not_reached_is_said(cases):
    """13 % damping needs gains of 112 (two_area_thyristor); with at most 60 it is 7.2 %, and the design says so."""
    case = cases("two_area_thyristor")
    free, bound = pss(case, damping=0.13), pss(case, damping=0.13, max_gain=60)
    assert free.reached
    assert "largest gains are 101 to 112 pu; up to 200 pu are allowed." in str(free)
    assert not bound.reached
    assert "No stabilizers with gains of at most 60 pu were found that reach the damping" in str(bound)
    for found, most in ((free, 200), (bound, 60)):
        largest = gains(found, *np.geomspace(0.003, 3000, 3000)).max(axis=1)
        assert largest.max() <= most * 1.001
        assert list(found.largest_gains.values()) == pytest.approx(largest, rel=1e-3)
    assert 0.0 < bound.worst_after < free.worst_after


def test_the_filter_holds_back_noise_and_its_lag_is_compensated(cases):
    """Far above the band the gain falls with the frequency; in the band the phase is that without the filter."""
    case = cases("two_area_thyristor")
    plain, filtered = pss(case, noise_filter=0), pss(case, noise_filter="20ms")
    assert gains(plain, 1000).ravel() == pytest.approx(gains(plain, 100).ravel(), rel=0.02)
    assert gains(filtered, 1000).ravel() == pytest.approx(gains(filtered, 100).ravel() / 10, rel=0.05)  # 0.027
    for one, other in zip(plain.controllers, filtered.controllers, strict=True):
        hz = np.geomspace(0.3, 2, 9)
        turn = other.to_control()(2j * np.pi * hz) / one.to_control()(2j * np.pi * hz)
        assert np.abs(np.rad2deg(np.angle(np.ravel(turn)))).max() < 5  # 3.3


def test_a_design_is_compared_with_the_stabilizers_that_it_replaces(cases):
    case = cases("two_area")
    found = pss(case, damping=0.1)
    assert found.worst_replaced == case.modes().damping_ratio[case.modes().within(0.1, 3)].min()
    assert f"The stabilizers of the case, which they replace, give {found.worst_replaced:.4f}" in str(found)
    assert found.given.case == case
    assert not found.base.case.devices.get("pss")
    assert pss(cases("two_area_thyristor")).worst_replaced is None


@pytest.mark.parametrize("wrong", [0, -1, float("nan"), float("inf")])
def test_a_bound_is_a_gain(cases, wrong):
    with pytest.raises(StudyError, match="max_gain = "):
        pss(cases("two_area_thyristor"), max_gain=wrong)

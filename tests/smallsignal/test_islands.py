"""A network of two islands from the beginning has the modes of both, and each has its own angle reference."""

from dataclasses import replace

import numpy as np
import pytest
from islands import joined
from scipy.optimize import linear_sum_assignment

import stabctl as st
from stabctl._util.errors import StabctlError
from stabctl.design.lqg import _reduced, _Scales
from stabctl.design.quadratic import Weights
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen
from stabctl.simulation.setup import setup
from stabctl.smallsignal import descriptor
from stabctl.smallsignal.analysis import analyze

NONE = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
LATE = st.Controller(("deviation:1",), ("order:1",), *NONE, [[20.0]], delay="100ms")
LAWS = {
    "speed": st.Feedback(0.05),
    "sampled": st.Feedback(0.05).sampled(60, "50ms"),
    "surface": st.StorageLaw(slope=0.3, angle_gain=0.5, deadband=0.0),
}
PAIRS = [("two_area", "wscc9"), ("wscc9", "two_area_thyristor"), ("wscc9", "wscc9")]


@pytest.fixture(scope="module", params=PAIRS, ids="+".join)
def points(request):
    """The joined case, and the two alone."""
    one, other = (st.load(name) for name in request.param)
    return [case.initialize(storage="50MW") for case in (joined(one, other), one, other)]


@pytest.mark.parametrize("group", ["1+1001", "1001+1002+1003"])
def test_a_group_is_a_part_of_one_island(group):
    """Of machines in both, and of all in one of them, which left nothing to compare with."""
    point = joined(st.load("two_area"), st.load("wscc9")).initialize()
    with pytest.raises(StabctlError, match="not in one island with others"):
        point.linearize(outputs=f"deviation:{group}")


def test_orders_without_storage_are_no_inputs():
    with pytest.raises(StabctlError, match="has no storage devices"):
        st.load("wscc9").linearize(inputs="order")


def apart(whole, *parts):
    """Largest difference between eigenvalues and those of the parts, matched one to one."""
    parts = np.concatenate(parts)
    assert len(parts) == len(whole)
    distance = np.abs(parts[:, None] - whole)
    return distance[linear_sum_assignment(distance)].max()


def test_the_modes_are_those_of_both(points):
    whole, *parts = (point.modes() for point in points)
    assert apart(whole.eigenvalues, *(p.eigenvalues for p in parts)) < 1e-9  # 2e-11
    assert whole.references == 2
    assert (whole.eigenvalues[:2] == 0).all()
    assert "rotating angle" in whole.label(0)
    assert whole.label(0) != whole.label(1)
    least = min(parts, key=lambda p: p.damping_ratio[p.swings()].min())
    assert (
        str(whole).partition("least damped")[2].split("(")[0] == str(least).partition("least damped")[2].split("(")[0]
    )


def test_the_vectors_belong_to_them(points):
    found = points[0].modes()
    A, s, V, W = found.linear.A, found.eigenvalues, found.right, found.left
    size = np.outer(np.linalg.norm(W, axis=0), np.linalg.norm(V, axis=0))
    assert (np.abs(W.conj().T @ V - np.eye(len(s))) / size).max() < 1e-11
    moving = s != 0
    scale = np.abs(A).max()
    assert np.abs(A @ V - V * s)[:, moving].max() < 1e-12 * scale * np.abs(V).max()
    assert np.abs(A @ V[:, :2]).max() < 1e-9
    R = found.linear.rotation()
    assert R.shape == (len(A), 2)
    assert not (R[:, 0] * R[:, 1]).any()
    assert np.abs(A @ R).max() < 1e-9 * scale


def test_a_band_finds_the_modes_of_both(points):
    whole, *parts = (analyze(descriptor(point), (0.1, 2.5)).eigenvalues for point in points)
    assert apart(whole, *parts) < 1e-8


@pytest.mark.parametrize("law", LAWS)
def test_so_are_those_of_a_closed_loop(points, law):
    """A deviation is that against the center of inertia of its own island; against that of both it was 0.7 1/s off."""
    whole, *parts = (point.closed_loop(LAWS[law]) for point in points)
    assert apart(whole.eigenvalues(), *(p.eigenvalues() for p in parts)) < 1e-8  # 6e-11
    assert whole.modes().references == 2


def test_a_late_loop_has_the_roots_of_both(points):
    whole, one, other = points[0].closed_loop(LATE), points[1].closed_loop(LATE), points[2]
    found, alone = whole.modes(), one.modes()
    assert found.certified
    fast = np.abs(other.modes().eigenvalues) > 2 * np.pi * 10
    assert apart(found.eigenvalues, alone.eigenvalues, other.modes().eigenvalues[~fast]) < 1e-6
    assert found.references == 2


def test_the_loop_of_a_run_is_the_same(points):
    law = LAWS["speed"]
    fastest = [setup(point, law).closed.fastest for point in points]
    assert fastest[0] == pytest.approx(max(fastest[1:]), rel=1e-9)


@pytest.mark.slow
def test_the_margins_are_those_of_its_island(points):
    one = st.Controller(("deviation:1",), ("order:1",), *NONE, [[20.0]])
    if (points[2].modes().eigenvalues.real > 1e-6).any():
        with pytest.raises(StabctlError, match="is unstable, so it has no margins"):
            points[0].margins(one)
        return
    whole, alone = (point.margins(one) for point in points[:2])
    assert str(whole).partition("\n")[2] == str(alone).partition("\n")[2]


@pytest.mark.parametrize("signal", ["deviation:1", "angle:1", "rest_speed:1", "bus_angle:5", "angle_deviation:2"])
def test_a_controller_reads_what_the_linear_model_shows(points, signal):
    """A quantity against the center of inertia is that of the island, in both: 1e-9 of a small step."""
    gain = st.Controller((signal,), ("order:1",), *NONE, [[0.5]])
    whole, alone = (point.simulate("7:+1MW@0.1s", "1s", control=gain) for point in points[:2])
    assert np.abs(whole.arrays.order[:, 0] - alone.arrays.order[:, 0]).max() < 1e-9
    assert np.ptp(alone.arrays.order[:, 0]) > 1e-7
    assert (
        apart(
            points[0].closed_loop(gain).eigenvalues(),
            *(p.closed_loop(*c).eigenvalues() for p, c in ((points[1], [gain]), (points[2], []))),
        )
        < 1e-8
    )


def test_an_infinite_bus_stands_still_in_its_island_alone():
    """Beside it the machines of the other island still move together in the mode of their frequency: no swing mode."""
    one, other = st.load("two_area"), st.load("wscc9").classical()
    rows = other.devices["gencls"]
    infinite = replace(other, devices={"gencls": {**rows, 1: rows[1]._replace(H=0.0)}})
    whole, *parts = (case.modes() for case in (joined(one, infinite), one, infinite))
    assert len(whole.swings()) == sum(len(p.swings()) for p in parts) == 5
    named = [
        [m.label(k) for k in range(len(m)) if m.label(k).startswith("common frequency")] for m in (whole, parts[0])
    ]
    assert named[0] == named[1]
    assert named[0]


def test_areas_are_in_one_island_each():
    whole = st.smallsignal.areas(joined(st.load("two_area"), st.load("wscc9")).modes())
    assert sorted(sorted(group) for group in whole.groups) == [[1, 2], [3, 4], [1001, 1002, 1003]]
    with pytest.raises(StabctlError, match="choose 2 to 7 areas"):
        st.smallsignal.areas(joined(st.load("two_area"), st.load("wscc9")).modes(), 1)


def test_an_estimator_has_no_state_of_an_angle_reference(points):
    """No signal sees it, so its covariance would grow without end."""
    weights, scales = Weights(), _Scales(1.0, 0.1, np.ones(len(points[0].rotors.unit)))
    reads = chosen(points[0].case, "deviation", OUTPUTS)
    small = _reduced(points[0], chosen(points[0].case, "order", INPUTS), reads, scales, weights, 16)
    assert not [name for name in small.states if name.startswith("angle reference")]

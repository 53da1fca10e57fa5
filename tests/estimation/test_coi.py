"""Speeds against the rest: the definition, delays, missing machines, islands."""

import numpy as np
import pytest

from stabctl.estimation._signals import COAST, LIMIT, CoiReference
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import Estimate
from stabctl.estimation.pmu import Pmu
from stabctl.simulation.contingency import Contingency

H = np.array([3.0, 2.0, 5.0, 10.0])
S = np.array([[0.01, -0.002, 0.004, 0.0]])
WHOLE, THERE = np.zeros((1, 4), int), np.ones((1, 4), bool)


def estimate(slip=S, acceleration=0.0, received=THERE):
    none = np.zeros(slip.shape)
    return Estimate(slip, none + acceleration, none, none, received, none)


def rest(i, keep=(0, 1, 2, 3)):
    others = [j for j in keep if j != i]
    return S[0, i] - H[others] @ S[0, others] / H[others].sum()


def test_it_is_the_own_speed_less_the_coi_speed_of_the_rest():
    got = CoiReference(H, 60, 0, 0).step(estimate(), WHOLE)
    assert got.speed[0] == pytest.approx([rest(i) for i in range(4)], abs=1e-15)
    assert got.usable.all()


def test_a_common_speed_does_not_matter():
    a, b = (CoiReference(H, 60, 0, 0).step(estimate(S + c), WHOLE).speed for c in (0.0, 0.05))
    assert np.abs(a - b).max() < 1e-15


def test_constant_accelerations_are_compensated_exactly():
    coi, a = CoiReference(H, 60, 0, 3), np.array([0.1, -0.3, 0.2, 0.05])
    for k in range(6):
        got = coi.step(estimate(S + a * k / 60, a), WHOLE)
    exact = CoiReference(H, 60, 0, 0).step(estimate(S + a * 5 / 60, a), WHOLE)
    assert np.abs(got.speed - exact.speed).max() < 1e-15


def test_prediction_is_capped():
    coi, a = CoiReference(H, 60, 0, 30), np.array([0.0, 0.6, 0.0, 0.0])
    for _ in range(40):
        got = coi.step(estimate(S, a), WHOLE)
    assert got.speed[0, 0] == pytest.approx(rest(0) - H[1] * 0.6 * 0.1 / 17)


def test_what_is_not_extrapolated_is_in_the_variance():
    """Reports 0.5 s old: the speed of machine 2 has moved on for 0.4 s at 0.6 pu/s."""
    coi, a = CoiReference(H, 60, 0, 30), np.array([0.0, 0.6, 0.0, 0.0])
    for _ in range(40):
        got = coi.step(estimate(S, a), WHOLE)
    assert got.sigma[0, 0] == pytest.approx(H[1] * 0.6 * 0.4 / 17)
    assert not got.usable[0, 0]


@pytest.mark.parametrize("islands", [WHOLE, np.array([[0, 0, 0, 1]])])
def test_the_variance_beside_an_infinite_bus_is_that_of_the_others(islands):
    """Its own weight, the square of its inertia, is not in the sum, nor is what rounding leaves of it."""
    heavy, variance = np.array([1e10, *H[1:]]), np.array([[1e-8, 2e-8, 3e-8, 4e-8]])
    got = CoiReference(heavy, 60, 0, 0).step(estimate()._replace(variance=variance), islands).sigma
    others = H[1:] if islands is WHOLE else H[1:3]
    mean = others**2 @ variance[0, 1 : 1 + len(others)] / others.sum() ** 2
    assert got[0, 0] == pytest.approx(np.sqrt(variance[0, 0] + mean), rel=1e-9)


@pytest.mark.parametrize("late", [0.05, 0.2, 0.35])
def test_the_variance_of_late_deviations_is_that_of_their_errors(cases, late):
    """Mean squares of errors over `sigma`: 0.7, 0.8, 2.2, with 60 and 1250 in place of the last two."""
    point = cases("two_area").classical().initialize(storage="50MW")
    control = EstimatorControl(pmu=Pmu(latency=late), engine="batched")
    found = point.estimate(Contingency("7", clear="8cyc", trip="7-8"), "4s", control=control, seeds=(1, 2))
    rows = found.time > found.cleared_s + 0.3
    ok = (found.usable & found.on)[rows]
    error = ((found.deviation_estimated - found.deviation) / found.sigma)[rows][ok]
    assert ok.mean() > 0.2
    assert 0.4 < np.mean(error**2) < 5


def test_a_silent_machine_stays_in_the_sums_with_a_growing_variance():
    """Its own estimate while it is sure, the speed of the others as its variance grows beyond their spread."""
    coi, gone, sigma = CoiReference(H, 60, 0, 0), np.array([[True, True, False, True]]), []
    others = H[[0, 1, 3]] @ S[0, [0, 1, 3]] / H[[0, 1, 3]].sum()
    for k in range(40):
        variance = np.where(gone, 0.0, (1e-3 * k) ** 2)
        got = coi.step(estimate(received=gone)._replace(variance=variance), WHOLE)
        sigma.append(got.sigma[0, 0])
        assert got.usable[0].tolist() == [True, True, (k + 1) / 60 <= COAST + 1e-9 and 1e-3 * k < LIMIT, True]
    assert np.all(np.diff(sigma[:3]) > 0)
    at_last = H[[1, 3]] @ S[0, [1, 3]] + H[2] * others
    assert got.speed[0, 0] == pytest.approx(S[0, 0] - at_last / 17, abs=2e-5)
    assert sigma[-1] < sigma[3] * 5 + 1e-3  # no more than the spread of the others


def test_a_machine_without_a_pmu_knows_itself_as_late_as_the_others_do():
    coi, without = CoiReference(H, 60, 0, 3), np.array([[True, False, False, False]])
    for k in range(6):
        got = coi.step(estimate(S + 0.001 * k), WHOLE, without)
    late = S[0] + 0.002
    assert got.speed[0, 0] == pytest.approx(late[0] - H[1:] @ late[1:] / H[1:].sum())
    assert got.speed[0, 1] == pytest.approx(S[0, 1] + 0.005 - H[[0, 2, 3]] @ late[[0, 2, 3]] / H[[0, 2, 3]].sum())


def test_storage_is_off_below_seventy_percent_of_the_inertia():
    coi, gone = CoiReference(H, 60, 0, 0), np.array([[True, True, True, False]])  # half of it
    used = [coi.step(estimate(received=gone), WHOLE).usable.any() for _ in range(40)]
    assert used[:30] == [True] * 30
    assert not any(used[31:])


def test_islands_have_their_own_coi_and_tripped_machines_none():
    got = CoiReference(H, 60, 0, 0).step(estimate(), np.array([[0, 0, 1, 1]]))
    assert got.speed[0] == pytest.approx([S[0, 0] - S[0, 1], S[0, 1] - S[0, 0], S[0, 2] - S[0, 3], S[0, 3] - S[0, 2]])
    got = CoiReference(H, 60, 0, 0).step(estimate(), np.array([[0, 0, 0, -1]]))
    assert got.speed[0, 0] == pytest.approx(rest(0, (0, 1, 2)))
    assert got.usable[0].tolist() == [True, True, True, False]


def test_a_machine_alone_deviates_from_nothing():
    got = CoiReference(H, 60, 0, 0).step(estimate(acceleration=0.1), np.array([[0, 0, 0, 1]]))
    assert (got.speed[0, 3], got.acceleration[0, 3], got.usable[0, 3]) == (0, 0, False)
    moving = CoiReference(H[:1], 60, 0, 0).step(estimate(S[:, :1], received=THERE[:, :1]), WHOLE[:, :1])
    assert moving.speed == 0


def test_a_filter_that_has_lost_its_rotor_is_not_believed():
    """A speed half a turn per frame off, with a small variance: unusable itself, and the others do without it."""
    wrong = S.copy()
    wrong[0, 2] += 0.5
    right, got = (
        CoiReference(H, 60, 0, 0).step(estimate(), WHOLE),
        CoiReference(H, 60, 0, 0).step(estimate(wrong), WHOLE),
    )
    assert not got.usable[0, 2]
    others = [0, 1, 3]
    assert np.abs(got.speed - right.speed)[0, others].max() < 0.005
    swing = S.copy()
    swing[0, 2] += 0.03  # a swing of 1.8 Hz
    assert CoiReference(H, 60, 0, 0).step(estimate(swing), WHOLE).usable.all()

"""Which megawatt keeps a contingency survived: three ways to the gradient, and what it predicts."""

import numpy as np
import pytest

from stabctl.clearing import Search
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.placement import _scaling
from stabctl.placement._scaling import FINE, FINEST, along, bisect, critical_scaling
from stabctl.placement.sensitivity import sensitivity
from stabctl.placement.trials import Trials
from stabctl.simulation.contingency import Contingency

TO_SURVIVE = (Contingency("29", 4.75 / 60, "26-29"), Contingency("16", 10.625 / 60, "16-21"))


@pytest.fixture(scope="module")
def trials(cases):
    case = cases("ieee39").classical()
    point = operating_point.solve(
        case.with_storage(Storage(m.machine, m.storage_bus, 0.3 * m.base) for m in case.machines)
    )
    return Trials(point, TO_SURVIVE, np.array([s.rating for s in point.case.storage]))


@pytest.fixture(scope="module")
def boundary(trials):
    """The uniform fleets that just survive each contingency."""
    uniform = trials.cap / 6
    return [_critical(trials, uniform, k) * uniform for k in range(2)]


@pytest.fixture(scope="module")
def by_scaling(trials, boundary):
    return [_scaling.by_scaling(trials, boundary[k], k) for k in range(2)]


def _critical(trials, mw, k):
    survives = along(trials, mw, k)
    first = critical_scaling(survives, 6.0)
    return bisect(survives, (1 - FINE) * first, first, FINEST)


def _degrees(a, b):
    return np.rad2deg(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)))


@pytest.mark.slow
def test_the_cut_is_tight_at_the_boundary(trials, boundary, by_scaling):
    for k, (mw, d) in enumerate(zip(boundary, by_scaling, strict=True)):
        assert d @ mw == pytest.approx(1, abs=1e-12)
        assert _scaling.by_peak(trials, mw, k) @ mw == pytest.approx(1, abs=1e-12)
        assert trials.survives(mw, k)
        assert not all(trials.survives((1 - less) * mw, k) for less in (1e-4, 2e-4, 5e-4, 1e-3))


@pytest.mark.slow
def test_a_gradient_predicts_the_critical_scalings_of_other_fleets(trials, boundary, by_scaling):
    """Of a fleet s near the boundary: 1 / (d . s)."""
    rng = np.random.default_rng(0)
    for k, (mw, d) in enumerate(zip(boundary, by_scaling, strict=True)):
        for _ in range(3):
            other = mw + 0.06 * mw.sum() * rng.random(10) / 10
            assert abs(_critical(trials, other, k) * (d @ other) - 1) < 0.01  # 5.2e-3, 1.7e-3
        for i in np.argsort(-d)[:2]:
            less = mw.copy()
            less[i] *= 0.8
            assert abs(_critical(trials, less, k) * (d @ less) - 1) < 0.02  # 9.5e-3, 5.5e-3


@pytest.mark.parametrize(("k", "degrees"), [(0, 3.0), (1, 25.0)])
def test_the_largest_angle_gives_the_gradient(trials, boundary, by_scaling, k, degrees):
    d = _scaling.by_peak(trials, boundary[k], k)
    assert _degrees(d, by_scaling[k]) < degrees  # 1.6, 17.9
    assert d.argmax() == by_scaling[k].argmax()


def test_the_swept_angle_gives_it_where_one_machine_runs_away(trials, boundary, by_scaling):
    places = [(s.machine, s.bus) for s in trials.point.case.storage]
    J = sensitivity(trials.point, places).J
    d = _scaling.by_swept_angle(trials, 1.01 * boundary[0], 0, J)
    machine = trials.point.case.storage[d.argmax()].machine
    assert machine == 9  # behind the faulted bus
    assert d[d.argmax()] > 0
    assert _degrees(d, by_scaling[0]) < 4  # 2.8


def test_by_peak_says_where_it_is_of_no_use(trials):
    assert _scaling.by_peak(trials, 1e-3 * trials.cap, 1) is None


def test_a_fleet_that_always_survives_has_no_gradient(trials):
    always = Trials(trials.point, [Contingency("39", 1e-3)], trials.cap, search=Search(observed_s=1.0))
    assert _scaling.by_scaling(always, trials.cap, 0) is None


def test_what_cannot_be_scaled_is_none():
    mw = np.ones(2)
    assert _scaling._scaled(np.array([np.nan, 1.0]), mw) is None
    assert _scaling._scaled(np.array([-1.0, 0.5]), mw) is None
    assert _scaling._scaled(np.zeros(2), mw) is None
    assert _scaling._scaled(np.array([3.0, 1.0]), mw) == pytest.approx([0.75, 0.25])


def test_a_cap_does_not_hide_what_a_larger_device_would_do(trials, boundary):
    """The gradient of a device at its cap is found with a larger device."""
    capped = Trials(trials.point, trials.contingencies, np.where(np.arange(10) == 8, boundary[0][8], trials.cap))
    assert _scaling.by_peak(capped, boundary[0], 0)[8] > 0

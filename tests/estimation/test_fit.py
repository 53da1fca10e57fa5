"""Inertia and reactance from recorded reports: wrong data are recovered within the error that is stated."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.fit import paraboloid
from stabctl.simulation.contingency import Contingency

FAULT = Contingency("7", "11cyc", "7-8")


def recorded(points, **factors):
    control = EstimatorControl(engine="batched", **factors)
    return estimate(points("two_area"), FAULT, 2.5, control=control, record=False)


def test_the_paraboloid_gives_maximum_and_covariance_of_a_normal_likelihood():
    covariance, peak = np.array([[4e-4, 1e-4], [1e-4, 9e-4]]), np.array([0.01, -0.02])
    shifts = np.random.default_rng(1).uniform(-0.05, 0.05, (2, 60))
    apart = shifts - peak[:, None]
    at, sigma = paraboloid(shifts, 7 - np.einsum("ik,ij,jk->k", apart, np.linalg.inv(covariance), apart) / 2)
    assert at == pytest.approx(peak, abs=1e-12)
    assert sigma == pytest.approx([0.02, 0.03], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("inertia", "reactance"), [(1.2, 1.0), (1.0, 0.8), (0.8, 1.25), ((1.0, 1.2, 0.9, 1.0), 1.0)])
def test_wrong_data_are_recovered(points, inertia, reactance):
    found = recorded(points, inertia_factor=inertia, reactance_factor=reactance).fit()
    for got, sigma, wrong, most in (
        (found.inertia, found.inertia_sigma, inertia, 0.03),
        (found.reactance, found.reactance_sigma, reactance, 0.06),
    ):
        right = 1 / np.broadcast_to(wrong, 4)
        assert np.all(np.abs(got - right) < most * right), got
        assert np.all(np.abs(got - right) < 3.5 * sigma), (got, sigma)
        assert np.all(sigma < most)
    assert len(found.df) == 4
    assert "machine 1: inertia x" in str(found)


@pytest.mark.slow
def test_reports_of_machines_that_are_off_tell_nothing(cases):
    lost = Contingency("7", "6cyc", events=["4@1.3s"])
    found = estimate(cases("two_area").classical(), lost, 1.6, storage="50MW", record=False)
    assert 0 < found.on[:, 0, 3].sum() < len(found.on)
    on = np.concatenate([np.ones((len(found.frames) - len(found.on), 1, 4), bool), found.on])
    wild = tuple(f._replace(V=np.where(here, f.V, -2 * f.V)) for f, here in zip(found.frames, on, strict=True))
    one, other = found.fit(), replace(found, frames=wild).fit()
    assert one.df.equals(other.df)


def test_what_the_recording_does_not_tell_keeps_its_factor(cases):
    fitted = estimate(cases("two_area").classical(), None, 0.2, record=False).fit()
    assert np.isnan(fitted.inertia_sigma).all()
    assert (fitted.inertia == 1).all()
    assert "inertia x unknown" in str(fitted)


def test_the_loop_uses_one_factor_per_machine(points):
    with pytest.raises(StudyError, match="one per machine"):
        recorded(points, inertia_factor=(1.0, 1.2))
    with pytest.raises(StudyError, match="above 0"):
        recorded(points, reactance_factor=0.0)

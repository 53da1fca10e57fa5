"""What a run asks of the storage devices."""

import numpy as np
import pytest

from stabctl.controllers import Controller, Feedback
from stabctl.design.law_measurement import duty
from stabctl.simulation.contingency import Contingency


@pytest.fixture(scope="module")
def fleet(cases):
    return cases("two_area").initialize(storage="50MW")


def test_idle_devices_have_no_duty(fleet):
    run = fleet.simulate(Contingency("7-8@0.4", clear="6cyc"), until="5s")
    found = duty(run)
    assert found.energy_kwh == 0
    assert found.switchings == 0
    assert found.coi_hz == pytest.approx(60 * np.abs(run.arrays.coi_speed - 1).max())
    assert found.voltage > 0.9


def test_energy_is_the_range_of_the_integral_of_the_power(fleet):
    run = fleet.simulate(Contingency("7-8@0.4", clear="20cyc"), until="8s", control=Feedback(speed_gain=0.05))
    P = run.arrays.storage
    steps = np.diff(run.time)[:, None] * (P[1:] + P[:-1]) / 2
    charge = np.vstack([np.zeros(P.shape[1]), np.cumsum(steps, axis=0)]) / 3.6
    assert duty(run).energy_kwh == pytest.approx(np.ptp(charge, axis=0).sum(), rel=2e-4)  # 4e-5


@pytest.mark.parametrize(("rate", "least", "most"), [(0.5, 0, 2), (20, 15, 60)])
def test_switchings_are_counted_within_a_swing(fleet, rate, least, most):
    """An order that changes sign at a rate of its own, about 0.6 swings a second."""
    law = Controller.from_function(lambda seen: np.sign(np.sin(np.pi * rate * seen.time)), "deviation:1", "order:1@5")
    run = fleet.simulate(Contingency("7-8@0.4", clear="10cyc"), until="8s", control=law)
    assert least <= duty(run).switchings <= most

"""Estimators in the loop: laws first, then the numbers."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl.clearing.critical_time import clearing_time
from stabctl.controllers import BangBang, Feedback
from stabctl.estimation.loop import Driven, watch
from stabctl.estimation.pmu import Pmu
from stabctl.simulation.sampled import Sampled
from stabctl.simulation.simulation import run

FAST = Driven(engine="batched")
CLASSICAL, FULL = ("ieee39 classical", "two_area classical"), ("two_area", "wnaps")
EXACT = Pmu(60, 0, 0, 0, 0, 0, 0, 0)


def judged(study, name, driven=FAST, seeds=(1, 2, 3)):
    """Record and score of a study over seeds."""
    point, events, cleared, _ = study(name)
    found = watch(point, events, cleared + 5, driven, seeds)
    assert all(r.outcome.stable for r in found.runs)
    return found, found.after(cleared, cleared + 5)


def test_both_engines_give_the_same_run(study):
    point, events, cleared, _ = study("two_area")
    one, two = (watch(point, events, cleared + 1, replace(FAST, engine=e)) for e in ("filterpy", "batched"))
    assert (one.orders == two.orders).all()
    for name in ("estimated", "deviation_estimated", "sigma"):
        assert np.abs(getattr(one, name) - getattr(two, name)).max() < 1e-10  # 2e-14


def test_many_seeds_together_are_the_same_as_one_by_one(study):
    point, events, cleared, _ = study("two_area")
    together = watch(point, events, cleared + 0.5, FAST, (4, 5))
    for k, seed in enumerate((4, 5)):
        alone = watch(point, events, cleared + 0.5, replace(FAST, seed=seed))
        assert np.abs(together.deviation_estimated[:, k] - alone.deviation_estimated[:, 0]).max() < 1e-12
        assert (together.orders[:, k] == alone.orders[:, 0]).all()
    assert (together.deviation_estimated[:, 0] != together.deviation_estimated[:, 1]).any()


def test_run_and_watch_are_the_same_simulation(study):
    point, events, cleared, _ = study("two_area")
    assert isinstance(FAST, Sampled)
    assert not isinstance(BangBang(), Sampled)
    whole = run(point, events, cleared + 1, FAST)
    found = watch(point, events, cleared + 1, FAST, record=True)
    assert (whole.rows == found.runs[0].rows).all()


def test_the_ideal_estimator_knows_the_truth(study):
    found, score = judged(study, "two_area", replace(FAST, kind="ideal"), (1,))
    assert score[:5] == (0, 0, 0, 0, 0)
    assert (found.deviation == found.deviation_estimated).all()


@pytest.mark.parametrize("name", [*CLASSICAL, *FULL])
def test_nothing_moves_at_rest_without_noise(study, name):
    found = watch(study(name)[0], (), 3, replace(FAST, pmu=EXACT))
    assert np.abs(found.estimated).max() * 60e3 < 0.01  # mHz; 1e-4


@pytest.mark.parametrize("name", CLASSICAL)
def test_classical_machines_without_noise(study, name):
    """What is left is the unknown instant of the jumps."""
    _, score = judged(study, name, replace(FAST, pmu=EXACT), (1,))
    assert score.rmse_mhz < 1.5  # 0.8, 1.0


@pytest.mark.parametrize("name", [*CLASSICAL, *FULL])
def test_speeds_are_known_at_the_defaults(study, name):
    """RMSE <= 15 mHz, 99 % <= 40 mHz, delay <= 10 ms, wrong <= 4 %, opposite none; none before the fault."""
    found, score = judged(study, name)
    assert score.rmse_mhz <= 15  # 5.3, 4.8, 6.0, 4.3
    assert score.p99_mhz <= 40  # 15, 12, 15, 11
    assert abs(score.delay_ms) <= 10  # 0.1, 0.5, 3.4, 1.3
    assert score.wrong_command_share <= 0.04  # 0.020, 0.017, 0.017, 0.0003
    assert score.opposite_command_share == 0
    assert found.commands(before=1.0) == 0


@pytest.mark.parametrize("name", [*CLASSICAL, *FULL])
def test_no_command_in_a_minute_of_noise(study, name):
    found = watch(study(name)[0], (), 60, FAST)
    assert found.commands() == 0
    assert not found.orders.any()
    assert np.abs(found.deviation_estimated).max() * 60e3 < 40  # of 100 mHz; 23, 19, 20, 25
    assert 0.8 < np.nanmean(found.nis) < 1.1  # 0.88, 0.92, 0.95, 0.93


def test_it_is_better_than_its_baselines(study):
    point, events, cleared, _ = study("two_area")
    kinds = ("kalman", "kinematic", "frequency")
    runs = [watch(point, events, cleared + 5, replace(FAST, kind=kind)) for kind in kinds]
    kalman, kinematic, frequency = (found.after(cleared, cleared + 5).rmse_mhz for found in runs)
    assert 2 * kalman < kinematic < frequency  # 5.9, 22, 440: its own switching moves the terminal's frequency


@pytest.mark.parametrize("wrong", [(1.15, 1.15), (0.85, 0.85), (1.15, 0.85), (0.85, 1.15)])
@pytest.mark.parametrize("name", [*CLASSICAL, *FULL])
def test_inertia_and_reactance_may_be_wrong_by_fifteen_percent(study, name, wrong):
    _, score = judged(study, name, replace(FAST, inertia=wrong[0], reactance=wrong[1]), (1,))
    assert score.rmse_mhz <= 30  # at most 13.4, 10.6, 10.3, 4.9
    assert score.opposite_command_share == 0


@pytest.mark.parametrize("name", [*CLASSICAL, *FULL])
def test_losing_everything_for_a_tenth_of_a_second_at_clearing_swaps_no_command(study, name):
    cleared = study(name)[2]
    found, score = judged(study, name, replace(FAST, pmu=Pmu(outage_s=(cleared, cleared + 0.1))))
    assert score.opposite_command_share == 0
    assert not (found.wanted * found.given < 0).any()


@pytest.mark.parametrize("pmu", [Pmu(rate=30), Pmu(rate=120), Pmu(kind="P"), Pmu(kind="M"), Pmu(loss=0.2, burst=4)])
def test_other_pmus(study, pmu):
    _, score = judged(study, "two_area", replace(FAST, pmu=pmu))
    assert score.rmse_mhz < 25  # 11, 6.1, 10, 15, 17
    assert score.opposite_command_share == 0


@pytest.mark.parametrize("name", [*CLASSICAL, *FULL])
def test_clearing_time_survives(study, name):
    """Within 3 % or half a cycle of the ideal controller."""
    point, _, _, (fault, trip) = study(name)
    ideal = clearing_time(point, fault, trip, BangBang()).cycles
    bare = clearing_time(point, fault, trip).cycles
    found = clearing_time(point, fault, trip, FAST).cycles
    assert abs(found - ideal) <= max(0.03 * ideal, 0.5)  # 9.5, 9.875, 12.25, 6.5: no difference
    assert found > bare  # 7.625, 5.25, 9, 4.5


def test_clearing_time_falls_with_latency(study):
    point, _, _, (fault, trip) = study("two_area")
    found = [clearing_time(point, fault, trip, replace(FAST, pmu=Pmu(latency_ms=ms))).cycles for ms in (0, 100, 200)]
    assert found == sorted(found, reverse=True)  # 12.25, 12.25, 12
    assert found[-1] > 11.5


def test_a_continuous_law_lives_on_estimates_too(study):
    point, events, cleared, _ = study("two_area")
    found, score = judged(study, "two_area", replace(FAST, law=Feedback(speed_gain=0.05)), (1,))
    assert score.rmse_mhz < 15  # 8
    assert len(np.unique(found.orders)) > 100
    assert np.abs(found.orders).max() <= 1


def test_a_tripped_machine_leaves_the_sums_and_its_storage_idles(study):
    from stabctl.simulation.events import TripMachine

    point = study("ieee39 classical")[0]
    found = watch(point, [TripMachine(10, 0.5)], 2, FAST)
    row = [m.machine for m in point.case.machines].index(10)
    after = found.time > 0.55
    assert not found.on[after][:, 0, row].any()
    assert not found.usable[after][:, 0, row].any()
    error = (found.deviation_estimated - found.deviation)[after, 0] * 60e3
    assert np.abs(np.delete(error, row, 1)).max() < 60  # 30

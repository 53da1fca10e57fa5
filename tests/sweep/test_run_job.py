"""The result of a job: that of the equivalent call, or a sentence."""

from types import SimpleNamespace

import pytest

from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.estimation.estimate import estimate
from stabctl.jobs.run_task import run_task
from stabctl.model import fleet
from stabctl.simulation.contingency import Contingency
from stabctl.sweep import run_job, study_file
from stabctl.sweep.kind import SWEEP
from stabctl.sweep.task import tasks

SIMULATE = 'kind = "simulate"\ncase = "two_area"\nfault = "7"\ntrip = "7-8"\nclear = "11cyc"\nuntil_s = 3\n'


@pytest.fixture
def results(write):
    def of(text):
        path = write(text)
        found = [run_task(task) for task in tasks(study_file.read(path), path)]
        return [SimpleNamespace(**{**dict.fromkeys(SWEEP.found), **row.values}) for row in found]

    return of


def test_a_clearing_time_is_that_of_the_call(results, cases):
    head = 'kind = "clearing-time"\ncase = "two_area"\nfault = "7-8@0.2"\nresolution = "0.5cyc"\nobserve_s = 3\n'
    (result,) = results(
        head + 'storage = "5%dispatch"\nlag_s = 0.05\ncharacteristic = "conductance"\ndeadband_hz = 0.05'
    )
    case = cases("two_area")
    devices = fleet.everywhere(case, "5%dispatch", characteristic="conductance", lag=0.05)
    point = operating_point.solve(case.with_storage(devices))
    found = clearing_time(point, "7-8@0.2", control=BangBang(0.05), resolution="0.5cyc", observe=3)
    assert (result.status, result.outcome, result.cycles, result.seconds) == (
        "ok",
        "found",
        found.cycles,
        found.seconds,
    )
    assert (result.machine, result.runs, result.monotone) == (found.machine, len(found.runs), found.monotone)
    assert result.message == str(found)


def test_a_simulation_under_an_estimator_is_that_of_the_call(results, cases):
    ideal, kalman, alone = results(
        SIMULATE + '[[job]]\nstorage = "50MW"\n[[job]]\nstorage = "50MW"\nestimator = "kalman"\nseed = 4\n'
        '[[job]]\nstorage = "none"\nestimator = "kinematic"\nclear = "5cyc"'
    )
    case = cases("two_area")
    point = operating_point.solve(case.with_storage(fleet.everywhere(case, "50MW")))
    seen = estimate(point, Contingency("7", 11 / 60, ["7-8"]), 3.0, seeds=4)
    assert kalman.rmse_mhz == seen.accuracy.rmse_mhz
    assert kalman.max_angle_from_coi_deg == seen.runs[0].max_angle_from_coi_deg != ideal.max_angle_from_coi_deg
    assert ideal.outcome == kalman.outcome == alone.outcome == "stable"
    assert (ideal.rmse_mhz, alone.energy_mwh) == (None, None)
    assert alone.rmse_mhz > kalman.rmse_mhz
    assert 0 < ideal.energy_mwh < 4 * 50 * 2 / 3600  # MWh: never more than every device at full power all the time


def test_what_a_job_is_refused_for_is_in_its_row(results):
    late, controlled, good = results(
        SIMULATE + '[[job]]\nuntil_s = 1.1\n[[job]]\nestimator = "kalman"\ncontrol = "none"\n[[job]]\n'
    )
    assert [r.status for r in (late, controlled, good)] == ["error", "error", "ok"]
    assert "after its last event" in late.message
    assert "needs a control law" in controlled.message
    assert good.outcome == "lost_synchronism"
    assert good.worker
    assert good.version
    assert good.wall_s > 0


@pytest.mark.parametrize("estimator", ["ideal", "kalman"])
@pytest.mark.parametrize("ends", ["until_s = 0.8\nat_s = 1.0", "until_s = 1e-10\nat_s = 0.0"])
def test_a_run_that_ends_before_the_fault_is_refused(results, estimator, ends):
    head = SIMULATE.replace("until_s = 3\n", "")
    (result,) = results(f'{head}estimator = "{estimator}"\nstorage = "50MW"\n{ends}')
    assert result.status == "error"
    assert "must end after its last event" in result.message


def test_a_parameter_of_the_case_changes_the_result(results):
    found = results(SIMULATE.replace("11cyc", "5cyc") + 'set."genrou.1.H" = [6.5, 13]')
    assert {r.status for r in found} == {"ok"}
    assert found[0].max_angle_from_coi_deg != found[1].max_angle_from_coi_deg


def test_motors_change_the_result_and_the_key(results, cases):
    found = results(SIMULATE.replace("11cyc", "5cyc") + "motor_share = [0, 0.4]")
    case = cases("two_area").with_motors(0.4)
    run = case.initialize().simulate(Contingency("7", 5 / 60, ["7-8"]), 3.0)
    assert found[1].max_angle_from_coi_deg == run.max_angle_from_coi_deg != found[0].max_angle_from_coi_deg


@pytest.mark.parametrize(("stable_above", "monotone"), [((), 1), ((9.5,), 0)])
def test_whether_stability_is_monotone_is_in_the_row(results, monkeypatch, stable_above, monotone):
    found = SimpleNamespace(
        status="found", cycles=9.0, seconds=0.15, runs=(1, 2), machine=4, stable_above=stable_above, wall_s=0.0
    )
    monkeypatch.setattr(run_job, "clearing_time", lambda *_, **__: found)
    (result,) = results('kind = "clearing-time"\ncase = "two_area"\nfault = "7"\n')
    assert (result.monotone, result.cycles, result.runs, result.machine) == (monotone, 9.0, 2, 4)


def test_a_failure_that_must_not_be_is_marked_as_one(results, monkeypatch):
    monkeypatch.setattr(run_job, "simulate", lambda *_, **__: 1 / 0)
    (result,) = results(SIMULATE)
    assert result.status == "bug"
    assert result.message.startswith("ZeroDivisionError: division by zero.")

"""The result of a job: that of the equivalent call, or a sentence."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from systems import registered

import stabctl as st
from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.devices.exciters import sexs
from stabctl.dynamics import operating_point
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.jobs.task import run_task
from stabctl.model import fleet
from stabctl.simulation.contingency import Contingency
from stabctl.sweep import job, study_file
from stabctl.sweep.job import SWEEP
from stabctl.sweep.sweep import run_sweep, tasks

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


def test_supercapacitors_have_the_energy_of_their_key(results, cases):
    rows = results(SIMULATE + 'storage = "50MW"\nstorage_model = "supercap"\nstorage_energy_mwh = ["5kWh", 0.2]\n')
    for energy, row in zip((0.005, 0.2), rows, strict=True):
        case = cases("two_area").with_storage("50MW", storage_model="supercap", energy=energy)
        run = case.simulate(Contingency("7", 11 / 60, ["7-8"]), 3.0, control=BangBang(), record=True)
        assert row.energy_mwh == pytest.approx(np.ptp(run.arrays.energy, axis=0).sum(), rel=1e-12)
    assert rows[0].energy_mwh < 0.9 * rows[1].energy_mwh


@pytest.mark.slow
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


def test_the_energy_of_a_row_is_the_integral_of_the_power(results, cases):
    """In MWh, the largest change of each device, summed over devices of different ratings."""
    head = SIMULATE.replace('"11cyc"', '"9cyc"') + 'deadband_hz = 0.06\nstorage = "1=31MW,2=17MW,4=53MW"\n'
    (result,) = results(head)
    case = cases("two_area").with_storage({1: "31MW", 2: "17MW", 4: "53MW"})
    run = case.simulate(Contingency("7", 9 / 60, ["7-8"]), 3.0, control=BangBang(0.06))
    power = run.storage.to_numpy()
    into = np.vstack([np.zeros(3), np.cumsum(np.diff(run.time)[:, None] * (power[1:] + power[:-1]) / 2, axis=0)]) / 3600
    each = np.ptp(into, axis=0)
    assert len({*each.round(6)}) == 3
    assert result.energy_mwh == pytest.approx(each.sum(), rel=3e-4)  # 5.3e-5: the power changes between two rows
    assert result.energy_mwh == pytest.approx(np.ptp(run.arrays.energy, axis=0).sum(), rel=1e-12)


@pytest.mark.slow
def test_the_seed_of_a_job_is_that_of_its_noise(results, cases):
    """Rows of several seeds differ, and each is that of the call with its seed."""
    noisy = (
        'storage = "70MW"\nestimator = "frequency"\npmu_noise_mrad = 9\nloss = 0.3\nlatency_ms = 30\npmu_rate = 30\n'
    )
    found = results(f"{SIMULATE}{noisy}seed = [3, 8, 21]\n")
    point, wanted = cases("two_area").with_storage("70MW").initialize(), []
    for seed in (3, 8, 21):
        control = EstimatorControl([BangBang(0.1)], "frequency", Pmu.noisy(30, 9, 30, 0.3), seed=seed)
        run = point.simulate(Contingency("7", 11 / 60, "7-8"), 3.0, control=control)
        wanted.append((seed, run.max_angle_from_coi_deg, run.outcome.message))
    assert [(row.seed, row.max_angle_from_coi_deg, row.message) for row in found] == wanted
    assert len({angle for _, angle, _ in wanted}) == 3


def test_the_seed_of_a_clearing_time_is_that_of_its_noise(results, monkeypatch):
    def seen(*_, control, **__):
        found = {"status": "found", "seconds": 0.15, "runs": (), "machine": None, "stable_above": ()}
        return SimpleNamespace(cycles=float(control.seed), **found)

    monkeypatch.setattr(job, "clearing_time", seen)
    head = 'kind = "clearing-time"\ncase = "two_area"\nfault = "7"\nestimator = "kalman"\nseed = [3, 8]\n'
    assert [row.cycles for row in results(head)] == [3.0, 8.0]


def test_what_a_job_is_refused_for_is_in_its_row(results):
    heavy, good = results(SIMULATE + '[[job]]\nset."loads.7.p" = "9GW"\n[[job]]\n')
    assert [r.status for r in (heavy, good)] == ["error", "ok"]
    assert "power flow" in heavy.message
    assert good.outcome == "lost_synchronism"
    assert good.worker
    assert good.version
    assert good.wall_s > 0


@pytest.mark.parametrize("estimator", ["ideal", "kalman"])
@pytest.mark.parametrize("ends", ["until_s = 0.8\nat_s = 1.0", "until_s = 1e-10\nat_s = 0.0"])
def test_a_run_that_ends_before_the_fault_is_refused(results, estimator, ends):
    head = SIMULATE.replace("until_s = 3\n", "")
    with pytest.raises(StudyError, match=r"until_s = .*: the fault is not cleared before that"):
        results(f'{head}estimator = "{estimator}"\nstorage = "50MW"\n{ends}')


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
    monkeypatch.setattr(job, "clearing_time", lambda *_, **__: found)
    (result,) = results('kind = "clearing-time"\ncase = "two_area"\nfault = "7"\n')
    assert (result.monotone, result.cycles, result.runs, result.machine) == (monotone, 9.0, 2, 4)


def test_a_failure_that_must_not_be_is_marked_as_one(results, monkeypatch):
    monkeypatch.setattr(job, "simulate", lambda *_, **__: 1 / 0)
    (result,) = results(SIMULATE)
    assert result.status == "bug"
    assert result.message.startswith("ZeroDivisionError: division by zero.")


def test_a_device_file_that_is_edited_stops_the_sweep(tmp_path):
    """Workers would run what the keys of the rows do not say."""
    device, study = tmp_path / "own_exciter.py", tmp_path / "study.toml"
    source = Path(sexs.__file__).read_text().replace("from .", "from stabctl.devices.exciters.")
    device.write_text(source)
    with registered(device):
        case = st.load("two_area")
        case = case.with_device("own_exciter", 1, **case.devices["sexs"][1]._asdict())
        st.write(case, tmp_path / "mine")
        study.write_text('kind = "simulate"\ncase = "mine"\nfault = "7"\nclear = "6cyc"\nuntil_s = 1.2\n')
        assert run_sweep(study, tmp_path / "a.db", workers=1).errors == 0
        device.write_text(source.replace("Output(clip(", "Output(0.5 * clip("))
        with pytest.raises(StudyError, match=r"own_exciter\.py has been edited since the study began"):
            run_sweep(study, tmp_path / "b.db", workers=1)
        devices.register(device)
        assert run_sweep(study, tmp_path / "b.db", workers=1).errors == 0

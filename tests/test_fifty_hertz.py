"""A system of 50 Hz: wherever the frequency of the case counts, 60 in its place would be noticed.

With inertias 6/5 as long, a classical system of 50 Hz takes 6/5 as long for everything: as many cycles as at 60 Hz.
"""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from systems import registered

from stabctl import io
from stabctl.clearing import clearing_time, screen
from stabctl.cli import shared
from stabctl.cli.groups import StabilityOptions
from stabctl.controllers import BangBang, Feedback, StorageDevice
from stabctl.dynamics import operating_point
from stabctl.estimation.estimate import estimate
from stabctl.estimation.pmu import Instrument, Pmu
from stabctl.jobs.task import run_task
from stabctl.model import powerflow
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion, checked
from stabctl.simulation.simulate import simulate
from stabctl.sweep import study_file
from stabctl.sweep.sweep import tasks

KEEP_ON = Criterion(max_angle=np.inf)


@cache
def point(hz, name="two_area", storage=None, *, slower=True):
    """Operating point of the classical machines at a frequency; `slower` with their inertia in proportion to 1/hz."""
    case = io.load(name).classical()
    rows = case.devices["gencls"].items()
    inertia = {i: par._replace(H=par.H * 60 / hz if slower else par.H) for i, par in rows}
    case = replace(case, frequency_hz=float(hz), devices={"gencls": inertia})
    return operating_point.solve(case.with_storage(storage) if storage else case)


def test_a_power_flow_has_no_frequency():
    sixty, fifty = (powerflow.solve(replace(io.load("two_area"), frequency_hz=hz)) for hz in (60.0, 50.0))
    assert np.abs(sixty.V - fifty.V).max() < 1e-12
    assert np.abs(sixty.S - fifty.S).max() < 1e-12


@pytest.mark.parametrize("storage", [None, "50MW"])
def test_a_slower_system_does_the_same_in_as_many_cycles(storage):
    runs = []
    for hz in (60, 50):
        fault = Contingency("7-8@0.1", clear="6cyc", at="6cyc")
        control = BangBang(deadband=0.1 * hz / 60) if storage else None
        options = {"control": control, "step": "0.5cyc", "criterion": KEEP_ON}
        runs.append(simulate(point(hz, storage=storage), fault, "120cyc", **options))
    sixty, fifty = runs
    assert np.abs(sixty.time * 60 - fifty.time * 50).max() < 1e-9
    assert np.abs(sixty.arrays.speed - fifty.arrays.speed).max() < 1e-12
    assert np.abs(sixty.arrays.angle - fifty.arrays.angle).max() < 1e-10
    if storage:
        assert (np.abs(fifty.arrays.order) == 1).any()
        assert (sixty.arrays.order == fifty.arrays.order).all()
        assert np.abs(sixty.arrays.energy * 60 - fifty.arrays.energy * 50).max() < 1e-9


def test_an_angle_moves_by_the_frequency_times_the_slip():
    run = simulate(point(50), Contingency("7", clear="5cyc", at=0.1), 1.0, step="1ms", criterion=KEEP_ON)
    moved = 2 * np.pi * 50 * np.trapezoid(run.arrays.speed - 1, run.time, axis=0)
    assert np.abs(run.arrays.angle[-1] - run.arrays.angle[0] - moved).max() < 1e-6  # rad of 1.1; 2e-7


@pytest.mark.parametrize("storage", [None, "50MW"])
def test_clearing_times_are_the_same_in_cycles(storage):
    found = []
    for hz in (60, 50):
        control = BangBang(deadband=0.1 * hz / 60) if storage else None
        options = {"observe": "200cyc", "step": "0.5cyc", "criterion": Criterion(low_voltage_s=0.5 * 60 / hz)}
        found.append(clearing_time(point(hz, storage=storage), "7-8@0.4", control=control, scan=0, **options))
    sixty, fifty = found
    assert fifty.cycles == sixty.cycles
    assert fifty.seconds == fifty.cycles / 50
    assert [(run.cycles, run.outcome) for run in fifty.runs] == [(run.cycles, run.outcome) for run in sixty.runs]


def test_gains_and_deadband_of_feedback_are_in_hertz_and_radians():
    par = Feedback(0.02, 0.01, deadband=0.5).par(StorageDevice(rating=45.0, machine=900.0, frequency=50.0))
    assert par.deadband == 0.01
    assert par.speed_gain == pytest.approx(0.02 * 2 * np.pi * 50 * 900 / 45)
    assert par.acceleration_gain == par.speed_gain / 2


def test_the_frequency_of_a_bus_is_the_rate_of_its_angle():
    """A slower system at slower oscillations responds alike, in pu."""
    sixty, fifty = (
        point(hz, storage="50MW").linearize("power:2", "frequency:7").response(np.array([0.3, 1.0, 3.0]) * hz / 60)
        for hz in (60, 50)
    )
    assert np.abs(fifty - sixty).max() < 1e-9 * np.abs(sixty).max()


def test_the_measured_frequency_of_a_bus_is_its_filtered_frequency():
    """The filter has 20 ms at any frequency of the system."""
    hz = np.array([0.3, 1.0, 3.0])
    both = point(50, storage="50MW").linearize("power:2", "frequency:7,bus_frequency:7").response(hz)
    assert np.abs(both[:, 1, 0] * (1 + 0.02j * 2 * np.pi * hz) / both[:, 0, 0] - 1).max() < 1e-9  # 6e-14


REACTOR = '''
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE

NAME = "reactor"
ROLE = "shunt"


class Par(NamedTuple):
    """Constants."""

    wb: Annotated[float, "rad/s", "base speed", FROM_CASE]
    V0: Annotated[float, "pu", "voltage without current"]


@inline
def current(v, p):
    """Injected current (pu)."""
    return 0 * v[0], 0 * v[1]
'''


def test_devices_at_buses_know_the_base_speed(tmp_path):
    path = tmp_path / "reactor.py"
    path.write_text(REACTOR)
    with registered(path) as (device,):
        case = io.load("two_area").classical().set("frequency_hz", 50)
        case = replace(case, devices=case.devices | {"reactor": {7: device.Par(0, 1.0)}})
        assert operating_point.solve(case).constants("reactor")[1]["wb"] == 2 * np.pi * 50


def test_two_area_at_fifty_hertz():
    """9 cycles at 60 Hz: the same inertia and the same torque, but an angle that grows more slowly."""
    found = clearing_time(io.load("two_area").set("frequency_hz", 50), "7-8@0", scan=0)
    assert (found.cycles, found.seconds) == (8.625, 0.1725)


def test_a_screen_counts_cycles_of_the_case():
    options = {"buses": [7], "resolution": "0.5cyc", "limit": "20cyc", "longest": 0}
    found = (screen(point(hz), observe=f"{100 / hz}s", below=f"{15 / hz}s", **options) for hz in (60, 50, 120))
    sixty, fifty, fast = found
    assert max(p.cycles for p in sixty.pairs) > 15 / 2
    for other in (fifty, fast):
        assert [(p.fault, p.trip, p.cycles) for p in other.pairs] == [(p.fault, p.trip, p.cycles) for p in sixty.pairs]
    assert fifty.search.limit_cycles == 15
    least = min(p.seconds for p in fifty.pairs)
    assert fifty.pairs[0].cycles == 50 * least
    assert not fifty.below(least).pairs
    assert fifty.below(least + 1e-6).pairs == fifty.pairs[: len(fifty.below(f"{50 * least + 1e-4}cyc").pairs)] != ()


def test_options_of_commands_count_cycles_of_the_case():
    case = io.load("two_area").set("frequency_hz", 50)
    assert shared.lag("5cyc", case) == 0.1
    opened, tripped, stepped = shared.events(case, ["7-8@25cyc"], ["2@50cyc"], ["7:+50MW@5cyc"])
    assert (opened.at, tripped.at, stepped.at) == (0.5, 1.0, 0.1)
    limits = StabilityOptions(min_frequency=47.5, max_frequency=51.5, frequency_delay="25cyc").criterion(case)
    assert (limits.min_frequency, limits.max_frequency, limits.frequency_delay_s) == (0.95, 1.03, 0.5)


def test_frequencies_of_a_criterion_are_relative_to_that_of_the_case():
    given = Criterion(max_angle="180deg", min_frequency="47.5Hz", max_frequency="51.5Hz", low_voltage_s="300ms")
    found = checked(given, 50.0)
    assert (found.min_frequency, found.max_frequency) == (pytest.approx(0.95), pytest.approx(1.03))
    assert (found.max_angle, found.low_voltage_s) == (pytest.approx(np.pi), pytest.approx(0.3))


def test_an_estimate_ends_after_cycles_of_the_case(stabctl):
    words = ("estimate", "two_area", "--classical", "--set", "frequency_hz=50", "--storage", "50MW", "--fault", "7")
    out = stabctl(*words, "--at", 0.5, "--clear", "5cyc", "--observe", "15cyc", "--pmu-rate", 50, "--json")[1]
    assert "until 0.900 s" in json.loads(out)["message"]


def test_a_pmu_reports_the_frequency_of_a_turning_phasor():
    instrument = Instrument(Pmu.exact(50), (1,), 1, 50.0)
    for k in range(4):
        V = np.exp(2j * np.pi * (0.5 * k / 50 + 0.25 * (k / 50) ** 2)).reshape(1, 1)  # 0.5 Hz, and 0.5 Hz/s more
        frame = instrument.report(k / 50, V, V, V.real)
    assert 50 * frame.frequency[0, 0] == pytest.approx(0.5 + 0.5 * 2.5 / 50, abs=1e-12)
    assert 50 * frame.rocof[0, 0] == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("hz", [50, 60])
@pytest.mark.parametrize(("name", "frames"), [("none", 0), ("P", 1), ("M", 3)])
def test_the_window_of_a_class_has_as_many_cycles(hz, name, frames):
    """One report per cycle: the window of class P reaches one cycle to each side, that of class M three."""
    pmu = Pmu.exact(hz, filter_class=name)
    assert pmu.own_frames(hz) == pmu.remote_frames(hz) == frames
    instrument, reported = Instrument(pmu, (1,), 1, float(hz)), []
    for k in range(12):
        V = np.full((1, 1), 1.0 if k == 5 else 0.0, complex)
        reported.append(instrument.report(k / hz, V, V, V.real).V[0, 0])
    assert np.flatnonzero(reported).tolist() == list(range(5, 5 + 2 * frames + 1))
    assert sum(reported) == pytest.approx(1)
    assert np.argmax(np.abs(reported)) == 5 + frames


def test_noise_of_a_pmu_is_in_hertz_and_seconds():
    one = np.ones((1, 4000), complex)
    frequency = Instrument(Pmu.exact(50, frequency=0.01, rocof=0.2), (1,), 4000, 50.0).report(0, one, one, one.real)
    clock = Instrument(Pmu.exact(50, clock=1e-4), (1,), 4000, 50.0).report(0, one, one, one.real)
    assert 50 * np.std(frequency.frequency) == pytest.approx(0.01, rel=0.05)
    assert 50 * np.std(frequency.rocof) == pytest.approx(0.2, rel=0.05)
    assert np.std(np.angle(clock.V)) == pytest.approx(2 * np.pi * 50 * 1e-4, rel=0.05)


@pytest.mark.parametrize(("estimator", "mhz"), [("kalman", 0.5), ("kinematic", 20)])  # 0.2, 10.8
def test_an_estimator_follows_the_speeds(estimator, mhz):
    fault = Contingency("7", clear="5cyc", at=0.2)
    found = estimate(point(50, storage="50MW"), fault, "100cyc", estimator=estimator, pmu=Pmu.exact(50))
    assert found.time[-1] == pytest.approx(2.0, abs=0.021)
    error = 50e3 * np.abs(found.deviation_estimated - found.deviation)
    assert found.accuracy.rmse_mhz == pytest.approx(np.sqrt(np.mean(error[found.time > 0.349] ** 2)))
    assert found.accuracy.rmse_mhz < mhz
    assert found.deadband == 0.1 / 50


def test_a_sweep_changes_the_frequency(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        'kind = "clearing-time"\ncase = "two_area"\nmachines = "classical"\nfault = "7-8@0.4"\nscan = "0cyc"\n'
        'set."frequency_hz" = [60, 50]\nstorage = ["none", "50MW"]\n'
    )
    found = [run_task(task).values for task in tasks(study_file.read(path), path)]
    expected = [
        clearing_time(point(hz, storage=storage, slower=False), "7-8@0.4", scan=0, control=storage and BangBang())
        for hz in (60, 50)
        for storage in (None, "50MW")
    ]
    assert sorted((r["cycles"], r["seconds"]) for r in found) == sorted((e.cycles, e.seconds) for e in expected)

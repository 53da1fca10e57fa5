"""Bad PMUs: frozen, drifting, turned, spoofed; each is named, left out, and the loop hardly notices."""

import numpy as np
import pytest

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.controllers import Feedback
from stabctl.estimation._bad_data import PmuCheck, Residuals
from stabctl.estimation._network_model import NetworkModel
from stabctl.estimation.estimate import estimate
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import BadPmu, BadReports, Instrument, Pmu
from stabctl.estimation.rotor_units import Terminals
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulate import simulate
from stabctl.simulation.simulation import Simulation

FAULT = Contingency("7", "11cyc", "7-8")
KINDS = {  # what is wrong, and seconds within which it is found
    "frozen": ({"frozen": True}, 0.1),
    "jump": ({"jump": "5deg"}, 0.1),
    "ramp": ({"ramp": "1deg"}, 0.8),  # 0.42..0.65 at machines 1 to 4 with 8 seeds, with and without the fault
    "drift": ({"drift": "30us"}, 1.1),  # 0.52..0.98
    "slow drift": ({"drift": "1us"}, 12.0),  # 7.0..11.1
}


def control(*bad):
    return EstimatorControl(pmu=Pmu(bad=bad), engine="batched", check_pmus=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "at"),
    [("jump", 1.1), *(pytest.param(kind, at, marks=pytest.mark.slow) for kind in list(KINDS)[:4] for at in (0.5, 1.1))],
)
def test_a_bad_pmu_is_named_and_the_speeds_stay_right(kind, at):
    wrong, within = KINDS[kind]
    bad = BadPmu(3, at, **wrong)
    found = estimate(io.load("two_area"), FAULT, 3.5, storage="50MW", control=control(bad), seeds=(1, 2), record=False)
    assert [(alarm.seed, alarm.machine) for alarm in sorted(found.alarms)] == [(1, 3), (2, 3)]
    assert all(at < alarm.time_s + 1e-9 < at + within for alarm in found.alarms)
    assert "PMU of machine 3" in str(found)
    late = found.time > at + within + 0.7
    error = (found.deviation_estimated - found.deviation)[late] * 60e3
    assert np.sqrt(np.mean(error**2)) < 7  # 2.5..6.2 mHz; 2.2 with good PMUs
    assert all(run.outcome.stable for run in found.runs)


@pytest.mark.slow
def test_good_pmus_raise_no_alarm_in_a_fault():
    found = estimate(io.load("two_area"), FAULT, 4, storage="50MW", control=control(), seeds=(1, 2, 3), record=False)
    assert found.alarms == ()


def test_of_two_pmus_that_explain_the_same_neither_is_named():
    """Means 0.2 s after a jump of 5 degrees, of two machines alone: which of them it was shows in the second order."""
    both, apart = np.array([[1], [1]]) / 2**0.5, np.array([[1], [-1]]) / 2**0.5
    e, G = np.array([1.3e-3 - 3e-2j, 1.2e-3 + 3e-2j]), np.array([[1, -1.004], [-0.992, 1]])
    of, near, wide = np.array([0, 1, 0, 1]), (9e-5 * both) @ (9e-5 * both).T, (9e-4 * apart) @ (9e-4 * apart).T
    assert Residuals(of, e, near + wide, G).suspects(0.0) == {}


@pytest.mark.slow
def test_a_pmu_that_is_right_again_is_used_again_after_five_seconds():
    bad = BadPmu(3, 0.5, jump="5deg", until=1.0)
    found = estimate(io.load("two_area"), None, 7, storage="50MW", control=control(bad), record=False)
    out, back = found.alarms
    assert (out.machine, back.machine, out.left_out, back.left_out) == (3, 3, True, False)
    assert 0.5 - 1e-9 < out.time_s < 0.6
    assert 6.0 - 1e-9 < back.time_s < 6.5  # 6.15: lost reports do not count
    assert "used again" in str(back)


@pytest.mark.parametrize("at_first", [0.0, 0.1])
@pytest.mark.parametrize("wrong", [{"jump": "5deg"}, {"ramp": "9deg"}, {"drift": "30us"}])
def test_a_wrong_clock_reports_what_turned_phasors_would(wrong, at_first):
    """Voltage, current, frequency and ROCOF: of bad reports, and of a PMU that sees phasors turned in this way."""
    bad = BadPmu(1, at_first, **wrong, until=0.2)
    pmu = Pmu.exact(bad=(bad,))
    spoil, healthy, seen = BadReports(pmu, [1], 60.0), Instrument(pmu, (1,), 2, 60.0), Instrument(pmu, (1,), 2, 60.0)
    for k in range(20):
        at = k / 60
        V = np.exp(1j * np.array([[0.3 * at, 0.2 + at**2]]))
        wrong_now = at_first - 1e-9 < at < 0.2 - 1e-9
        turn = (bad.jump + (bad.ramp + 120 * np.pi * bad.drift) * (at - at_first)) if wrong_now else 0.0
        turned = V * np.exp(1j * turn * np.array([0, 1]))
        told = spoil(at, healthy.report(at, V, 0.5 * V, V.real))
        right = seen.report(at, turned, 0.5 * turned, V.real)
        for name in ("V", "I", "frequency", "rocof"):
            assert getattr(told, name) == pytest.approx(getattr(right, name), abs=1e-11)  # 2e-13 of the ROCOF


def test_a_frozen_pmu_repeats_its_whole_report():
    pmu = Pmu(bad=(BadPmu(1, 0.1, frozen=True),))
    spoil, meter = BadReports(pmu, [1], 60.0), Instrument(pmu, (1,), 2, 60.0)
    seen = (np.exp(1j * np.full((2, 1, 2), k / 9)) for k in range(9))
    frames = [spoil(k / 60, meter.report(k / 60, *phasors, np.ones((1, 2)))) for k, phasors in enumerate(seen)]
    for name in ("V", "I", "frequency", "rocof"):
        own = np.array([getattr(frame, name)[0] for frame in frames])
        assert (own[6:, 1] == own[5, 1]).all()
        assert (own[6:, 0] != own[5:-1, 0]).all()


def test_the_frequency_estimator_sees_a_bad_pmu():
    """36 degrees more in every second are 0.1 Hz, in the deviation of the machine itself and in that of the others."""
    found = []
    for bad in ((), (BadPmu(3, "0.5s", ramp="36deg"),)):
        how = EstimatorControl(Feedback(0.0), "frequency", Pmu.exact(bad=bad))
        found.append(estimate(io.load("two_area"), None, 1, storage="3=50MW", control=how, record=False))
    error = 60 * (found[1].deviation_estimated - found[0].deviation_estimated)[-1, 0]
    H = np.array([6.5, 6.5, 6.175, 6.175])
    assert error == pytest.approx(np.where([0, 0, 1, 0], 0.1, -0.1 * H[2] / (H.sum() - H)), abs=1e-9)  # 3e-12


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(KINDS)[:4])
@pytest.mark.parametrize("pair", [(1, 10), (3, 9), (4, 5)])
def test_two_bad_pmus_of_ten_are_both_named_and_no_other(kind, pair):
    wrong, within = KINDS[kind]
    bad = [BadPmu(machine, 1.05, **wrong) for machine in pair]
    fault = Contingency("16", "6cyc", "16-17")
    found = estimate(io.load("ieee39"), fault, 3.5, storage="5%mva", control=control(*bad), seeds=(1, 2), record=False)
    assert sorted((a.seed, a.machine) for a in found.alarms) == [(seed, machine) for seed in (1, 2) for machine in pair]
    assert all(a.time_s < 1.05 + within + 0.3 for a in found.alarms)  # ramp and drift after 0.6 to 1.2 s


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_loop_with_a_bad_pmu_keeps_its_clearing_time(kind):
    """12.25 cycles with good PMUs, and with a bad one no more than a quarter of a cycle from that."""
    assert stable_after((12, 12.5), BadPmu(3, 1.0, **KINDS[kind][0])) == [True, False]


@pytest.mark.slow
def test_the_clearing_time_with_good_pmus_is_a_dozen_cycles_and_a_quarter():
    assert stable_after((12.25, 12.375)) == [True, False]


def stable_after(cycles, *bad):
    point = io.load("two_area").initialize(storage="50MW")
    runs = [simulate(point, Contingency("7", f"{n}cyc", "7-8"), 11, control=control(*bad)) for n in cycles]
    return [run.outcome.stable for run in runs]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "minutes"), [("two_area", 10), ("ieee39", 2)])
def test_no_false_alarm(points, name, minutes):
    """Six seeds, an hour of frames of two_area in all (216,000); T of a good PMU is beyond 40 once in 5e8 frames."""
    point, seeds, pmu = points(name), 6, Pmu()
    simulation, network = Simulation(setup(point)), NetworkModel(point)
    V, I = Terminals(simulation).phasors(point.V)
    others = network.other_currents(point.V, I, simulation.switching)
    instrument = Instrument(pmu, range(seeds), len(V), 60.0)
    meters = Instrument(Pmu(loss=0.0), [[k, 2] for k in range(seeds)], len(others), 60.0)
    check, used = PmuCheck(network, pmu, 60.0, (seeds, len(V))), np.ones((seeds, len(V)), bool)
    rows = [np.tile(each, (seeds, 1)) for each in (V, I, 0 * V.real, others)]
    for k in range(minutes * 3600):
        metered = meters.report(k / 60, rows[3], rows[3], rows[3].real).I
        frame = instrument.report(k / 60, *rows[:3])
        assert check(frame, metered, [simulation.switching] * seeds, used) == []


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"at": -1}, "at = -1"),
        ({"at": 1, "jump": "90us"}, "jump"),
        ({"at": 1, "drift": 3}, "drift"),
        ({"at": 2, "frozen": True, "until": "1s"}, "give a later end"),
        ({"at": 1}, "Nothing is wrong with the PMU of machine 3"),
    ],
)
def test_mistakes_are_sentences(given, says):
    with pytest.raises(StudyError, match=says):
        BadPmu(3, **given)


def test_a_bad_pmu_is_one_of_the_case(points):
    with pytest.raises(StudyError, match="has no machine 9"):
        estimate(points("two_area"), FAULT, control=control(BadPmu(9, 1.0, frozen=True)))

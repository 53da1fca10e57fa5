"""Where a run lands in time: steps, events, intervals, ends."""

from dataclasses import replace

import numpy as np
import pytest
from comparison import KEEP_ON
from systems import REGC_C, small

from stabctl._util.errors import StudyError
from stabctl.controllers import BangBang, Controller, Gate
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import initialize
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.simulation import steps
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import (
    Clear,
    Fault,
    LoadStep,
    Open,
)
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation, run


@pytest.fixture(scope="module")
def two_area(points):
    return points("two_area")


LATER = {
    "none": None,
    "continuous": BangBang(),
    "sampled": BangBang().sampled(50, "40ms"),
    "gate": Controller("deviation", "order", [], [], [], 100 * np.eye(4), gate=Gate(end=5.0037)),
    "function": Controller.from_function(lambda seen: 100 * seen["deviation"], "deviation", "order", rate=25),
    "estimator": EstimatorControl(BangBang(), pmu=Pmu(rate=25)),
}  # what ends neither at a step nor at a frame


class TestTime:
    def test_it_lands_exactly_on_every_event(self, two_area):
        instants = (0.1, 0.1 + 1 / 77, 0.3, 0.3 + 1e-4)
        events = [
            Fault("7", instants[0]),
            Clear("7", instants[1]),
            Open("7-8", instants[2]),
            LoadStep(7, instants[3], 5.0),
        ]
        traced = run(two_area, events, 0.5, step=1 / 100)
        for t in (*instants, 0.0, 0.5):
            assert np.abs(traced.time - t).min() < 1e-12
        assert np.diff(traced.time).max() <= 0.01 + 1e-12
        assert (np.diff(traced.time) > 0).all()
        assert traced.steps == len(traced.time) - 1

    def test_an_interval_at_a_time_equals_one_run(self, two_area):
        events = Contingency("7", 8 / 60, ["7-8"], at=0.5)
        whole = run(two_area, events, 2.0, step=1 / 120)
        sim = Simulation(setup(two_area, step=1 / 120), events)
        for k in range(1, 61):
            assert sim.advance(k / 30)
        pieces = sim.finish()
        assert np.array_equal(np.round(whole.time, 9), np.round(pieces.time, 9))
        assert np.abs(whole.arrays.speed - pieces.arrays.speed).max() < 1e-7
        quiet = replace(two_area.case, loads=tuple(d._replace(p_current=0.0) for d in two_area.case.loads))
        point = operating_point.solve(quiet)
        whole, sim = run(point, events, 2.0, step=1 / 120), Simulation(setup(point, step=1 / 120), events)
        for k in range(1, 61):
            sim.advance(k / 30)
        assert np.abs(whole.arrays.speed - sim.finish().arrays.speed).max() < 1e-11

    def test_a_late_start_finds_the_events_before_it_done(self, two_area):
        traced = run(two_area, [Open("7-8", 0.5)], 1.5, start=1.0)
        assert traced.time[0] == 1.0
        assert np.ptp(traced.arrays.speed) > 1e-5

    def test_an_early_stop_ends_the_run_at_the_slip(self, two_area):
        traced = run(two_area, Contingency("7", 0.3, ["7-8"]), 10.0)
        assert traced.outcome.kind == "lost_synchronism"
        assert traced.time[-1] == pytest.approx(traced.outcome.time_s)
        assert traced.outcome.time_s < 4
        assert traced.max_angle_from_coi_deg >= np.rad2deg(3.5)
        later = run(two_area, Contingency("7", 0.3, ["7-8"]), 10.0, criterion=Criterion(max_angle=6.0))
        assert later.outcome.time_s > traced.outcome.time_s

    def test_the_slip_is_measured_against_the_centre_of_inertia(self, two_area):
        traced = run(two_area, Contingency("7", 0.3, ["7-8"]), 10.0)
        H = two_area.inertia
        change = traced.arrays.angle - traced.arrays.angle[0]
        off = np.abs(change - (change @ H / H.sum())[:, None])
        assert np.rad2deg(off.max()) == pytest.approx(traced.max_angle_from_coi_deg, abs=1e-9)
        assert two_area.case.machines[off[-1].argmax()].machine == traced.outcome.machine
        assert (off[:-1] < 3.5).all()

    @pytest.mark.parametrize("rates", [(), (50,), (30, 50)])
    @pytest.mark.parametrize("start", [0.0, 0.137])
    def test_a_run_does_not_depend_on_where_it_ends(self, rates, start):
        long = steps.steps(start, 3.0, 1 / 120, rates, whole=np.inf)
        for end in (start + 1.0, start + 1.0 + 1e-9, 1.234567, 2.0 - 1e-9, 2.9999):
            short = steps.steps(start, end, 1 / 120, rates, whole=np.inf)
            n = len(short.sizes)
            assert np.array_equal(short.starts, long.starts[:n])
            assert np.array_equal(short.sizes[:-1], long.sizes[: n - 1])
            assert np.array_equal(short.due, long.due[: len(short.due)])
            assert short.starts[-1] + short.sizes[-1] == pytest.approx(end, abs=1e-12)
            assert 0 < short.sizes[-1] < long.sizes[n - 1] * (1 + 1e-5)
            begun = steps.whole(start, end, 1 / 120, rates)
            again = steps.steps(begun, 3.0, 1 / 120, rates, whole=np.inf)
            assert begun <= end + 1e-9
            assert again.starts == pytest.approx(long.starts[-len(again.starts) :], abs=1e-12)
            assert again.sizes == pytest.approx(long.sizes[-len(again.sizes) :], abs=1e-12)

    @pytest.mark.parametrize("control", LATER.values(), ids=LATER)
    def test_a_later_end_changes_nothing_before_it(self, points, control):
        point = initialize(points("two_area").case, "20MW")
        fault = Contingency("1-5@0.5", clear="7cyc")
        whole = run(point, fault, 6.0, control)
        for end in (4.0, 4.0 + 1e-9, 4.113):
            part = run(point, fault, end, control)
            n = len(part.time) - 2  # the last step is shorter, which its row says
            assert np.array_equal(part.time[:n], whole.time[:n])
            assert np.array_equal(part.rows[:n], whole.rows[:n])

    def test_without_record_the_outcome_is_the_same(self, two_area):
        events = Contingency("7", 0.3, ["7-8"])
        a, b = run(two_area, events, 5.0), run(two_area, events, 5.0, record=False)
        assert (a.outcome, a.steps) == (b.outcome, b.steps)
        assert a.peak == pytest.approx(b.peak, abs=0)
        assert len(b.rows) == 0


class TestLimitsOfTheStep:
    def test_steps(self, two_area):
        longest = steps.REACH / two_area.fastest
        with pytest.raises(StudyError, match=r"^The step 0\.05 s is too long for two_area, whose fastest eigenvalue"):
            run(two_area, step=0.05)
        for bad in (0.0, -0.1, float("nan"), float("inf")):
            with pytest.raises(StudyError, match=r"^The step .* s is not allowed; it must be at least 1e-07 s\.$"):
                run(two_area, step=bad)
        assert run(two_area, [LoadStep(7, 0.1, 10.0)], 1.0, step=0.99 * longest).outcome.kind == "stable"

    @pytest.mark.parametrize(
        ("path", "value", "says"),
        [
            ("genrou.3.T2d", 2e-5, r"T2d = 2e-05 s of genrou, machine 3 at bus 3\)"),
            ("sexs.2.TR", 1.1e-3, r"TR = 0.0011 s of sexs, machine 2 at bus 2; a control lag below 1 ms is bypassed\)"),
        ],
    )
    def test_a_short_step_names_the_time_constant_that_forces_it(self, cases, path, value, says):
        point = operating_point.solve(cases("two_area").set(path, value))
        assert steps.checked(point, None) < steps.STEP
        with pytest.raises(StudyError, match=says):
            run(point, step=0.01)

    @pytest.mark.parametrize(
        ("given", "fastest", "says"),
        [
            ({"Kip": 12.0, "Te": 0.02}, 13 / 0.02, "current control of REGC_C 1"),
            ({"Kppll": 800.0, "wmax": 99.0, "wmin": -99.0}, 800.0, "PLL of REGC_C 1"),
        ],
    )
    def test_a_short_step_names_the_loop_that_forces_it(self, given, fastest, says):
        """The current control has (1 + Kip)/Te, the phase-locked loop Kppll; no time constant is as short."""
        point = operating_point.solve(small({"regc_c": REGC_C._replace(**given)}))
        assert point.fastest == pytest.approx(fastest, rel=0.05)
        assert steps.checked(point, None) == pytest.approx(steps.REACH / point.fastest / 2)
        with pytest.raises(StudyError, match=rf"near {point.fastest:.0f} 1/s \({says}\); give at most"):
            run(point, step=0.01)

    def test_the_longest_step_is_carried_and_twice_as_long_would_not_be(self, two_area, monkeypatch):
        longest = steps.REACH / two_area.fastest
        events = [LoadStep(7, 0.1, 10.0)]
        carried = run(two_area, events, 3.0, step=longest, criterion=KEEP_ON)
        assert np.abs(np.diff(carried.arrays.Efd[-20:], axis=0)).max() < 0.01
        monkeypatch.setattr(steps, "REACH", 10.0)
        wild = run(two_area, events, 3.0, step=2 * longest, criterion=KEEP_ON)
        assert np.abs(wild.arrays.Efd[-1] - carried.arrays.Efd[0]).max() > 2.5

    @pytest.mark.parametrize("until", [0.0, -1.0, float("nan"), float("inf")])
    def test_ends(self, two_area, until):
        with pytest.raises(StudyError, match=r"it must end after its start"):
            run(two_area, until=until)


class TestLength:
    def test_a_run_of_too_many_steps_is_refused_before_it_starts(self, two_area):
        for control in (None, EstimatorControl(BangBang())):
            with pytest.raises(StudyError, match=r"1e\+09 s takes 1.2e\+11 steps, more than the 5e\+07 "):
                run(two_area.case.with_storage("50MW").initialize(), None, 1e9, control)

    def test_too_many_steps_name_the_time_constant_that_makes_them_short(self, cases, two_area):
        short = operating_point.solve(cases("two_area").set("genrou.3.T2d", 2e-5))
        with pytest.raises(StudyError, match=r"steps \(T2d = 2e-05 s of genrou, machine 3 at bus 3\), more than"):
            run(short, None, 1e6)
        with pytest.raises(StudyError, match=r"takes 1\.2e\+08 steps, more than the 5e\+07 allowed"):
            run(two_area, None, 1e6)
        steps.affordable(two_area, 0.01, 0.01 * steps.MOST, 0)  # as many as are allowed
        with pytest.raises(StudyError, match=r"takes 1e\+09 steps, more than"):  # nothing but the user forces it
            run(short, None, 1e3, step=1e-6)

    def test_a_record_that_would_fill_the_memory_is_refused(self, two_area, monkeypatch):
        monkeypatch.setattr(steps, "memory", lambda: 2e6)
        with pytest.raises(StudyError, match=r"100 s takes .* GB, more than half of the memory \(0.001 GB\)"):
            run(two_area, None, 100.0)
        assert run(two_area, None, 0.1, record=False).outcome.stable

    def test_the_size_of_a_record_is_that_of_its_numbers(self, two_area, monkeypatch):
        """Half of the memory holds it exactly, and a byte less does not."""
        made = run(two_area, None, 3.0, step=0.01)
        width, length = made.rows.shape[1], 300 * 0.01
        size = 300 * width * made.rows.itemsize
        monkeypatch.setattr(steps, "memory", lambda: 2 * size * (1 + 1e-12))
        steps.affordable(two_area, 0.01, length, width)
        monkeypatch.setattr(steps, "memory", lambda: 2 * size - 2)
        with pytest.raises(StudyError, match=rf"takes {size / 1e9:.3g} GB".replace(".", r"\.")):
            steps.affordable(two_area, 0.01, length, width)

    def test_the_memory_is_known(self):
        assert 1e8 < steps.memory() < 1e15

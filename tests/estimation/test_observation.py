"""What the estimators are given, frame by frame: truth, computed reports, and PMUs that are left out and come back."""

from types import SimpleNamespace

import numpy as np
import pytest
from uneven import uneven_point

import stabctl as st
from stabctl.estimation._observation import LONG, Observation
from stabctl.estimation.pmu import Pmu
from stabctl.estimation.rotor_units import Terminals
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

EXACT = {"angle": 0.0, "magnitude": 0.0, "clock": 0.0, "loss": 0.0}


@pytest.mark.parametrize(("filter_class", "window"), [("none", 0), ("P", 2), ("M", 6)])
def test_a_machine_without_a_pmu_has_a_report_when_the_network_has_been_the_same_for_a_window(filter_class, window):
    """A line opens in the second of two simulations; before the frame the reports are those of the network at rest."""
    point = uneven_point()
    simulations = [Simulation(setup(point)), Simulation(setup(point), [st.Open("30-40#2", 0.05)])]
    pmu = Pmu(rate=50, **EXACT, missing=(3,), filter_class=filter_class)
    seen = Observation(simulations, pmu, (1, 2))
    assert seen._late == 3
    since = [LONG, LONG]
    for k in range(14):
        for s in simulations:
            s.advance(k / 50)
        truth, frame = seen(k / 50)
        for n, s in enumerate(simulations):
            V, I = Terminals(s).phasors(s.V)
            assert truth.V[n] == pytest.approx(V, abs=1e-5)
            assert truth.I[n] == pytest.approx(I, abs=1e-5)
            assert truth.slip[n] == pytest.approx(s.speed - 1, abs=1e-5)
            assert truth.delta[n] == pytest.approx(s.angle, abs=1e-5)
            assert truth.acceleration[n] == pytest.approx(s.acceleration, abs=1e-5)
            assert truth.island[n] == pytest.approx(s.island, abs=1e-5)
            assert truth.buses[n] == pytest.approx(s.V, abs=1e-5)
            opened = n == 1 and s.switching.branches
            since[n] = 0 if opened and since[n] >= LONG else since[n] + 1
            assert frame.since[n, 0] == since[n]
            known = since[n] >= window
            assert frame.received[n].tolist() == [True, known, True, True]
            assert frame.parts.computed[n].tolist() == [False, known, False, False]
            if window == 0:
                assert frame.V[n] == pytest.approx(V, abs=1e-6)
                assert frame.I[n] == pytest.approx(I, abs=1e-5)
            if not known:
                assert (frame.V[n, 1], frame.I[n, 1]) == (1.0, 0.0)
                assert not frame.parts.V[n].any()
            others = np.array([0, 2, 3])
            assert not frame.parts.V[n, others].any()
            assert frame.parts.V[n, 1].sum() == (pytest.approx(frame.V[n, 1]) if known else 0)
    assert 0 < since[1] < 14


def test_a_pmu_found_bad_is_left_out_when_the_others_hear_of_it():
    """Beside one that never was there. Told at frame 4, right again at frame 12; 60 ms are three frames."""
    point = uneven_point()
    pmu = Pmu(rate=50, **EXACT, latency="60ms", missing=(3,))
    seen, asked = Observation([Simulation(setup(point))], pmu, (8,), check=True), []

    class Check:
        def __call__(self, frame, others, switching, used):
            asked.append((frame.received.copy(), used.copy()))
            return [(0, 2, "it is wrong")] if len(asked) == 4 else []

        def recovered(self, frame, others, switching, *, used, left_out):
            asked.append("back")
            assert left_out.tolist() == [[False, False, True, False]]
            assert used.tolist() == [[True, False, False, True]]
            return [(0, 2)] if asked.count("back") == 9 else []

    seen._check = Check()
    for k in range(1, 20):
        _, frame = seen(k / 50)
        out = 4 + 3 <= k < 12 + 3
        assert seen.without.tolist() == [[False, True, out, False]]
        assert seen.excluded.tolist() == [[False, False, k == 7, False]]
        assert frame.parts.computed[0, 2] == out
        assert np.delete(frame.received[0], 1).all()
    assert asked.count("back") == 9
    assert [str(alarm) for alarm in seen.alarms] == [
        "seed 8: the PMU of machine 12 is left out from 0.080 s on; it is wrong",
        "seed 8: the PMU of machine 12 is used again from 0.240 s on; its phasors have been consistent for 5 s",
    ]
    given = [one[1].tolist()[0][2] for one in asked if one != "back"]
    assert given == [k <= 4 or k > 12 for k in range(1, 20)]


def test_a_pmu_is_not_checked_while_its_window_holds_two_networks():
    point = uneven_point()
    simulation, asked = Simulation(setup(point), [st.Open("30-40#2", 0.05)]), []
    pmu = Pmu(rate=50, **EXACT, filter_class="P", bad=(st.BadPmu(3, 0.0, jump="5deg"),))
    seen = Observation([simulation], pmu, (1,), check=True)
    seen._check = lambda frame, *_: asked.append(bool(frame.received.all())) or []
    for k in range(9):
        simulation.advance(k / 50)
        truth, frame = seen(k / 50)
        turned = np.angle(frame.V[0, 1] / truth.V[0, 1])
        assert k > 2 or turned == pytest.approx(np.deg2rad(5), abs=1e-6)
    assert asked == [True, True, True, False, False, True, True, True, True]


def test_what_is_sharp_depends_on_noise_and_clocks():
    """Relative standard deviation of a report: the larger noise, and the turn by the clock."""
    point = uneven_point()
    for angle, magnitude in ((3e-3, 1e-3), (1e-3, 3e-3)):
        pmu = Pmu(angle=angle, magnitude=magnitude, clock=2e-5)
        seen = Observation([Simulation(setup(point))], pmu, (1,))
        assert seen._error == pytest.approx(np.hypot(3e-3, 2 * np.pi * 50 * 2e-5))


def test_a_simulation_that_has_ended_repeats_its_last_truth():
    point = uneven_point()
    simulation = Simulation(setup(point))
    seen = Observation([simulation], Pmu(rate=50, **EXACT), (1,))
    first, _ = seen(0.0)
    ended = SimpleNamespace(outcome="over", switching=simulation.switching)
    seen.simulations = [ended]
    again, frame = seen(0.02)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert frame.since.tolist() == [[LONG + 1]]

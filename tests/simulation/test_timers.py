"""Voltage collapse and its timer: the same at every step, in a search and in a single run."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from stabctl.clearing import Search, Trial, clearing_time
from stabctl.clearing.critical_time import last_stable
from stabctl.controllers import BangBang
from stabctl.dynamics.operating_point import initialize
from stabctl.simulation._judgment import time_beyond
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation, run


@pytest.mark.parametrize("parts", [1, 3, 10])
def test_a_timer_does_not_depend_on_the_steps(parts):
    """A broken line that is above zero from 0.5 to 1.75 s and from 2.5 to 3.25 s, timed in steps to each corner."""
    corners, values = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 3.5]), np.array([-0.4, 0.4, 0.8, -0.8, 0.8, -0.8])
    seconds, times = 0.0, []
    instants = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in pairwise(corners)]))
    for a, b in pairwise(instants):
        seconds, longest = time_beyond(seconds, *np.interp((a, b), corners, values), b - a)
        times.append(longest)
    times = np.array(times)
    assert times[instants[1:] <= 2.0].max() == pytest.approx(1.25, abs=1e-12)
    assert times[instants[1:] > 2.0].max() == pytest.approx(0.75, abs=1e-12)
    assert seconds == 0


@pytest.fixture(scope="module")
def wscc9(points):
    return points("wscc9")


@pytest.mark.parametrize("step", [None, 1 / 240, 1 / 1000])
def test_voltage_collapse_of_wscc9_does_not_depend_on_the_step(wscc9, step):
    """Bus 8 is below 0.5 pu for almost 0.5 s, and returns by a jump where the low solution ends at the load's kink."""
    found = clearing_time(wscc9, Contingency("8", trip="8-9"), resolution="0.01cyc", step=step, scan=0, longest=0)
    assert found.cycles == pytest.approx(6.38)
    beyond = next(r for r in found.runs if r.cycles == pytest.approx(6.39))
    assert beyond.outcome == "voltage_collapse"
    assert beyond.time_s == pytest.approx(0.719, abs=0.005)  # 0.7188 at 1/4000 s, 0.7226 at 1/120 s


def test_the_solution_beyond_a_kink_is_found(wscc9):
    """At every instant of a run near collapse the voltages solve the network equations: none is without solution."""
    found = run(wscc9, Contingency("8", clear="6.3cyc", trip="8-9"), 3.0, step=1 / 2000)
    assert found.outcome.stable, found.outcome
    low = np.abs(found.arrays.V[:, [b.bus for b in wscc9.case.buses].index(8)])
    after = found.time > found.happened.changes[-1].at
    assert 0.4 < low[after].min() < 0.5  # below its threshold, and above it again
    assert low[-1] > 0.6


@pytest.mark.parametrize(("control", "name"), [(None, "idle"), (BangBang(), "bang-bang")])
def test_a_search_and_single_runs_agree_near_voltage_collapse(cases, control, name):
    """Runs of a search, made again on their own: the same outcome at the same instant."""
    point = initialize(cases("two_area").classical(), "20MW")
    trial = Trial(point, Contingency("1-5@0.5"), control, Search(longest_s=20.0))
    found = last_stable(trial.attempt, 160, 60, 12, **trial.search.shorter())
    collapsed = 0
    for k, ran in list(found.runs.items())[::5]:
        fault = replace(trial.contingency, clear=trial.duration(k), at=trial.at)
        for until in (21.0, 21.0 + 1e-9):
            again = run(point, fault, until, control, record=False).outcome
            if ran.stable:
                assert again.stable or again.time_s > trial.cleared(k) + ran.observed_s - 0.01, (k, again)
                continue
            assert (again.kind, again.time_s) == (ran.outcome, pytest.approx(ran.time_s + trial.at, abs=1e-12)), k
            collapsed += again.kind == "voltage_collapse"
    assert collapsed > 0


@pytest.mark.parametrize("hz", [50.0, 60.0])
def test_the_delay_of_the_frequency_is_timed_from_the_crossing(cases, hz):
    """A load that is lost lets the frequency rise: the verdict comes a delay after the limit, whatever the step."""
    case = cases("two_area").classical().set("frequency_hz", hz)
    point = initialize(case)
    rules = {"min_frequency": 0.9, "max_frequency": 1.001, "frequency_delay_s": 0.33}
    instants = []
    for step in (1 / 37, 1 / 100, 1 / 1000):
        found = Simulation(setup(point, step=step, criterion=Criterion(**rules)), ["9:-600MW@0.1s"])
        found.advance(3.0)
        ran = found.finish()
        assert ran.outcome.kind == "frequency_instability"
        coi = ran.arrays.coi_speed
        crossed = np.interp(1.001, coi[: coi.argmax() + 1], ran.time[: coi.argmax() + 1])
        assert ran.outcome.time_s == pytest.approx(crossed + 0.33, abs=2e-4)  # 1e-5: voltages within a step
        assert ran.time[-1] - step < ran.outcome.time_s <= ran.time[-1]
        instants.append(ran.outcome.time_s)
    assert np.ptp(instants) < 5e-4

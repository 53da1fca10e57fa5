"""Runs that share their set-up are those that do not, to the last bit, in whatever order they are made."""

import numpy as np
import pytest
from hard import mixed

import stabctl as st
from stabctl.clearing import Trial
from stabctl.controllers import BangBang, Feedback
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import run, run_of

MACHINES = DEFAULT._replace(coi="machines")
STUDIES = {
    "relay": (lambda: st.load("two_area").initialize("50MW"), BangBang(), DEFAULT),
    "accelerations": (lambda: st.load("two_area").initialize("50MW"), Feedback(20.0, 0.05), MACHINES),
    "hard": (lambda: mixed().initialize(), None, DEFAULT),
    "steps": (lambda: st.load("wnaps").initialize(), None, MACHINES),
}


def contingencies(point, rng):
    """Faults at random buses for random times, half of them with a line opened, a quarter with a load step."""
    case, found = point.case, []
    for _ in range(6):
        k = case.branches[rng.integers(len(case.branches))]
        load = case.loads[rng.integers(len(case.loads))]
        trip = (f"{k.from_bus}-{k.to_bus}",) if rng.random() < 0.5 else ()
        more = (f"{load.bus}:+{load.p / 5 + 1:.0f}MW@0.3s",) if rng.random() < 0.25 else ()
        found.append(Contingency(str(k.from_bus), f"{rng.integers(0, 40) / 4}cyc", trip, at="0.1s", events=more))
    return found


@pytest.mark.parametrize("name", STUDIES)
def test_a_shared_set_up_changes_no_bit(name):
    made, control, criterion = STUDIES[name]
    point = made()
    system, several = setup(point, control, criterion=criterion), contingencies(point, np.random.default_rng(51))
    alone = [run(made(), one, 1.0, control, criterion=criterion) for one in several]
    for i in (*range(len(several)), *reversed(range(len(several)))):
        shared = run_of(system, several[i], 1.0)
        assert shared.outcome == alone[i].outcome
        assert np.array_equal(shared.rows, alone[i].rows)


def test_trials_of_one_system_share_their_set_up(points):
    trial = Trial(points("ieee39"), Contingency("16", trip="16-17"))
    other = trial.of(Contingency("16", trip="16-21"))
    assert other.setup is trial.setup
    assert other.attempt(20) == Trial(points("ieee39"), Contingency("16", trip="16-21")).attempt(20)
    assert trial.attempt(20) != other.attempt(20)

"""The grid of small fleets with which the siting program is compared."""

import importlib.util
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from stabctl.dynamics import operating_point
from stabctl.model import fleet
from stabctl.placement.trials import Trials
from stabctl.simulation.contingency import Contingency

SCRIPT = Path(__file__).parents[2] / "analysis" / "placement_brute_force.py"


@pytest.fixture
def brute():
    spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_grid_has_every_pair_and_triple_once(brute):
    fleets = np.array(list(brute.grid(10, 24.0)))
    assert len(fleets) == len(np.unique(fleets, axis=0)) == 45 * 11 + 120 * 55
    assert np.allclose(fleets.sum(axis=1), 24.0)
    assert np.allclose(fleets / 2, np.round(fleets / 2))
    assert set((fleets > 0).sum(axis=1)) == {2, 3}


@pytest.mark.slow
def test_survivors_are_those_that_survive_each_contingency(brute, cases, monkeypatch):
    monkeypatch.setattr(brute, "PARTS", 2)
    case, total = cases("ieee39").classical(), 300.0
    asked = Contingency("29", 4.75 / 60, "26-29"), Contingency("16", 10.0 / 60, "16-21")
    tried, survivors, runs = brute.search(case, asked, total)
    devices = fleet.everywhere(case, brute.CAP)
    cap = np.array([d.rating for d in devices])
    trials = Trials(operating_point.solve(case.with_storage(devices)), asked, cap)
    halves = [np.bincount(pair, minlength=10) * total / 2 for pair in combinations(range(10), 2)]
    expected = [mw for mw in halves if (mw <= cap).all() and not trials.lost(mw)]
    assert tried == sum((mw <= cap).all() for mw in halves)
    assert tried <= runs <= 2 * tried
    assert 0 < len(survivors) < tried
    assert np.array_equal(survivors, expected)

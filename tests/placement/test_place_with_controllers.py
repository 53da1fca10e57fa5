"""Controllers act in every simulation of a siting, beside the law of the storage or instead of it."""

import json

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.placement.place import acting_in
from stabctl.placement.trials import Trials

SITE = ((9, 29),)
FAULT = st.Contingency("29", clear=4.75 / 60, trip="26-29")


@pytest.fixture(scope="module")
def case(cases):
    return cases("ieee39").classical()


def gain(k, rate=60):
    """Orders in proportion to the deviation of machine 9."""
    return st.Controller.from_control(control.tf(k, 1), "deviation:9", "order:9@29", rate=rate, name="gain")


def sized(case, **options):
    return st.place(case, [FAULT], candidates=SITE, observe=2.0, **options)


@pytest.mark.slow
def test_a_controller_that_gives_the_orders_is_in_place_of_the_law(case):
    """A steep gain is the sign of the deviation, as the bang-bang law without its thresholds: nearly its fleet."""
    steep, law = sized(case, control=gain(1e5, 120)), sized(case, control=st.BangBang(1e-9, 0.0))
    assert steep.total_mw == pytest.approx(law.total_mw, rel=0.02)
    assert "In every simulation act gain: deviation:9 -> order:9@29" in str(steep)
    assert "act gain" not in str(law)


def test_what_acts():
    field = st.Controller.from_control(control.tf(1, 1), "speed:9", "power:9")
    orders = gain(1.0)
    assert acting_in(None) == [st.BangBang()]
    assert acting_in(field) == [st.BangBang(), field]
    assert acting_in([orders, field]) == [orders, field]
    assert acting_in([orders, st.BangBang(0.2)]) == [st.BangBang(0.2), orders]
    with pytest.raises(StudyError, match="give the estimator as validate"):
        acting_in(st.EstimatorControl(st.BangBang(), "kalman"))


def test_a_trial_is_the_simulation_with_the_controllers(case):
    """The controllers are attached once, for all sizes of the fleet: each is the run of a case with that fleet."""
    one = gain(1000.0)
    fleet = case.with_storage([st.Storage(9, 29, 300.0)])
    trials = Trials(fleet.initialize(), [FAULT], np.array([300.0]), one)
    for mw in (100.0, 250.0):
        found = trials.simulate(np.array([mw]), 0)
        alone = case.initialize(storage=[st.Storage(9, 29, mw)])
        fresh = alone.simulate(st.Contingency("29", clear=4.75 / 60, trip="26-29", at=0.0), "2s", control=one)
        n = min(len(found.time), len(fresh.time))
        assert np.array_equal(found.arrays.speed[:n], fresh.arrays.speed[:n])
        assert np.abs(found.arrays.storage).max() == pytest.approx(np.abs(fresh.arrays.storage).max())
        assert np.abs(found.arrays.storage).max() > 20


@pytest.fixture
def command(stabctl, tmp_path):
    """The record of stabctl place for the fault, with what is saved in a file."""

    def run(acting):
        acting.save(tmp_path / "acting.toml")
        (tmp_path / "one.toml").write_text('[[contingency]]\nfault = "29"\ntrip = "26-29"\nclear = "4.75cyc"\n')
        (tmp_path / "sites.csv").write_text("bus,machine\n29,9\n")
        words = ("place", "ieee39", "--classical", "--contingencies", tmp_path / "one.toml", "--observe", 2, "--json")
        files = "--candidates", tmp_path / "sites.csv", "--controller", tmp_path / "acting.toml"
        code, out, err = stabctl(*words, *files)
        assert (code, err) == (0, "")
        return json.loads(out)

    return run


@pytest.mark.slow
def test_the_command_takes_controller_files(command):
    record = command(gain(1e4))
    assert record["controllers"] == ["gain: deviation:9 -> order:9@29 (0 states, 60/s)"]
    assert record["contingencies"][0]["stable"]


@pytest.mark.slow
def test_the_command_takes_a_law_from_its_file(case, command):
    """A law in a file is in place of the paper's, and needs the fleet that it needs in Python."""
    law = st.StorageLaw(angle_gain=1.0, min_voltage=0.0)
    record = command(law)
    assert record["contingencies"][0]["stable"]
    assert record["total_mw"] == sized(case, control=law).total_mw
    assert record["total_mw"] < sized(case).total_mw - 1

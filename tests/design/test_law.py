"""Design of a storage law."""

import json
from dataclasses import replace

import numpy as np
import pytest
from uneven import uneven_point

from stabctl._util.errors import StudyError
from stabctl.clearing import Search, Trial, screen
from stabctl.controllers import BangBang, StorageLaw
from stabctl.design import LawLimits, law
from stabctl.design.law import LawSearch, no_stable_limit_cycle, spread, training_contingencies
from stabctl.design.law_measurement import LAW, Bench, Measurement, from_row, later, measurement_task
from stabctl.design.law_result import parameters
from stabctl.io.control_files import load
from stabctl.jobs import Runner
from stabctl.jobs.task import Base
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulate import simulate
from stabctl.simulation.simulation import Simulation

FAULT = Contingency("7-8@0.4")
QUICK = {"resolution": "0.5cyc", "scan": 0.0, "observe": "5s", "limit": "40cyc"}


@pytest.fixture(scope="module")
def fleet(cases):
    return cases("two_area").initialize(storage="50MW")


@pytest.fixture(scope="module")
def found(fleet, tmp_path_factory):
    store = tmp_path_factory.mktemp("laws")
    return law(fleet, FAULT, limits=LawLimits(return_within=0), store=store, workers=2, **QUICK), store


@pytest.mark.slow
def test_the_designed_law_is_better_than_the_papers(fleet, found):
    design, _ = found
    (only,) = design.contingencies
    assert only.none.reach < only.reference.reach < only.designed.reach
    assert only.designed.reach >= 33.5  # 34.5, on a grid of half a cycle
    assert only.training
    assert design.kept
    assert only.designed.duty.switchings <= 2
    for control, reached in ((None, only.none), (BangBang(), only.reference), (design.law, only.designed)):
        again = fleet.clearing_time(FAULT, control=control, **QUICK)
        assert again.cycles == reached.reach


def test_a_law_with_a_large_delay_is_not_quiet(fleet, found):
    """Half a period of the inter-area mode late, a law drives the swings that it should stop."""
    assert found[0].no_limit_cycle
    law = StorageLaw(deadband=0.02, slope=0.02)
    assert no_stable_limit_cycle(fleet, law.sampled(60))
    assert not no_stable_limit_cycle(fleet, law.sampled(60, "800ms"))


def test_the_group_is_named(found):
    assert found[0].contingencies[0].group.machines == (3, 4)
    assert "machine 4 loses synchronism with 3" in str(found[0])


def test_a_design_continues_from_its_store(fleet, found):
    design, store = found
    seen = []
    again = law(fleet, FAULT, limits=LawLimits(return_within=0), store=store, progress=seen.append, **QUICK)
    assert again.law == design.law
    assert again.df.equals(design.df)
    assert again.wall_s < design.wall_s / 2


def test_the_law_of_a_design_is_read_from_its_file(found, tmp_path):
    path = found[0].save(tmp_path / "law.toml")
    assert load(path) == found[0].law


@pytest.mark.slow
def test_without_low_voltage_the_law_gains_less(fleet, found):
    gated = law(fleet, FAULT, limits=LawLimits(return_within=0, min_voltage=0.8), **QUICK)
    assert gated.law.min_voltage == 0.8
    assert 27 <= gated.contingencies[0].designed.reach < found[0].contingencies[0].designed.reach


def test_the_training_is_a_share_of_every_part():
    faults = tuple(Contingency(str(k), trip=f"{k}-1") for k in range(2, 12))
    chosen = training_contingencies(faults, 0.5, 1)
    places = np.sort([faults.index(c) for c in chosen])
    assert (places // 2).tolist() == [0, 1, 2, 3, 4]
    assert training_contingencies(faults, 0.5, 1) == chosen
    assert len(training_contingencies(faults, 1.0, 1)) == 10
    assert len(training_contingencies(faults[:1], 0.5, 1)) == 1


def test_a_screen_is_spread_over_the_machines(points):
    found = screen(points("two_area"), limit="20cyc", observe="1s", longest=0.0, resolution="1cyc", buses=[7, 9])
    taken = spread(found, 3)
    first = {p.machine: p.contingency for p in reversed(found.pairs) if p.cycles}
    assert set(taken[: len(first)]) == set(first.values())
    assert len(spread(found, 100)) == sum(bool(p.cycles) for p in found.pairs)


def test_parameters_without_an_effect_are_not_listed():
    names = [p.name for p in parameters(StorageLaw(groups="3+4", slope=0.05).sampled(60, "50ms"))]
    assert names == ["groups", "angle gain", "slope", "deadband", "lowest voltage", "rate", "delay"]


@pytest.mark.parametrize(
    ("given", "options", "sentence"),
    [
        ((), {}, "no contingency"),
        (5, {}, "contingencies = 5 is not allowed; give a list"),
        ([Contingency(trip="7-8")], {}, "with a fault"),
        (FAULT, {"training": 0.0}, "not a share"),
    ],
)
def test_wrong_contingencies(fleet, given, options, sentence):
    with pytest.raises(StudyError, match=sentence):
        law(fleet, given, **QUICK, **options)


def test_a_law_needs_storage(points):
    with pytest.raises(StudyError, match="no storage devices"):
        law(points("two_area"), FAULT)


@pytest.mark.slow
def test_a_law_from_the_command_line_is_taken_by_clearing_time(stabctl, tmp_path):
    law = tmp_path / "law.toml"
    words = "two_area", "--storage", "50MW", "--fault", "7-8@0.4", "--resolution", "0.5cyc", "--scan", "0s"
    quick = "--observe", "5s", "--return-within", "0s", "--json", "--report", tmp_path, "--out", law
    code, out, _ = stabctl("design", "law", *words, *quick)
    assert code == 0
    record = json.loads(out)
    assert record["contingencies"][0]["group"] == "3+4"
    assert (tmp_path / "two_area_law.html").is_file()
    code, out, _ = stabctl("clearing-time", *words, "--controller", law, "--json")
    assert code == 0
    assert json.loads(out)["cycles"] == record["contingencies"][0]["designed_cycles"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "Give the contingencies with one of"),
        (("--fault", "7", "--from-screen", "3"), "Give the contingencies with one of"),
        (("--from-screen", "3", "--trip", "7-8"), "--trip applies only to --fault"),
        (("--fault", "7", "--max-energy", "5MW"), "5MW"),
        (("--fault", "7"), "no storage devices"),
    ],
)
def test_wrong_options(stabctl, words, sentence):
    code, _, err = stabctl("design", "law", "two_area", *words)
    assert code == 2
    assert sentence in err


def test_contingencies_of_a_file_without_a_fault_are_named(stabctl, tmp_path):
    file = tmp_path / "list.toml"
    file.write_text('[[contingency]]\nfault = "7"\nclear = "6cyc"\n[[contingency]]\ntrip = "8-9"\n')
    code, _, err = stabctl("design", "law", "two_area", "--contingencies", file)
    assert code == 2
    assert "left out without one: trip 8-9." in err
    assert "no storage devices" in err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "fault", "trip", "storage", "least", "limits"),
    [
        ("two_area", "7-8@0.4", (), "50MW", 27.5, {"min_voltage": 0.8}),  # 27.625
        ("two_area", "7-8@0.4", (), "50MW", 30.5, {}),  # 33.0
        ("two_area", "7-8@0.4", (), "27MW", 25.5, {}),  # 27.25
    ],
)
def test_clearing_times_of_the_designed_law(cases, case, fault, trip, storage, least, limits):
    contingency = Contingency(fault, trip=trip)
    design = law(cases(case), contingency, storage=storage, limits=LawLimits(**limits))
    (only,) = design.contingencies
    assert only.designed.reach >= least
    assert design.kept
    assert only.designed.later.stable
    assert only.designed.later.left_kwh <= 0.05 * only.designed.later.energy_kwh
    found = cases(case).clearing_time(contingency, storage=storage, control=design.law, observe="10s")
    assert found.cycles == only.designed.reach


def test_every_simulation_of_a_measurement_is_counted(fleet, monkeypatch):
    """Those of the search, of its first guess, of the duty, and a long one of a law that returns the energy."""
    made, whole = [], Simulation.__init__
    monkeypatch.setattr(Simulation, "__init__", lambda self, *a, **k: (made.append(1), whole(self, *a, **k))[1])
    search = Search(resolution_cycles=1.0, limit_cycles=40.0, observed_s=2.0, scan_cycles=0.0)
    with Runner(LAW, workers=1) as runner:
        bench = Bench(fleet, search, runner, within_s=2.0)
        returns = StorageLaw(arm_at=0.2, return_time=1.0)
        for case, near in (((None, FAULT), None), ((returns, FAULT), None), ((returns, FAULT), 20.0)):
            made.clear()
            task = measurement_task(Measurement(*case, search, near, 2.0), Base(fleet), False)
            assert from_row(LAW.run(task).values).runs == len(made) > 3
        made.clear()
        bench.measured([(None, FAULT)], bench.coarse)
        assert bench.simulations == len(made)


def test_every_simulation_of_a_design_is_counted(fleet, monkeypatch):
    made, whole = [], Simulation.__init__
    monkeypatch.setattr(Simulation, "__init__", lambda self, *a, **k: (made.append(1), whole(self, *a, **k))[1])
    monkeypatch.setattr(LawSearch, "best", lambda self, start, groups: [start])
    coarse = {"resolution": "2cyc", "scan": 0.0, "observe": "2s", "limit": "40cyc", "workers": 1}
    assert law(fleet, FAULT, limits=LawLimits(return_within=0), **coarse).simulations == len(made)


def test_what_is_left_is_summed_over_devices_that_gave_and_took(fleet):
    """As in a recorded run that ends then; devices above and below their energy do not cancel."""
    search = Search(resolution_cycles=1.0, observed_s=3.0, longest_s=0.0)
    trial = Trial(fleet, FAULT, StorageLaw(slope=0.5, deadband=0.0), search)
    energy = 1e3 * trial.simulate(8, record=True).arrays.energy
    left = energy[-1] - energy[0]
    assert later(trial, 8, 3.0).left_kwh == pytest.approx(np.abs(left).sum(), rel=0.02)
    assert abs(left.sum()) < 0.9 * np.abs(left).sum()


def test_what_devices_hold_long_after_is_in_kilowatt_hours_on_any_base():
    """A system of 137 MVA and 50 Hz; the energies are those of a recorded run, which ends a little later."""
    point, within, trial_of = uneven_point(), 1.5, Contingency("30-40#2@0.4")
    trial = Trial(point, trial_of, StorageLaw(deadband="5mHz", slope=0.01), Search(1.0, observed_s=1.0))
    found = later(trial, 4, within)
    end = trial.last_event(4) + within
    run = simulate(point, replace(trial_of, clear=trial.duration(4), at=trial.at), end, control=trial.control)
    energy = 1e3 * run.dataset["storage_energy"].to_numpy()
    rows = [np.searchsorted(run.time, t - 1e-9) for t in [*np.arange(0, end - 1e-9, 0.25), end]]
    assert found.energy_kwh == pytest.approx(np.ptp(energy[rows], axis=0).sum(), rel=0.02)
    assert found.left_kwh == pytest.approx(np.abs(energy[-1] - energy[0]).sum(), rel=0.02)
    assert found.stable

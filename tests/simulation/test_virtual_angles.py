"""Virtual angles and speeds of converters: signals like those of rotors, in centers of inertia, laws and verdicts."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from systems import FORMING, REGC, REGC_C, registered, small

import stabctl as st
from stabctl._util.errors import EquilibriumError
from stabctl.simulation import outcome
from stabctl.simulation.events import Clear, Fault, Open
from stabctl.simulation.simulate import simulate

LOOP = Path(__file__).parent.parent / "devices" / "locked_source.py"
DROOP = FORMING._replace(TPf=0.1)
FAULT = st.Contingency("2", clear="12cyc", at=0.1)


@pytest.fixture(scope="module")
def mixed():
    """A converter with droop, whose H is 5 s, against the machine."""
    return st.initialize(small({"regfm_a1": DROOP}))


def test_its_angle_is_the_integral_of_its_speed(mixed):
    run = simulate(mixed, FAULT, 2.0)
    wb = 2 * np.pi * run.point.case.frequency_hz
    slip, t = run.arrays.speed - 1, run.time
    moved = wb * ((slip[1:] + slip[:-1]) / 2 * np.diff(t)[:, None]).sum(axis=0)
    assert np.ptp(run.arrays.angle, axis=0).min() > 0.05
    assert moved == pytest.approx(run.arrays.angle[-1] - run.arrays.angle[0], rel=2e-3)  # 5e-4
    assert run.dataset.machine.values.tolist() == [1, 2]


@pytest.mark.parametrize("coi", ["all", "machines"])
def test_the_largest_change_of_angle_is_that_from_the_stated_center(mixed, coi):
    """Inertia constant times rating, TPf/(2 mp) of the converter; or the machine alone."""
    run = simulate(mixed, FAULT, 2.0, criterion=st.Criterion(coi=coi))
    H = np.array([0.1 / 0.02 * 4 * (coi == "all"), 5.0 * 40])  # s on 100 MVA
    moved = run.arrays.angle - run.arrays.angle[0]
    assert run.peak == pytest.approx(np.abs(moved - (moved @ H / H.sum())[:, None]).max(axis=0), abs=1e-12)
    assert (run.peak[1] < 1e-9) == (coi == "machines")


def test_the_definition_changes_no_motion_and_needs_a_machine(mixed):
    both = [simulate(mixed, FAULT, 2.0, criterion=st.Criterion(coi=coi)) for coi in ("all", "machines")]
    assert np.array_equal(both[0].rows, both[1].rows)
    case = small({"regfm_a1": DROOP})
    alone = st.initialize(replace(case, devices={"regfm_a1": {1: DROOP, 2: FORMING._replace(Pmin=-1.0)}}))
    runs = [simulate(alone, FAULT, 2.0, criterion=st.Criterion(coi=coi)) for coi in ("all", "machines")]
    assert runs[0].peak.min() > 0.01
    assert np.array_equal(runs[0].peak, runs[1].peak)


def test_lost_synchronism_names_converter_and_reason(mixed):
    found = simulate(mixed, [Fault("2", 0.1), Clear("2", 1.1)], 5.0).outcome
    assert (found.kind, found.machine) == ("lost_synchronism", 1)
    assert str(found).startswith("Converter 1 (REGFM_A1) lost synchronism at ")
    assert "s: its virtual angle moved 201 degrees relative to the center of inertia. The fault at bus 2" in str(found)


def test_linear_models_and_modes_have_its_speed(mixed):
    """wb times the speed is the rate of the angle, also where the speed is an output."""
    linear = mixed.linearize(outputs="speed, coi_speed, deviation:1")
    wb = 2 * np.pi * mixed.case.frequency_hz
    speeds = linear.A[linear.angles()] / wb
    assert np.abs(linear.C[:2] - speeds).max() < 1e-15
    H = mixed.inertia / mixed.inertia.sum()
    assert np.abs(linear.C[2:] - [H @ speeds, speeds[0] - speeds[1]]).max() < 1e-15
    modes = mixed.modes()
    assert np.abs(modes.speeds - speeds @ modes.right)[:, modes.eigenvalues != 0].max() < 1e-12
    (swing,) = modes.swings()
    assert modes.label(swing) == "converter 1 against the rest"


def test_laws_and_controllers_read_it():
    """The law acts on the deviation from the others; a controller on the speed itself, which is an output."""
    base = st.initialize(small({"regfm_a1": DROOP}), storage="1=60MW")
    run = simulate(base, FAULT, 1.5, control=st.BangBang(deadband=0.05, min_voltage=0.5))
    deviation = (run.arrays.speed[:, 0] - run.arrays.speed[:, 1]) * base.case.frequency_hz
    wanted = np.where(np.abs(deviation) > 0.05, np.sign(deviation), 0)
    far = (np.abs(np.abs(deviation) - 0.05) > 0.01) & (np.abs(run.arrays.V[:, 1]) > 0.5) & (run.time > 0.33)
    assert set(wanted[far]) >= {0, 1}
    assert np.array_equal(run.arrays.order[far, 0], wanted[far])
    read = st.Controller(["speed:1"], ["order:1@2"], [], [], [], [[40.0]])
    run = simulate(base, FAULT, 1.5, control=read)
    assert np.abs(run.arrays.order[:, 0] - 40 * (run.arrays.speed[:, 0] - 1))[run.time > 0].max() < 1e-12


def test_a_phase_locked_loop_that_slips_has_lost_synchronism():
    with registered(LOOP) as (device,):
        base = st.initialize(small({"locked_source": device.Par(0, 0)}))
        assert base.system.unweighted.column("unit").tolist() == [0]
        assert simulate(base, [Fault("2", 0.1), Clear("2", 0.15)], 2.0).outcome.stable
        found = simulate(base, [Fault("2", 0.1)], 5.0)
    assert (found.outcome.kind, found.outcome.machine) == ("lost_synchronism", 1)
    assert str(found.outcome).startswith("Converter 1 (source behind a loop) lost synchronism at ")
    assert "s: the angle of its phase-locked loop moved 201 degrees relative to the center" in str(found.outcome)
    assert found.unstable_machines == (1,)


def test_without_a_voltage_source_an_island_is_refused():
    case = small({"regc_a": REGC})
    case = replace(case, devices={"regc_a": {1: REGC, 2: REGC}})
    with pytest.raises(EquilibriumError, match=r"^small cannot .* because its units 1, 2 are grid-following; add a "):
        st.initialize(case)
    case = small({"regc_a": REGC})
    apart = replace(
        case,
        buses=(case.buses[0]._replace(kind="swing"), *case.buses[1:]),
        branches=case.branches[:1],
    )
    with pytest.raises(EquilibriumError, match=r"^The island of buses 1, 2 in small cannot .* only unit, 1, is grid"):
        st.initialize(apart)


def test_cut_off_without_a_voltage_source_an_island_is_blacked_out():
    run = simulate(st.initialize(small({"regc_a": REGC})), [Open("2-3", 0.1), Open("2-3#2", 0.1)], 1.0)
    cut = "The switching cut off buses 1, 2 without a machine or grid-forming converter: blacked out, its load lost."
    assert str(run.outcome).startswith(cut)


def test_the_range_of_a_phase_locked_loop_is_in_its_own_units_and_is_named_at_either_end(monkeypatch):
    """Of a loop from -9 to 14 rad/s at 50 Hz."""
    case = replace(small({"regc_c": REGC_C._replace(wmin=-9.0, wmax=14.0)}), frequency_hz=50.0)
    point = case.initialize()
    (loop,) = point.system.unweighted.rows
    low, high = 1 - 9 / (100 * np.pi), 1 + 14 / (100 * np.pi)
    assert (loop.least, loop.most) == pytest.approx((low, high), rel=1e-12)
    monkeypatch.setattr(outcome, "_unweighted", lambda *_: loop)
    for speed, at in ((low, True), (high, True), (1.0, False), (low + 1e-3, False), (high - 1e-3, False)):
        said = outcome._at_limit(point, SimpleNamespace(speed=np.array([speed]), machine=0))
        wanted = f"at a limit of its range from {50 * low:.2f} to {50 * high:.2f} Hz"
        assert said.endswith(wanted) if at else said == ""

"""Laws of the core: solutions, starts, records, processes."""

import dataclasses
import pickle

import numpy as np
import pytest

from stabctl import io
from stabctl._util.errors import EquilibriumError, StudyError
from stabctl.controllers import BangBang, Feedback
from stabctl.dynamics import operating_point
from stabctl.model import fleet, powerflow
from stabctl.model.tables import Branch, Bus, Storage
from stabctl.simulation import stepper
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import Clear, Fault, Open, TripMachine
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation, run


@pytest.fixture(scope="module")
def two_area():
    return io.load("two_area")


def constant_power(case, share):
    """The case with a share of its loads constant power, the rest constant current."""
    parts = {"p_power": share, "q_power": share, "p_current": 1 - share, "q_current": 1 - share}
    return dataclasses.replace(case, loads=tuple(load._replace(**parts) for load in case.loads))


@pytest.mark.parametrize("share", [0.5, 0.6, 0.7, 0.8])
def test_voltages_return_to_the_upper_solution_after_a_fault(two_area, share):
    """A longer fault is never survived where a shorter one collapses: of several solutions the highest is taken."""
    point = operating_point.solve(constant_power(two_area, share))
    for cycles in (1, 3, 6):
        held = run(point, Contingency("7", cycles / 60, ["7-8"]))
        assert held.outcome.stable
        assert np.abs(held.arrays.V[-1]).min() > 0.85


@pytest.mark.parametrize(("S10", "S12"), [(0.001, 0.4), (0.03, 0.4), (0.0, 0.4), (0.1, 0.4), (0.0, 0.05), (0.2, 0.8)])
def test_saturated_machines_start(two_area, S10, S12):
    rows = {k: par._replace(S10=S10, S12=S12) for k, par in two_area.devices["genrou"].items()}
    case = dataclasses.replace(two_area, devices=dict(two_area.devices) | {"genrou": rows})
    quiet = run(operating_point.solve(case), until=1.0)
    assert np.abs(quiet.arrays.speed - 1).max() < 1e-11


@pytest.mark.parametrize(("KA", "TA"), [(200.0, 0.001), (212.0, 0.001), (300.0, 0.002), (800.0, 0.005), (1000.0, 0.0)])
def test_fast_exciters_start(two_area, KA, TA):
    rows = {k: par._replace(KA=KA, TA=TA, TR=0.0) for k, par in two_area.devices["sexs"].items()}
    case = dataclasses.replace(two_area, devices=dict(two_area.devices) | {"sexs": rows})
    assert operating_point.solve(case).iterations < 10


def test_a_load_threshold_above_the_voltage_is_refused(two_area):
    low = dataclasses.replace(two_area, loads=(two_area.loads[0]._replace(v_low=1.0), *two_area.loads[1:]))
    with pytest.raises(EquilibriumError, match=r"The load at bus 7 .* its v_low = 1 pu, .* 0\.961 pu"):
        operating_point.solve(low)


def test_the_last_row_of_a_ramp_continues_it_and_finish_is_once(two_area):
    case = two_area.with_storage([Storage(1, 5, 50.0, ramp=50.0)])
    simulation = Simulation(setup(operating_point.solve(case)))
    simulation.orders[:] = 1
    simulation.advance(0.3)
    first, again = simulation.finish(), simulation.finish()
    assert first is again
    assert np.diff(first.arrays.storage[:, 0]).max() < 50 / 120 * 1.01
    assert first.arrays.storage[-1, 0] == pytest.approx(15.0, abs=0.5)


def test_orders_from_outside_are_limited_and_checked(two_area):
    point = operating_point.solve(two_area.with_storage(fleet.everywhere(two_area, "50MW")))
    simulation = Simulation(setup(point), [Open("1-5", 0.1)])
    simulation.orders[:] = 5
    simulation.advance(0.3)
    assert simulation.finish().arrays.storage.max() == pytest.approx(50, rel=1e-9)
    assert simulation.finish().arrays.storage[-1, 0] == pytest.approx(
        50, rel=1e-9
    )  # its machine is alone, the order stays
    simulation = Simulation(setup(point))
    simulation.orders[0] = np.nan
    with pytest.raises(StudyError, match="not finite"):
        simulation.advance(0.1)


def test_a_tripped_machine_gives_no_power(two_area):
    traced = run(operating_point.solve(two_area), [TripMachine(1, 0.5)], 1.0)
    after = traced.time > 0.5 - 1e-9
    assert (traced.arrays.P[after, 0] == 0).all()
    assert (traced.arrays.Pm[after, 0] == 0).all()
    assert (traced.arrays.Efd[after, 0] == 0).all()
    assert (traced.arrays.P[~after, 0] > 0).all()


def test_a_fault_at_the_end_of_a_tapped_branch_is_the_bus_fault(two_area):
    rows = [k._replace(tap=1.1) if (k.from_bus, k.to_bus) == (7, 8) else k for k in two_area.branches]
    point = operating_point.solve(dataclasses.replace(two_area, branches=tuple(rows)))
    through = 0.01 + 0.02j
    on_line = run(point, [Fault("7-8@0", 0.1, through), Open("7-8", 0.2)], 1.0)
    at_bus = run(point, [Fault("7", 0.1, through), Clear("7", 0.2), Open("7-8", 0.2)], 1.0)
    assert np.abs(on_line.arrays.speed - at_bus.arrays.speed).max() < 1e-9


def test_phase_shift_turns_the_far_side_back(two_area):
    """The from side leads by the phase: behind an unloaded shifter the voltage lags by it."""
    case = dataclasses.replace(
        two_area,
        buses=(*two_area.buses, Bus(99, "pq")),
        branches=(*two_area.branches, Branch(8, 99, 0.0, 0.1, tap=1.0, phase=30.0)),
    )
    V = powerflow.solve(case).V
    assert np.angle(V[-1] / V[7], deg=True) == pytest.approx(-30.0, abs=1e-6)


def test_load_flow_survives_a_jumper_and_a_far_guess(two_area):
    """A new bus behind a very short line, with no idea of its angle."""
    load = two_area.loads[1]
    case = dataclasses.replace(
        two_area,
        buses=(*two_area.buses, Bus(99, "pq")),
        branches=(*two_area.branches, Branch(9, 99, 0.0, 1e-4)),
        loads=(two_area.loads[0], load._replace(bus=99)),
    )
    moved, plain = powerflow.solve(case), powerflow.solve(two_area)
    assert np.abs(np.abs(moved.V[:-1]) - np.abs(plain.V)).max() < 2e-2


def test_signals_of_storage_are_in_the_result(two_area):
    case = two_area.with_storage([Storage(1, 5, 50.0, energy=0.01, charge=0.5)])
    data = run(operating_point.solve(case), Contingency("7-8@0.4", 0.35), 4.0, BangBang()).dataset
    assert data.storage_energy.attrs["units"] == "MWh"
    assert float(data.storage_energy[0, 0]) == pytest.approx(0.005)
    assert float(data.storage_energy.max()) <= 0.01
    assert float(data.storage_energy.min()) >= 0
    assert set(np.unique(data.storage_order)) <= {-1.0, 0.0, 1.0}


def test_cases_and_points_travel_between_processes(two_area):
    assert pickle.loads(pickle.dumps(two_area)) == two_area
    point = operating_point.solve(two_area)
    run(point, until=0.1)
    assert np.array_equal(pickle.loads(pickle.dumps(point)).s, point.s)


def test_rules_of_any_number_run_on_one_compilation(two_area):
    point = operating_point.solve(two_area)
    for criterion in (Criterion(max_angle=3), Criterion(low_voltage_s=0), Criterion(1, 1, 0, 2)):
        run(point, until=0.05, criterion=criterion)
    assert len(stepper.advance.signatures()) == 1


def test_results_cannot_be_written(two_area):
    traced = run(operating_point.solve(two_area), until=0.1)
    for array in (traced.arrays.angle, traced.arrays.speed, traced.arrays.V, traced.rows, traced.time, traced.peak):
        with pytest.raises(ValueError, match="read-only"):
            array.flat[0] = 9


def test_voltages_now_are_those_of_the_row_now(two_area):
    point = operating_point.solve(two_area)
    simulation = Simulation(setup(point), [Fault("7", 0.5), Clear("7", 0.6)])
    simulation.advance(0.5)
    during = simulation.V
    assert abs(during[6]) < 1e-4
    simulation.advance(0.9)
    assert np.abs(simulation.V - simulation.finish().arrays.V[-1]).max() < 1e-7


@pytest.mark.parametrize("bad", [{"deadband": -1.0}, {"min_voltage": float("nan")}])
@pytest.mark.parametrize("law", [BangBang, Feedback])
def test_laws_refuse_impossible_thresholds(law, bad):
    with pytest.raises(StudyError):
        law(**bad)


def test_a_run_that_ends_before_its_events_is_refused(two_area):
    with pytest.raises(StudyError, match=r"must end after its last event at 1\.1 s"):
        run(operating_point.solve(two_area), Contingency("7", 0.1), 1.05)


def test_a_unit_cut_off_by_its_own_fault_does_not_spoil_the_clearing_time():
    """Machine 12 of wnaps hangs on 27-28 and runs away alone; the others are judged, however long they are watched."""
    case = io.load("wnaps")
    ends = [run(operating_point.solve(case), Contingency("27-28@1", 0.05), until) for until in (2.0, 16.0)]
    assert all(end.outcome.stable and end.outcome.kind == "islanded" for end in ends)
    assert "was tripped" not in ends[0].outcome.message

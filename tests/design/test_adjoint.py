"""Gradients of a run by its adjoint: those of the numbers computed, so differences of runs must agree with them."""

import numpy as np
import pytest
from systems import EXDC2, ROUND, small, with_shares

from stabctl._util.errors import StudyError
from stabctl.design._adjoint import Shown, gradients
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.simulation import run
from stabctl.simulation.stages import stages

END, RATE = 0.8, 60


def _run(point, fault, orders):
    return run(point, fault, END, Schedule(orders, rate=RATE, min_voltage=0.0))


def _from_coi(point, machine):
    """Weights of the states whose sum is the angle of a machine against the COI."""
    rotors, weight = point.rotors, np.zeros(point.layout.nx)
    weight[rotors.angle] = -rotors.inertia / rotors.inertia.sum()
    weight[rotors.angle[machine]] += 1
    return weight


def _shown(point, ran):
    """The first machine's angle at two rows, the second's speed at the end, and the mean of the first's angle."""
    one, speed, last = _from_coi(point, 0), np.zeros(point.layout.nx), len(ran.rows) - 1
    speed[point.rotors.angle[1] + 1] = 1.0
    every = np.arange(last // 2, last, 3)
    alone = [(last, one), (last // 2, one), (last, speed)]
    mean = Shown(every, np.tile(one / len(every), (len(every), 1)))
    return [*(Shown(np.array([row]), w[None]) for row, w in alone), mean]


def _values(point, ran, shown):
    x = ran.rows[:, : point.layout.nx]
    return np.array([(one.weights * x[one.rows]).sum() for one in shown])


def _differ(point, fault, seed=7):
    """Largest difference between gradients and central differences of two runs, relative to the largest slope."""
    random, devices = np.random.default_rng(seed), len(point.case.storage)
    orders = random.uniform(-0.7, 0.7, (round(END * RATE), devices))
    way, step = random.standard_normal(orders.shape), 1e-4
    ran = _run(point, fault, orders)
    assert ran.outcome.stable
    shown = _shown(point, ran)
    by_frame = np.zeros((*orders.shape, len(shown)))
    np.add.at(by_frame, np.floor(ran.time[:-1] * RATE + 1e-6).astype(int), gradients(ran, shown))
    ahead, behind = (_values(point, _run(point, fault, orders + s * way), shown) for s in (step, -step))
    slope, difference = np.einsum("kjp,kj->p", by_frame, way), (ahead - behind) / (2 * step)
    return np.abs(slope - difference).max() / np.abs(difference).max(), stages(ran)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("two_area", Contingency("7-8@0.4", clear="18cyc", at=0.1)),
        ("wscc9", Contingency("7", trip="5-7", clear="5cyc", at=0.1)),
    ],
    ids=["two_area", "wscc9"],
)
def test_gradients_are_the_limits_of_differences(cases, name, fault):
    differ, made = _differ(cases(name).initialize(storage="40MW"), fault)
    assert differ < 3e-5  # two_area 1.1e-6, wscc9 4.8e-6: voltages are found to 1e-7 pu
    acted = any((part.held > 0).any() and (part.clipped != 0).any() for part in made)
    assert acted == (name == "two_area")  # limits of the field voltage


@pytest.mark.parametrize("bus", [7, 9])
def test_so_they_are_after_a_step_of_any_load(cases, bus):
    point = with_shares(cases("two_area"), p_current=1.0).initialize(storage="40MW")
    assert _differ(point, f"{bus}:+100MW@0.1s")[0] < 3e-5  # 3.9e-6, 8.1e-7


def test_a_limit_moves_with_the_signal_that_scales_it():
    exciter = EXDC2._replace(VRmax=2.2)  # times the terminal voltage
    case = small({"genrou": ROUND, "exdc2": exciter}).with_storage("40MW")
    fault = Contingency("2", clear="6cyc", impedance=0.02j, at=0.1)
    differ, made = _differ(case.initialize(), fault)
    assert any((part.clipped > 0).any() for part in made)
    assert differ < 3e-5  # 9.3e-6; 1 without the movement of the limit


def test_what_comes_too_late_has_no_effect_and_what_comes_too_early_does_not_count(cases):
    point = cases("two_area").initialize(storage="40MW")
    ran = _run(point, Contingency("7-8@0.4", clear="6cyc", at=0.1), np.zeros((10, 4)))
    row = len(ran.rows) // 2
    shown = [Shown(np.array([row]), _from_coi(point, 0)[None])]
    whole, part = gradients(ran, shown), gradients(ran, shown, first=20)
    assert np.all(whole[row:] == 0)
    assert np.all(whole[1 : row - 2] != 0)
    assert np.all(part[:20] == 0)
    assert np.array_equal(part[20:], whole[20:])


def test_the_stages_made_again_end_where_the_run_did(cases):
    point = cases("two_area_thyristor").initialize(storage="40MW")
    ran = _run(point, Contingency("7", trip="7-8", clear="6cyc", at=0.1), np.full((10, 4), 0.5))
    for part in stages(ran):
        rows = ran.rows[part.first : part.first + len(part.sizes)]
        missed = np.abs(part.signals[:, 0, : rows.shape[1]] - rows).max()
        assert missed < 1e-6  # 4e-8: voltages are found to 1e-7 pu


def test_a_run_without_its_machines_is_refused(cases):
    point = cases("two_area").initialize(storage="40MW")
    ran = run(point, "3@0.1s", 0.5)
    with pytest.raises(StudyError, match="a machine was disconnected"):
        gradients(ran, [Shown(np.array([3]), _from_coi(point, 0)[None])])

"""Laws of the stepper, as plain Python: where it may be interrupted, and what the table of its method does."""

import numpy as np
import pytest
from in_plain_python import CONTROLS, FAULT, KEEP_ON, experiment

import stabctl as st

STEPS = 60


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return experiment("interrupted", tmp_path_factory.mktemp("interrupted"))


@pytest.mark.slow
@pytest.mark.parametrize("control", ["bang-bang", "feedback", "sampled", "gate", "frames"])
def test_a_run_interrupted_at_every_stage_is_the_same_to_the_last_bit(runs, control):
    """Each call asks the caller for the voltages once; what has acted in a step does not act again."""
    whole, interrupted = runs[f"{control} whole"], runs[f"{control} interrupted"]
    assert len(whole) == STEPS + 1
    assert np.array_equal(whole, interrupted)
    assert runs[f"{control} calls"] >= 4 * STEPS  # more where orders change, or a step has parts


@pytest.mark.parametrize("control", ["bang-bang", "feedback"])
def test_these_runs_have_what_could_be_lost_between_two_calls(runs, control):
    """Steps in parts, or voltages that are solved for a second time."""
    assert runs[f"{control} calls"] > 4 * STEPS + 10  # 448, 267


@pytest.mark.parametrize("control", CONTROLS)
def test_these_runs_are_those_of_compiled_code(runs, control):
    point = st.load("two_area").with_storage("50MW", energy=0.01).initialize()
    run = point.simulate(FAULT, 0.5, control=CONTROLS[control](), criterion=KEEP_ON)
    found, whole = np.column_stack([run.time, run.rows]), runs[f"{control} whole"]
    assert np.abs(found - whole).max() < 1e-9  # 2e-12


@pytest.fixture(scope="module")
def angles(tmp_path_factory):
    return experiment("orders", tmp_path_factory.mktemp("orders"))


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order"), [("rk4", 4), ("heun", 2)])
def test_another_table_is_another_method_with_its_own_order(angles, method, order):
    """Half the step leaves 2**-order of the error: 3.87 and 1.99, against steps of 1/1280 s."""
    coarse, fine = (np.abs(angles[f"{method} {steps}"] - angles["rk4 1280"]).max() for steps in (80, 160))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.2)

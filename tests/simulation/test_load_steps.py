"""A load step changes the loads of a bus in proportion, in whatever rows they are, and may take all of them away."""

from dataclasses import replace

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.simulation.topology import stage

STEP = {"p": -0.3 * 967.0, "q": -0.3 * 100.0}


def written(case, *shares):
    """The case with the load at bus 7 as several loads of 0.6, 0.4, each in parts as those of a RAW file."""
    (whole,) = (load for load in case.loads if load.bus == 7)
    V = abs(case.power_flow().V[case.row_of_bus[7]])
    rows = []
    for id, (size, power, current) in enumerate(shares, start=1):
        one = whole._replace(p=size * whole.p, q=size * whole.q, v=1.0, id=str(id), v_low=0.7)
        none = dict.fromkeys(("p_power", "q_power", "p_current", "q_current"), 0.0)
        for part, scale, kind in ((power, 1, "power"), (current, V, "current"), (1 - power - current, V * V, "")):
            kinds = {f"p_{kind}": 1.0, f"q_{kind}": 1.0} if kind else {}
            rows.append(one._replace(p=part * one.p / scale, q=part * one.q / scale, **none | kinds))
    return replace(case, loads=(*rows, *(load for load in case.loads if load is not whole)))


@pytest.fixture(scope="module")
def case():
    return st.load("two_area")


def test_the_rows_of_a_load_make_no_difference(case):
    (whole,) = (load for load in case.loads if load.bus == 7)
    shares = {"p_power": 0.3, "q_power": 0.3, "p_current": 0.5, "q_current": 0.5, "v_low": 0.7}
    one = replace(case, loads=tuple(k._replace(**shares) if k is whole else k for k in case.loads))
    runs = [
        c.simulate(st.LoadStep(7, 0.1, **STEP), "2s") for c in (one, written(case, (0.6, 0.3, 0.5), (0.4, 0.3, 0.5)))
    ]
    assert np.abs(runs[0].speed.values - runs[1].speed.values).max() < 1e-9  # 2e-12
    assert abs(runs[0].speed.values[-1] - 1).max() > 1e-3


def test_a_load_that_is_taken_away_draws_nothing(case):
    base = written(case, (0.6, 0.3, 0.3), (0.4, 0.5, 0.2)).initialize()
    for id, size in (("", 1.0), ("1", 0.6), ("2", 0.4)):
        run = base.simulate(st.LoadStep(7, 0.1, p=-size * 967.0, q=-size * 100.0, id=id), "0.2s")
        switched = stage(base, run.happened.changes[1].switching)
        left = [value for _, _, par in switched.constants for value in par[:6]]
        assert len(left) == 6 * (4 if not id else 2)
        assert np.abs(left).max() < 1e-13
        bus = case.row_of_bus[7]
        gone = (stage(base, run.happened.changes[0].switching).Y - switched.Y)[bus, bus]
        expected = {"": 0.6 * 0.4 + 0.4 * 0.3, "1": 0.6 * 0.4, "2": 0.4 * 0.3}[id] * (9.67 - 1j) / abs(base.V[bus]) ** 2
        assert abs(gone - expected) < 1e-12


def test_motors_are_switched_off_as_they_run():
    case = st.load("two_area").with_motors(0.5)
    (whole,) = (load for load in case.loads if load.bus == 7)
    both = tuple(whole._replace(p=share * whole.p, q=share * whole.q, id=id) for share, id in ((0.7, "a"), (0.3, "b")))
    others = tuple(load for load in case.loads if load is not whole)
    par = case.devices["cim"][7]
    rest = {key: row for key, row in case.devices["cim"].items() if key != 7}
    two = replace(case, loads=(*both, *others), devices=case.devices | {"cim": {7: par, "7#2": par} | rest})
    off = {"p": -0.3 * whole.p, "q": -0.3 * whole.q}
    one, chosen = (
        case.simulate(st.LoadStep(7, 0.1, **off), "1s"),
        two.simulate(st.LoadStep(7, 0.1, **off, id="b"), "1s"),
    )
    assert np.abs(one.speed.values - chosen.speed.values).max() < 1e-9  # 1e-12
    gone = two.simulate(st.LoadStep(7, 0.1, p=-whole.p, q=-whole.q), "0.5s")
    motors = [
        par for table, _, par in stage(gone.point, gone.happened.changes[1].switching).constants if table == "cim"
    ]
    assert len(motors) == 2
    assert all(abs(par.mva) < 1e-13 and abs(par.Bsh) < 1e-13 and par.slip > 0 for par in motors)


def test_a_load_that_is_not_there_is_told(case):
    with pytest.raises(StudyError, match="two_area has no load 3 at bus 7; it has 1"):
        case.simulate(st.LoadStep(7, 0.1, p=5, id="3"), "1s")

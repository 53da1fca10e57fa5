"""Studies one after another on the same operating point: each gives what it gives alone, on a new one."""

import numpy as np
import pytest
from systems import KINDS, small
from uneven import uneven

import stabctl as st
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage

FAULT = st.Contingency("2", clear="5cyc", at=0.1)
LINE = st.Contingency("2-3@0.3", clear="4cyc", at=0.1)
OPTIONS = {"until": 0.8, "control": st.BangBang(0.02)}


def same(one, other):
    """Whether two runs are the same, signal by signal."""
    return one.rows.shape == other.rows.shape and np.array_equal(one.rows, other.rows)


def equipped(model, ratings=(40.0, 25.0)):
    rows = [
        Storage(k, bus, r, storage_model=model, mva=1.3 * r) for k, bus, r in zip((1, 2), (2, 3), ratings, strict=True)
    ]
    return small(KINDS["sexs, pss, steam"]).with_storage(rows)


@pytest.mark.parametrize(
    "model",
    ["ideal", "regfm", *(pytest.param(m, marks=pytest.mark.slow) for m in ("regc", "regc_b", "regc_c", "regfm_b1"))],
)
def test_simulated_resized_and_simulated_again_it_is_a_new_system(model):
    """Factors of the network that hold the old ratings would show; and the first point is as it was."""
    first = operating_point.solve(equipped(model))
    before = [first.simulate(fault, **OPTIONS) for fault in (FAULT, LINE)]
    resized = first.resized([16.0, 61.0])
    fresh = operating_point.solve(resized.case)
    for fault, old in zip((FAULT, LINE), before, strict=True):
        again, wanted = resized.simulate(fault, **OPTIONS), fresh.simulate(fault, **OPTIONS)
        assert again.time == pytest.approx(wanted.time, abs=1e-12)
        assert again.rows == pytest.approx(wanted.rows, abs=1e-8)
        assert np.abs(again.arrays.V - old.arrays.V).max() > 1e-4
        assert same(first.simulate(fault, **OPTIONS), old)
    assert resized.admittance().toarray() == pytest.approx(fresh.admittance().toarray(), abs=1e-12)
    back = resized.resized([40.0, 25.0])
    assert back.simulate(FAULT, **OPTIONS).rows == pytest.approx(before[0].rows, abs=1e-8)


def test_resized_by_the_row_of_each_device():
    """Ratings, energies and MVA follow their own row, whatever the others are."""
    point = operating_point.solve(equipped("regfm"))
    fresh = point.resized([16.0, 61.0]).case
    assert [(s.machine, s.bus, s.rating) for s in fresh.storage] == [(1, 2, 16.0), (2, 3, 61.0)]
    assert [s.mva for s in fresh.storage] == pytest.approx([1.3 * 16, 1.3 * 61])


EDITS = {  # what is edited: each must show in the runs after it, as in a case that never was otherwise
    "genrou.3.H": 4.4,
    "sexs.7.KA": 70.0,
    "gencls.5.x1d": 0.2,
    "branches.50-40.x": 0.11,
    "loads.50.p": 31.0,
    "buses.30.b": 44.0,
    "frequency_hz": 60.0,
    "machines.7.base": 350.0,
    "storage.7.rating": 5.0,
}


@pytest.mark.parametrize("what", EDITS)
def test_edited_initialized_and_simulated_it_is_a_new_system(what):
    """A point of the case before has been simulated: nothing of it is left in the next."""
    fault = st.Contingency("50", clear="4cyc", at=0.1)
    base = uneven()
    before = base.initialize().simulate(fault, **OPTIONS)
    edited = base.set(what, EDITS[what])
    after = edited.initialize().simulate(fault, **OPTIONS)
    fresh = uneven().set(what, EDITS[what])
    assert same(after, operating_point.solve(fresh).simulate(fault, **OPTIONS))
    assert after.rows.shape != before.rows.shape or np.abs(after.rows - before.rows).max() > 1e-4
    assert same(base.initialize().simulate(fault, **OPTIONS), before)


STUDIES = {
    "a fault": lambda p: p.simulate(FAULT, **OPTIONS).rows,
    "a line": lambda p: p.simulate(LINE, **OPTIONS).rows,
    "a machine tripped": lambda p: p.simulate(st.TripMachine(1, 0.1), 0.5).rows,
    "a load": lambda p: p.simulate("2:+30MW@0.1s", 0.5).rows,
    "modes": lambda p: np.sort_complex(p.modes().eigenvalues),
    "a linear model": lambda p: p.linearize("order:1@2", "bus_frequency:3,flow:2-3").A,
    "a clearing time": lambda p: np.array(p.clearing_time("2", resolution="1cyc", limit="40cyc", observe="1s").cycles),
    "short-circuit power": lambda p: p.short_circuit().mva,
}


def test_studies_on_one_point_are_those_on_new_ones():
    """In two orders, each twice."""
    shared, case = operating_point.solve(equipped("regfm")), equipped("regfm")
    alone = {name: study(operating_point.solve(case)) for name, study in STUDIES.items()}
    for name in (*STUDIES, *reversed(STUDIES)):
        assert np.array_equal(STUDIES[name](shared), alone[name]), name

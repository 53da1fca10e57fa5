"""Identifiers of circuits that hold blanks, dashes, marks and units: what a case calls a circuit names that one."""

from dataclasses import replace

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.model import naming
from stabctl.model.location import circuit, faulted, locate

IDS = ["A B", "1-2", "@1", "a:b", " 1", "", "'", "ü", "1,2", "7-8", "#2", "ckt 3", "8@0.4", "A  B", "1", "11", "1 "]


def renamed(name, shift=0):
    case = st.load(name)
    ids = [IDS[(k + shift) % len(IDS)] for k in range(len(case.branches))]
    return case, replace(case, branches=tuple(b._replace(circuit=i) for b, i in zip(case.branches, ids, strict=True)))


@pytest.mark.parametrize("name", ["two_area", "wscc9", "ieee39"])
@pytest.mark.parametrize("shift", range(0, len(IDS), 3))
def test_what_a_circuit_is_called_names_it(name, shift):
    _, case = renamed(name, shift)
    names = naming.circuit_names(case.branches)
    assert len(set(names)) == len(case.branches)
    for row, called in enumerate(names):
        assert circuit(case, called) == (row, True)
        assert naming.row(case, "branches", called) == row
        assert locate(case, f"{called}@0.25").branch == row
        assert locate(case, f"{called}@0.25").fraction == 0.25
        assert faulted(case, f"{called}@0.25") == called


def test_parallel_circuits_whose_identifiers_begin_alike_are_told_apart():
    case = st.load("two_area")
    ids = iter(["A", "A B", "A  B", "a"])
    between = [
        b._replace(circuit=next(ids)) if {b.from_bus, b.to_bus} in ({7, 8}, {8, 9}) else b for b in case.branches
    ]
    case = replace(case, branches=tuple(between))
    rows = [circuit(case, name)[0] for name in ("7-8 ckt A", "7-8 ckt A B", "8-9 ckt A  B", "8-9 ckt a")]
    assert rows == [k for k, b in enumerate(case.branches) if b.circuit]


@pytest.mark.parametrize("shift", [0, 5, 9])
def test_a_run_and_a_clearing_time_are_those_with_plain_identifiers(shift):
    plain, case = renamed("two_area", shift)
    names = naming.circuit_names(case.branches)
    row = next(k for k, b in enumerate(case.branches) if (b.from_bus, b.to_bus) == (7, 8))
    found = [
        c.initialize().simulate(st.Contingency(f"{name}@0.4", clear="6cyc"), "2s")
        for c, name in ((plain, "7-8"), (case, names[row]))
    ]
    assert np.array_equal(*(run.rows for run in found))
    assert st.Contingency(f"{names[row]}@0.4", clear="6cyc").described(case).endswith(f"by opening {names[row]}")
    opened = case.initialize().simulate(st.Open(names[row], 0.5), "1s")
    assert np.array_equal(opened.rows, plain.initialize().simulate(st.Open("7-8", 0.5), "1s").rows)


def test_a_screen_is_that_with_plain_identifiers_and_is_resumed(tmp_path):
    plain, case = renamed("two_area", 3)
    wanted, found = plain.screen(), case.screen(store=tmp_path)
    assert [(p.fault, p.cycles) for p in found.pairs] == [(p.fault, p.cycles) for p in wanted.pairs]
    again = case.screen(store=tmp_path)
    assert [(p.fault, p.trip, p.cycles) for p in again.pairs] == [(p.fault, p.trip, p.cycles) for p in found.pairs]
    assert sum(p.wall_s for p in again.pairs) == sum(p.wall_s for p in found.pairs)  # kept, not found again
    for pair in found.pairs:
        one = case.initialize().clearing_time(pair.contingency)
        assert (one.cycles, one.trip) == (pair.cycles, pair.trip)


def test_a_name_that_no_circuit_has_is_refused_in_a_sentence():
    _, case = renamed("two_area")
    for text in ("7-8 ckt A C", "7-8 ckt", "ckt A B", "7-8 ckt A B ", "@", "7-8@@0.4"):
        with pytest.raises(StudyError) as error:
            locate(case, text)
        assert str(error.value).endswith(".")

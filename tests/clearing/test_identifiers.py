"""Identifiers with blanks, dashes and other signs, as PSS/E files may hold: every study takes them as any other."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.clearing import clearing_time, screen
from stabctl.clearing.screen import PLACE
from stabctl.controllers import BangBang
from stabctl.jobs.store import rows
from stabctl.model import location, naming
from stabctl.placement.place import place
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Open, TripMachine

IDS = ["A B", "1-2", "@1", "a:b", " 1", "", "'", "ü", "1,2", "a/b", "#2", "@0.5", "''", "a", "7-8", "ckt"]
QUICK = {"resolution": "1cyc", "longest": "0s", "observe": "2s"}


@pytest.fixture(scope="module")
def plain(cases):
    """Two areas, whose second circuits differ from the first ones."""
    case = cases("two_area").classical()
    return replace(case, branches=tuple(_other(k) if i in (9, 11) else k for i, k in enumerate(case.branches)))


def _other(branch):
    return branch._replace(x=1.2 * branch.x)


def identified(case, id):
    """The case with that identifier everywhere; that of every second circuit is longer, or the same in capitals."""
    second = id.upper() if id.upper() != id else f"{id}1"
    branches = tuple(k._replace(circuit=second if i in (9, 11) else id) for i, k in enumerate(case.branches))
    machines = tuple(m._replace(name=f"{m.bus}/{id}") for m in case.machines)
    return replace(case, branches=branches, machines=machines, loads=tuple(k._replace(id=id) for k in case.loads))


@pytest.fixture(scope="module", params=IDS)
def case(request, plain):
    return identified(plain, request.param)


def by_row(case, found):
    """(Bus, row of the line opened) -> answer, of a screen."""
    return {
        (p.fault, location.circuit(case, p.contingency.trip[0])[0]): (p.status, p.cycles, p.limited_by)
        for p in found.pairs
    }


def test_the_text_of_a_circuit_is_read_back(case):
    circuits = naming.circuits(case.branches)
    texts = list(map(str, circuits))
    assert len(set(texts)) == len(case.branches)
    assert [location.written(text) for text in texts] == circuits
    assert naming.listed(", ".join(texts)) == texts
    assert Contingency(trip=", ".join(texts)).trip == tuple(circuits)
    for row, circuit in enumerate(circuits):
        assert location.locate(case, str(circuit)) == location.locate(case, circuit) == (None, row, None)
        assert location.locate(case, f"{circuit}@0.25") == (None, row, 0.25)
        assert location.placed(case, str(circuit._replace(a=circuit.b, b=circuit.a, at=0.3))) == circuit._replace(
            at=0.7
        )
        assert case.set(f"branches.{circuit}.x", 0.5).branches[row].x == 0.5
        assert Contingency(events=f"{circuit}@1s").timed(case) == (Open(circuit, 1.0),)


def test_a_fault_on_a_circuit_is_cleared_by_opening_it(plain, case):
    second = naming.circuits(case.branches)[9]
    for fault in (f"{second}@0.4", second._replace(at=0.4)):
        run = st.simulate(case, Contingency(fault, "0.1s", events="8-9#2@1.5s"), until=2.0)
        same = st.simulate(plain, Contingency("7-8#2@0.4", "0.1s", events="8-9#2@1.5s"), until=2.0)
        first = st.simulate(plain, Contingency("7-8@0.4", "0.1s", events="8-9#2@1.5s"), until=2.0)
        assert (run.arrays.angle == same.arrays.angle).all()
        assert not (run.arrays.angle == first.arrays.angle).all()


def test_a_machine_is_told_by_its_name(case):
    for row, machine in enumerate(case.machines):
        bus, id = str(machine.bus), machine.name[len(str(machine.bus)) + 1 :]
        quoted = f"{bus}/'{id.replace(chr(39), 2 * chr(39))}'"
        assert case.machine(machine.name) is case.machine(quoted) is machine
        for name in (machine.name, quoted):
            (trip,) = Contingency(events=f"{name}@1s").timed(case) if id else (TripMachine(name, 1.0),)
            assert case.machine(trip.machine) is machine
        if id:
            assert case.with_storage({quoted: "50MW"}).storage == case.with_storage(f"{quoted}=50MW").storage
            assert case.with_storage(f"{quoted}=50MW").storage[0].machine == case.machines[row].machine


def test_a_flow_is_read_from_its_own_circuit(plain, case):
    first, second = naming.circuits(case.branches)[8:10]
    found = case.initialize().linearize("load_p:7", f"flow:{second}, flow:{first}")
    same = plain.initialize().linearize("load_p:7", "flow:7-8#2, flow:7-8")
    assert (found.C == same.C).all()
    assert not np.allclose(found.C[0], found.C[1])
    assert list(found.outputs) == [f"P line {second}", f"P line {first}"]


def test_machines_whose_names_differ_in_a_blank_or_capitals(plain):
    names = ["1/1", "1/ 1", "1/A", "1/a"]
    case = replace(plain, machines=tuple(m._replace(name=n) for m, n in zip(plain.machines, names, strict=True)))
    assert [case.machine(name).machine for name in names] == [1, 2, 3, 4]
    assert [Contingency(events=f"{n}@1s").timed(case)[0].machine for n in names] == names


@pytest.fixture(scope="module")
def screened(plain):
    found = screen(plain, **QUICK)
    return by_row(plain, found)


def test_a_screen_has_the_same_clearing_times(case, screened, tmp_path):
    found = screen(case, **QUICK, store=tmp_path)
    assert by_row(case, found) == screened
    kept = [dict(row) for row in rows(tmp_path / "screen.db", PLACE)]
    again = screen(case, **QUICK, store=tmp_path)
    assert [vars(p) for p in again.pairs] == [vars(p) for p in found.pairs]
    assert [dict(row) for row in rows(tmp_path / "screen.db", PLACE)] == kept  # not run again
    pair = found.pairs[0]
    one = clearing_time(case, Contingency(pair.fault, trip=pair.trip), **QUICK)
    assert (one.cycles, one.contingency.trip) == (pair.cycles, pair.contingency.trip)


def test_stored_rows_of_other_identifiers_are_not_taken(plain, tmp_path):
    """The same bus and two circuits whose identifiers are exchanged: other rows, and each its own answer."""
    case = identified(plain, "A")
    ids = {"A": "A1", "A1": "A"}
    other = replace(case, branches=tuple(k._replace(circuit=ids.get(k.circuit, k.circuit)) for k in case.branches))
    found, exchanged = (screen(one, **QUICK, buses=[7], store=tmp_path) for one in (case, other))
    assert by_row(case, found) == by_row(other, exchanged)
    assert len(list(rows(tmp_path / "screen.db", PLACE))) == 2


def test_a_location_is_printed_in_one_form(plain, tmp_path):
    case = identified(plain, "A B")
    found = screen(case, **QUICK, buses=[7])
    (trip,) = {p.trip[0] for p in found.pairs if p.contingency.trip[0].id == "A B"}
    assert trip == "7-8 ckt 'A B'"
    assert trip in str(found)
    assert trip in set(found.df["trip"])
    with found.save(tmp_path / "pairs.csv").open(newline="") as file:
        assert trip in {row["trip"] for row in csv.DictReader(file)}
    for text in ("7-8 ckt A B", "8-7 ckt 'a b'", "7-8#1", "7-8 ckt 'A B'"):
        one = clearing_time(case, Contingency("7", trip=[text]), **QUICK)
        assert one.trip == (trip,)
        assert str(Contingency("7", "6cyc", [text]).placed(case)) == f"fault 7, cleared after 6cyc by opening {trip}"


@pytest.mark.slow
def test_place_survives_faults_at_circuits_with_identifiers(plain, tmp_path):
    case, found = identified(plain, "1,2"), []
    for base, trip in ((plain, "7-8"), (case, "7-8 ckt '1,2'")):
        wanted = [Contingency("7", "10.5cyc", trip)]
        one = place(base, wanted, observe="2s", control=BangBang(), store=tmp_path / f"{len(found)}")
        found.append(one)
        assert {c.contingency.trip for c in one.contingencies} == {(naming.circuits(base.branches)[8],)}
        assert trip in str(one)
    assert found[0].total_mw == found[1].total_mw > 0


@pytest.mark.parametrize("id", ["A B", "1-2", "@1", "a:b", "'", "ü", "1,2"])
def test_on_the_command_line(stabctl, plain, tmp_path, id):
    case = replace(identified(plain, id), name="mine")
    st.write(case, tmp_path / "mine")
    second = str(naming.circuits(case.branches)[9])
    words = "simulate", tmp_path / "mine", "--fault", f"{second}@0.4", "--clear", "3cyc", "--until", "1.5"
    trips = "--open", "8-9#2@1.2s", "--trip-machine", f"3/'{id.replace(chr(39), 2 * chr(39))}'@1.4s"
    code, out, err = stabctl(*words, "--trip", second, "--trip", "8-9", *trips, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["outcome"]
    code, out, err = stabctl("screen", tmp_path / "mine", "--resolution", "1cyc", "--observe", "2s", "--json")
    assert (code, err) == (0, "")
    assert second in {pair["trip"] for pair in json.loads(out)["pairs"]}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("7-8 ckt 'A", "Branch 7-8 of mine has no circuit 'A; its identifiers are 'A B', 'A B1'."),
        ("7-8 ckt A", "Branch 7-8 of mine has no circuit A; its identifiers are 'A B', 'A B1'."),
        ("7-8 A B", "'7-8 A B' is not a location; write 83 for a bus, 7-8, 7-8#2 or 7-8 ckt 'A B' for a circuit"),
        ("7-8 ckt", "'7-8 ckt' is not a location; write 83 for a bus, 7-8, 7-8#2 or 7-8 ckt 'A B' for a circuit"),
    ],
)
def test_what_is_no_circuit_is_said_in_a_sentence(plain, text, said):
    case = replace(identified(plain, "A B"), name="mine")
    with pytest.raises(StudyError) as caught:
        Contingency(text, "6cyc").check(case)
    assert str(caught.value).startswith(said)

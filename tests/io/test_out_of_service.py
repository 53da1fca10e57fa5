"""What is out of service in a file: its name is kept, and contingencies and users that name it are told so."""

import json
import pickle
from dataclasses import replace

import pytest
from test_internal_buses import BUSES, THREE, WHOLE, written

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.io.contingencies import read_contingencies
from stabctl.jobs.task import fingerprint

LINE = "0.01,0.1,0.05,0,0,0,0,0,0,0"
OUT = {
    "bus": [*BUSES, "6,'OLD HILL',115,4,1,1,1,1,0"],
    "load": [*WHOLE["load"], "3,'2',0,1,1,60,20,0,0,0,0,1,1,0", "5,'1',0,1,1,6,2,0,0,0,0,1,1,0"],
    "shunt": ["3,'1',1,0,10", "3,'2',0,0,10", "4,'1',0,0,10"],
    "gen": [*WHOLE["gen"], "2,'G2',50,0,99,-99,1.03,0,200,0,0.2,0,0.1,1,0,100"],
    "branch": [*WHOLE["branch"], f"1,3,'2',{LINE},0", f"4,5,'1',{LINE},0", f"4,6,'1',{LINE},1"],
    "transformer": [*THREE, "3,4,5,'2',1,1,1,0,0,2,'T',0,1,1", *THREE[1:]],
}
KEPT = [
    "OPEN BRANCH FROM BUS 1 TO BUS 3 CKT 1",
    "OPEN BRANCH FROM BUS 3 TO BUS 4 TO BUS 5 CKT 1",
    "REMOVE UNIT 1 FROM BUS 2",
    "REMOVE LOAD 1 FROM BUS 3",
    "REMOVE SHUNT 1 FROM BUS 3",
]
LEFT_OUT = {
    "OPEN BRANCH FROM BUS 1 TO BUS 3 CKT 2": "branch 1-3 ckt 2",
    "OPEN BRANCH FROM BUS 5 TO BUS 4": "branch 4-5 ckt 1",
    "OPEN BRANCH FROM BUS 4 TO BUS 6": "bus 6",
    "OPEN BRANCH FROM BUS 5 TO BUS 4 TO BUS 3 CKT 2": "branch 3-4-5 ckt 2",
    "REMOVE UNIT G2 FROM BUS 2": "machine 2/G2",
    "REMOVE LOAD 2 FROM BUS 3": "load 2 at bus 3",
    "REMOVE LOAD FROM BUS 5": "load 1 at bus 5",
    "SET BUS 5 LOAD TO 50 PERCENT": "load 1 at bus 5",
    "REMOVE SHUNT 2 FROM BUS 3": "shunt 2 at bus 3",
    "REMOVE SHUNT FROM BUS 4": "shunt 1 at bus 4",
    "OPEN BUS 'OLD HILL'": "bus 6",
}
NEVER = [
    "OPEN BRANCH FROM BUS 1 TO BUS 3 CKT 3",
    "OPEN BRANCH FROM BUS 1 TO BUS 4",
    "OPEN BRANCH FROM BUS 3 TO BUS 4 TO BUS 5 CKT 3",
    "OPEN BUS 7",
    "REMOVE UNIT G3 FROM BUS 2",
    "REMOVE LOAD 3 FROM BUS 3",
    "REMOVE SHUNT FROM BUS 5",
]


@pytest.fixture
def case(tmp_path):
    raw = written(tmp_path, **OUT)
    raw.with_suffix(".dyr").write_text("1 'GENCLS' 1 5 1 /\n2 'GENCLS' 1 5 1 /\n")
    return st.load(raw)


def con(tmp_path, *statements):
    """A CON file with a contingency of three lines for every statement, named N1, N2 ..."""
    blocks = (f"CONTINGENCY N{k}\n{one}\nEND\n" for k, one in enumerate(statements, 1))
    path = tmp_path / "these.con"
    path.write_text("".join(blocks) + "END\n")
    return path


@pytest.mark.parametrize("change", [lambda case, _: case, lambda case, folder: st.load(st.write(case, folder / "x"))])
def test_a_contingency_of_what_is_out_of_service_is_left_out(case, tmp_path, change):
    case = pickle.loads(pickle.dumps(change(case, tmp_path).set("loads.3.p", 61)))
    path = con(tmp_path, *KEPT, *LEFT_OUT)
    found = read_contingencies(path, case)
    assert {one.name.partition(",")[0] for one in found} == {f"N{k + 1}" for k in range(len(KEPT))}
    assert len(found.left_out) == len(LEFT_OUT)
    for k, (said, (statement, what)) in enumerate(zip(found.left_out, LEFT_OUT.items(), strict=True), len(KEPT) + 1):
        assert said.startswith(f"{path} line {3 * k - 1}, ")
        assert statement[:30] in said
        assert said.endswith(f": {what} is out of service in x; contingency 'N{k}' is left out.")


@pytest.mark.parametrize("statement", NEVER)
def test_what_a_file_never_had_is_refused(case, tmp_path, statement):
    path = con(tmp_path, *KEPT, *LEFT_OUT, statement)
    with pytest.raises(StudyError, match=rf"these\.con line {3 * (len(KEPT) + len(LEFT_OUT) + 1) - 1}, .*x has no "):
        read_contingencies(path, case)


def test_statements_by_subsystem_leave_out_what_is_out_of_service(case, tmp_path):
    (tmp_path / "these.con").write_text(
        "SKIP\n1 TO 3 CKT 2\nEND\nSINGLE BRANCH FROM BUS 6\nSINGLE BRANCH IN SUBSYSTEM S\nEND\n"
    )
    (tmp_path / "these.sub").write_text("SUBSYSTEM S\nBUSES 1 3\nBUS 6\nEND\nEND\n")
    found = read_contingencies(tmp_path / "these.con", case, tmp_path / "these.sub")
    assert {*map(str, (t for one in found for t in one.trip))} == {"1-3", "2-3", "1-2"}
    assert [said.partition(": ")[2] for said in found.left_out] == [
        "bus 6 is out of service in x; its contingencies are left out."
    ]
    with pytest.raises(StudyError, match=r"all contingencies name something that is out of service: .* line 2, "):
        read_contingencies(con(tmp_path, "OPEN BUS 6"), case)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda case: st.Contingency("3", "6cyc", "4-5").check(case), "Branch 4-5 ckt 1 is out of service in x"),
        (
            lambda case: st.Contingency("3", "6cyc", "1-3 ckt 2").check(case),
            "Branch 1-3 ckt 2 is .*; in service is 1-3",
        ),
        (lambda case: st.Contingency("3", "6cyc", "1-3#2").check(case), "Branch 1-3 ckt 2 is out of service in x"),
        (lambda case: st.Contingency("3", "6cyc", "4-6").check(case), "Branch 4-6 ckt 1 is out of service in x"),
        (lambda case: st.Contingency("6", "6cyc").check(case), "Bus 6 is out of service in x"),
        (lambda case: st.Contingency("old hill", "6cyc").check(case), "Bus 6 is out of service in x"),
        (lambda case: case.machine("2/G2"), "Machine 2/G2 is out of service in x; its machines are 1/1, 2/1"),
        (lambda case: case.trip_machine(2).machine("2/1"), "Machine 2/1 is out of service in x"),
        (lambda case: case.set("branches.4-5.x", 1), "Branch 4-5 ckt 1 is out of service in x"),
        (lambda case: case.set("buses.6.v", 1), "Bus 6 is out of service in x"),
        (lambda case: st.Contingency("3", "6cyc", "4-1").check(case), "There is no branch 4-1 in x"),
    ],
)
def test_who_names_it_is_told_so(case, wrong, message):
    with pytest.raises(StudyError, match=message):
        wrong(case)


def test_it_changes_no_result(case):
    assert case.out_of_service
    assert fingerprint(case) == fingerprint(replace(case, out_of_service=()))


def test_the_commands_say_what_is_left_out(stabctl, case, tmp_path):
    path = con(tmp_path, *KEPT[:1], *LEFT_OUT)
    args = "screen", tmp_path / "x.raw", "--contingencies", path, "--limit", "4cyc", "--resolution", "2cyc"
    code, out, err = stabctl(*args)
    assert code == 0
    assert "contingency 'N2' is left out. (1 of 11 warnings; --verbose prints all.)" in err
    found = json.loads(stabctl(*args, "--json")[1])["left_out"]
    assert len(found) == 11
    assert found[0].endswith("branch 1-3 ckt 2 is out of service in x; contingency 'N2' is left out.")
    assert "11 contingencies left out that name something out of service; the first: " in " ".join(out.split())


def test_a_matpower_file_keeps_names_too(tmp_path):
    (tmp_path / "two.m").write_text(
        "function mpc = two\nmpc.version = '2';\nmpc.baseMVA = 100;\n"
        "mpc.bus = [1 3 0 0 0 0 1 1 0 230 1 1.1 0.9; 2 1 50 0 0 0 1 1 0 230 1 1.1 0.9;\n"
        "3 4 0 0 0 0 1 1 0 230 1 1.1 0.9];\n"
        "mpc.gen = [1 50 0 99 -99 1 100 1 99 0; 2 0 0 99 -99 1 100 0 99 0; 2 -5 0 0 0 1 100 0 0 -5];\n"
        "mpc.branch = [1 2 0 0.1 0 0 0 0 0 0 0 0; 1 2 0 0.1 0 0 0 0 0 0 1 0];\n"
    )
    case = st.load(tmp_path / "two.m")
    assert [tuple(one) for one in case.out_of_service] == [
        ("bus", 3, 0, 0, ""), ("branch", 1, 2, 0, "1"), ("machine", 2, 0, 0, "2/1"), ("load", 2, 0, 0, "G2"),
    ]  # fmt: skip
    with pytest.raises(StudyError, match="Branch 1-2 ckt 1 is out of service in two; in service is 1-2 ckt 2"):
        st.Contingency("1", "6cyc", "1-2 ckt 1").check(case)

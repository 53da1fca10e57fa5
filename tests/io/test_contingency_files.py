"""CON, SUB and MON files of PSS/E: every statement, counts by hand, and files with mistakes."""

import random
import re
from dataclasses import replace

import pytest
from islands import joined, single

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.io.contingencies import monitored, read_contingencies
from stabctl.io.contingencies.subsystems import Subsystems
from stabctl.model.tables import Link
from stabctl.simulation.events import LoadStep, SwitchShunt, TripMachine
from stabctl.simulation.outage import Outages

SUB = """/PSS(R)E 35
COM SUBSYSTEM description file entry created by PSS(R)E Config File Builder
COM
SUBSYSTEM 'WEST'
   AREA 1
END
SUBSYSTEM 'GRID'
   JOIN 'GROUP 1'
      AREAS 1 2
      KVRANGE 200.0 300.0
   END
END
SYSTEM ENDS
   BUS 7
   BUSES 10 11
   KV 20
END
END
"""
CON = """/PSS(R)E 35
COM
COM CONTINGENCY description file entry created by PSS(R)E Config File Builder
COM
CONTINGENCY 'TIE 1 AND 2'
OPEN LINE FROM BUS      7 TO BUS      8 CIRCUIT 1
TRIP BRANCH FROM BUS    8 TO BUS      9 CKT 2   / the second
END
contingency G2
remove unit 1 from bus 2
END
CONTINGENCY 'BUS 8'
DISCONNECT BUS 8
END
CONTINGENCY LOAD7
REMOVE LOAD 1 FROM BUS 7
REMOVE SHUNT 1 FROM BUS 9
END
CONTINGENCY LESS
DECREASE BUS 9 LOAD BY 100 MW
SET BUS 7 SHUNT TO 50 PERCENT
END
SKIP
8 TO 9 CKT 2
END
SINGLE BRANCH IN SUBSYSTEM 'GRID'
SINGLE TIE FROM SUBSYSTEM 'WEST'
SINGLE UNIT IN SUBSYSTEM 'WEST'
END
"""


@pytest.fixture
def case(cases):
    """The two-area system with areas and rated voltages."""
    two = cases("two_area")
    west = {1, 2, 5, 6, 7}
    rows = [
        b._replace(area=1 if b.bus in west else 2, zone=b.bus % 2, owner=3, rated=20.0 if b.bus < 5 else 230.0)
        for b in two.buses
    ]
    return replace(two, buses=tuple(rows))


@pytest.fixture
def read(case, tmp_path):
    """The contingencies of a text."""

    def made(con, sub=None):
        (tmp_path / "these.con").write_text(con)
        if sub is not None:
            (tmp_path / "these.sub").write_text(sub)
        return read_contingencies(tmp_path / "these.con", case, None if sub is None else tmp_path / "these.sub")

    return made


def block(*statements):
    return "\n".join(["CONTINGENCY 'A'", *statements, "END", "END", ""])


def test_subsystems_are_united_and_joined(case, tmp_path):
    (tmp_path / "these.sub").write_text(SUB)
    found = {name: sorted(one.buses) for name, one in Subsystems(tmp_path / "these.sub", case).named.items()}
    assert found["WEST"] == [1, 2, 5, 6, 7]
    assert found["GRID"] == [5, 6, 7, 8, 9, 10, 11]
    assert found["ENDS"] == [1, 2, 3, 4, 7, 10, 11]


@pytest.mark.parametrize(
    ("selectors", "buses"),
    [
        ("AREA 1 ZONE 0", {1, 2, 4, 5, 6, 7, 8, 10}),  # united outside a group
        ("JOIN AREA 1 ZONE 0 END", {2, 6}),
        ("JOIN X\nAREA 1\nZONE 0\nEND\nBUS 11", {2, 6, 11}),
        ("JOIN AREA 1 KV 20 END JOIN AREA 2 KV 20 END", {1, 2, 3, 4}),
        ("OWNER 3", set(range(1, 12))),
        ("BUS 3 BUS 4", {3, 4}),
    ],
)
def test_selectors_of_a_subsystem(case, tmp_path, selectors, buses):
    (tmp_path / "these.sub").write_text(f"SUBSYSTEM S\n{selectors}\nEND\nEND\n")
    assert Subsystems(tmp_path / "these.sub", case).named["S"].buses == buses


def test_a_file_like_those_of_the_config_file_builder(read, case):
    """By hand: 5 blocks of which one has two ends; 8 lines of 230 kV less the one skipped; 2 ties; 2 machines."""
    found = read(CON, SUB)
    blocks, ends = found[:6], {one.name: one for one in found}
    assert [one.name for one in blocks] == [
        "TIE 1 AND 2, fault at bus 7", "TIE 1 AND 2, fault at bus 8", "G2", "BUS 8", "LOAD7", "LESS",
    ]  # fmt: skip
    assert [[*map(str, one.trip)] for one in blocks[:2]] == [["7-8", "8-9#2"]] * 2
    assert (blocks[2].fault, blocks[2].after) == ("6", (TripMachine(2, 0.0),))
    assert len(blocks[3].trip) == 4
    seven, nine = case.loads
    assert blocks[4].after == (LoadStep(7, 0.0, -seven.p, -seven.q), SwitchShunt(9, 0.0, 0.0, -350.0))
    assert blocks[5].after == (LoadStep(9, 0.0, -100.0, -100.0 * nine.q / nine.p), SwitchShunt(7, 0.0, 0.0, -100.0))
    assert len(found) == 6 + 2 * 7 + 0 + 2  # the ties 7-8 are among the 7 lines
    assert "machine 1" in ends
    assert "machine 3" not in ends
    assert all(one.clear is None for one in found)
    for one in found:
        one.with_clear("6cyc").check(case)


@pytest.mark.parametrize(
    ("statement", "pairs"),
    [
        ("DOUBLE BRANCH IN SUBSYSTEM GRID", 8 * 7 // 2),
        ("PARALLEL LINE IN SUBSYSTEM GRID", 2),
        ("DOUBLE TIE FROM SYSTEM WEST", 1),
        ("BUSDOUBLE BRANCH IN SUBSYSTEM GRID", 1 + 3 + 6 + 3 + 1 - 2),  # at buses 6 to 10; parallel ones meet at two
        ("SINGLE BRANCH FROM BUS 8", 4),
    ],
)
def test_pairs_of_branches(read, statement, pairs):
    assert len(read(f"{statement}\nEND\n", SUB)) == 2 * pairs


def test_machines_and_buses_of_a_subsystem(read):
    found = read("DOUBLE MACHINE IN SUBSYSTEM ENDS\nSINGLE BUS IN SUBSYSTEM WEST\nEND\n", SUB)
    assert len(found) == 6 + 5


def test_every_word_for_the_buses_of_a_subsystem_is_read(read):
    every = read("SINGLE BUS IN SUBSYSTEM WEST\nEND\n", SUB)
    for words in ("BUS IN", "bus from", "BUSES IN", "BUSES FROM"):
        assert read(f"{words} SUBSYSTEM WEST\nEND\n", SUB) == every
    for word in ("BUSN", "BUSNAMES", "BUSNUMBERS"):
        with pytest.raises(StudyError, match="is not represented, because buses are given by number or name without"):
            read(f"{word}\nEND\n", SUB)


def test_a_machine_behind_its_transformer_is_named_where_it_is_accepted(case, tmp_path):
    """Machine B of bus 5 is at bus 1, in the case behind the transformer."""
    first, *others = case.machines
    named = replace(case, machines=(first._replace(name="5/B"), *others))
    path = tmp_path / "these.con"
    path.write_text(block("REMOVE MACHINE B FROM BUS 5"))
    assert read_contingencies(path, named)[0].after == (TripMachine("5/B", 0.0),)
    path.write_text(block("REMOVE MACHINE 7 FROM BUS 5"))
    with pytest.raises(StudyError, match="has no machine 7 at bus 5; it has 5/B"):
        read_contingencies(path, named)


def test_keywords_are_in_any_case_and_may_be_cut(read):
    whole = read(block("OPEN BRANCH FROM BUS 5 TO BUS 6 CIRCUIT 1"))
    for same in (
        "ope bra fro bus 5 to bus 6 cir 1",
        "Trip Line From Bus 6 To 5 ckt '1 '",
        "DISC LIN FROM BUS 5 TO BUS 6",
        "DIS BRA FROM BUS 5 TO BUS 6",
    ):
        assert {(one.fault, one.trip) for one in read(block(same))} == {(one.fault, one.trip) for one in whole}


def test_machines_that_are_cut_off_without_load_trip(read, case):
    """A step-up transformer that opens leaves its machine alone; a part with a load is left to the run."""
    alone = read(block("OPEN BRANCH FROM BUS 1 TO BUS 5"))
    assert [(one.fault, one.after) for one in alone] == [(bus, (TripMachine(1, 0.0),)) for bus in ("1", "5")]
    split = read(block("OPEN LINE FROM BUS 7 TO BUS 8 CKT 1", "OPEN LINE FROM BUS 7 TO BUS 8 CKT 2"))
    assert all(one.after == () for one in split)
    run = case.simulate(alone[1].with_clear("3cyc"), until="2s")
    assert list(run.on[-1]) == [False, True, True, True]


def test_machines_of_another_island_or_with_a_link_do_not_trip(case):
    """An island without loads of its own, and a machine that feeds an HVDC link, are left to the run."""
    alone = single(case, 100.0)
    two = joined(case, replace(alone, loads=()))
    assert Outages(two).cut_off((0,)) == (1,)
    links = (Link("sent", 1, 11, 50.0),)
    assert Outages(replace(case, links=links)).cut_off((0,)) == ()


def test_halves_of_a_load_and_shunts_of_a_bus_are_each_lost_once(case, tmp_path):
    one, other = case.loads
    half = one._replace(p=one.p / 2, q=one.q / 2)
    path = tmp_path / "these.con"
    path.write_text(block("REMOVE LOAD 1 FROM BUS 7", "REMOVE LOAD 2 FROM BUS 7", *["REMOVE SHUNT FROM BUS 7"] * 2))
    (found,) = read_contingencies(path, replace(case, loads=(half, half, other)))
    halves = (LoadStep(7, 0.0, -half.p, -half.q, id) for id in ("1", "2"))
    assert found.after == (*halves, SwitchShunt(7, 0.0, 0.0, -200.0))


def test_a_transformer_with_three_windings_is_one_branch(case, tmp_path):
    star = case.buses[7]._replace(bus=99, name="star 5-6-8", g=0.0, b=0.0)
    rows = [case.branches[0]._replace(from_bus=bus, to_bus=99, circuit="T1") for bus in (5, 6, 8)]
    three = replace(case, buses=(*case.buses, star), branches=(*case.branches, *rows))
    for how in ("OPEN BRANCH FROM", "OPEN THREEWINDING AT"):
        (tmp_path / "these.con").write_text(block(f"{how} BUS 5 TO BUS 6 TO BUS 8 CIRCUIT T1"))
        found = read_contingencies(tmp_path / "these.con", three)
        assert [one.fault for one in found] == ["5", "6", "8"]
        assert {len(one.trip) for one in found} == {3}
    (tmp_path / "these.sub").write_text("SUBSYSTEM S BUSES 5 8 END\nEND\n")
    (tmp_path / "these.con").write_text("SINGLE BRANCH IN SUBSYSTEM S\nEND\n")
    found = read_contingencies(tmp_path / "these.con", three, tmp_path / "these.sub")
    assert sum(one.name.startswith("branch 5-6-8 ckt T1") for one in found) == 3
    twin = tuple(k._replace(to_bus=98, circuit="1") for k in rows)
    beside = replace(three, buses=(*three.buses, star._replace(bus=98)), branches=(*three.branches, *twin))
    both = read_contingencies(tmp_path / "these.con", beside, tmp_path / "these.sub")
    assert {one.name for one in both} - {one.name for one in found} == {
        f"branch 5-6-8, fault at bus {end}" for end in (5, 6, 8)
    }


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("OPEN BRNCH FROM BUS 7 TO BUS 8", "BRNCH is not allowed here; .*did you mean BRANCH?"),
        ("OPEN LINE FROM BUS 7 TO BUS 88", "has no bus 88; the nearest numbers are 9, 10, 11"),
        ("OPEN LINE FROM BUS 7 TO BUS 9", "has no branch 7-9; the branches at bus 7 are 7-6, 7-8"),
        ("OPEN LINE FROM BUS 7 TO BUS 7", "has no branch 7-7"),
        ("OPEN LINE FROM BUS 7 TO BUS 8 CKT 3", "has no circuit 3; it has 1, 2"),
        ("OPEN LINE FROM BUS 7", "the line ends too early; TO must follow"),
        ("OPEN LINE FROM BUS 7 TO BUS 8 CKT 1 2", "2 is not allowed here; it must be the end of the line"),
        ("OPEN LINE FROM BUS 5 TO BUS 6\nOPEN LINE FROM BUS 6 TO BUS 5", "the branch is named above, too"),
        ("REMOVE MACHINE 2 FROM BUS 1", "has no machine 2 at bus 1; it has 1"),
        ("REMOVE MACHINE 1 FROM BUS 7", "has no machine 1 at bus 7; it has none there"),
        ("REMOVE LOAD FROM BUS 8", "has no load at bus 8"),
        ("REMOVE LOAD X FROM BUS 7", "has no load X at bus 7; it has 1"),
        ("REMOVE SHUNT FROM BUS 8", "has no shunt at bus 8"),
        ("CLOSE BRANCH FROM BUS 7 TO BUS 8", "CLOSE is not represented, because a branch that is not in service"),
        ("ADD MACHINE 1 TO BUS 7", "ADD is not represented"),
        ("SET BUS 1 GENERATION TO 100 MW", "GENERATION is not represented"),
        ("SET BUS 7 LOAD TO 100 PERCENT", "it changes nothing"),
        ("REMOVE LOAD FROM BUS 7\nREDUCE BUS 7 LOAD BY 50 PERCENT", "the load is named above, too"),
        ("REDUCE BUS 7 SHUNT BY 50 PERCENT\nREDUCE BUS 7 SHUNT BY 20 PERCENT", "the shunt is named above, too"),
        ("DECREASE BUS 7 LOAD BY 1000 MW", "only 967 can be taken away"),
        ("SET BUS 7 LOAD TO lots PERCENT", "lots is not a number"),
        ("SET BUS 8 LOAD TO 50 PERCENT", "it needs a load with active power at the bus"),
        ("SET BUS 7 LOAD TO 50 MVAR", "and MW or PERCENT"),
        ("OPEN LINE FROM BUS '7 TO BUS 8", "a quote is not closed"),
        ("SINGLE BRANCH IN SUBSYSTEM WEST", "SINGLE is not allowed here"),
        ("CONTINGENCY B", "contingency 'A' of line 1 has no END before it"),
        ("COM nothing", "nothing is lost"),
    ],
)
def test_a_mistake_in_a_block_is_a_sentence(read, statement, words):
    with pytest.raises(StudyError, match=rf"these.con line \d+, .*{words}") as error:
        read(block(statement), SUB)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


@pytest.mark.parametrize(
    ("con", "sub", "words"),
    [
        ("CONTINGENCY A B\nEND\n", None, "line 1, .*CONTINGENCY and a name"),
        (block("DISCONNECT BUS 8")[:-8], None, "line 1, .*it has no END"),
        (block("DISCONNECT BUS 8") + "DISCONNECT BUS 7\n", None, "line 5, .*nothing may follow the END"),
        (block("DISCONNECT BUS 8")[:-4] * 2, None, "line 4, .*line 1 has a contingency of this name, too"),
        (block("DISCONNECT BUS 8").replace("A", "'a\vb'", 1), None, "line 1, .*one line of text without control"),
        ("COM nothing yet", None, "has no contingencies; write CONTINGENCY"),
        ("SKIP\n7 TO 8\n", None, "line 1, .*it has no END"),
        ("SINGLE LINE IN SUBSYSTEM WEST\nEND", None, "the subsystems are missing"),
        ("SINGLE LINE IN SUBSYSTEM WET\nEND", SUB, "has no subsystem WET; did you mean WEST"),
        ("SINGLE LINE IN SUBSYSTEM WEST\nEND", SUB.replace("AREA 1", "AREA 9"), "these.sub line 5, .*no area 9"),
        ("SINGLE LINE IN SUBSYSTEM WEST\nEND", SUB.replace("AREA 1", "AERA 1"), "line 5, .*did you mean AREAS"),
        ("SINGLE LINE IN SUBSYSTEM WEST\nEND", SUB.replace("200.0 300.0", "300 200"), "line 10, .*is empty"),
        ("SINGLE LINE IN SUBSYSTEM WEST\nEND", SUB.replace("WEST", "GRID"), "line 7, .*a subsystem 'GRID' above"),
        ("SINGLE LINE IN SUBSYSTEM WEST\nEND", SUB[:-4], "the END of the file is missing"),
    ],
)
def test_a_mistake_in_a_file_is_a_sentence(read, con, sub, words):
    with pytest.raises(StudyError, match=words):
        read(con, sub)


def test_subsystems_belong_to_a_con_file(case, tmp_path):
    with pytest.raises(StudyError, match="belong to contingencies"):
        read_contingencies(tmp_path / "these.toml", case, tmp_path / "these.sub")
    with pytest.raises(StudyError, match="there is no such file"):
        read_contingencies(tmp_path / "missing.con", case)


def changed(text, rng):
    """A text with one token deleted, doubled, misspelled, replaced by a bus that is not there, or an END lost."""
    lines = text.splitlines()
    kind = rng.choice(["delete", "double", "misspell", "bus", "end"])
    ends = [i for i, line in enumerate(lines) if line.strip() == "END"]
    if kind == "end":
        del lines[rng.choice(ends)]
        return "\n".join(lines)
    i = rng.choice([k for k, line in enumerate(lines) if line.strip()])
    words = lines[i].split()
    places = [k for k, word in enumerate(words) if kind != "bus" or word.isdecimal()]
    if not places:
        return text
    k = rng.choice(places)
    if kind == "misspell":
        j = rng.randrange(len(words[k]))
        words[k] = words[k][:j] + rng.choice("QXZ") + words[k][j + 1 :]
    else:
        words[k : k + 1] = {"delete": [], "double": [words[k]] * 2, "bus": ["98765"]}[kind]
    lines[i] = " ".join(words)
    return "\n".join(lines)


def meaning(found):
    """What happens, without names."""
    return {(one.fault, one.trip, one.impedance, one.events, one.after) for one in found}


@pytest.mark.parametrize("seed", range(100))
def test_a_changed_file_means_the_same_or_is_refused(read, seed):
    rng = random.Random(seed)
    con, sub = (changed(CON, rng), SUB) if seed % 2 else (CON, changed(SUB, rng))
    whole = meaning(read(CON, SUB))
    refused = ""
    try:
        found = read(con, sub)
    except StudyError as error:
        refused = str(error)
    assert re.search(r"these\.(con|sub) line \d+, ", refused) if refused else meaning(found) == whole, (con, sub)


MON = """/PSS(R)E 34
COM MONITORED element file entry created by PSS(R)E Config File Builder
MONITOR VOLTAGE RANGE ALL BUSES 0.90 1.10
MONITOR VOLTAGE RANGE SUBSYSTEM 'WEST' 0.950 1.050
MONITOR VOLTAGE RANGE KV 20 0.98
MONITOR VOLTAGE RANGE BUS 8 0.94 1.1
MONITOR VOLTAGE DEVIATION SUBSYSTEM 'WEST' 0.030 0.060
MONITOR BRANCHES IN SUBSYSTEM 'WEST'
MONITOR TIES FROM SUBSYSTEM 'WEST'
MONITOR INTERFACE 'TIE' RATING 400 MW
7 8 1
7 8 2
END
END
"""


def test_monitored_voltages(case, tmp_path):
    (tmp_path / "these.mon").write_text(MON)
    (tmp_path / "these.sub").write_text(SUB)
    found = monitored(tmp_path / "these.mon", case, tmp_path / "these.sub")
    assert found.voltages[5] == (0.95, 1.05)
    assert found.voltages[1] == (0.98, float("inf"))
    assert (found.voltages[8], found.voltages[9]) == ((0.94, 1.1), (0.9, 1.1))
    assert len(found.unused) == 3
    with pytest.raises(StudyError, match=r"these.mon line 4, .*the subsystems are missing"):
        monitored(tmp_path / "these.mon", case)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("MONITOR VOLTAGE RANGE BUS 8 1.1 0.9", "line 1, .*is empty"),
        ("MONITOR VOLTAGE RNGE BUS 8 0.9", "did you mean RANGE"),
        ("MONITOR INTERFACE X\n7 8\n", "line 1, .*it has no END"),
        ("MONITOR INTERFACE X\n7 9\nEND", "line 2, .*no branch 7-9"),
        ("MONITOR VOLTAGE RANGE AREA 7 0.9 1.1", "has no bus with AREA 7"),
        ("END\n7", "line 2, .*nothing may follow"),
        ("END", "monitors nothing"),
    ],
)
def test_mistakes_in_what_is_monitored(case, tmp_path, text, words):
    (tmp_path / "these.mon").write_text(text)
    with pytest.raises(StudyError, match=rf"these.mon .*{words}"):
        monitored(tmp_path / "these.mon", case)


def test_a_study_with_monitored_voltages(case, tmp_path):
    """Bus 8 is at 0.9486 pu, below the usual 0.95, but in the range that is monitored."""
    (tmp_path / "these.mon").write_text(
        "MONITOR VOLTAGE RANGE BUS 8 0.94 1.1\nMONITOR BRANCHES IN SUBSYSTEM WEST\nEND\n"
    )
    (tmp_path / "these.sub").write_text(SUB)
    given = {"faults": [st.Contingency("7", trip="7-8")], "worst": 0, "scan": 0, "resolution": "2cyc"}
    usual = case.study(**given)
    own = case.study(**given, monitored=tmp_path / "these.mon", subsystems=tmp_path / "these.sub")
    assert [[bus for bus, _ in one.low_or_high] for one in (usual, own)] == [[8], []]
    assert any("Monitored by the file, but not here: flows" in line for line in own.remarks())

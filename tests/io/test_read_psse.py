"""PSS/E files: what they say of the network is what the case has, in every version, with their names."""

import re
from dataclasses import replace

import numpy as np
import pytest
from psse_replay import DATA

import stabctl as st
from stabctl._util.errors import CaseError, StudyError
from stabctl.io import _lexer, psse
from stabctl.io.psse import dyr
from stabctl.model import location, naming, network, powerflow
from stabctl.simulation.events import Clear, Fault, Open

THREE = DATA / "psid/GENROU/ThreeBusMulti.raw"
TVC = DATA / "psid/EXAC1/TVC_System_32.raw"


def mismatch(case):
    """Largest power mismatch (MW, Mvar) at the voltages that the file gives."""
    net = network.build(case)
    V = np.array([b.v * np.exp(1j * np.deg2rad(b.angle)) for b in case.buses])
    S = V * (network.admittance(net) @ V).conj() + powerflow.demand(case)
    np.add.at(S, net.machine_bus, -np.array([m.p + 1j * m.q for m in case.machines]) / case.base_mva)
    return np.abs(S.real).max() * case.base_mva, np.abs(S.imag).max() * case.base_mva


@pytest.mark.parametrize(
    ("raw", "p", "q"),
    [(THREE, 0.0015, 0.0006), (TVC, 0.04, 0.3), (DATA / "psid/Test01/OMIB.raw", 0.0013, 0.0005)],
)  # the last digits of the voltages amount to 0.0014, 0.039, 0.0012 MW and 0.0005, 0.29, 0.0004 Mvar
def test_stored_voltages_are_those_of_the_power_flow(raw, p, q):
    case = psse.read_psse(raw)
    assert mismatch(case) < (p, q)
    flow = case.power_flow()
    assert np.abs(np.abs(flow.V) - [b.v for b in case.buses]).max() < 5e-6  # 4.7e-6 pu, the last digit
    assert np.abs(np.rad2deg(np.angle(flow.V)) - [b.angle for b in case.buses]).max() < 1e-4  # 5.0e-5 degrees


LOAD = "   103,'1 ',1,   1,   1,   250.000,    30.000,     0.000,     0.000,     0.000,     0.000,   1,1,0\n"
SHUNTS = "Begin Fixed shunt data\n"


@pytest.mark.parametrize(
    ("after", "added", "says"),
    [
        (LOAD, LOAD, r"line 9.*load 103/1 appears twice, first in line 8"),
        (SHUNTS, "103,'1',1,0,50\n103,'1 ',1,0,50\n", r"line 11.*shunt 103/1 appears twice, first in line 10"),
    ],
)
def test_a_load_or_shunt_that_appears_twice_is_told(tmp_path, after, added, says):
    """It would count twice; another identifier is another load."""
    text = THREE.read_text()
    assert after in text
    (tmp_path / "x.raw").write_text(text.replace(after, after + added, 1))
    with pytest.raises(CaseError, match=says):
        psse.read_psse(tmp_path / "x.raw")
    (tmp_path / "x.raw").write_text(text.replace(after, after + added.replace("'1 '", "'2'"), 1))
    psse.read_psse(tmp_path / "x.raw")


def test_machines_of_one_bus_that_hold_several_voltages_are_told(tmp_path):
    """The first one holds."""
    first = next(line for line in THREE.read_text().split("\n") if line.startswith("   102,'1 ',   100"))
    second = first.replace("'1 '", "'2 '").replace("1.02000", "1.03000")
    (tmp_path / "x.raw").write_text(THREE.read_text().replace(first, f"{first}\n{second}", 1))
    case = psse.read_psse(tmp_path / "x.raw")
    assert case.buses[1].v == 1.02
    assert any("the machines at bus 102 have several VS; the first holds: 1.02 pu" in note for note in case.notes)


def test_names_and_identifiers_are_those_of_the_file():
    case = psse.read_psse(TVC)
    assert [m.name for m in case.machines] == ["1/1", "2/1"]
    assert [b.name for b in case.buses] == ["BUS1", "BUS2", "BUS3", "BUS4"]
    assert list(case.power_flow().branches.index) == ["1-4 ckt 1", "1-4 ckt 2", "2-4", "4-3"]


def test_a_case_without_dynamic_data_has_a_power_flow_only():
    case = st.load(THREE)
    assert case.power_flow().iterations > 0
    with pytest.raises(StudyError, match="ThreeBusMulti has no dynamic models, only a power flow"):
        case.initialize()


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le with its mark"])
def test_files_in_the_encodings_of_windows_are_read(tmp_path, encoding):
    (tmp_path / "ThreeBusMulti.raw").write_bytes(
        ("\ufeff" * encoding.endswith("mark") + THREE.read_text()).encode(encoding.partition(" ")[0])
    )
    assert psse.read_psse(tmp_path / "ThreeBusMulti.raw") == psse.read_psse(THREE)


def test_files_in_the_code_page_of_windows_are_those_in_utf8(tmp_path):
    """The same case, folder and names, and one correction line for each file; undefined bytes do no harm."""
    text = THREE.read_text().replace("'BUS 3'", "'Köln – Süd'").replace("'BUS 2'", "'ÉVORA'")
    cases = []
    for encoding in ("utf-8", "cp1252"):
        (tmp_path / "x.raw").write_bytes(text.encode(encoding))
        (tmp_path / "x.con").write_bytes("CONTINGENCY 'Weiß'\nOPEN BUS 'KÖLN – SÜD'\nEND\nEND\n".encode(encoding))
        cases.append(st.load(tmp_path / "x.raw"))
        assert [c.name for c in st.read_contingencies(tmp_path / "x.con", cases[-1])] == ["Weiß"]
    told = f"{tmp_path / 'x.raw'}: it is read as Windows-1252, because it is not UTF-8."
    assert cases[1].notes == (told, *cases[0].notes)
    assert replace(cases[1], notes=cases[0].notes) == cases[0]
    assert naming.bus_number(cases[1], "köln – süd") == 103
    st.write(cases[1], tmp_path / "folder")
    assert st.load(tmp_path / "folder").buses == cases[0].buses
    (tmp_path / "x.raw").write_bytes(text.encode("cp1252").replace("É".encode("cp1252"), b"\x81"))
    assert st.load(tmp_path / "x.raw").buses[1].name == "?VORA"


@pytest.mark.parametrize("text", ["", "\n \n"])
def test_an_empty_file_is_told(tmp_path, text):
    (tmp_path / "x.raw").write_text(text)
    with pytest.raises(CaseError, match=r"x\.raw: the file is empty"):
        psse.read_psse(tmp_path / "x.raw")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("0.99341", "O.99341", "line 6, field VM: 'O.99341' is not a number."),
        ("103,'BUS 3'", "102,'BUS 3'", "line 6, field I: bus 102 appears twice, first in line 5."),
        ("103,'1 ',1", "109,'1 ',1", "line 8, field I: there is no bus 109."),
        ("100.00, 33,", "100.00, 28,", "line 1, field REV: version 28 of RAW files is not supported; save it as 30"),
        ("1.20000E-1,   0.00000", ",   0.00000", "line 14, field X: it is left out and has no default."),
        ("'BUS 2'", "'BUS 2", "line 5: the quote in "),
        ("0.99341", "0.0", "line 6, v_pu: 0.0 is not allowed; it must be a number from 0.01 to 100."),
    ],
)
def test_a_mistake_is_told_with_line_and_field(tmp_path, old, new, says):
    text = THREE.read_text()
    assert old in text
    (tmp_path / "x.raw").write_text(text.replace(old, new, 1))
    with pytest.raises(CaseError) as caught:
        psse.read_psse(tmp_path / "x.raw")
    assert str(caught.value).startswith(f"{tmp_path / 'x.raw'} {says}")


COMMENTS = "peak load", "peak load, 'summer'", "'", "it's 3, 4", 'an "old", value', "a/b, 'c/d'", ", , ,", "101 'X"


@pytest.mark.parametrize("comment", COMMENTS)
@pytest.mark.parametrize("commas", [True, False])
def test_a_comment_changes_nothing(tmp_path, comment, commas):
    """After every record of every section and after their end records, with commas and without."""
    rows = THREE.read_text().split("\n")
    if not commas:
        rows = [row.replace(",", " ") for row in rows]
    (tmp_path / "x.raw").write_text("\n".join(rows))
    rows = [
        row if i in (1, 2) or not row.strip() else f"{row.partition('/')[0]} / {comment}" for i, row in enumerate(rows)
    ]
    (tmp_path / "y.raw").write_text("\n".join(rows))
    case, same = (psse.read_psse(tmp_path / name) for name in ("x.raw", "y.raw"))
    assert (same.buses, same.branches, same.machines, same.loads) == (
        case.buses,
        case.branches,
        case.machines,
        case.loads,
    )
    assert case.loads == psse.read_psse(THREE).loads != ()


@pytest.mark.parametrize("saturation", ["0 0", "0.1 0.4"])
def test_a_circuit_without_a_time_constant_is_absent(tmp_path, saturation):
    """Modes of GENROU with T'q0 = 0 are those of x'q = xq and a short T'q0."""
    text = "101 'GENCLS' 1 0 0 /\n102 'GENROU' 1 8 0.03 {} 0.05 6.2 0.05 1.8 1.7 0.3 {} 0.25 0.2 {} /\n"
    swings = []
    for T1q, x1q in ((0, 0.55), (1e-4, 1.7)):
        (tmp_path / "x.dyr").write_text(text.format(T1q, x1q, saturation))
        modes = (case := psse.read_psse(THREE, tmp_path / "x.dyr")).modes()
        swings.append(modes.eigenvalues[modes.swings()])
        said = "line 2, GENROU of 102/1: T'q0 = 0: there is no such circuit; x'q becomes xq"
        assert any(said in note for note in case.notes) == (T1q == 0)
    assert swings[0] == pytest.approx(swings[1], abs=0.05)  # 0.037; 0.1 with a constant flux


@pytest.mark.parametrize("comment", COMMENTS)
def test_a_comment_in_a_dyr_file_changes_nothing(tmp_path, comment):
    records = "101 'GENCLS' 1 0 0 /", "102 'GENROU' 1 8 0.03 0.4 0.05", "6.2 0.05 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /"
    (tmp_path / "x.dyr").write_text("\n".join(f"{r} {comment}" if r.endswith("/") else r for r in records))
    (tmp_path / "y.dyr").write_text(" ".join(records))
    assert [r[1:] for r in dyr.read(tmp_path / "x.dyr")] == [r[1:] for r in dyr.read(tmp_path / "y.dyr")]


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("5,'26' Drop ', 87.0 / 'a', 'b'", ["5", "26' Drop", "87.0"]),  # an apostrophe in a name
        ("5,'N/S' , 'A, B' / c", ["5", "N/S", "A, B"]),
        ("5 'N/S, W' 87.0 / c, 'd'", ["5", "N/S, W", "87.0"]),
        ("5 'O'HARE' ,'x' /'", ["5", "O'HARE", "x"]),
        ('5 "N / S" 1/2', ["5", "N / S", "1"]),
    ],
)
def test_quoted_fields(text, fields):
    assert _lexer.split(text, _lexer.Place(THREE, 1)).fields == fields


@pytest.mark.parametrize(
    "record", ["101 'GENCLS' 1 5.5 0.25 / ", "101,GENCLS 1,5.5 0.25/", "101,'GENCLS','1',5.5,0.25/"]
)
def test_records_of_one_line_are_read_in_one_pass(tmp_path, monkeypatch, record):
    """Twice as many records on a line are searched for twice as many fields, each once."""
    searched = []

    def split(text, place, start=0, filled=False):
        line = _lexer.split(text, place, start, filled)
        searched.append((line.end or len(text)) - start)
        return line

    monkeypatch.setattr(dyr, "split", split)
    for count in (10, 1000):
        searched.clear()
        (tmp_path / "x.dyr").write_text(record * count)
        found = dyr.read(tmp_path / "x.dyr")
        assert len(found) == count
        assert {r[1:] for r in found} == {(101, "GENCLS", "1", ("5.5", "0.25"))}
        assert sum(searched) <= len(record) * count


@pytest.mark.parametrize(
    ("name", "codes", "allowed"),
    [
        ("CW", "4,2,1", "1, 2, 3"),
        ("CZ", "1,0,1", "1, 2, 3"),
        ("CM", "1,2,3", "1, 2"),
        ("STAT", "1,2,1", "0, 1, 2, 3, 4"),
    ],
)
def test_codes_of_a_transformer(tmp_path, name, codes, allowed):
    text = TVC.read_text().replace("0,'1 ',1,2,1,", f"0,'1 ',{codes},", 1)
    text = text.replace("',1,   1,1.0000", f"',{5 if name == 'STAT' else 1},   1,1.0000", 1)
    (tmp_path / "x.raw").write_text(text)
    with pytest.raises(CaseError, match=rf"line 19, field {name}: \d is not allowed; it must be one of {allowed}\.$"):
        psse.read_psse(tmp_path / "x.raw")


class TestNames:
    """Machines, circuits and buses are accepted and told by the names of the file."""

    @pytest.fixture
    def case(self):
        return st.load(TVC)

    def test_of_circuits(self, case):
        rows = {
            text: naming.row(case, "branches", text) for text in ("1-4 ckt 2", "4-1 CKT 2", "1-4#2", "BUS1-bus4 ckt 2")
        }
        assert set(rows.values()) == {1}
        with pytest.raises(StudyError, match="Branch 1-4 of TVC_System_32 has no circuit 3; its identifiers are 1, 2"):
            st.Contingency("1-4 ckt 3@0.5", "6cyc").check(case)

    @pytest.mark.parametrize("ids", [("1", "2"), ("@1", "*1"), ("7", "&A"), ("1", "@1")])
    def test_of_circuits_are_read_back(self, tmp_path, ids):
        """The name of every circuit leads to its row, from both ends, and to points along it."""
        text = TVC.read_text().replace("     1,      4,'1 '", f"1,4,'{ids[0]}'")
        text = text.replace("     1,      4,'2 '", f"4,1,'{ids[1]}'")
        (tmp_path / "x.raw").write_text(text)
        case = st.load(tmp_path / "x.raw")
        assert [k.circuit for k in case.branches[:2]] == list(ids)
        for row, name in enumerate(naming.keys(case, "branches")):
            assert location.circuit(case, name) == (row, True)
            assert location.locate(case, f"{name}@0.25") == (None, row, 0.25)
            assert [*map(str, st.Contingency(f"{name}@0.25", "6cyc").placed(case).opened)] == [name]
            k = case.branches[row]
            other = name.replace(f"{k.from_bus}-{k.to_bus}", f"{k.to_bus}-{k.from_bus}")
            assert location.locate(case, f"{other}@0.25") == (None, row, 0.75)

    def test_of_a_bus_with_a_dash(self, tmp_path):
        """A fault at bus NORTH-4 is at a bus: it is removed, and opens nothing."""
        (tmp_path / "x.raw").write_text(TVC.read_text().replace("'BUS4        '", "'NORTH-4'"))
        case = st.load(tmp_path / "x.raw")
        fault = st.Contingency("NORTH-4", 0.1, "1-4 ckt 2")
        assert fault.timed(case) == (Fault("4", 1.0), Clear("4", 1.1), Open("1-4 ckt 2", 1.1))
        assert str(fault) == "fault NORTH-4, cleared after 0.1 s by opening 1-4 ckt 2"

    def test_of_machines_and_buses(self, case):
        assert case.machine("2/1") is case.machine(2) is case.machine("bus2/1")
        with pytest.raises(StudyError, match="There is no machine 2/7 in TVC_System_32; its machines are 1/1, 2/1"):
            case.machine("2/7")
        st.Contingency("Bus4", "6cyc", events=["1-4 ckt 2@2s", "2/1@3s", "BUS3:+50MW@2s"]).check(case)

    def test_of_several_machines_at_a_bus(self, tmp_path):
        text = TVC.read_text()
        line = next(row for row in text.splitlines(keepends=True) if row.startswith("     2,'1 ',   300"))
        (tmp_path / "x.raw").write_text(
            text.replace(line, line.replace("300.000", "100.000") + line.replace("'1 '", "'B '"))
        )
        case = st.load(tmp_path / "x.raw")
        assert [m.name for m in case.machines] == ["1/1", "2/1", "2/B"]
        assert case.machine("2/b").p == 300


def test_a_branch_without_impedance_gets_the_same_one_on_every_base(tmp_path):
    """1e-5 pu on 100 MVA, in ohms whatever the base of the file."""
    branch = next(row for row in THREE.read_text().split("\n") if row.replace(" ", "").startswith("101,102,'1'"))
    fields = branch.split(",")
    joined = ",".join([*fields[:3], "0", "0", *fields[5:]])
    for base in (100.0, 0.02, 3000.0):
        text = THREE.read_text().replace(branch, joined, 1).replace("100.00, 33", f"{base}, 33", 1)
        (tmp_path / "x.raw").write_text(text)
        assert psse.read_psse(tmp_path / "x.raw").branches[0].x == pytest.approx(1e-5 * base / 100)


@pytest.mark.parametrize("kind", ["impedance", "current", "power"])
def test_loads_of_a_kind_draw_the_same_power(tmp_path, kind):
    powers = "250.000,    30.000,     0.000,     0.000,     0.000,     0.000"
    (tmp_path / "x.raw").write_text(THREE.read_text().replace(powers, "100, 5, 70, 20, 80, -5"))
    case = st.load(tmp_path / "x.raw")
    assert [(load.p, load.q, load.v) for load in case.loads] == [(100, 5, 0), (70, 20, 1), (80, 5, 1)]
    V = abs(case.power_flow().V[2])
    assert case.power_flow().df.p_load_mw[103] == pytest.approx(100 + 70 * V + 80 * V**2, rel=1e-12)
    same = case.with_loads(kind)
    assert np.abs(same.power_flow().V - case.power_flow().V).max() < 1e-12  # 2e-15
    assert {(load.p_power, load.p_current, load.v) for load in same.loads} == {
        {"impedance": (0, 0, 0), "current": (0, 1, 0), "power": (1, 0, 0)}[kind]
    }


def test_a_case_read_back_from_its_folder_is_equal(tmp_path):
    case = st.load(TVC)
    assert st.load(st.write(case, tmp_path / "TVC_System_32")) == case


UNMODELED = {  # section -> its records, and the kind and name by which they are told
    "VSC dc line data": ("'V1', 1, 0.7\n 102,1,1,100.0\n 103,2,1,-99.5", "VSC DC line (V1)"),
    "Multi-terminal dc line data": (
        "'M1', 2, 2, 1, 1, 500.0\n 102,2\n 103,2\n 1,102\n 2,103\n 1,2,'1',5.0",
        "multi-terminal DC line (M1)",
    ),
    "FACTS device data": ("'F1', 103, 0, 1", "FACTS device (F1)"),
    "GNE device data": ("'G1', 'MODEL', 1, 103, 1, 1, 0\n 1, 1, 1\n 0.5\n 1", "GNE device (G1)"),
    "Induction machine data": ("103, '1', 1, 1, 1", "induction machine (103)"),
}


def test_what_is_not_modeled_is_named_once_with_its_line(tmp_path):
    text = THREE.read_text()
    for section, (record, _) in UNMODELED.items():
        begins = re.search(rf"[^\n]*Begin {re.escape(section)}[^\n]*\n", text, re.IGNORECASE)
        assert begins, section
        text = text[: begins.end()] + record + "\n" + text[begins.end() :]
    (tmp_path / "x.raw").write_text(text)
    case = psse.read_psse(tmp_path / "x.raw")
    lines = text.split("\n")
    expected = [
        f"{tmp_path / 'x.raw'} line {lines.index(record.split(chr(10))[0]) + 1}: {told} is left out: it is read and"
        for record, told in UNMODELED.values()
    ]
    assert [note.removesuffix(" not modeled.") for note in case.notes] == expected
    assert np.allclose(case.power_flow().V, psse.read_psse(THREE).power_flow().V)


@pytest.mark.parametrize(
    ("tail", "reason"),
    [
        ("0 0 0  0 0 0 0 0 0 0 0 0 0  0", ""),
        ("0 0 0  0 0 0.5 0.5 1 1 0 0 0 0  0", ""),
        ("0.001 0 0  0 0 0 0 0 0 0 0 0 0  0", r"a deadband \(DB1 is not 0\) is not supported"),
        ("0 0 0  0 0 0.5 0.7 1 1 0 0 0 0  0", "a valve curve other than GV = PGV is not supported"),
        ("0 0 0  0 0 0 0 0 0 0 0 0 0  2", r"a blocking of the valve \(IBLOCK is not 0\) is not supported"),
    ],
)
def test_wsieg1_is_ieeeg1_without_deadbands_and_curve(tmp_path, tail, reason):
    genrou = "102 'GENROU' 1 8 0.03 0.4 0.05 6.2 0.05 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /"
    constants = "0 0 20 0.1 0 0.2 0.1 -0.2 1.5 0 0.3 0.3 0 8 0.4 0 0.5 0.3 0 0 0 0"
    (tmp_path / "x.dyr").write_text(f"101 'GENCLS' 1 0 0 /\n{genrou}\n102 'WSIEG1' 1 {constants} {tail} /\n")
    if reason:
        with pytest.raises(CaseError, match=rf"WSIEG1 of 102/1 \(line 3: {reason}\)"):
            psse.read_psse(THREE, tmp_path / "x.dyr")
        return
    case = psse.read_psse(THREE, tmp_path / "x.dyr")
    (tmp_path / "y.dyr").write_text(f"101 'GENCLS' 1 0 0 /\n{genrou}\n102 'IEEEG1' 1 {constants} /\n")
    assert case.devices == psse.read_psse(THREE, tmp_path / "y.dyr").devices


def test_modes_name_the_machines_with_a_rotor_beside_converters():
    files = DATA / "psid/RENA"
    case = psse.read_psse(files / "ThreeBusRenewable.raw", files / "ThreeBus_REN_A_DEFAULT_FLAG.dyr")
    modes = case.modes()
    assert {m.name for m in case.machines} > set(modes.linear.point.rotor_names)
    for k in range(len(modes.eigenvalues)):
        assert [part.machine for part in modes.mode(k).shape] == list(modes.linear.point.rotor_names)

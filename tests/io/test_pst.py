"""Data files of the Power System Toolbox: what they say, what is refused, and published modes."""

import random
import re
from pathlib import Path

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import CaseError, StabctlError
from stabctl.io import pst
from stabctl.io.import_report import import_report
from stabctl.io.pst.tables import read as read_tables

FOLDERS = Path(__file__).parents[1] / "reference" / "pst", Path(st.__file__).parent / "verification" / "cases"
FILES = {path.stem: path for folder in FOLDERS for path in sorted(folder.glob("*.m"))}
SMALL = """% a machine at an infinite bus
disp('two machines')
bus = [...
 1 1.05 20 0.9 0.2 0 0 0 0 2 9 -9 20;
 2 1.00  0 0   0   0 0 0 0 1 9 -9 20;
 3 1.00  5 0   0   0.2 0.1 0 0.05 3 0 0 230];
line = [1 3 0 0.1 0 1 0; 3 2 0.0 0.2 0.04 1 0];
mac_con = [ 1 1 120 0.15 0 1.8 0.3 0.25 8 0.03...
              1.7 0.55 0.25 0.4 0.05 3.5 0 0 1;
            2 2 1e4 0.15 0 1.8 0.3 0.25 8 0.03 1.7 0.55 0.25 0.4 0.05 5 0 0 2];
exc_con = [0 1 0.01 200 0.05 0 0 5 -5; 0 2 0 100 0.05 0 0 5 -5];
load_con = [3 0 0 0.5 0];
"""


@pytest.fixture
def written(tmp_path):
    """A file with this text."""

    def write(text):
        path = tmp_path / "small.m"
        path.write_text(text)
        return path

    return write


def tables(case):
    """Everything of a case but what is said about it."""
    return case.buses, case.branches, case.machines, case.loads, dict(case.devices), case.base_mva, case.frequency_hz


def test_the_modes_of_a_published_system():
    """G. Rogers, Power System Oscillations, 2025, stored result of d2aem: four classical machines."""
    found = st.load(FILES["d2aem"]).initialize().modes().eigenvalues
    for published in (3.531868j, 7.509163j, 7.574632j):
        assert np.abs(found - published).min() < 2e-5  # 6e-6


@pytest.mark.parametrize("name", FILES)
def test_a_file_starts_in_equilibrium(name):
    report = import_report(FILES[name])
    assert {one.kind for one in report.unsupported} == ({"svc_con"} if name == "data2a" else set())
    assert report.start.rate < 1e-6
    assert report.start.drift < 1e-6
    assert not report.failures
    assert report.complete == (name != "data2a")


def test_a_bus_without_a_machine_holds_its_voltage_and_is_an_impedance(written):
    text = SMALL.replace("0.2 0.1 0 0.05 3 0 0 230", "0.2 0.1 0 0.05 2 0 0 230").replace("3 1.00  5", "3 1.03  5")
    case = st.load(written(text))
    point = case.initialize()
    assert abs(point.power_flow().V[2]) == pytest.approx(1.03, abs=1e-9)
    (held,) = (load for load in case.loads if load.id == "G")
    assert (held.p_power, held.p_current, held.kind) == (0, 0, "injection")
    assert case.buses[2].kind == "pq"


@pytest.mark.parametrize("elsewhere", ["0 0", "0.1 0.3"])
def test_the_voltage_is_held_whatever_is_generated_at_load_buses(written, elsewhere):
    """The Mvar at bus 3 are those of the system with the generation at bus 4, which has no machine either."""
    text = SMALL.replace("0.2 0.1 0 0.05 3 0 0 230", f"0.2 0.1 0 0.05 2 0 0 230; 4 1 0 {elsewhere} 0.1 0 0 0 3 0 0 230")
    case = st.load(written(text.replace("3 1.00  5", "3 1.03  5").replace("0.04 1 0]", "0.04 1 0; 3 4 0 0.1 0 1 0]")))
    assert [load.bus for load in case.loads if load.id == "G"] == ([3] if elsewhere == "0 0" else [4, 3])
    assert abs(case.power_flow().V[2]) == pytest.approx(1.03, abs=1e-9)


def test_a_swing_bus_without_a_machine_is_an_impedance_too(written):
    """PST solves the power flow with it; then the first machine that holds a voltage has the angle found."""
    text = SMALL.replace("2 1.00  0 0   0   0 0 0 0 1", "2 1.00  0 0   0   0 0 0 0 2").replace(
        "0.05 3 0 0 230", "0.05 1 0 0 230"
    )
    case = st.load(written(text))
    assert [bus.kind for bus in case.buses] == ["swing", "pv", "pq"]
    (held,) = (load for load in case.loads if load.id == "G")
    V, S = case.power_flow().V, case.power_flow().S
    assert V[2] == pytest.approx(np.exp(1j * np.deg2rad(5)), abs=1e-9)  # as in the file
    assert S[0].real == pytest.approx(0.9, abs=1e-9)
    assert held.p == pytest.approx(100 * (0.9 - 0.2), rel=0.05)  # what the machine gives and the load does not draw
    assert case.initialize().modes().eigenvalues.real.max() < 1


def test_an_infinite_bus_is_a_voltage_behind_a_reactance(written):
    """w = sqrt(wb K / 2H), K = E V cos(angle) / X, of a classical machine at an infinite bus without anything else."""
    text = SMALL.replace("0.2 0.1 0 0.05 3", "0 0 0 0 3").replace("0.2 0.04 1 0", "0.2 0 1 0")
    text = text.replace("1.8 0.3 0.25 8", "0 0.3 0 0") + "ibus_con = [0; 1];\n"
    case = st.load(written(text))
    assert set(case.devices) == {"gencls"}
    assert [par.H for par in case.devices["gencls"].values()] == [3.5, 0]
    point = case.initialize()
    V, S = point.power_flow().V, point.power_flow().S
    behind = [V[k] + 1j * 0.3 * (100 / base) * (S[k] / V[k]).conj() for k, base in ((0, 120), (1, 1e4))]
    X = 0.3 * 100 / 120 + 0.1 + 0.2 + 0.3 * 100 / 1e4
    K = (behind[0] * behind[1].conjugate()).real / X * 100 / 120
    assert point.modes().eigenvalues.imag.max() == pytest.approx(np.sqrt(2 * np.pi * 60 * K / 7), rel=1e-6)


@pytest.mark.parametrize(
    ("changed", "plain"),
    [
        ("bus(:,4:7) = bus(:,4:7)/2;", ("0.9 0.2 0 0", "0.45 0.1 0 0", "0.2 0.1 0 0.05", "0.1 0.05 0 0.05")),
        ("mac_con(:,16) = 4;", ("0.05 3.5 0", "0.05 4 0", "0.05 5 0", "0.05 4 0")),
        ("mac_con(:,17)=mac_con(:,18);", ()),
        ("mac_con(:,16) = mac_con(:,16);", ()),
        ("mac_con(:,20:21) = zeros(2,2)*2;", ()),
        ("exc_con(2,:) = [];", ("; 0 2 0 100 0.05 0 0 5 -5]", "]")),
        ("exc_con([2],:) = [];", ("; 0 2 0 100 0.05 0 0 5 -5]", "]")),
        ("mac_con(1,16) = 4;", ("0.05 3.5 0", "0.05 4 0")),
        ("lmon_con = [1:2]';", ()),
        ("flag = true;\nif ~flag\n mac_con(:,16) = 4;\nend", ()),
        ("flag = 0;\nif flag\n for k = 1:9\nelse\n mac_con(1,16) = 4;\nend", ("0.05 3.5 0", "0.05 4 0")),
        ("line = [1 3 0 0.5*0.2 0 1 0;3,2,0,.4/2,0.04,1,0];", ()),
        ("clear x; notes = {'a', [1 2; 3]}; x.y = notes;", ()),
    ],
)
def test_statements_change_matrices(written, changed, plain):
    """The case is that of a file with the values in place."""
    text = SMALL
    for old, new in zip(plain[::2], plain[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    assert tables(st.load(written(SMALL + changed + "\n"))) == tables(st.load(written(text)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("load_con", "bus(:,2) = 1.01*abs(bus(:,2));\nload_con", "is not data but code, which is not run; write"),
        ("load_con", "system('rm x')\nload_con", "line 12: \"system('rm x')\" is not data but code"),
        ("load_con", "for k = 1:3\nload_con", "is not data but code"),
        ("load_con", "if unknown\nload_con", "is not data but code"),
        ("load_con = [3", "load_con = [9", "there is no bus 9"),
        ("0.2 0.1 0 0.05 3", "0.2 x 0 0.05 3", "field bus: 'x' is not a number"),
        ("0.2 0.1 0 0.05 3", "0.2 0.1 0 3", "line 6: the row has 12 columns; a row of bus needs 13"),
        ("0.2 0.1 0 0.05 3", "0.2 0.1/0 0 0.05 3", "'0.1/0' is divided by zero"),
        ("3 1.00  5", "2 1.00  5", "bus 2 appears twice"),
        ("line = [1 3", "line = [1 7", "there is no bus 7"),
        ("exc_con = [0 1", "exc_con = [0 7", "there is no machine 7"),
        ("[ 1 1 120", "[ 1 1 0", "0 MVA is not allowed"),
        ("load_con = [3 0 0 0.5 0]", "load_con = [3 0.6 0 0.5 0]", "are not between 0 and 1 in sum"),
        ("load_con = [3 0 0 0.5 0];", "load_con = [3 0 0 0.5 0", "load_con is not closed by ']'"),
        ("mac_con = [", "mac_con(9,16) = 1; mac_con = [", "is not data but code"),
        ("load_con", "mac_con(9,16) = 1;\nload_con", "'mac_con(9,16)' is not an element of mac_con"),
        ("load_con", "ibus_con = zeros(3,1);\nload_con", "ibus_con has 3 elements; it needs one for each row"),
        ("load_con", "if 1 == 2\nload_con", "is not data but code"),
        ("load_con", "mac_con(:,20) = bus(:,1)*2;\nload_con", "is not data but code"),
        ("load_con", "mac_con(:,20) = line(:,1);\nload_con", "is not data but code"),
        ("load_con", "basmva = -100;\nload_con", "basmva = -100 is not allowed"),
    ],
)
def test_a_mistake_is_one_sentence_with_its_line(written, old, new, said):
    assert old in SMALL
    with pytest.raises(CaseError) as raised:
        st.load(written(SMALL.replace(old, new, 1)))
    assert said in str(raised.value)
    assert "small.m" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_what_has_no_model_is_named(written):
    text = SMALL.replace("exc_con = [0 1", "exc_con = [4 1") + "pss_con = [2 1 9 10 0.1 0.02 0.1 0.02 0.2 -0.2];\n"
    report = import_report(written(text + "svc_con = [1 3 600 1 0 100 0.05];\n"))
    assert [(one.kind, one.reason) for one in report.unsupported] == [
        ("svc_con", "it is not modeled"),
        ("exc_con", "exciters of type 4 are not modeled"),
        ("pss_con", "stabilizers that read the power are not modeled"),
    ]
    assert not report.complete


def test_a_stabilizer_goes_with_its_exciter(written):
    text = SMALL.replace("exc_con = [0 1", "exc_con = [4 1") + "pss_con = [1 1 9 10 0.1 0.02 0.1 0.02 0.2 -0.2];\n"
    report = import_report(written(text))
    assert [one.kind for one in report.unsupported] == ["exc_con"]
    assert any("pss of machine 1 left out, because its exciter has no model" in one for one in report.corrections)
    assert report.start.drift < 1e-6


@pytest.mark.parametrize(
    ("limits", "read"), [("0.2 -0.1", (0.2, -0.1)), ("0.1 0", (0.1, 0)), ("0 -0.1", (0, -0.1)), ("0 0", (10, -10))]
)
def test_one_limit_of_a_stabilizer_may_be_0_and_without_any_there_is_none(written, limits, read):
    text = SMALL + f"pss_con = [1 1 9 10 0.1 0.02 0.1 0.02 {limits}];\n"
    par = st.load(written(text)).devices["pss"][1]
    assert (par.Vmax, par.Vmin) == read


def test_the_disturbance_of_a_file_is_said_as_options():
    (said,) = (note for note in st.load(FILES["data3m9b"]).notes if "sw_con" in note)
    place, options = said.split(": sw_con is ")
    assert place == f"{FILES['data3m9b']} line 123"
    options, later = options.split("; ")
    assert options == "--fault 4 --trip 4-5 --at 0.1s --clear 0.05s"
    assert later == "its far end opens 0.05 s later, here with the near end."


def test_the_command_line_reads_it(stabctl, written):
    code, out, _ = stabctl("import", written(SMALL))
    assert code == 0
    assert re.search("mac_con +machine +2 +2", out)
    code, out, _ = stabctl("modes", written(SMALL))
    assert code == 0


WORDS = ["0", "-1", "1e99", "nan", "Inf", "x", "", "]", "[", "';"]


def attempt(path):
    """What is said of a file, and its power flow."""
    try:
        return "", pst.read_pst(path).power_flow()
    except StabctlError as error:
        return str(error), None


@pytest.mark.slow
def test_damaged_files_are_read_or_refused_in_a_sentence(written):
    """500 files with characters, words and lines changed: never a traceback, and what is read is in balance."""
    rng, read = random.Random(48), 0
    text = [FILES[name].read_text() for name in ("d2asbegp", "data2a", "data3m9b")]
    for _ in range(500):
        lines = rng.choice(text).split("\n")
        for _ in range(rng.randint(1, 3)):
            k = rng.randrange(len(lines))
            words = lines[k].split(" ")
            match rng.randrange(5):
                case 0:
                    words[rng.randrange(len(words))] = rng.choice(WORDS)
                case 1:
                    lines.insert(k, lines[rng.randrange(len(lines))])
                case 2:
                    words = [lines[k][: rng.randrange(len(lines[k]) + 1)]]
                case 3:
                    words = [lines[k].replace(".", rng.choice(["", "..", "...", "e"]), 1)]
                case 4:
                    words = [f"{lines[k]}{rng.choice([';', '%', '...', ' 7', ' = 3'])}"]
            lines[k] = " ".join(words)
        said, flow = attempt(written("\n".join(lines)))
        assert len(said.splitlines()) == (flow is None)
        if flow is None:
            continue
        read += 1
        at = {bus.bus: k for k, bus in enumerate(flow.case.buses)}
        net = np.array([complex(b.g, -b.b) * abs(v) ** 2 for b, v in zip(flow.case.buses, flow.V, strict=True)])
        for row, power in zip(flow.case.machines, flow.S, strict=True):
            net[at[row.bus]] -= power * flow.case.base_mva
        for row in flow.case.loads:
            net[at[row.bus]] += complex(row.p, row.q)
        for row, power in zip(flow.case.branches, flow.branch_power, strict=True):
            net[[at[row.from_bus], at[row.to_bus]]] += power * flow.case.base_mva
        assert np.abs(net).max() < 1e-3 * max(1, np.abs(flow.S).max())
    assert 100 < read < 450


def test_without_a_swing_bus_the_first_machine_has_it(written):
    text = SMALL.replace("0 0 0 0 1 9 -9 20", "0 0 0 0 2 9 -9 20")
    assert text != SMALL
    case = st.load(written(text))
    assert [b.kind for b in case.buses if b.bus in (1, 2)] == ["swing", "pv"]
    assert any("there is no reference bus with a generator; bus 1 becomes it" in note for note in case.notes)


ROW = "1 1 120 0.15 {ra} {xd} 0.3 {d} {q} 3.5 0 0 1 {s};"
DAMPED, TRANSIENT = "0.25 8 0.03", "0    8 0"


def machine(written, ra="0", xd="1.8", d=DAMPED, q="1.7 0.55 0.25 0.4 0.05", s="0 0"):
    """The system with this machine at bus 1, and what is said of it."""
    a, b = SMALL.index("1 1 120"), SMALL.index("2 2 1e4")
    text = SMALL[:a] + ROW.format(ra=ra, xd=xd, d=d, q=q, s=s) + SMALL[b:].replace("5 0 0 2]", "5 0 0 2 0 0]")
    case = st.load(written(text))
    return case, [note.split("machine 1: ")[1] for note in case.notes if "machine 1: " in note]


@pytest.mark.parametrize(
    ("d", "q", "computed", "said"),
    [
        (DAMPED, "1.7 0.55 0.25 0.4 0", "1.7 0.25 0.25 0.4 999", "T''q0 = 0 becomes 999 s and x'q becomes x''q = 0.25"),
        (DAMPED, "1.7 0.55 0.25 0 0.05", "1.7 0.55 0.25 999 0.05", "T'q0 = 0 becomes 999 s, as in PST."),
        (TRANSIENT, "1.7 0.3 0 0 0", "1.7 0.3 0 999 0", "T'q0 = 0 becomes 999 s, as in PST."),
        (TRANSIENT, "1.7 0 0 0.4 0", "1.7 0.3 0 0.4 0", None),
    ],
)
def test_circuits_without_a_time_constant_are_those_that_pst_computes_with(written, d, q, computed, said):
    """Checks of data in mac_sub.m and mac_tra.m of PST 3.0 and PSTess."""
    (case, notes), (same, _) = machine(written, d=d, q=q), machine(written, d=d, q=computed)
    assert dict(case.devices) == dict(same.devices)
    assert [note.startswith(said) for note in notes] == [True] * len(notes) == [True] * (said is not None)
    assert ("genrou" if d == DAMPED else "two_axis") in case.devices
    assert np.isfinite(case.initialize().modes().eigenvalues).all()


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"s": "0.1 0.4"}, "its saturation is that of PSS/E's GENROU, in PST 3 of E'q alone, in PSTess none."),
        ({"d": TRANSIENT}, "x'q = 0.55 pu stays beside x'd = 0.3 pu; the stator of PST has x'd on both axes."),
    ],
)
def test_where_a_machine_differs_from_that_of_pst_is_said(written, row, said):
    assert machine(written, **row)[1] == [said]
    assert machine(written)[1] == []


def dc_exciter(written, KE="1", high="10 -10", points="3.9 0.07 5.2 0.91"):
    """The import report of the system with a DC exciter of these constants at machine 1."""
    text = SMALL.replace("0 1 0.01 200 0.05 0 0 5 -5", f"1 1 0.01 40 0.02 0 0 {high} {KE} 0.785 {points} 0.03 1.0")
    return import_report(written(text.replace("; 0 2 0 100 0.05 0 0 5 -5]", "]")), check=False)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"KE": "0"}, "KE = 0: computed at the start so that the regulator is at a tenth of VRMAX, as in PSS/E"),
        ({"high": "0 0"}, "VRMAX = 0: computed from saturation as 9.932, VRMIN as its negative, as in PSS/E"),
    ],
)
def test_what_a_dc_exciter_leaves_to_be_computed_is_said(written, row, said):
    report = dc_exciter(written, **row)
    assert any(f"machine 1: {said}, not as in PST." in one for one in report.corrections)
    assert not any("as in PSS/E" in one for one in dc_exciter(written).corrections)
    assert report.case.initialize().modes().stable


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"points": "0 0.0039 0 1.555"}, "give it at two field voltages (columns 12 to 15)"),
        ({"high": "0 0", "points": "0 0 0 0"}, "there is no saturation at E2; give VRMAX"),
    ],
)
def test_a_dc_exciter_without_a_model_is_named_with_what_to_do(written, row, said):
    (one,) = dc_exciter(written, **row).unsupported
    assert (one.kind, one.owner, said in one.reason) == ("exc_con", "machine 1", True)


def test_a_classical_machine_has_no_resistance_as_in_pst(written):
    case = st.load(written(SMALL.replace("0.15 0 1.8 0.3 0.25 8 0.03...", "0.15 0.02 0 0.3 0.25 8 0.03...")))
    assert case.devices["gencls"][1].ra == 0
    assert any("machine 1 is classical; its resistance of 0.02 pu is left out, as in PST." in n for n in case.notes)


def test_saturation_of_a_machine_without_subtransient_circuits_is_left_out_and_said(written):
    """Of the machine at bus 1, x''d = 0 and saturation 0.1 and 0.4."""
    old = "0.15 0 1.8 0.3 0.25 8 0.03...\n              1.7 0.55 0.25 0.4 0.05 3.5 0 0 1;"
    new = "0.15 0 1.8 0.3 0    8 0...\n              1.7 0.55 0    0.4 0    3.5 0 0 1 0.1 0.4;"
    text = SMALL.replace(old, new).replace("5 0 0 2];", "5 0 0 2 0 0];")
    assert new in text
    case = st.load(written(text))
    assert 1 in case.devices["two_axis"]
    assert any(
        re.search(r"line 8.*: machine 1: it has no subtransient circuits; its saturation", n) for n in case.notes
    )


def test_a_file_in_the_code_page_of_windows_is_told(written):
    path = written(SMALL)
    plain = st.load(path)
    path.write_bytes(SMALL.replace("a machine", "eine Maschine für alle").encode("cp1252"))
    told = f"{path}: it is read as Windows-1252, because it is not UTF-8."
    assert st.load(path).notes == (told, *plain.notes)
    assert tables(st.load(path)) == tables(plain)


def test_what_is_assigned_to_other_names_is_told_unless_it_is_empty(written):
    text = SMALL + "dcsp_con = [];\ndcl_con = [1 2 3];\nnote = 'text';\nspan = 1:2;\ncell = {};\n"
    assert {*read_tables(written(text)).unread} == {"dcl_con", "note", "span", "cell"}

"""MATPOWER files: the laws of the format, the stored solutions of public systems, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import CaseError, StudyError
from stabctl.io.matpower import mpc
from stabctl.model import network, powerflow

FILES = Path(__file__).parent.parent / "reference" / "import"
SMALL = """function mpc = small
mpc.version = '2';
mpc.baseMVA = 100; % MVA
%% bus data
mpc.bus = [
	1	3	0	0	0	0	1	1.02	0	138	1	1.1	0.9;
	2	1	50	20	1	-5	1	1	0	138	1	1.1	0.9;
	3	2	0	0	0	0	1	1	0	138	1	1.1	0.9;
];
mpc.gen = [
	1	0	0	99	-99	1.02	100	1	200	0;
	3	30	0	99	-99	1.01	60	1	50	0;
	3	10	0	99	-99	1.01	0	1	50	0;
];
mpc.branch = [
	1	2	0.01	0.1	0.02	0	0	0	0	0	1;
	2	3	0.01	0.1	0.02	0	0	0	1.05	30	1;
	3	2	0.01	0.1	0.02	0	0	0	0.95	-30	0;
	3	2	0.01	0.1	0.02	0	0	0	0.95	-30	1;
];
mpc.gencost = [ 2 0 0 3 0.01 40 0; 2 0 0 3 0.01 40 0; 2 0 0 3 0.01 40 0 ];
mpc.bus_name = {'West % 1'; "Mid, dle"; 'O''Hara'};
"""


def written(folder, text, name="small.m"):
    (folder / name).write_text(text)
    return folder / name


def small(folder, old="", new=""):
    assert old in SMALL
    return written(folder, SMALL.replace(old, new, 1) if old else SMALL)


def test_every_column_arrives(tmp_path):
    case = st.load(small(tmp_path))
    assert (case.name, case.base_mva, case.frequency_hz) == ("small", 100, 60)
    assert [b.name for b in case.buses] == ["West % 1".replace("%", " "), "Mid, dle", "O'Hara"]
    assert [b.kind for b in case.buses] == ["swing", "pq", "pv"]
    assert [b.v for b in case.buses] == [1.02, 1, 1.01]  # VG
    assert (case.buses[1].g, case.buses[1].b, case.buses[1].rated) == (1, -5, 138)
    assert [(m.name, m.machine, m.bus, m.base, m.p) for m in case.machines] == [
        ("1/1", 1, 1, 100, 0),
        ("3/1", 3, 3, 60, 30),
        ("3/2", 11, 3, 100, 10),
    ]
    assert case.loads[0][:5] == (2, 50, 20, 1, 1)
    assert [(k.from_bus, k.to_bus, k.tap, k.phase, k.circuit) for k in case.branches] == [
        (1, 2, 1, 0, "1"),
        (2, 3, 1.05, 30, "1"),
        (3, 2, 0.95, -30, "3"),
    ]
    assert case.notes == (f"{tmp_path / 'small.m'}: not represented: gencost.",)
    assert list(case.power_flow().branches.index) == ["1-2", "2-3 ckt 1", "3-2 ckt 3"]


def test_ratio_and_shift_are_those_of_the_manual(tmp_path):
    """MATPOWER's manual, eq. 3.2: Yff = (ys + jb/2)/tau^2, Yft = -ys/(tau e^-jshift), of branch 2-3."""
    case = st.load(small(tmp_path))
    case = replace(case, branches=case.branches[:2], buses=tuple(b._replace(g=0, b=0) for b in case.buses))
    Y = network.admittance(network.build(case)).toarray()
    ys, tap = 1 / (0.01 + 0.1j), 1.05 * np.exp(1j * np.pi / 6)
    assert Y[1, 2] == pytest.approx(-ys / tap.conj(), rel=1e-12)
    assert Y[2, 1] == pytest.approx(-ys / tap, rel=1e-12)
    assert Y[1, 1] - (ys + 0.01j) == pytest.approx((ys + 0.01j) / 1.05**2, rel=1e-12)


def test_the_frequency_is_an_option(tmp_path):
    assert st.read_matpower(small(tmp_path), frequency="50Hz").frequency_hz == 50
    assert st.load(small(tmp_path), frequency=50).frequency_hz == 50
    with pytest.raises(StudyError, match="frequency applies only to a file ending in"):
        st.load("two_area", frequency=50)
    with pytest.raises(StudyError, match="dyr applies only to a PSS/E file"):
        st.load(small(tmp_path), dyr="x.dyr")


def mismatch(case, stored):
    """Power missing (MVA) at stored voltages: active except at the swing bus, reactive at pq buses."""
    net = network.build(case)
    produced = np.zeros(len(case.buses), complex)
    np.add.at(produced, net.machine_bus, [(m.p + 1j * m.q) / case.base_mva for m in case.machines])
    miss = stored * (network.admittance(net) @ stored).conj() - produced + powerflow.demand(case, abs(stored))
    kinds = np.array([b.kind for b in case.buses])
    return case.base_mva * abs(miss.real[kinds != "swing"]).max(), case.base_mva * abs(miss.imag[kinds == "pq"]).max()


@pytest.mark.parametrize(
    ("file", "mw", "mvar", "dv", "degrees"),  # measured
    [
        ("matpower/case60nordic.m", 0.2, 0.05, 5e-6, 5e-4),  # 0.133 (printed digits), 0.021, 1.1e-6, 2.2e-4
        ("matpower/case_ACTIVSg200.m", 0.05, 0.02, 5e-5, 2e-3),  # 0.024, 0.007, 1.4e-5, 9.3e-4
        ("powermodels/case24.m", 0.05, 0.1, 2e-5, 5e-4),  # 0.020, 0.068, 7.2e-6, 1.1e-4
        ("powermodels/case30.m", 0.05, 0.1, 2e-5, 5e-4),  # 0.011, 0.049, 5.3e-6, 1.0e-4
        ("powermodels/frankenstein_00.m", 0.1, 0.2, 5e-5, 2e-3),  # 0.080, 0.100, 1.4e-5, 8.7e-4
    ],
)
def test_the_stored_solution_is_ours(file, mw, mvar, dv, degrees):
    case = st.read_matpower(FILES / file)
    of = {b.BUS_I: b.VM * np.exp(1j * np.deg2rad(b.VA)) for b, _ in mpc.read(FILES / file).of("bus")}
    stored, found = np.array([of[b.bus] for b in case.buses]), case.power_flow().V
    assert mismatch(case, stored)[0] < mw
    assert mismatch(case, stored)[1] < mvar
    assert abs(abs(found) - abs(stored)).max() < dv <= 1e-4
    assert np.rad2deg(abs(np.angle(found / stored))).max() < degrees <= 0.01


def test_a_file_whose_phase_shifts_are_not_in_degrees():
    """Stored voltages of case89pegase are a solution with its three phase shifts as radians of the other sign."""
    case = st.read_matpower(FILES / "matpower" / "case89pegase.m")
    stored = np.array([b.v * np.exp(1j * np.deg2rad(b.angle)) for b in case.buses])
    assert mismatch(case, stored)[0] > 1000  # 3002 MW
    branches = tuple(k._replace(phase=-np.rad2deg(k.phase)) for k in case.branches)
    assert mismatch(replace(case, branches=branches), stored)[0] < 0.3  # 0.18 MW


def test_generators_at_their_reactive_limit_keep_it():
    case = st.read_matpower(FILES / "matpower" / "case_ACTIVSg200.m")
    fixed = {67, 94, 114, 167}
    assert {b.bus for b in case.buses if b.kind == "pq"} >= fixed
    assert sum("reactive limit" in note for note in case.notes) == len(fixed)
    V, rows = abs(case.power_flow().V), {b.bus: i for i, b in enumerate(case.buses)}
    assert all(abs(V[rows[bus]] - 1.04) > 1e-4 for bus in fixed)  # their VG


def test_dc_lines_are_injections(tmp_path):
    case = st.read_matpower(FILES / "powermodels" / "case5_dc.m")
    at = {load.bus: (load.p, load.q) for load in case.loads if load.kind == "hvdc"}
    assert at[3][0] == 15
    assert at[5][0] == pytest.approx(-13.85)
    assert [load for load in case.with_load_level(0.5).loads if load.kind == "hvdc"] == [*case.loads[-2:]]
    assert any("toggle_dcline" in note for note in case.notes)


def test_dispatchable_loads_and_a_missing_reference_bus(tmp_path):
    text = SMALL.replace(
        "3	10	0	99	-99	1.01	0	1	50	0;",
        "3	-10	-4	99	-99	1.01	0	1	0	-50;",
    )
    case = st.load(written(tmp_path, text.replace("1	3	0	0", "1	2	0	0")))
    assert [(load.bus, load.p, load.q) for load in case.loads] == [(2, 50, 20), (3, 10, 4)]
    assert case.buses[0].kind == "swing"
    assert case.notes[0].endswith("constant-power load; in MATPOWER it also holds the voltage of the bus, at VG.")
    assert ["the dispatchable load" in case.notes[0], "there is no reference bus" in case.notes[1]] == [True, True]


def test_what_is_left_out_with_an_isolated_bus_is_said(tmp_path):
    """A bus at which nothing is in service is left out silently: MATPOWER's cases have such ones."""
    bus = "	4	4	{}	0	0	0	1	1	0	138	1	1.1	0.9;"
    bus += "\n];\nmpc.gen = [\n	4	5	0	9	-9	1	9	{}	9	0;"
    line = "mpc.branch = [\n	1	4	0.01	0.1	0	0	0	0	0	0	{};"
    text = SMALL.partition("mpc.gencost")[0].replace("];\nmpc.gen = [", bus).replace("mpc.branch = [", line)
    says = "bus 4 is isolated (type 4) and left out with what is in service at it, as in MATPOWER."
    for used in [(0, 0, 0), (7, 0, 0), (0, 1, 0), (0, 0, 1)]:
        notes = st.load(written(tmp_path, text.format(*used))).notes
        assert any(says in note for note in notes) == any(used)


def test_the_ways_to_write_a_matrix(tmp_path):
    """Commas, rows on one line, comments, block comments, continued lines and statements on one line."""
    text = SMALL.replace(
        "mpc.version = '2';\nmpc.baseMVA = 100;", "%{\nmpc.baseMVA = 7;\n%}\nmpc.version = '2'; mpc.baseMVA = 100;"
    )
    text = text.replace("1	3	0	0	0	0	1	1.02", "1, 3, 0,0 ,0 0 1 ... continued\n 1.02").replace(
        "0.9;\n	2	1", "0.9; 2	1"
    )
    text = text.replace("mpc.branch = [\n", "mpc.branch = [ % from ]; to\n\n")
    assert st.load(written(tmp_path, text)) == st.load(small(tmp_path))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("mpc.gencost", "mpc.bus(:, 3) = 2 * 3;\nmpc.gencost", "line 21: 'mpc.bus(:, 3) = 2 ... is not data but code"),
        ("mpc.gencost", "system('touch x');\nmpc.gencost", "line 21: ... code, which is not run"),
        ("mpc.gencost", "mpc.bus = mpc.bus;\nmpc.gencost", "line 21: mpc.bus is assigned again, first in line 5"),
        ("mpc.baseMVA = 100;", "mpc.baseMVA = 10 * 10;", "line 3: ... code"),
        ("mpc.baseMVA = 100;", "", "there is no mpc.baseMVA"),
        ("mpc.baseMVA = 100;", "mpc.baseMVA = -1;", "line 3, field baseMVA: -1 MVA is not allowed"),
        ("mpc.baseMVA = 100;", "mpc.baseMVA = many;", "line 3, field baseMVA: 'many' is not a number"),
        ("mpc.version = '2'", "mpc.version = '1'", "line 2, field version"),
        ("function mpc = small", "function [baseMVA, bus] = small", "line 1: this is a file of MATPOWER version 1"),
        ("50	20	1	-5", "50	2O	1	-5", "line 7, field QD: '2O' is not a number"),
        ("50	20	1	-5", "50	NaN	1	-5", "line 7, field QD: nan is not allowed"),
        ("50	20	1	-5", "50	sqrt(2)	1	-5", "line 7: '(' is not allowed within mpc.bus"),
        ("50	20	1	-5", "50	1_0	1	-5", "line 7: ... is not a row of numbers"),
        ("50	20	1	-5", "50	20	-5", "line 7: the row has 12 columns; a row of mpc.bus needs 13"),
        ("0.95	-30	1;", '0.95	-30	1;\n"', "line 20: ... is not a row"),
        ("	2	1	50", "	2.5	1	50", "line 7, field BUS_I: 2.5 is not a whole number"),
        ("	2	1	50", "	1	1	50", "line 7, field BUS_I: bus 1 appears twice, first in line 6"),
        ("	2	1	50", "	2	7	50", "line 7, field BUS_TYPE: 7 is not a type of bus"),
        ("	3	30	0", "	9	30	0", "line 12, field GEN_BUS: there is no bus 9"),
        ("	1	2	0.01", "	1	9	0.01", "line 16, field T_BUS: there is no bus 9"),
        ("	1	2	0.01	0.1", "	1	1	0.01	0.1", "line 16, to_bus: branch 1-1 connects a bus to itself"),
        ("];\nmpc.gen = [", "mpc.gen = [", "line 5: mpc.bus is not closed by ']' before line 9"),
        ("%% bus data", "%{", "line 4: the block comment %{ is not closed"),
        ("mpc.gencost", "%{\n%{\n%}\nmpc.gencost", "line 21: the block comment %{ is not closed"),
        ("	2	1	50", "%{\n	2	1	50", "line 7: the block comment %{ is not closed"),
        ("'O''Hara'};", "'O''Hara'}';", "line 22: \"';\" is not data but code"),
        ("; 'O''Hara'", "", "line 22: mpc.bus_name must contain 3 texts"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_named_with_its_line(tmp_path, old, new, says):
    with pytest.raises(CaseError) as error:
        st.load(small(tmp_path, old, new))
    assert all(part in str(error.value) for part in says.split(" ... "))
    assert not Path("x").exists()


def test_a_file_that_is_too_large_or_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr("stabctl.io._lexer.LARGEST_FILE", 100)
    with pytest.raises(CaseError, match="MB, the largest that is read"):
        st.load(small(tmp_path))
    with pytest.raises(CaseError, match="there is no such file"):
        st.load(tmp_path / "other.m")


def test_long_lines_do_not_hang(tmp_path):
    """Blanks, quotes and brackets in numbers that a careless pattern would search for years."""
    for piece in (" ", "'", "[", "mpc.bus = [ ", "1 ", ".", "%", '"', "''"):
        with pytest.raises(CaseError):
            st.load(written(tmp_path, piece * 300_000))
        with pytest.raises(CaseError):
            st.load(small(tmp_path, "50	20	1	-5", piece * 100_000))


def test_the_command_line_reads_it(tmp_path, stabctl):
    path = small(tmp_path)
    code, out, err = stabctl("powerflow", path, "--branches", "--frequency", "50Hz")
    assert code == 0
    assert "power flow of small" in out
    assert err == f"stabctl: warning: {path}: not represented: gencost.\n"
    code, out, err = stabctl("modes", path)
    assert (code, out) == (2, "")
    assert "small has no dynamic models" in err


def test_without_dynamic_data_there_is_a_power_flow(tmp_path):
    case = st.load(small(tmp_path))
    assert case.power_flow().iterations > 0
    with pytest.raises(StudyError, match="no dynamic models"):
        case.initialize()


def test_a_file_in_the_code_page_of_windows_keeps_its_names(tmp_path):
    path = small(tmp_path, "West % 1", "Süd")
    path.write_bytes(path.read_text("utf-8").encode("cp1252"))
    case = st.load(path)
    assert case.buses[0].name == "Süd"
    assert case.notes[0] == f"{path}: it is read as Windows-1252, because it is not UTF-8."

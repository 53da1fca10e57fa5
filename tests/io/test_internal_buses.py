"""Star points of transformers and terminals behind step-up transformers, which a RAW file does not number."""

from pathlib import Path

import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.clearing.screen_result import lines
from stabctl.clearing.templates import contingencies
from stabctl.model import naming

SECTIONS = "bus load shunt gen branch transformer area dc vsc imp multi section zone tie owner facts switched gne im"
BUSES = [
    "1,'A',230,3,1,1,1,1.02,0",
    "2,'B',230,2,1,1,1,1.03,0",
    "3,'C',230,1,1,1,1,1,0",
    "4,'D',115,1,1,1,1,1,0",
    "5,'E',20,1,1,1,1,1,0",
]
THREE = [
    "3,4,5,'1',1,1,1,0,0,2,'T',1,1,1",
    "0.002,0.1,100,0.002,0.06,100,0.002,0.12,100,1,0",
    *["1,0,0,100,100,100,0,0,1.1,0.9,1.1,0.9,33,0,0,0,0"] * 3,
]
MACHINES = (1, 50, 11, 1.02), (2, 70, -7, 1.03)  # bus, MW, Mvar, pu
WHOLE = {
    "bus": BUSES,
    "load": ["3,'1',1,1,1,60,20,0,0,0,0,1,1,0", "4,'1',1,1,1,30,10,0,0,0,0,1,1,0"],
    "gen": [f"{bus},'1',50,0,99,-99,{v},0,200,0,0.2,0,0.1,1,1,100" for bus, v in ((1, 1.02), (2, 1.03))],
    "branch": [f"{ends},'1',0.01,0.1,0.05,0,0,0,0,0,0,0,1" for ends in ("1,3", "2,3", "1,2")],
    "transformer": THREE,
}


def written(folder, **sections) -> Path:
    """A system of version 33 with classical machines, of these sections instead of the whole."""
    parts = WHOLE | sections
    rows = [row for name in SECTIONS.split() for row in [*parts.get(name, ()), "0 /"]]
    (folder / "x.raw").write_text("\n".join(["0,100,33,0,0,60 /", "a", "b", *rows, "Q", ""]))
    records = [f"{row.split(',')[0]} 'GENCLS' 1 5 1 /" for row in parts["gen"]]
    (folder / "x.dyr").write_text("\n".join(records) + "\n")
    return folder / "x.raw"


@pytest.fixture
def case(tmp_path):
    return st.load(written(tmp_path))


def test_internal_buses_are_told_by_their_names(case, stabctl, tmp_path):
    assert [naming.told(b) for b in case.buses if naming.internal(b)] == [
        "11 (star 3-4-5)", "12 (terminal 1/1)", "13 (terminal 2/1)",
    ]  # fmt: skip
    with pytest.raises(StudyError, match=r"the branches at bus 3 are 3-1, 3-2, 3-11 \(star 3-4-5\)\."):
        st.Contingency("3", "6cyc", "3-4").check(case)
    out = stabctl("powerflow", tmp_path / "x.raw")[1]
    assert [row.split("\t")[0] for row in out.splitlines() if "(" in row and "\t" in row] == [
        "11 (star 3-4-5)", "12 (terminal 1/1)", "13 (terminal 2/1)",
    ]  # fmt: skip


@pytest.mark.parametrize(("r", "x"), [(0.004, 0), (0, 0.1), (0.004, 0.1), (0, 0)])
def test_a_step_up_transformer_has_resistance_or_reactance_or_both(tmp_path, r, x):
    """RT + jXT is in per unit of MBASE; the machine produces its losses on top of PG and QG."""
    rows = [f"{bus},'1',{p},{q},99,-99,{v},0,200,0,0.2,{r},{x},0.96,1,100" for bus, p, q, v in MACHINES]
    case = st.load(written(tmp_path, gen=rows))
    step_up = [b for b in case.branches if b.tap == 0.96]
    assert len(step_up) == 2 * bool(r or x)
    for branch in step_up:
        assert complex(branch.r, branch.x) == pytest.approx(complex(r, x) * 100 / 200)
    for machine, (_, p, q, v) in zip(case.machines, MACHINES, strict=True):
        lost = complex(r, x) * (abs(complex(p, q)) / (v / 0.96)) ** 2 / 200
        assert complex(machine.p, machine.q) == pytest.approx(complex(p, q) + bool(r or x) * lost)


def test_criteria_with_rated_voltages_leave_them_out(case, tmp_path):
    (tmp_path / "all.toml").write_text('title = "x"\n[[voltage]]\nname = "r"\nbelow = 1.9\nkv = [1, 500]\n')
    run = case.simulate(until="1s")
    assert {v.where for v in run.judge(tmp_path / "all.toml").violations} == {f"bus {n}" for n in range(1, 6)}
    (tmp_path / "all.toml").write_text('title = "x"\n[[voltage]]\nname = "r"\nbelow = 1.9\n')
    assert {v.where for v in run.judge(tmp_path / "all.toml").violations} == {f"bus {n}" for n in range(1, 6)}


def test_a_machine_is_lost_after_a_fault_at_the_high_side_of_its_step_up(case, tmp_path):
    for category, name in (("P1", "P1.1 machine 2/1"), ("P5", "P5.1 machine 2/1")):
        (found,) = (one for one in contingencies(case, category) if one.name == name)
        assert str(found.fault) == "2"
    (tmp_path / "g.con").write_text("CONTINGENCY 'G'\nREMOVE MACHINE 1 FROM BUS 2\nEND\nEND\n")
    (found,) = st.read_contingencies(tmp_path / "g.con", case)
    assert found.fault == "2"
    assert [m.storage_bus for m in case.machines] == [1, 2]


def test_they_have_no_fault_and_no_normal_voltage(case):
    screen = case.screen(faults="buses", resolution="2cyc", longest="0s", scan=0)
    assert {p.fault for p in screen.pairs} == {*"12345"}
    assert case.screen(faults="buses", buses=[11], resolution="2cyc", longest="0s", scan=0).screened == 1
    study = case.study(faults="lines", worst=0, remedies="none", voltages=(1.9, 2.0), resolution="2cyc", scan=0)
    assert {bus for bus, _ in study.low_or_high} == {1, 2, 3, 4, 5}


def test_a_series_capacitor_is_a_line(tmp_path):
    rows = ["1,6,'1',0.01,0.2,0.05,0,0,0,0,0,0,0,1", "6,2,'1',0,-0.1,0,0,0,0,0,0,0,0,1"]
    found = st.load(written(tmp_path, bus=[*BUSES, "6,'F',230,1,1,1,1,1,0"], branch=[*WHOLE["branch"], *rows]))
    assert "6-2" in map(str, lines(found).screened)
    assert "P1.2 line 6-2, fault at bus 6" in [one.name for one in contingencies(found, "P1")]


def test_a_transformer_without_rated_voltages_is_no_line(tmp_path):
    rated = [row.replace(",230,", ",0,").replace(",115,", ",0,").replace(",20,", ",0,") for row in BUSES]
    assert [*map(str, lines(st.load(written(tmp_path, bus=rated))).screened)] == ["1-3", "2-3", "1-2"]


def test_a_branch_with_charging_is_no_step_up_transformer(tmp_path):
    """Bus 1 is at 20 kV, and two branches of turns ratio 1 join it to 230 kV."""
    two = ["1,'A',20,3,1,1,1,1.02,0", "3,'C',230,1,1,1,1,1,0"]
    parts = {"bus": two, "gen": ["1,'1',50,0,99,-99,1.02,0,200,0,0.2,0,0,1,1,100"], "transformer": []}
    parts |= {"load": WHOLE["load"][:1]}
    row = "1,3,'{}',0.01,0.1,{},0,0,0,0,0,0,0,1"
    case = st.load(written(tmp_path, **parts, branch=[row.format(1, 0.05), row.format(2, 0.04)]))
    assert case.machines[0].storage_bus == 1
    assert len(lines(case).screened) == 2
    with pytest.raises(StudyError, match="has no line that can be opened without splitting the network"):
        st.load(written(tmp_path, **parts, branch=[row.format(1, 0.05)])).screen()
    step_up = st.load(written(tmp_path, **parts, branch=[row.format(1, 0), row.format(2, 0)]))
    assert step_up.machines[0].storage_bus == 3
    with pytest.raises(StudyError, match="x has no branch that counts as a line"):
        step_up.screen()


@pytest.mark.parametrize(
    ("low", "high", "bus"), [(0.69, 33, 3), (0.4, 0.69, 3), (33, 0.69, 1), (20, 20, 1), (0, 33, 1)]
)
def test_storage_is_at_the_high_side_whatever_the_voltages(tmp_path, low, high, bus):
    """A machine of 690 V is behind a transformer, too; nothing is known of sides without rated voltages."""
    parts = {"bus": [f"1,'A',{low},3,1,1,1,1.02,0", f"3,'C',{high},1,1,1,1,1,0"], "load": WHOLE["load"][:1]}
    parts |= {"gen": ["1,'1',50,0,99,-99,1.02,0,200,0,0.2,0,0,1,1,100"], "transformer": []}
    case = st.load(written(tmp_path, **parts, branch=["1,3,'1',0.01,0.1,0,0,0,0,0,0,0,0,1"]))
    assert case.machines[0].storage_bus == bus

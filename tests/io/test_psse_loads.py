"""Loads and DC lines of RAW files: who a record of the DYR file means, what they draw, and what is out of service."""

import numpy as np
import pytest

import stabctl as st
from stabctl.model.naming import loads_at

ORDER = "bus load shunt gen branch trafo area dc vsc imp multi section zone transfer owner facts switched gne motor"
MOTOR = "'CIM5BL' '1' 1 0.01 0.09 4.2 0.035 0.09 0 0 0 0 0 0 {} 1.25 0.8 0 0 0 0 0.5 /\n"
UNITS = "1 'GENCLS' 1 5 1 /\n2 'GENCLS' 1 5 1 /\n"


@pytest.fixture
def read(tmp_path):
    """The import of three buses of which two have a machine; the sections that are given replace or add lines."""

    def made(dyr=UNITS, version=33, general="", load="3,'1',1,1,1,40,15,30,10,30,-10,1", **sections):
        lines = {
            "bus": "1,'A',20,3,1,1,1,1.02,0\n2,'B',20,2,1,1,1,1.02,0\n3,'C',230,1,1,1,1,0.98,0",
            "load": load,
            "gen": "1,'1',50,0,999,-999,1.02,0,200,0,0.2,0,0,1,1\n2,'1',50,0,999,-999,1.02,0,200,0,0.2,0,0,1,1",
            "branch": "1,3,'1',0.01,0.1,0.05,0,0,0,0,0,0,0,1\n2,3,'1',0.01,0.1,0.05,0,0,0,0,0,0,0,1",
        } | sections
        if version > 33:
            rates = ",".join("0" * 12)
            lines["branch"] = f"1,3,'1',0.01,0.1,0.05,'',{rates},0,0,0,0,1\n2,3,'1',0.01,0.1,0.05,'',{rates},0,0,0,0,1"
        parts = [lines.get(name, "") for name in ORDER.split()]
        head = f"0,100,{version},0,0,60 / x\na\nb\n" + (f"{general}\n0 /\n" if version > 33 else "")
        if version > 33:
            parts.insert(ORDER.split().index("trafo"), "")  # switching devices
        (tmp_path / "x.raw").write_text(head + "".join(f"{part}\n0 /\n" if part else "0 /\n" for part in parts) + "Q\n")
        (tmp_path / "x.dyr").write_text(dyr)
        return st.import_report(tmp_path / "x.raw", check=False)

    return made


def test_a_record_means_a_machine_or_a_load_by_its_kind(read):
    """A machine at a bus with a load of the same identifier, and the reverse, is not there."""
    found = read(UNITS + "3 'SEXS' 1 .1 10 100 .1 -5 5 /\n2 " + MOTOR.format(0))
    assert not found.complete
    told = str(found)
    assert "the RAW file has no machine 3/1 (x.dyr line 3)" in told
    assert "the RAW file has no load 2/1 (x.dyr line 4)" in told


def test_a_motor_has_its_mva_once(read):
    """In parts of constant power, current and admittance: the motors have the shares that these draw."""
    case = read(UNITS + "3 " + MOTOR.format(130.0)).case
    assert [row for row, _ in loads_at(case, 3)] == [0, 1, 2]
    own = [par.Mbase for par in case.devices["cim"].values()]
    drawn = np.array([40, 30 * 0.98, 30 * 0.98**2])
    assert own == pytest.approx(130 * drawn / drawn.sum())


def test_a_load_in_parts_is_one(read):
    found = read()
    assert "2 machines, 1 load;" in str(found)
    more = found.case.with_load(3, p="200MW")
    assert [load.p for load in more.loads] == pytest.approx([80, 60, 60])
    assert [load.q for load in more.loads] == [load.q for load in found.case.loads]


@pytest.mark.parametrize(("given", "low"), [("PQBRAK=0.5", 0.5), ("pqbrak = 0.0", 0.01), ("BLOWUP=5.0", 0.7)])
def test_constant_power_ends_at_pqbrak(read, given, low):
    case = read(version=34, general=f"GENERAL, THRSHZ=0.0001, {given}").case
    assert [load.v_low for load in case.loads if load.p_power] == [low]


@pytest.mark.parametrize("rc", [0.0, 2.0])
def test_commutating_resistances_take_power(read, rc):
    """P = (Vdc +- 2 N Rc I) I, and its power factor from the voltage behind them."""
    ends = [f"{bus},2,20,5,{rc},6,230,0.9,1,1.5,.5,.00625" for bus in (1, 3)]
    dc = "\n".join(["'LINK',1,2.0,500,500,0,0,0,'R',0,20,1.0", *ends])
    rectifier, inverter = (load for load in read(dc=dc).case.loads if load.kind == "hvdc")
    current = 500 / rectifier_voltage(500, 500, 2.0)
    for load, volts, way, V in ((rectifier, 500 / current, 1, 1.02), (inverter, 500 / current - 2 * current, -1, 0.98)):
        behind = volts + way * 4 * rc * current
        assert load.p == pytest.approx(way * behind * current, abs=1e-9)
        ideal = 3 * np.sqrt(2) / np.pi * 2 * 230 * 0.9 * V
        assert load.q == pytest.approx(behind * current * np.tan(np.arccos(behind / ideal)), abs=1e-9)


def test_a_load_level_leaves_dc_lines_as_they_are(read):
    """They are no loads, unlike machines that are injections, which are part of the dispatch."""
    ends = [f"{bus},2,20,5,0,6,230,0.9,1,1.5,.5,.00625" for bus in (1, 3)]
    dc = "\n".join(["'LINK',1,2.0,50,500,0,0,0,'R',0,20,1.0", *ends])
    case = read(dyr=UNITS.splitlines()[0], dc=dc).case  # machine 2 is an injection
    half = case.with_load_level(0.5)
    share = [new.p / old.p for new, old in zip(half.loads, case.loads, strict=True)]
    assert [load.kind for load in case.loads] == [*["load"] * 3, *["hvdc"] * 2, "injection"]
    assert share == pytest.approx([0.5, 0.5, 0.5, 1, 1, 0.5])
    assert [m.p / n.p for m, n in zip(half.machines, case.machines, strict=True)] == [0.5]
    assert half.with_loads("current").loads[-3:] == half.loads[-3:]


def rectifier_voltage(power, inverter, resistance):
    """Where the inverter's voltage and the rectifier's power are given."""
    current = max(np.roots([resistance, inverter, -power]))
    return inverter + resistance * current


def test_what_is_out_of_service_is_not_missed(read):
    out = {
        "facts": "'F1',3,0,{},0,0,1.0,50,0,0.05",
        "vsc": "'V1',{},0.7\n1,0,1,0,100\n3,0,1,0,100",
        "motor": "3,'1',{},1,1,1,1,1,100,1,50",
    }
    assert read(**{name: text.format(0) for name, text in out.items()}).complete
    for name, text in out.items():
        assert not read(**{name: text.format(1)}).complete, name


def test_a_statement_means_loads_alone_and_what_they_draw(read, tmp_path):
    """At a bus with an inverter, and where the voltage is not 1 pu."""
    ends = [f"{bus},2,20,5,0,6,230,0.9,1,1.5,.5,.00625" for bus in (1, 3)]
    case = read(dc="\n".join(["'LINK',1,2.0,50,500,0,0,0,'R',0,20,1.0", *ends])).case
    V = abs(case.power_flow().V[case.row_of_bus[3]])
    drawn = 40 + 15j + (30 + 10j) * V + (30 + 10j) * V**2
    for text, share in (("REMOVE LOAD FROM BUS 3", -1.0), ("SET BUS 3 LOAD TO 50 PERCENT", -0.5)):
        (tmp_path / "x.con").write_text(f"CONTINGENCY 'A'\n{text}\nEND\nEND\n")
        (one,) = st.read_contingencies(tmp_path / "x.con", case)
        assert complex(one.after[0].p, one.after[0].q) == pytest.approx(share * drawn)
    (tmp_path / "x.con").write_text("CONTINGENCY 'A'\nREMOVE LOAD FROM BUS 1\nEND\nEND\n")
    with pytest.raises(st.StabctlError, match="has no load at bus 1"):
        st.read_contingencies(tmp_path / "x.con", case)

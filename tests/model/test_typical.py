"""Typical machines: every unit of the table starts in steady state and is stable; outputs say that they are typical."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.model import typical
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Load, Machine
from stabctl.model.typical import Known

FILES = Path(__file__).parent.parent / "reference" / "import"
UNITS = {unit["unit"]: unit for unit in typical._units()}


def plant(unit, p, q):
    """A unit that supplies p + jq (pu of its rating) through a transformer and a line to a large steam unit."""
    mva = unit["mva"]
    size = {"base_mva": mva, "frequency_hz": 60.0, "devices": {}}
    case = Case(
        "plant",
        (Bus(1, "pq", 1.0, 20.0), Bus(2, "swing", 1.0)),
        (Branch(1, 2, 0.0, 0.25),),
        (Machine(1, 1, mva, p * mva, 1, q * mva, "1/1"), Machine(2, 2, 100 * mva, 0.0, 2)),
        loads=(Load(2, 50 * mva, 10 * mva),),
        **size,
    )
    return case.with_typical_machines({1: Known(unit["kind"], mva), 2: Known("steam", 100 * mva)})


@pytest.mark.parametrize("name", UNITS)
def test_every_unit_is_stable_at_its_rated_power(name):
    """On its own rating: power 0.8, 0.4 Mvar; a condenser 0.6 Mvar. The source prints them as data of real units."""
    unit = UNITS[name]
    p, q = (0.0, 0.6) if unit["kind"] == "condenser" else (0.8 * min(1, unit["Pmax"]), 0.4)
    case = plant(unit, p, q)
    assert case.machines[0].base == unit["mva"]
    point = case.initialize()
    found = point.modes()
    largest = max(e.real for e in found.eigenvalues if abs(e) > 1e-3)
    assert largest < -0.005  # measured: -0.0098 (H10, whose governor is slowest) and less
    assert abs(point.simulate(until=2).speed - 1).max() < 1e-9


def test_the_table_is_that_of_the_book():
    """Values that other publications print for these units, with their source in the table."""
    assert len(UNITS) == 24
    f5, h9 = UNITS["F5"], UNITS["H9"]
    assert (f5["mva"], f5["H"], f5["xd"], f5["T1d"], f5["R"]) == (100, 4.985, 1.18, 5.9, 0.05)
    assert (h9["mva"], h9["xd"], h9["xq"], h9["F"]) == (86, 1.05, 0.67, -2)
    for unit in UNITS.values():
        assert 0 < unit["xl"] < unit["x2"] < unit["x1d"] < unit["xd"] >= unit["xq"]
        assert 1.0 < unit["mva"] < 1400
        assert unit["S10"] < unit["S12"]


@pytest.mark.parametrize(
    ("kind", "mva", "unit"),
    [
        ("steam", 5, "F4"),
        ("steam", 150, "F7"),
        ("steam", 2000, "F19"),
        ("hydro", 95, "H10"),
        ("nuclear", 1000, "N6"),
        ("gas", 400, "CT2"),
        ("condenser", 33, "SC2"),
    ],
)
def test_the_unit_nearest_in_rating_is_taken(kind, mva, unit):
    power = 0j if kind == "condenser" else 0.5 * mva
    found, rating = typical._sized(Known(kind, mva), complex(power), 1.0)
    assert (found["unit"], rating) == (unit, mva)


def test_a_rating_is_raised_to_what_the_power_needs():
    """Apparent power, the largest power of the governor, and 0.3 pu of absorbed reactive power."""
    for S in (90 + 60j, 104.9 + 0j, 20 - 40j, -150 + 0j):
        unit, rating = typical._sized(Known("steam", 100), S, 1.0)
        assert rating >= max(abs(S), -S.imag / 0.3)
        assert S.real <= unit["Pmax"] * rating
    assert typical._sized(Known("steam", 100), 30 + 5j, 1.0)[1] == 100
    assert typical._sized(Known(), 85 + 0j, 1.0)[1] == pytest.approx(100)


@pytest.mark.parametrize("name", UNITS)
def test_a_rating_is_raised_until_the_exciter_covers_the_field_voltage(name):
    """All reactive power, as a generator that runs as a condenser, at a high and a low voltage; condensers need it."""
    unit, kind = UNITS[name], UNITS[name]["kind"]
    raised = []
    for V in (0.75, 1.05):
        made, rating = typical._sized(Known(kind, unit["mva"]), 1e-13 + 1j * unit["mva"], V)
        raised.append(rating > 1.01 * unit["mva"])
        field = typical._field(made, 1j * unit["mva"] / rating, V)
        assert field <= 0.9 * V * typical.EXCITER["VRmax"]
        assert rating < 2 * unit["mva"]  # 1.32
    assert (True in raised) == (unit["xd"] > 2.12)


@pytest.mark.parametrize("unit", ["H9", "F8", "CT2", "N6", "SC1"])
def test_the_field_voltage_expected_is_that_of_the_operating_point(unit):
    p = 0.0 if unit == "SC1" else 0.5
    case = plant(UNITS[unit], p, 0.55)
    point, m = case.initialize(), case.machines[0]
    S, V = point.flow.S[0] * case.base_mva / m.base, abs(point.V[0])
    expected = typical._field(UNITS[unit], complex(S), float(V))
    assert expected == pytest.approx(point.s[point.layout.signals[0, "Efd"]], rel=0.01)  # 0.005: the q axis saturates


@pytest.mark.slow
def test_a_system_of_two_thousand_buses_starts():
    """Without a disturbance it stands still, and a fault is simulated at the default step."""
    case = st.load(FILES / "matpower" / "case_ACTIVSg2000.m", machines="typical")
    assert any("16 machines" in note and "field voltage" in note for note in case.notes)
    point = case.initialize()
    assert point.fastest < 100  # 77 1/s; a loop of 1,040 1/s forced steps of 1.2 ms
    assert abs(point.simulate(until=2).speed - 1).max() < 1e-9
    run = point.simulate(st.Contingency("3141", clear="6cyc"), 3)  # a bus among wind farms, where the network is weak
    assert run.outcome.stable
    assert run.steps == 3 * 120


def test_loads_and_converters_are_those_used_where_nothing_is_known():
    """Constant active current and reactive admittance; what the power flow drew at the bus stays the same."""
    rows = (Load(2, 80, 30, 1, 1, id="1"), Load(2, 10, 5, id="2"), Load(2, 7, 3, 1, 1, id="3", kind="injection"))
    case = Case(
        "two",
        (Bus(1, "swing", 1.0, 20.0), Bus(2, "pv", 0.97)),
        (Branch(1, 2, 0.0, 0.25),),
        (Machine(1, 1, 200, 50, 1), Machine(2, 2, 100, 40, 2)),
        loads=rows,
        base_mva=100.0,
        frequency_hz=60.0,
        devices={},
    )
    made = case.with_typical_machines({2: Known("converter")})
    first, *others, wind = made.loads
    assert (first.p_power, first.p_current, first.q_power, first.q_current) == (0, 1, 0, 0)
    assert tuple(others) == rows[1:]
    assert (round(wind.p, 6), wind.p_current, wind.q_current, wind.kind) == (-40, 1, 1, "injection")
    assert any("1 load of constant power" in note for note in made.notes)
    before, after = case.power_flow(), made.power_flow()
    assert after.V == pytest.approx(before.V, abs=1e-9)
    assert [load.p_power for load in made.with_loads("power").loads] == [1, 1, 1, 0]


def test_every_output_says_that_they_are_typical(stabctl):
    path = FILES / "powermodels" / "case14.m"
    case = st.load(path, machines="typical")
    assert case == st.read_matpower(path, machines="typical")
    assert "with typical machines" in case.name
    assert "with typical machines" in case.title
    assert "Anderson and Fouad" in case.source
    assert "are typical" in case.notes[0]
    for words in (
        ("powerflow",),
        ("modes",),
        ("simulate", "--until", "1"),
        ("clearing-time", "--fault", "4", "--limit", "2cyc"),
    ):
        words = (words[0], path, *words[1:], "--machines", "typical")
        code, out, err = stabctl(*words)
        assert code == 0
        assert "case14 with typical machines" in " ".join(out.split())
        assert "are typical, chosen by rating from Anderson and Fouad" in err
        assert json.loads(stabctl(*words, "--json")[1])["case"] == "case14 with typical machines"


@pytest.mark.parametrize("kind", ["impedance", "current", "power"])
def test_the_notes_tell_of_typical_loads_only_where_there_are_some(kind):
    path = FILES / "powermodels" / "case14.m"
    (told,) = set(st.load(path, machines="typical").notes) - set(st.load(path, machines="typical", loads=kind).notes)
    assert "constant current for active, constant admittance for reactive power" in told


def test_the_label_survives_the_csv_folder(tmp_path):
    case = st.load(FILES / "powermodels" / "case9.m", machines="typical")
    again = st.load(st.write(case, tmp_path / "mine"))
    assert again == case
    assert again.name == "case9 with typical machines"


def test_never_without_asking_and_never_over_data():
    with pytest.raises(StudyError, match="two_area has dynamic data"):
        st.load("two_area", machines="typical")
    with pytest.raises(StudyError, match="the only choice is typical"):
        st.load("two_area", machines="usual")
    case = st.load(FILES / "powermodels" / "case24.m")
    with pytest.raises(
        StudyError, match=r"no model for machines 1/1, 1/2, .* and 25 more; give their dynamic data, --dyr"
    ):
        case.initialize()


def test_fuels_and_types_choose_the_kind():
    case = st.load(FILES / "matpower" / "case_ACTIVSg200.m", machines="typical")
    wind = [load for load in case.loads if load.kind == "injection"]
    assert len(wind) == 6
    assert {m.bus for m in case.machines}.isdisjoint(load.bus for load in wind)
    flow = st.load(FILES / "matpower" / "case_ACTIVSg200.m").power_flow()
    assert abs(case.power_flow().V - flow.V).max() < 1e-8  # the same power flow, whatever is behind a bus
    nuclear = case.devices["genrou"][189]  # 569 MVA, genfuel nuclear
    assert (nuclear.xd, nuclear.H) == (UNITS["N3"]["xd"], UNITS["N3"]["H"])


def test_a_raw_file_without_dynamic_data_takes_them():
    raw = next((FILES / "psid").glob("*/*.raw"))
    case = st.read_psse(raw).with_typical_machines()
    assert case.initialize().case.name.endswith("with typical machines")
    assert np.allclose(abs(case.power_flow().V), abs(st.read_psse(raw).power_flow().V))
    assert replace(case, notes=()) == case


@pytest.mark.parametrize("kind", ["impedance", "current", "power"])
def test_loads_that_are_of_a_kind_stay_and_a_lowest_voltage_of_their_own_is_kept(cases, kind):
    case = cases("two_area")
    own = replace(case, loads=(case.loads[0]._replace(v_low=0.3), *case.loads[1:]))
    once = own.with_loads(kind)
    assert once.with_loads(kind).loads == once.loads
    assert once.loads[0].v_low == 0.3
    assert [load.v_low for load in once.loads[1:]] == [{"power": 0.7}.get(kind, 0.5)] * (len(case.loads) - 1)
    mine = replace(once, loads=tuple(load._replace(v_low=0.5) for load in once.loads))
    assert mine.with_loads(kind).loads == mine.loads

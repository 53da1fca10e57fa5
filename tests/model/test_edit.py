"""Edited cases: an edit is what editing the files would be, and what cannot be edited is told with what can."""

import csv
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from systems import CLASSICAL, doubled, small

from stabctl import io
from stabctl._util.errors import CaseError, StabctlError, StudyError
from stabctl._util.schema import fields
from stabctl._util.wording import near
from stabctl.dynamics import operating_point
from stabctl.model import naming, powerflow, tables
from stabctl.model.case import Case
from stabctl.model.tables import TABLES, Link, Load, Storage


@pytest.fixture(scope="module")
def case():
    two_area = io.load("two_area")
    return replace(
        two_area.with_storage("50MW"),
        links=(Link("dc no. 1", 7, 9, 10.0),),
        loads=(*two_area.loads, Load(7, 10.0, 1.0)),
    )


def every_value(case):
    """Table, row, key and field of every value of the case but the keys of devices."""
    for table in (*TABLES, *case.devices):
        record = TABLES[table] if table in TABLES else tables.models()[table].Par
        for i, key in enumerate(naming.keys(case, table)):
            for f in fields(record).values():
                yield table, i, key, f


VALUES = list(every_value(replace(io.load("two_area").with_storage("50MW"), links=(Link("dc", 7, 9, 10.0),))))


@pytest.mark.slow
@given(st.sampled_from(VALUES), st.sampled_from(["0.5", "2", "-3", "0.07", "pq", "swing", "current", "x"]))
@settings(max_examples=80)
def test_setting_a_value_is_editing_its_cell(tmp_path_factory, place, text):
    table, i, key, f = place
    case = replace(io.load("two_area").with_storage("50MW"), links=(Link("dc", 7, 9, 10.0),))
    folder = io.write(case, tmp_path_factory.mktemp("edited") / "two_area")
    rows = list(csv.reader((folder / f"{table}.csv").open(newline="")))
    rows[i + 1][rows[0].index(f.column)] = text
    with (folder / f"{table}.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)

    def outcome(make):
        try:
            return make()
        except StabctlError:
            return "refused"

    found = outcome(lambda: case.set(f"{table}.{key}.{f.name}", text))
    assert found == outcome(lambda: io.load(folder))
    assert found == outcome(lambda: case.set(f"{table}.{key}.{f.column}", text))


def test_text_with_a_unit_is_the_number_in_the_unit_of_the_column(case):
    assert case.set("machines.2.p", "0.65GW") == case.set("machines.2.p_mw", 650)
    assert case.set("machines.2.p", "650").machine(2).p == 650
    assert case.set("storage.1@5.lag", "50ms").storage[0].lag == 0.05
    assert case.set("storage.1.rating", "5%mva").storage[0].rating == 45
    assert case.set("buses.3.angle", "0.1rad").buses[2].angle == pytest.approx(5.729577951308232)
    assert case.set("frequency_hz", "50Hz").frequency_hz == case.set("frequency_hz", 50).frequency_hz == 50
    assert case.set("title", "another").title == "another"


def test_rows_are_named_as_a_user_names_them(case):
    assert case.set("branches.7-8#2.x", 0.2).branches == case.set("branches.8-7#2.x", 0.2).branches
    second = [k.x for k in case.set("branches.7-8#2.x", 0.2).branches if {k.from_bus, k.to_bus} == {7, 8}]
    assert second == [case.branches[naming.row(case, "branches", "7-8")].x, 0.2]
    assert [load.p for load in case.set("loads.7#2.p", 20).loads] == [967, 1767, 20]
    assert case.set("links.dc no. 1.p", 20).links[0].p == 20
    assert case.set("pss.1.K", 10).devices["pss"][1].K == 10


def test_a_name_that_two_buses_have_is_none(case):
    names = {7: "North", 8: "SOUTH", 9: "south"}
    named = replace(case, buses=tuple(b._replace(name=names.get(b.bus, "")) for b in case.buses))
    assert naming.bus_number(named, " north ") == 7
    assert naming.bus_number(named, "South") is None
    with pytest.raises(StudyError, match="two_area has no bus South"):
        named.set("buses.South.v", 1.02)


@pytest.mark.parametrize("count", [1, 8, 9, 12])
def test_all_names_that_could_be_meant_are_listed_or_counted(count):
    said = near("?", [f"n{i}" for i in range(count)]).removeprefix("it has ")
    listed, _, more = said.partition(" and ")
    assert len(listed.split(", ")) + int(more.partition(" more.")[0] or 0) == count


def test_nothing_else_changes(case):
    changed = case.set("sexs.2.KA", 100)
    assert {model: dict(rows) for model, rows in changed.devices.items()} == {
        model: {key: par._replace(KA=100.0) if (model, key) == ("sexs", 2) else par for key, par in rows.items()}
        for model, rows in case.devices.items()
    }
    assert changed.set("sexs.2.KA", 200) == case == case.set({})


def test_several_values_change_at_once(case):
    with pytest.raises(CaseError, match=r"Vmin = 0.3 is above Vmax = 0.2"):
        case.set("pss.1.Vmin", 0.3)
    par = case.set({"pss.1.Vmin": 0.3, "pss.1.Vmax": 0.4, "machines.1.p": 1, "machines.1.base": 2}).devices["pss"][1]
    assert (par.Vmin, par.Vmax) == (0.3, 0.4)


def test_two_names_of_one_value_are_refused(case):
    """Columns by name and header, rows by other names of them."""
    for one, other in (
        ("loads.7.p", "loads.7.p_mw"),
        ("branches.7-8#2.x", "branches.8-7#2.x"),
        ("pss.1.K", "pss. 1.K"),
    ):
        with pytest.raises(StudyError, match=f"{one} and {other} are the same value; give one of them"):
            case.set({one: 0.3, other: 0.4})


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("ps.1.K", 1, r"There is no table 'ps' in two_area; did you mean pss\?"),
        ("exst3.1.KA", 1, r"two_area has no rows in exst3; it has buses, branches, machines, loads, links, storage, "),
        ("pss.9.K", 1, r"two_area has no pss at 9; the nearest numbers are 2, 3, 4\."),
        ("branches.7-9.x", 1, r"two_area has no branch 7-9; did you mean .*7-8.*\?"),
        ("branches.7-8#4.x", 1, r"two_area has no branch 7-8#4; did you mean 7-8"),
        ("links.dc.p", 1, r"two_area has no HVDC link dc; it has dc no. 1\."),
        ("pss.1.k", 1, r"pss has no column 'k'; it has K, Tw, "),
        ("pss.1.Tww", 1, r"pss has no column 'Tww'; did you mean Tw"),
        ("genrou.1.mva", 1, r"genrou has no column 'mva'"),
        ("K", 1, r"'K' is not a value of a case; write table.key.column, such as pss.1.K, or one of name, "),
        ("", 1, r"'' is not a value of a case"),
        ("pss..K", 1, r"'pss..K' is not a value of a case"),
        ("machines.2.p", "5s", r"machines.2.p: '5s' is not a power"),
        ("sexs.1.TA", -1, r"two_area cannot have sexs.1.TA = -1: sexs.csv row 2, column TA_s: -1 is not allowed; "),
        (
            "machines.2.bus",
            2.5,
            r"two_area cannot have machines.2.bus = 2.5: machines.csv row 3, column bus: 2.5 is not ",
        ),
        ("machines.2.bus", "2.5", r"'2.5' is not allowed; it must be a whole number\."),
        ("buses.2.kind", "slack", r"'slack' is not allowed; it must be one of swing, pv, pq\."),
        ("frequency_hz", "fifty", r"frequency_hz: 'fifty' is not a frequency"),
        ("pss.1.K", None, r"None is not allowed; it must be a number\."),
    ],
)
def test_what_cannot_be_set_is_told_with_what_can(case, path, value, says):
    with pytest.raises(StabctlError, match=says) as caught:
        case.set(path, value)
    assert "\n" not in str(caught.value)


class TestLoads:
    def test_a_load_is_changed_where_it_stands(self, case):
        assert case.with_load(9, p="1.8GW").loads[1] == case.loads[1]._replace(p=1800.0)
        assert case.with_load(9, q="50Mvar", p_power=0.5, p_current=0.5).loads[1].p_power == 0.5
        assert case.with_load(9) == case

    def test_or_added_where_there_is_none(self, case):
        added = case.with_load(8, 50, q_current=1)
        assert added.loads == (*case.loads, Load(8, 50.0, 0.0, q_current=1.0))
        assert powerflow.solve(added).S.real.sum() > powerflow.solve(case).S.real.sum() + 0.4

    def test_of_several_one_must_be_named(self, case):
        with pytest.raises(StudyError, match=r"has 2 loads; change one with set\('loads.7#2.p'"):
            case.with_load(7, 50)

    def test_what_is_no_load_is_told(self, case):
        for says, options in (
            ("has no bus 99; the nearest numbers are 9, 10, 11", {"bus": 99}),
            ("Loads have no column 'p_powr'; did you mean p_power", {"bus": 9, "p_powr": 1}),
            ("'50s' is not a power", {"bus": 9, "p": "50s"}),
            ("p_power and p_current add up to 2", {"bus": 9, "p_power": 1, "p_current": 1}),
        ):
            with pytest.raises(StabctlError, match=says):
                case.with_load(**options)


class TestTrip:
    def test_machine_controls_and_storage_leave_and_its_bus_becomes_pq(self, case):
        left = case.trip_machine(2)
        assert [m.machine for m in left.machines] == [1, 3, 4]
        assert {tuple(rows) for rows in left.devices.values()} == {(1, 3, 4)}
        assert [s.machine for s in left.storage] == [1, 3, 4]
        assert [b.kind for b in left.buses if b.bus == 2] == ["pq"]
        point = operating_point.solve(left.set("loads.7.p", 300).with_storage("none"))
        assert abs(point.flow.V[1] - point.flow.V[5]) < 1e-9  # nothing flows from bus 2 to bus 6

    def test_a_bus_with_another_machine_keeps_its_voltage(self):
        two = doubled(small({"gencls": CLASSICAL}))
        left = two.trip_machine(101)
        assert left.buses == two.buses
        assert [m.machine for m in left.machines] == [1, 2]
        assert left.trip_machine(1).buses[0].kind == "pq"

    def test_the_swing_machine_stays(self, case):
        with pytest.raises(StudyError, match="Machine 3 of two_area is the only one at the swing bus 3"):
            case.trip_machine(3)
        with pytest.raises(StudyError, match="There is no machine 9 in two_area"):
            case.trip_machine(9)


def test_a_storage_row_keeps_every_edit_of_it(case):
    assert case.set("storage.1@5.characteristic", "current").storage[0] == Storage(1, 5, 50.0, "current")
    assert isinstance(case.set("storage.1@5.energy", "10MWh"), Case)

"""A mistake in a case folder is told in one sentence with its place."""

import pytest
from case_folder import cells, complaint, put, spoil

from stabctl import devices, io
from stabctl._util.errors import StabctlError
from stabctl.dynamics import operating_point

# table, row, column, value put there, what the sentence must hold besides the place
MISTAKES = [
    ("branches", 10, "to_bus", "88", "there is no bus 88 in buses.csv"),
    ("machines", 2, "bus", "77", "there is no bus 77 in buses.csv"),
    ("machines", 2, "storage_bus", "77", "there is no bus 77 in buses.csv"),
    ("loads", 3, "bus", "77", "there is no bus 77 in buses.csv"),
    ("machines", 4, "machine", "1", "machine 1 appears twice (rows 2 and 4); give each its own"),
    ("buses", 5, "bus", "1", "bus 1 appears twice (rows 2 and 5); give each its own"),
    ("genrou", 5, "machine", "1", "machine 1 appears twice (rows 2 and 5); it can have only one row in this table"),
    ("sexs", 3, "machine", "9", "there is no machine 9 in machines.csv"),
    ("branches", 2, "x_pu", "0", "branch 1-5 has no impedance; r or x must be at least 1e-09 pu in size"),
    ("branches", 6, "to_bus", "5", "branch 5-5 connects a bus to itself; give two different buses"),
    ("sexs", 3, "TA_s", "-0.05", "-0.05 is not allowed; it must be a number of at least 0"),
    ("genrou", 3, "T1d_s", "-8", "-8.0 is not allowed; it must be a number above 0"),
    ("genrou", 3, "H_s", "0", "0.0 is not allowed; it must be a number of at least 0.01"),
    ("genrou", 3, "H_s", "-6.5", "-6.5 is not allowed; it must be a number of at least 0.01"),
    ("genrou", 2, "x1d_pu", "0.2", "x1d = 0.2 of machine 1 must differ from the leakage reactance xl = 0.2"),
    ("genrou", 2, "x1q_pu", "0.2", "x1q = 0.2 of machine 1 must differ from the leakage reactance xl = 0.2"),
    ("genrou", 2, "xd_pu", "nan", "nan is not allowed; it must be a finite number above 0"),
    ("buses", 8, "v_pu", "nan", "nan is not allowed; it must be a finite number from 0.01 to 100"),
    ("buses", 8, "v_pu", "0", "0.0 is not allowed; it must be a number from 0.01 to 100"),
    ("buses", 8, "b_mvar", "inf", "inf is not allowed; it must be a finite number"),
    ("branches", 3, "r_pu", "nan", "nan is not allowed; it must be a finite number"),
    ("branches", 3, "r_pu", "low", "'low' is not allowed; it must be a number"),
    ("branches", 3, "tap", "0", "0.0 is not allowed; it must be a number from 0.01 to 100"),
    ("machines", 2, "base_mva", "0", "0.0 is not allowed; it must be a number of at least 1e-06"),
    ("machines", 2, "p_mw", "", "'' is not allowed; it must be a number"),
    ("machines", 2, "machine", "1.5", "'1.5' is not allowed; it must be a whole number above 0"),
    ("machines", 2, "machine", "0", "0 is not allowed; it must be a whole number above 0"),
    ("buses", 4, "kind", "slack", "'slack' is not allowed; it must be one of swing, pv, pq"),
    ("buses", 5, "kind", "swing", "buses 3 and 4 are both swing buses (rows 4 and 5); keep exactly one"),
    ("buses", 2, "kind", "pq", "bus 1 has a machine; make it pv or swing, not pq"),
    ("buses", 7, "kind", "pv", "bus 6 is a pv bus but has no machine; make it pq"),
    ("loads", 2, "p_power", "1.5", "1.5 is not allowed; it must be a number from 0 to 1"),
    ("loads", 2, "q_current", "-0.5", "-0.5 is not allowed; it must be a number from 0 to 1"),
    ("pss", 2, "Vmin_pu", "0.3", "Vmin = 0.3 is above Vmax = 0.2"),
    ("sexs", 2, "Efdmin_pu", "6", "Efdmin = 6 is above Efdmax = 5"),
    ("tgov", 2, "Pmin_pu", "1.5", "Pmin = 1.5 is above Pmax = 1"),
]


@pytest.mark.parametrize(("table", "row", "column", "value", "says"), MISTAKES)
def test_a_mistake_is_told_with_file_row_column_value_and_what_is_allowed(folder, table, row, column, value, says):
    spoil(folder, table, row, column, value)
    place = f"{folder / table}.csv row {row}, column {column}: "
    assert complaint(folder) == f"{place}{says}."


def test_a_link_given_twice(folder):
    head = ["link", "from_bus", "to_bus", "p_mw"]
    put(folder / "links.csv", [head, ["east", "7", "9", "10"], ["west", "7", "9", "10"], ["east", "9", "7", "5"]])
    assert complaint(folder) == (
        f"{folder}/links.csv row 4, column link: link east appears twice (rows 2 and 4); give each its own."
    )
    put(folder / "links.csv", [head, ["east", "7", "9", "10"], ["west", "7", "9", "10"]])  # two between the same buses
    assert [k.link for k in io.load(folder).links] == ["east", "west"]


def test_a_name_given_to_two_machines(folder):
    head, *rows = cells(folder / "machines.csv")
    names = "north", "east", "south", "north"
    put(folder / "machines.csv", [[*head, "name"], *([*r, name] for r, name in zip(rows, names, strict=True))])
    assert complaint(folder) == (
        f"{folder}/machines.csv row 5, column name: name north appears twice (rows 2 and 5); give each its own."
    )


def test_shares_of_a_load_that_sum_to_more_than_one(folder):
    spoil(folder, "loads", 2, "p_power", "0.5")
    assert complaint(folder) == (
        f"{folder}/loads.csv row 2, column p_current: the shares p_power and p_current add up to 1.5; "
        "they must not exceed 1."
    )


def test_a_bus_cut_off_from_the_swing_bus(folder):
    put(folder / "branches.csv", [r for r in cells(folder / "branches.csv") if r[:2] != ["2", "6"]])
    assert complaint(folder) == (
        f"{folder}/buses.csv row 3, column bus: bus 2 is not connected to the swing bus; "
        "add a branch or remove the bus."
    )


@pytest.mark.parametrize(
    ("table", "instead"), [("loads", "give the second load an id"), ("pss", "number the second device, as 2#2")]
)
def test_a_row_given_twice(folder, table, instead):
    rows = cells(folder / f"{table}.csv")
    put(folder / f"{table}.csv", [*rows, rows[-1]])
    repeated = f"row {len(rows) + 1}: it repeats row {len(rows)}; remove it, or {instead}."
    assert complaint(folder) == f"{folder}/{table}.csv {repeated}"


def test_no_digits_but_ascii(folder):
    spoil(folder, "loads", 2, "bus", "\u0667")
    assert (
        complaint(folder)
        == f"{folder}/loads.csv row 2, column bus: '\u0667' is not allowed; it must be a whole number."
    )


def test_a_folder_that_cannot_be_listed(folder, monkeypatch):
    def refuse(_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.iterdir", refuse)
    assert complaint(folder) == f"{folder}: the folder cannot be read (Permission denied)."


def test_no_swing_bus(folder):
    spoil(folder, "buses", 4, "kind", "pv")
    assert complaint(folder) == (
        f"{folder}/buses.csv, column kind: there is no swing bus; make one bus with a machine the swing bus."
    )


def test_a_machine_without_a_model(folder):
    put(folder / "genrou.csv", cells(folder / "genrou.csv")[:-1])
    put(folder / "sexs.csv", cells(folder / "sexs.csv")[:-1])
    assert complaint(folder) == (
        f"{folder}/machines.csv row 5, column machine: machine 4 has no model; "
        "add a row for it to one of gencls.csv, genroe.csv, genrou.csv, gensae.csv, gensal.csv, gentpj1.csv, "
        "two_axis.csv, csvgn1.csv, dera1.csv, regc_a.csv, regc_b.csv, regc_c.csv, regfm_a1.csv, "
        "regfm_b1.csv."
    )


def test_two_models_of_one_machine_and_controls_without_their_object(folder):
    put(folder / "gencls.csv", [["machine", "H_s", "D_pu", "ra_pu", "x1d_pu"], ["1", "6", "0", "0", "0.3"]])
    assert "row 2, column machine: machine 1 has two models, in gencls.csv and genrou.csv; keep one" in complaint(
        folder
    )
    put(folder / "genrou.csv", [r for r in cells(folder / "genrou.csv") if r[0] != "1"])
    assert "pss.csv row 2, column machine: machine 1 is modeled by gencls, which has no stabilizer" in complaint(folder)
    put(folder / "pss.csv", [r for r in cells(folder / "pss.csv") if r[0] != "1"])
    assert "sexs.csv row 2, column machine: machine 1 is modeled by gencls, which has no exciter" in complaint(folder)
    put(folder / "sexs.csv", [r for r in cells(folder / "sexs.csv") if r[0] not in ("1", "2")])
    assert "pss.csv row 2, column machine: machine 2 has no exciter for its stabilizer" in complaint(folder)
    put(folder / "pss.csv", [r for r in cells(folder / "pss.csv") if r[0] != "2"])
    assert io.load(folder).model(1, "machine") == "gencls"


@pytest.mark.parametrize(
    ("table", "column", "value", "limit"),
    [
        ("sexs", "Efdmax_pu", "1.5", "Efdmax"),
        ("sexs", "Efdmin_pu", "2.5", "Efdmin"),
        ("tgov", "Pmax_pu", "0.7", "Pmax"),
        ("tgov", "Pmin_pu", "0.9", "Pmin"),
    ],
)
def test_a_start_outside_a_limit_names_device_machine_bus_and_limit(folder, table, column, value, limit):
    spoil(folder, table, 3, column, value)
    with pytest.raises(StabctlError) as caught:
        operating_point.solve(io.load(folder))
    text = str(caught.value)
    assert text.startswith(
        f"{devices.models()[table].name} of machine 2 at bus 2 cannot be initialized: {limit} = {value} pu"
    )
    assert f"{table}.csv" in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("base_mva = 0", ", base_mva: 0 is not allowed; it must be a number from 1e-6 to 1e9."),
        ("base_mva = 'big'", ", base_mva: 'big' is not allowed; it must be a number."),
        ("frequency_hz = nan", ", frequency_hz: nan is not allowed; it must be a number from 1e-6 to 1e9."),
        ("frequenzy = 50", ": 'frequenzy' is not a valid entry; choose one of name"),
        ("base_mva = 0x" + "f" * 5000, ", base_mva: a number of many digits is not allowed"),
        ("name = 0x" + "f" * 5000, ", name: a number of many digits is not allowed"),
        ("name = 3", ", name: 3 is not allowed; it must be text."),
        ('title = "a\\u001b[31m"', ", title: 'a\\x1b[31m' is not allowed; it must be text without control"),
        ('source = "\\u202e"', ", source: '\\u202e' is not allowed; it must be text without control"),
        ('name = "two\\nlines"', ", name: 'two\\nlines' is not allowed; it must be one line of text."),
        ("name = ", ": it cannot be read as TOML ("),
    ],
)
def test_case_toml(folder, text, says):
    (folder / "case.toml").write_text(text)
    assert complaint(folder).startswith(f"{folder}/case.toml{says}")

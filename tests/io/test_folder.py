"""Case folders: round trip, every mistake located in one sentence, and no input that ends in a traceback."""

import csv
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from systems import KINDS

from stabctl import devices, io
from stabctl.dynamics import operating_point
from stabctl.errors import CaseError, StabctlError
from stabctl.io.folder import PACKAGED
from stabctl.model.case import TABLES, Link, Storage


@pytest.fixture
def folder(tmp_path):
    """A copy of two_area to spoil, with a storage and a link table."""
    return copied("two_area", tmp_path / "mine")


def copied(name, target):
    shutil.rmtree(target, ignore_errors=True)
    return Path(shutil.copytree(PACKAGED / name, target))


def cells(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def put(path, rows):
    with path.open("w", newline="", encoding="utf-8", errors="surrogatepass") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def spoil(folder, table, row, column, value):
    """Put `value` into a cell; `row` counts lines of the file."""
    rows = cells(folder / f"{table}.csv")
    rows[row - 1][rows[0].index(column)] = value
    put(folder / f"{table}.csv", rows)


def complaint(folder):
    with pytest.raises(CaseError) as caught:
        io.load(folder)
    text = str(caught.value)
    assert "\n" not in text
    assert text.endswith((".", "?"))
    return text


@pytest.mark.parametrize("name", io.packaged())
def test_a_case_written_and_read_is_the_same(cases, name, tmp_path):
    case = cases(name).with_storage([Storage(1, cases(name).machines[0].bus, 50.0, "current", lag=0.05)])
    again = io.load(io.write(case, tmp_path / name))
    assert again == case
    assert again.warnings == tuple(case.warnings)


def test_text_survives_the_round_trip(cases, tmp_path):
    from dataclasses import replace

    odd = replace(
        cases("two_area"), title='quote " backslash \\ tab\t line\n é', links=(Link('a, "b" ß', 7, 9, 10.0, 1 / 3),)
    )
    assert io.load(io.write(odd, tmp_path / "two_area")) == odd


def test_empty_cells_and_missing_columns_take_the_default(folder):
    rows = cells(folder / "branches.csv")
    put(folder / "branches.csv", [row[:4] for row in rows])
    assert {(k.b, k.tap, k.phase) for k in io.load(folder).branches} == {(0.0, 1.0, 0.0)}
    spoil(folder, "loads", 2, "v_low_pu", "")
    assert io.load(folder).loads[0].v_low == 0.5


def test_blank_lines_and_byte_order_mark_are_read_over_and_lines_still_counted(folder):
    path = folder / "machines.csv"
    lines = path.read_text().splitlines()
    lines[3] = lines[3].replace("900", "-900")
    path.write_text("\ufeff" + "\n\n".join(lines) + "\n", encoding="utf-8")
    assert complaint(folder).startswith(f"{path} row 7, column base_mva: -900.0 is not allowed")


# table, row, column, value put there, what the sentence must hold besides the place
MISTAKES = [
    ("branches", 10, "to_bus", "88", "there is no bus 88 in buses.csv"),
    ("machines", 2, "bus", "77", "there is no bus 77 in buses.csv"),
    ("machines", 2, "storage_bus", "77", "there is no bus 77 in buses.csv"),
    ("loads", 3, "bus", "77", "there is no bus 77 in buses.csv"),
    ("machines", 4, "machine", "1", "machine 1 appears twice (rows 2 and 4); machine numbers must be unique"),
    ("buses", 5, "bus", "1", "bus 1 appears twice (rows 2 and 5); bus numbers must be unique"),
    ("genrou", 5, "machine", "1", "machine 1 appears twice (rows 2 and 5); it can have only one row in this table"),
    ("sexs", 3, "machine", "9", "there is no machine 9 in machines.csv"),
    ("branches", 2, "x_pu", "0", "branch 1-5 has no impedance; r or x must be at least 1e-09 pu in size"),
    ("branches", 6, "to_bus", "5", "branch 5-5 connects a bus to itself; give two different buses"),
    ("sexs", 3, "TA_s", "-0.05", "-0.05 is not allowed; it must be a number of at least 0"),
    ("genrou", 3, "T1d_s", "-8", "-8.0 is not allowed; it must be a number of at least 0"),
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
        "add a row for it to gencls.csv or genrou.csv or gensal.csv or regc_a.csv."
    )


def test_two_models_of_one_machine_and_controls_without_their_object(folder):
    put(folder / "gencls.csv", [["machine", "H_s", "D_pu", "ra_pu", "x1d_pu"], ["1", "6", "0", "0", "0.3"]])
    assert "row 2, column machine: machine 1 has two models, in gencls.csv and genrou.csv; keep one" in complaint(
        folder
    )
    put(folder / "genrou.csv", [r for r in cells(folder / "genrou.csv") if r[0] != "1"])
    assert "sexs.csv row 2, column machine: machine 1 is modeled by gencls, which takes no exciter" in complaint(folder)
    put(folder / "sexs.csv", [r for r in cells(folder / "sexs.csv") if r[0] != "1"])
    assert "pss.csv row 2, column machine: machine 1 has no exciter for its stabilizer" in complaint(folder)
    put(folder / "pss.csv", [r for r in cells(folder / "pss.csv") if r[0] != "1"])
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
        f"{devices.models()[table].NAME} of machine 2 at bus 2 cannot be initialized: {limit} = {value} pu"
    )
    assert f"{table}.csv" in text
    assert "\n" not in text


def test_headers(folder):
    path = folder / "sexs.csv"
    rows = cells(path)
    put(path, [["machine", "TR_s", "KA", *rows[0][3:]], *rows[1:]])
    assert complaint(folder) == f"{path} row 1: 'KA' is not a column of this table; did you mean KA_pu?"
    put(path, [["machine", "TR_s", "TR_s", *rows[0][3:]], *rows[1:]])
    assert complaint(folder) == f"{path} row 1: column 'TR_s' appears twice; keep one."
    put(path, [row[:2] + row[3:] for row in rows])
    assert complaint(folder) == f"{path} row 1: column 'KA_pu' (regulator gain) is missing."
    put(path, [rows[0], rows[1][:-1], *rows[2:]])
    assert complaint(folder) == f"{path} row 2: the row has 7 cells, the header has 8."
    path.write_text("")
    assert complaint(folder).startswith(f"{path}: the table has no header; it must be machine, TR_s")


def test_files(folder):
    (folder / "lines.csv").write_text("a\n1\n")
    assert complaint(folder).startswith(f"{folder}/lines.csv: there is no table 'lines'; known are buses, branches")
    (folder / "lines.csv").unlink()
    (folder / "machines.csv").unlink()
    assert complaint(folder) == f"{folder}/machines.csv: the table is missing; a case folder needs one."
    (folder / "case.toml").unlink()
    assert complaint(folder) == f"{folder}/case.toml: the file is missing; a case folder needs one."
    assert complaint(folder / "nowhere").startswith(f"There is no case '{folder}/nowhere': give a folder, or one of ")


def test_what_is_no_file_is_not_waited_for(folder):
    (folder / "loads.csv").unlink()
    os.mkfifo(folder / "loads.csv")
    assert complaint(folder) == f"{folder}/loads.csv: it is not a regular file."
    (folder / "loads.csv").unlink()
    (folder / "loads.csv").symlink_to("/dev/zero")
    assert complaint(folder) == f"{folder}/loads.csv: it is not a regular file."
    (folder / "loads.csv").unlink()
    (folder / "loads.csv").mkdir()
    assert complaint(folder) == f"{folder}/loads.csv: it is not a regular file."


def test_a_file_too_large_for_a_table(folder):
    with (folder / "loads.csv").open("w") as file:
        file.truncate(10**9)
    assert complaint(folder) == f"{folder}/loads.csv: the file has more than 64 MB, which no table of a case needs."


@pytest.mark.parametrize("name", [3, None, "", " ", "\0", b"two_area"])
def test_what_is_no_name_of_a_case(name):
    with pytest.raises(CaseError, match="There is no case "):
        io.load(name)


def test_a_folder_with_other_tables_is_not_written_into(cases, folder):
    with pytest.raises(
        CaseError, match=r"holds genrou.csv, pss.csv, sexs.csv, tgov.csv, which two_area does not have; choose an em"
    ):
        io.write(cases("two_area").classical(), folder)
    assert io.load(folder).devices == cases("two_area").devices
    assert io.load(io.write(cases("two_area").set("pss.1.K", 3), folder)).devices["pss"][1].K == 3


def test_reading_a_case_takes_no_compiler_and_no_model_classes():
    script = (
        "import sys, stabctl; case = stabctl.load('two_area'); case.set('pss.1.K', 3);"
        "print([m for m in ('pandas', 'pydantic', 'matplotlib', 'xarray', 'numba') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert "pydantic" not in out
    assert set(eval(out)) <= {"numba"}


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
        ('name = "two\\nlines"', ", name: 'two\\nlines' is not allowed; it must be one line of text."),
        ("name = ", ": it cannot be read as TOML ("),
    ],
)
def test_case_toml(folder, text, says):
    (folder / "case.toml").write_text(text)
    assert complaint(folder).startswith(f"{folder}/case.toml{says}")


def test_a_relative_folder_is_named_as_given(folder, monkeypatch):
    put(folder / "machines.csv", cells(folder / "machines.csv")[:1])
    monkeypatch.chdir(folder)
    assert complaint(".") == "./machines.csv: the table is empty; a case needs at least one row."
    monkeypatch.chdir(folder.parent)
    assert complaint("mine") == "mine/machines.csv: the table is empty; a case needs at least one row."


class TestOverlay:
    @pytest.fixture
    def overlay(self, folder):
        made = folder.parent / "changed"
        made.mkdir()
        (made / "case.toml").write_text('extends = "mine"\n')
        return made

    def test_changes_the_given_columns_of_the_given_rows(self, overlay, folder):
        (overlay / "machines.csv").write_text("machine,p_mw\n2,650\n")
        (overlay / "sexs.csv").write_text("machine,KA_pu\n1,100\n")
        base, case = io.load(folder), io.load(overlay)
        assert case.name == "changed"
        assert [m.p for m in case.machines] == [700, 650, 719, 700]
        assert case.devices["sexs"][1] == base.devices["sexs"][1]._replace(KA=100.0)
        assert case.devices["sexs"][2] == base.devices["sexs"][2]

    def test_its_mistakes_are_located_in_its_own_file(self, overlay):
        (overlay / "machines.csv").write_text("machine,base_mva\n4,900\n3,-900\n")
        assert complaint(overlay).startswith(f"{overlay}/machines.csv row 3, column base_mva: -900.0 is not allowed")

    def test_mistakes_in_its_device_tables_too(self, overlay):
        (overlay / "sexs.csv").write_text("machine,Efdmax_pu\n3,4\n2,-6\n")
        assert complaint(overlay) == f"{overlay}/sexs.csv row 3, column Efdmin_pu: Efdmin = -5 is above Efdmax = -6."

    @pytest.mark.parametrize("table", ["machines", "buses"])
    def test_a_row_given_twice(self, overlay, table):
        column = table[:-1] if table == "machines" else "bus"
        (overlay / f"{table}.csv").write_text(f"{column}\n2\n\n1\n2\n")
        assert complaint(overlay) == (
            f"{overlay}/{table}.csv row 5, column {column}: {column} 2 appears twice (rows 2 and 5); "
            f"{column} numbers must be unique."
        )

    def test_a_device_given_twice(self, overlay):
        (overlay / "sexs.csv").write_text("machine,KA_pu\n1,100\n1,120\n")
        assert complaint(overlay) == (
            f"{overlay}/sexs.csv row 3, column machine: two_area has no machine 1#2 in sexs.csv; "
            "an overlay can only change existing rows."
        )

    def test_rows_that_the_other_case_lacks(self, overlay):
        (overlay / "machines.csv").write_text("machine,p_mw\n9,650\n")
        assert complaint(overlay) == (
            f"{overlay}/machines.csv row 2, column machine: two_area has no machine 9 in machines.csv; "
            "an overlay can only change existing rows."
        )

    def test_of_nothing_or_of_another_overlay(self, overlay):
        (overlay / "case.toml").write_text('extends = "nothing"\n')
        assert complaint(overlay).startswith(f"{overlay}/case.toml, extends: there is no case 'nothing'")
        (overlay / "case.toml").write_text('extends = "wnaps_paper"\n')
        assert "'wnaps_paper' is itself an overlay; give a full case" in complaint(overlay)


NUMBERS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(["nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "5e-324", "0", "-0.0", "9" * 400, "9" * 5000]),
    st.sampled_from(["1_0", "٣", "0x10", " 7 ", "1,5", "1e400", "True", "None"]),
)
CELLS = st.one_of(NUMBERS, st.text(max_size=20), st.sampled_from(["", "swing", "pq", "pv"]))
TABLE_NAMES = sorted(path.name for path in (PACKAGED / "two_area").glob("*.csv"))
PLACE = st.integers(0, 40)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory):
    return tmp_path_factory.mktemp("corrupt")


def attempt(folder):
    """Load and, where that succeeds, start: success or one sentence. Any other exception is the test's failure."""
    said = None
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):
        try:
            case = io.load(folder)
        except CaseError as error:
            said = str(error)
            case = None
        if said is not None:
            assert str(folder) in said
        try:
            if case is not None:
                operating_point.solve(case)
        except StabctlError as error:
            said = str(error)
    assert said is None or len(said.splitlines()) == 1


@pytest.mark.parametrize("table", TABLE_NAMES)
@given(where=st.lists(st.tuples(PLACE, PLACE, CELLS), min_size=1, max_size=2))
@settings(max_examples=60)
def test_any_cells_load_or_give_one_sentence(workshop, table, where):
    path = copied("two_area", workshop / "cells") / table
    rows = cells(path)
    for i, j, value in where:
        row = rows[i % len(rows)]
        row[j % len(row)] = value
    put(path, rows)
    attempt(path.parent)


@given(table=st.sampled_from(TABLE_NAMES), column=PLACE, row=PLACE, value=NUMBERS)
@example(table="buses.csv", column=0, row=0, value="9" * 400)
@example(table="machines.csv", column=0, row=0, value="9" * 5000)
@example(table="buses.csv", column=5, row=6, value="1e308")
@example(table="genrou.csv", column=7, row=0, value="1e-320")
@settings(max_examples=250)
def test_any_number_in_a_data_cell_loads_or_gives_one_sentence(workshop, table, column, row, value):
    path = copied("two_area", workshop / "numbers") / table
    rows = cells(path)
    rows[1 + row % (len(rows) - 1)][column % len(rows[0])] = value
    put(path, rows)
    attempt(path.parent)


@given(table=st.sampled_from(TABLE_NAMES), kind=st.integers(0, 5), at=PLACE, text=st.text(max_size=40))
@example(table="buses.csv", kind=4, at=0, text='bus,kind\n1,"pv\n')
@example(table="buses.csv", kind=4, at=0, text="\x00")
@settings(max_examples=150)
def test_broken_tables_load_or_give_one_sentence(workshop, table, kind, at, text):
    path = copied("two_area", workshop / "tables") / table
    rows = cells(path)
    n, m = at % len(rows), at % len(rows[0])
    match kind:
        case 0:
            del rows[n]
        case 1:
            rows.insert(n, rows[-1])
        case 2:
            rows = [row[:m] + row[m + 1 :] for row in rows]
        case 3:
            rows = [[*row[:m], text, *row[m:]] for row in rows]
    put(path, rows)
    if kind == 4:
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
    if kind == 5:
        path.write_bytes(path.read_bytes()[: at * 7] + text.encode("utf-16"))
    attempt(path.parent)


@given(
    st.one_of(st.text(max_size=60), st.tuples(st.sampled_from(["base_mva", "frequency_hz"]), NUMBERS).map(" = ".join))
)
@example('name = "two\\nlines"')
@example('extends = "\\u0000"')
@example('extends = "two_area"')
@example('extends = ""')
@example('extends = "toml"')
@example("base_mva = " + "9" * 400)
@example("base_mva = " + "9" * 5000)
@example("base_mva = 1e300")
@example("x = " + "[" * 5000)
@settings(max_examples=100)
def test_any_case_toml_loads_or_gives_one_sentence(workshop, text):
    folder = copied("two_area", workshop / "toml")
    (folder / "case.toml").write_text(text, encoding="utf-8", errors="surrogatepass")
    attempt(folder)


def test_every_table_of_the_format_is_exercised_by_some_packaged_case_or_test():
    seen = {path.stem for path in PACKAGED.glob("*/*.csv")}
    tried = {model for kind in KINDS.values() for model in kind}  # tests/dynamics
    assert seen | tried | {"storage", "exponential"} == set(TABLES) | set(devices.models())

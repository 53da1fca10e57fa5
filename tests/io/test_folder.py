"""Case folders: written and read again; headers, files and names."""

import os

import pytest
from case_folder import cells, complaint, put, spoil
from systems import KINDS, LIBRARY

from stabctl import devices, io
from stabctl._util.errors import CaseError
from stabctl.io.folder import PACKAGED
from stabctl.model.tables import TABLES, Link, Storage


@pytest.mark.parametrize("name", io.packaged())
def test_a_case_written_and_read_is_the_same(cases, name, tmp_path):
    case = cases(name).with_storage([Storage(1, cases(name).machines[0].bus, 50.0, "current", lag=0.05)])
    again = io.load(io.write(case, tmp_path / name))
    assert again == case
    assert again.notes == case.notes


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
    assert complaint(folder).startswith(
        f"{folder}/lines.csv: there is no table 'lines'; the tables are buses, branches"
    )
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
    assert complaint(folder) == f"{folder}/loads.csv: the file has more than 64 MB, the largest that is read."


@pytest.mark.parametrize("name", [3, None, "", " ", "\0", b"two_area"])
def test_what_is_no_name_of_a_case(name):
    with pytest.raises(CaseError, match="There is no case "):
        io.load(name)


def test_a_folder_with_other_tables_is_not_written_into(cases, folder):
    with pytest.raises(
        CaseError, match=r"contains genrou.csv, pss.csv, sexs.csv, tgov.csv, which two_area does not have; choose an em"
    ):
        io.write(cases("two_area").classical(), folder)
    assert io.load(folder).devices == cases("two_area").devices
    assert io.load(io.write(cases("two_area").set("pss.1.K", 3), folder)).devices["pss"][1].K == 3


def test_a_relative_folder_is_named_as_given(folder, monkeypatch):
    put(folder / "machines.csv", cells(folder / "machines.csv")[:1])
    monkeypatch.chdir(folder)
    assert complaint(".") == "./machines.csv: the table is empty; a case needs at least one row."
    monkeypatch.chdir(folder.parent)
    assert complaint("mine") == "mine/machines.csv: the table is empty; a case needs at least one row."


def test_every_table_of_the_format_is_exercised_by_some_packaged_case_or_test():
    seen = {path.stem for path in PACKAGED.glob("*/*.csv")}
    tried = {model for kind in (KINDS | LIBRARY).values() for model in kind}  # tests/dynamics
    assert seen | tried | {"storage", "out_of_service", "exponential", "csvgn1"} == set(TABLES) | set(devices.models())

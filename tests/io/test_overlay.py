"""A case that changes rows of another."""

import pytest
from case_folder import complaint

from stabctl import io


@pytest.fixture
def overlay(folder):
    made = folder.parent / "changed"
    made.mkdir()
    (made / "case.toml").write_text('extends = "mine"\n')
    return made


def test_changes_the_given_columns_of_the_given_rows(overlay, folder):
    (overlay / "machines.csv").write_text("machine,p_mw\n2,650\n")
    (overlay / "sexs.csv").write_text("machine,KA_pu\n1,100\n")
    base, case = io.load(folder), io.load(overlay)
    assert case.name == "changed"
    assert [m.p for m in case.machines] == [700, 650, 719, 700]
    assert case.devices["sexs"][1] == base.devices["sexs"][1]._replace(KA=100.0)
    assert case.devices["sexs"][2] == base.devices["sexs"][2]


def test_its_mistakes_are_located_in_its_own_file(overlay):
    (overlay / "machines.csv").write_text("machine,base_mva\n4,900\n3,-900\n")
    assert complaint(overlay).startswith(f"{overlay}/machines.csv row 3, column base_mva: -900.0 is not allowed")


def test_mistakes_in_its_device_tables_too(overlay):
    (overlay / "sexs.csv").write_text("machine,Efdmax_pu\n3,4\n2,-6\n")
    assert complaint(overlay) == f"{overlay}/sexs.csv row 3, column Efdmin_pu: Efdmin = -5 is above Efdmax = -6."


@pytest.mark.parametrize("table", ["machines", "buses"])
def test_a_row_given_twice(overlay, table):
    column = table[:-1] if table == "machines" else "bus"
    (overlay / f"{table}.csv").write_text(f"{column}\n2\n\n1\n2\n")
    assert complaint(overlay) == (
        f"{overlay}/{table}.csv row 5, column {column}: {column} 2 appears twice (rows 2 and 5); give each its own."
    )


def test_a_device_given_twice(overlay):
    (overlay / "sexs.csv").write_text("machine,KA_pu\n1,100\n1,120\n")
    assert complaint(overlay) == (
        f"{overlay}/sexs.csv row 3, column machine: two_area has no machine 1#2 in sexs.csv; "
        "an overlay can only change existing rows."
    )


def test_a_load_given_twice(overlay):
    (overlay / "loads.csv").write_text("bus,p_mw,q_mvar\n7,967,100\n9,1767,100\n7,967,100\n")
    assert complaint(overlay) == (
        f"{overlay}/loads.csv row 4: it repeats row 2; remove it, or give the second load an id."
    )
    (overlay / "loads.csv").write_text("bus,p_mw,q_mvar\n7,966,100\n9,1767,100\n7,1,0\n")
    assert io.load(overlay).loads[2].p == 1  # a second load at a bus is none


def test_a_storage_device_given_twice(overlay):
    (overlay / "storage.csv").write_text("machine,bus,rating_mw\n1,1,50\n1,1,50\n")
    assert complaint(overlay) == (
        f"{overlay}/storage.csv row 3, column machine: the device of machine 1 at bus 1 is given twice (rows 2 and 3); "
        "remove one of them."
    )


def test_rows_that_the_other_case_lacks(overlay):
    (overlay / "machines.csv").write_text("machine,p_mw\n9,650\n")
    assert complaint(overlay) == (
        f"{overlay}/machines.csv row 2, column machine: two_area has no machine 9 in machines.csv; "
        "an overlay can only change existing rows."
    )


def test_of_nothing_or_of_another_overlay(overlay):
    (overlay / "case.toml").write_text('extends = "nothing"\n')
    assert complaint(overlay).startswith(f"{overlay}/case.toml, extends: there is no case 'nothing'")
    (overlay / "case.toml").write_text('extends = "wnaps_paper"\n')
    assert "'wnaps_paper' is itself an overlay; give a full case" in complaint(overlay)

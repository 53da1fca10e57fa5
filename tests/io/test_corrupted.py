"""No content of a case folder ends in a traceback."""

import warnings

import pytest
from case_folder import cells, copied, put
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stabctl import io
from stabctl._util.errors import CaseError, StabctlError
from stabctl.dynamics import operating_point
from stabctl.io.folder import PACKAGED

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
@settings(max_examples=25)
def test_any_cells_load_or_give_one_sentence(workshop, table, where):
    path = copied("two_area", workshop / "cells") / table
    rows = cells(path)
    for i, j, value in where:
        row = rows[i % len(rows)]
        row[j % len(row)] = value
    put(path, rows)
    attempt(path.parent)


@pytest.mark.slow
@given(table=st.sampled_from(TABLE_NAMES), column=PLACE, row=PLACE, value=NUMBERS)
@example(table="buses.csv", column=0, row=0, value="9" * 400)
@example(table="machines.csv", column=0, row=0, value="9" * 5000)
@example(table="buses.csv", column=5, row=6, value="1e308")
@example(table="genrou.csv", column=7, row=0, value="1e-320")
@settings(max_examples=100)
def test_any_number_in_a_data_cell_loads_or_gives_one_sentence(workshop, table, column, row, value):
    path = copied("two_area", workshop / "numbers") / table
    rows = cells(path)
    rows[1 + row % (len(rows) - 1)][column % len(rows[0])] = value
    put(path, rows)
    attempt(path.parent)


@given(table=st.sampled_from(TABLE_NAMES), kind=st.integers(0, 5), at=PLACE, text=st.text(max_size=40))
@example(table="buses.csv", kind=4, at=0, text='bus,kind\n1,"pv\n')
@example(table="buses.csv", kind=4, at=0, text="\x00")
@settings(max_examples=60)
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
@settings(max_examples=60)
def test_any_case_toml_loads_or_gives_one_sentence(workshop, text):
    folder = copied("two_area", workshop / "toml")
    (folder / "case.toml").write_text(text, encoding="utf-8", errors="surrogatepass")
    attempt(folder)

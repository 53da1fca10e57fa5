"""A screen that is kept in a store: interrupted and continued, it gives the rows of an undisturbed one."""

import sqlite3

import pytest

from stabctl._util.errors import StudyError
from stabctl.clearing import screen
from stabctl.clearing.screen import PLACE, as_plain, from_plain
from stabctl.controllers import BangBang, Controller
from stabctl.dynamics import operating_point
from stabctl.jobs.store import rows


@pytest.fixture(scope="module")
def point(cases):
    return operating_point.solve(cases("ieee39").classical())


@pytest.fixture(scope="module")
def undisturbed(point):
    return screen(point, below="5cyc", buses="26 28 29 21")


def finished(folder):
    return {row["key"]: row["finished"] for row in rows(folder / "screen.db", PLACE)}


def test_plain_values_give_the_clearing_time_back(undisturbed):
    kinds = {run.margin is None for pair in undisturbed.pairs for run in pair.runs}
    assert kinds == {True, False}
    for pair in undisturbed.pairs:
        assert vars(from_plain(as_plain(pair), pair.contingency, pair.search)) == vars(pair)


def test_an_interrupted_screen_continues(point, undisturbed, tmp_path):
    def interrupt(_done, _total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        screen(point, below="5cyc", buses="26 28 29 21", store=tmp_path, workers=1, progress=interrupt)
    kept = finished(tmp_path)
    assert 1 <= len(kept) < 4
    again = screen(point, below="5cyc", buses="26 28 29 21", store=tmp_path)
    assert again.rows() == undisturbed.rows()
    assert again.simulations == undisturbed.simulations
    assert [p.runs for p in again.pairs] == [p.runs for p in undisturbed.pairs]
    now = finished(tmp_path)
    assert len(now) == 4
    assert kept.items() <= now.items()  # not run again
    screen(point, below="5cyc", buses="26 28 29 21", store=tmp_path)
    assert finished(tmp_path) == now


def test_another_case_or_search_is_another_row(point, tmp_path):
    for base, below in ((point, "3cyc"), (point, "3.5cyc"), (point.case.with_load_level(0.99), "3cyc")):
        screen(base, below=below, buses=[29], store=tmp_path)
    assert len(finished(tmp_path)) == 3


def test_what_cannot_be_stored_is_refused(cases, tmp_path):
    case = cases("two_area").with_storage("50MW")
    law = Controller.from_function(
        lambda seen, x: ([0.0], x), inputs=["deviation:1"], outputs=["order:1@5"], rate=60, start=[0.0]
    )
    with pytest.raises(StudyError, match="cannot be kept in a store"):
        screen(case, below="1cyc", control=[BangBang(), law], store=tmp_path)
    with pytest.raises(StudyError, match="used together"):
        screen(case, workers=1, scheduler="tcp://h:1")
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match="cannot be created"):
        screen(case, store=tmp_path / "file")
    with sqlite3.connect(tmp_path / "screen.db") as base:
        base.execute("CREATE TABLE money (amount)")
    with pytest.raises(StudyError, match="another kind of study"):
        screen(case, store=tmp_path)


def test_command(stabctl, tmp_path):
    words = "screen", "two_area", "--classical", "--below", "2cyc", "--store", tmp_path / "a" / "b", "--json"
    first, second = (stabctl(*words) for _ in range(2))
    assert first[0] == second[0] == 0
    assert len(finished(tmp_path / "a" / "b")) == 3

"""The results file: whose it is, what becomes of it, and the sentence for each mishap."""

import sqlite3

import pytest

from stabctl._util.errors import StudyError
from stabctl.jobs import Row, store
from stabctl.jobs.task import About
from stabctl.sweep.job import SWEEP, Job
from stabctl.sweep.results import cell, read, rows


def row(key, message=None, **found):
    return Row(key, Job("simulate", "two_area", fault="7", clear="6cyc").given(), found, About("ok", message))


def Store(path):
    return store.Store(path, SWEEP)


def test_a_row_comes_back_as_it_was(tmp_path):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a", outcome="stable", time_s=0.1 + 0.2, machine=3))
        kept.add(row("b"))
        kept.add(row("b", message="later"))
        assert {key: status for (key, *_), status in kept.statuses().items()} == {"a": "ok", "b": "ok"}
        assert [r["key"] for r in rows(path)] == ["a", "b"]  # read while it is open for writing
    first, second = rows(path)
    assert (first["time_s"], first["machine"], first["until_s"], first["resolution"]) == (0.1 + 0.2, 3, 10.0, None)
    assert second["message"] == "later"
    with sqlite3.connect(path) as base:
        assert base.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_what_one_of_the_jobs_has_found_is_a_column(tmp_path):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        for clear, found in (("6cyc", {}), ("20cyc", {"machine": 4})):
            job = Job("simulate", "two_area", fault="7", clear=clear).given()
            kept.add(Row(clear, job, {"time_s": 2.5} | found, About("ok", None)))
    found = read(path)
    assert found.columns == ("clear", "machine", "time_s")
    assert found.cells == (("6cyc", None, 2.5), ("20cyc", 4, 2.5))


def test_rows_are_read_in_a_folder_that_may_not_be_written(tmp_path, monkeypatch):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a"))
        monkeypatch.setattr("os.access", lambda *_: False)
        assert len(rows(path)) == 1  # the log of the open file is read too
    tmp_path.chmod(0o555)
    try:
        assert [r["key"] for r in rows(path)] == ["a"]
        assert [p.name for p in tmp_path.iterdir()] == ["results.db"]
    finally:
        tmp_path.chmod(0o755)


def test_a_file_that_is_not_ours_is_left_as_it_is(tmp_path):
    text, foreign = tmp_path / "notes.txt", tmp_path / "foreign.db"
    text.write_text("not a database, but long enough to be taken for one " * 20)
    with sqlite3.connect(foreign) as base:
        base.execute("CREATE TABLE money (amount)")
    for path, says in ((text, "it is not a results file"), (foreign, "another program")):
        before = path.read_bytes()
        for use in (Store, rows):
            with pytest.raises(StudyError, match=says) as caught:
                use(path)
            assert str(path) in str(caught.value)
        assert path.read_bytes() == before


def test_rows_of_another_format_are_not_mixed(tmp_path):
    path = tmp_path / "results.db"
    Store(path).__exit__()
    with sqlite3.connect(path) as base:
        base.execute("PRAGMA user_version = 99")
    with pytest.raises(StudyError, match="format 99"):
        Store(path)


@pytest.mark.parametrize(
    "change",
    ["ADD COLUMN note TEXT", "RENAME COLUMN outcome TO ending", "DROP COLUMN message"],
)
def test_foreign_columns_are_refused_by_all_alike(tmp_path, change):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a"))
    with sqlite3.connect(path) as base:
        base.execute(f"ALTER TABLE {SWEEP.table} {change}")
    before = path.read_bytes()
    for use in (Store, rows):
        with pytest.raises(StudyError, match="its columns are not those of stabctl"):
            use(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("damage", ["status = 3", "time_s = 'late'", "message = 'a' || char(27)"])
def test_values_of_another_kind_are_refused_by_all_alike(tmp_path, damage):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a"))
    with sqlite3.connect(path) as base:
        base.execute(f"UPDATE {SWEEP.table} SET {damage}")
    for use in (lambda path: Store(path).statuses(), lambda path: Store(path).rows(), rows):
        with pytest.raises(StudyError, match="it is damaged"):
            use(path)


def test_a_damaged_file(tmp_path):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        for k in range(200):
            kept.add(row(f"{k:064}", message="x" * 200))
    content = bytearray(path.read_bytes())
    content[8192:12288] = b"\x55" * 4096
    path.write_bytes(content)
    for use in (Store, rows):
        with pytest.raises(StudyError, match="it is damaged"):
            use(path)


def test_a_file_that_another_holds(tmp_path, monkeypatch):
    path = tmp_path / "results.db"
    monkeypatch.setattr(store, "PATIENCE", 0.1)
    with Store(path) as kept:
        holder = sqlite3.connect(path, isolation_level=None)
        holder.execute("BEGIN IMMEDIATE")
        with pytest.raises(StudyError, match="another program has locked it"):
            kept.add(row("a"))
        holder.execute("ROLLBACK")
        holder.close()
        kept.add(row("a"))
    assert len(rows(path)) == 1


def test_a_full_disk_keeps_what_was_there(tmp_path):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a"))
        kept._base.execute("PRAGMA max_page_count = 8")
        with pytest.raises(StudyError, match="the disk is full"):
            list(map(kept.add, (row(f"b{k}", message="x" * 1000) for k in range(100))))
        there = len(kept.statuses())
        assert there > 1
        kept._base.execute("PRAGMA max_page_count = 1000")
        kept.add(row("c"))
        assert len(kept.statuses()) == there + 1
    assert len(rows(path)) == there + 1


@pytest.mark.parametrize("become", [lambda path: path.unlink(), lambda path: path.rename(path.with_name("moved.db"))])
def test_a_file_that_is_deleted_or_moved_while_open(tmp_path, become):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a"))
        become(path)
        for use in (lambda: kept.add(row("b")), kept.statuses):
            with pytest.raises(StudyError, match="it was deleted, moved or replaced while the study was running"):
                use()
        path.write_text("")  # another file of that name
        with pytest.raises(StudyError, match="it was deleted, moved or replaced"):
            kept.add(row("b"))


def test_places_where_no_file_can_be(tmp_path):
    for path in (tmp_path / "nowhere" / "results.db", tmp_path):
        with pytest.raises(StudyError, match="cannot be opened or created"):
            Store(path)
    with pytest.raises(StudyError, match="There is no results file"):
        rows(tmp_path / "missing.db")
    assert not (tmp_path / "missing.db").exists()


@pytest.mark.parametrize(
    "damage",
    [
        "ALTER TABLE results RENAME COLUMN rmse_mhz TO rmse",
        "ALTER TABLE results DROP COLUMN worker",
        "UPDATE results SET cycles = 'x'",
        "PRAGMA writable_schema = 1; UPDATE sqlite_master SET sql = CAST(REPLACE(sql, 'worker', X'9d') AS TEXT)",
        "UPDATE results SET message = X'FF'",
        "UPDATE results SET message = 'a' || char(27)",
        "UPDATE results SET \"set\" = '[1]'",
        "UPDATE results SET \"set\" = '{'",
    ],
)
def test_rows_that_are_no_results(tmp_path, damage):
    path = tmp_path / "results.db"
    with Store(path) as kept:
        kept.add(row("a", message="stable"))
    with sqlite3.connect(path) as base:
        base.executescript(damage)
    with pytest.raises(StudyError, match=r"it is damaged|its columns are not those"):
        rows(path)


def test_cells_are_words_and_six_digits():
    given = [
        ("monotone", True),
        ("monotone", False),
        ("monotone", None),
        ("x", 1.23456789),
        ("case", "two_area"),
        ("outcome", "lost_synchronism"),
        ("z", 3),
    ]
    assert [cell(*one) for one in given] == ["yes", "no", "", "1.23457", "two_area", "lost synchronism", "3"]

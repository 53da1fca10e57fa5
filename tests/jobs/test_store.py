"""Results files while another process writes them."""

import sqlite3
from contextlib import closing

from stabctl.jobs import store
from stabctl.jobs.store import Store, rows
from stabctl.sweep.job import SWEEP


def test_a_file_that_is_created_while_it_is_read_is_empty_or_ours(tmp_path, monkeypatch):
    """The owner is read before the study creates its table, the number of tables after it."""
    path, kind = tmp_path / "results.db", SWEEP
    with closing(sqlite3.connect(path)) as base:
        base.execute("PRAGMA journal_mode = WAL")

    class Interrupted(sqlite3.Connection):
        def execute(self, text, *given):
            found = super().execute(text, *given).fetchall()
            if "user_version" in text:
                Store(path, kind).__exit__()
            return closed(found)

    def closed(found):
        class Answer:
            fetchone = staticmethod(lambda: found[0] if found else None)
            __iter__ = staticmethod(lambda: iter(found))

        return Answer()

    with closing(sqlite3.connect(path, factory=Interrupted)) as base:
        assert store._is_ours(base, path, kind) is False
    assert rows(path, kind) == []

"""The results file: SQLite with a write-ahead log, one transaction per row, keyed by content and labels of the job.

With synchronous = FULL a committed row is on the disk: neither a killed process nor a power failure loses it or damages
the file, and an interrupted commit has no effect.
"""

import os
import re
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

from stabctl._util.errors import StudyError

from .task import Kind, Row

OURS = int.from_bytes(b"STAB")  # application_id of the file
PATIENCE = 30.0  # s   to wait for a file that another process has locked

SENTENCES = {
    "SQLITE_FULL": "the disk is full; free some space and run the same command again to continue with the rows so far",
    "SQLITE_IOERR": "it cannot be read or written (is the disk full?); the rows so far are kept: run the same command "
    "again when there is space",
    "SQLITE_BUSY": "another program has locked it; wait until it is done, or close it",
    "SQLITE_LOCKED": "another program has locked it; wait until it is done, or close it",
    "SQLITE_NOTADB": "it is not a results file; choose another one",
    "SQLITE_CORRUPT": "it is damaged; keep a copy, and choose another file",
    "SQLITE_READONLY": "it is read-only; change its permissions, or choose another file",
    "SQLITE_CANTOPEN": "it cannot be opened or created; choose a file in a folder that exists and is writable",
}


class Store:
    """A results file open for writing, created if missing. Raises StudyError if the file cannot be used.

    Any thread may use it.
    """

    def __init__(self, path: str | Path, kind: Kind) -> None:
        self.path, self.kind, self._lock = Path(path), kind, Lock()
        self._columns = tuple(kind.columns)
        with _explained(self.path):
            self._base = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None, check_same_thread=False)
            try:
                self._open()
                self._file = os.stat(self.path)
            except BaseException:
                self._base.close()
                raise

    def _open(self) -> None:
        if not _is_ours(self._base, self.path, self.kind):
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.execute("BEGIN IMMEDIATE")
            if not _is_ours(self._base, self.path, self.kind):
                listed, unique = map(_quoted, (self._columns, ("key", *self.kind.labels)))
                self._base.execute(f"CREATE TABLE {self.kind.table} ({listed}, PRIMARY KEY ({unique}))")
                self._base.execute(f"PRAGMA application_id = {OURS}")
                self._base.execute(f"PRAGMA user_version = {self.kind.format}")
            self._base.execute("COMMIT")
        self._base.execute("PRAGMA journal_mode = WAL")
        self._base.execute("PRAGMA synchronous = FULL")

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self._base.close()

    def add(self, row: Row) -> None:
        """Write a row; it replaces one with the same key and labels."""
        given = row.values
        values, places = [given.get(column) for column in self._columns], ", ".join("?" * len(self._columns))
        self._check_present()
        with self._lock, _explained(self.path):
            self._base.execute(f"INSERT OR REPLACE INTO {self.kind.table} VALUES ({places})", values)

    def statuses(self) -> dict[tuple[str, ...], str]:
        """Key and labels -> status of every row."""
        self._check_present()
        return {self.kind.row(row): row["status"] for row in self._rows()}

    def rows(self) -> dict[str, dict[str, Any]]:
        """Key -> column -> value, of the rows that did not end in an error."""
        return {row["key"]: row for row in self._rows() if row["status"] == "ok"}

    def _rows(self) -> list[dict[str, Any]]:
        with self._lock, _explained(self.path):
            return _all(self._base, self.path, self.kind)

    def _check_present(self) -> None:
        """Raise StudyError if the file was deleted or replaced, which SQLite does not notice while it is open."""
        try:
            present = os.path.samestat(os.stat(self.path), self._file)
        except OSError:
            present = False
        if not present:
            raise StudyError(
                f"{self.path}: it was deleted, moved or replaced while the study was running, which stops; run the "
                "same command again."
            )


def rows(path: str | Path, kind: Kind) -> list[dict[str, Any]]:
    """Every row of a results file, column -> value; also while a study writes it."""
    path = Path(path)
    if not path.is_file():
        raise StudyError(f"There is no results file {path}; run the study that makes it, or check the name.")
    with _explained(path):
        base = sqlite3.connect(f"{path.resolve().as_uri()}?{_reading(path.resolve())}", uri=True, timeout=PATIENCE)
        try:
            if not _is_ours(base, path, kind):
                return []
            return _all(base, path, kind)
        finally:
            base.close()


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _all(base: sqlite3.Connection, path: Path, kind: Kind) -> list[dict[str, Any]]:
    """Every row, checked."""
    found = base.execute(f"SELECT * FROM {kind.table}")
    names = [column[0] for column in found.description]
    return [_checked(dict(zip(names, row, strict=True)), path, kind) for row in found]


def _checked(row: dict[str, Any], path: Path, kind: Kind) -> dict[str, Any]:
    """A row with the columns of this format and values of their kinds. Raises StudyError if it is damaged."""
    types = kind.columns
    sound = tuple(row) == tuple(types) and all(
        value is None
        or (
            (isinstance(value, (int, float) if types[name] is float else types[name]))
            and (not isinstance(value, str) or not re.search(r"[\x00-\x1f\x7f]", value))
        )
        for name, value in row.items()
    )
    if not sound:
        raise StudyError(f"{path}: {SENTENCES['SQLITE_CORRUPT']}.")
    return row


def _reading(path: Path) -> str:
    """How to open a file for reading: SQLite creates a log next to it, which is not possible in a read-only folder."""
    logged = path.with_name(f"{path.name}-wal").exists()
    return "mode=ro" if logged or os.access(path.parent, os.W_OK) else "mode=ro&immutable=1"


def _is_ours(base: sqlite3.Connection, path: Path, kind: Kind) -> bool:
    """Whether it is an undamaged results file of this kind and format; False if it is empty.

    All is read at one instant, as another process may be creating the table.
    """
    if base.in_transaction:
        return _is_ours_now(base, path, kind)
    base.execute("BEGIN")
    try:
        return _is_ours_now(base, path, kind)
    finally:
        base.rollback()


def _is_ours_now(base: sqlite3.Connection, path: Path, kind: Kind) -> bool:
    ((owner,), (format_,)) = (base.execute(f"PRAGMA {name}").fetchone() for name in ("application_id", "user_version"))
    if owner == OURS:
        tables = [name for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        if tables != [kind.table]:
            raise StudyError(f"{path}: it has the results of another kind of study; choose another file.")
        if format_ != kind.format:
            raise StudyError(
                f"{path}: its rows have format {format_}, this version uses {kind.format}; choose another file."
            )
        found = [name for _, name, *_ in base.execute(f"PRAGMA table_info({kind.table})")]
        if found != list(kind.columns):
            raise StudyError(f"{path}: its columns are not those of stabctl; keep a copy, and choose another file.")
        if base.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise StudyError(f"{path}: {SENTENCES['SQLITE_CORRUPT']}.")
        return True
    if owner or base.execute("SELECT count(*) FROM sqlite_master").fetchone() != (0,):
        raise StudyError(f"{path}: it is a database of another program; choose another file.")
    return False


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """An error of SQLite as a sentence."""
    try:
        yield
    except UnicodeDecodeError:  # in the name of a column
        raise StudyError(f"{path}: {SENTENCES['SQLITE_CORRUPT']}.") from None
    except sqlite3.Error as error:
        name = getattr(error, "sqlite_errorname", "")
        name = "SQLITE_CORRUPT" if "decode" in str(error) else name  # the name of a column
        said = next((text for start, text in SENTENCES.items() if name.startswith(start)), f"SQLite reports: {error}")
        raise StudyError(f"{path}: {said}.") from None

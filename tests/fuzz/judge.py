"""Runs an attempt, and says what is wrong with its end: anything but a result or one sentence."""

import io
import json
import os
import re
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from stabctl import cli
from stabctl._util.errors import StabctlError
from stabctl.jobs.task import run_task
from stabctl.sweep import study_file, sweep

from . import kill
from .attempt import Attempt

LIMIT = 30  # s   of computing time
ALLOWED = 0, 1, 2  # exit codes; 1 if a job of a sweep ended in an error
KEPT = "what stood here before\n"


class Hang(BaseException):
    """It takes too long."""


def judge(attempt: Attempt) -> str | None:
    """What is wrong, or None."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as top, _inside(Path(top) / "a" / "b"), _limited():
        attempt.put(Path())
        before = set(Path(top).rglob("*"))
        try:
            found = RUN.get(attempt.target, _command)(attempt)
        except Hang:
            return f"it takes more than {LIMIT} s"
        except Exception:
            return traceback.format_exc()
        return found or _left(attempt, set(Path(top).rglob("*")) - before)


@contextmanager
def _inside(folder: Path) -> Iterator[None]:
    there = os.getcwd()
    folder.mkdir(parents=True)
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(there)


@contextmanager
def _limited() -> Iterator[None]:
    """Hang after `LIMIT` s of computing, or ten times as long in all."""

    def stop(*_: object) -> None:
        raise Hang

    before = {name: signal.signal(name, stop) for name in (signal.SIGVTALRM, signal.SIGALRM)}
    signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT)
    signal.setitimer(signal.ITIMER_REAL, 10 * LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        for name, handler in before.items():
            signal.signal(name, handler)


@contextmanager
def _streams(words: list[str]) -> Iterator[tuple[Callable[[], str], Callable[[], str]]]:
    """The words as those of the program; yields what reads stdout and stderr."""
    before = sys.argv, sys.stdout, sys.stderr
    files = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in "oe"]
    sys.argv, sys.stdout, sys.stderr = ["stabctl", *words], *files
    try:
        yield tuple(lambda file=file: file.buffer.getvalue().decode() for file in files)  # type: ignore[misc]
    finally:
        sys.argv, sys.stdout, sys.stderr = before


def _command(attempt: Attempt) -> str | None:
    """Run the command line."""
    with _streams(attempt.words) as (out, err):
        try:
            cli.main()
            code = None
        except SystemExit as end:
            code = end.code
    return _wrong(code, out(), err(), "--json" in attempt.words)


def _wrong(code: object, out: str, err: str, as_json: bool) -> str | None:
    said = [line for line in err.split("\n") if line and not line.startswith("stabctl: compiling")]
    alone = [
        line
        for line in said
        if not re.match("stabctl: (warning: |[0-9a-z]+ more warning|another warning|[0-9]+ unusual values?: )", line)
    ]
    if code not in ALLOWED:
        return f"the exit code is {code!r}: {err}"
    if not all(line.startswith("stabctl: ") for line in said) or "Traceback" in out + err:
        return f"more than sentences: {err}"
    if code == 2 and len(alone) != 1:
        return f"{len(alone)} sentences instead of one: {err}"
    if max(map(len, said), default=0) > 2000:
        return f"a sentence of {max(map(len, said))} characters"
    if odd := {c for c in out + err if not (c.isprintable() or c in "\n\t")}:
        return f"control characters {odd} on the terminal"
    if code == 0 and (number := re.search(r"(?<![\w'])[-+]?nan(?!\w)", out, re.IGNORECASE)):
        return f"{number[0]!r} in a result: {out}"
    if code == 0 and as_json and out:
        json.loads(out)
    return None


def _study(attempt: Attempt) -> str | None:
    """Run the first jobs of a study file in this process."""
    try:
        jobs = sweep.tasks(study_file.read(attempt.words[0]), attempt.words[0])
    except StabctlError as error:
        return _wrong(2, "", f"stabctl: {error}\n", False)
    for one in jobs[:3]:
        result = run_task(one).about
        if result.status not in ("ok", "error") or "mistake in stabctl" in (result.message or ""):
            return f"job {one.job} ends with {result}"
    return None


RUN = {"study": _study, "kill": kill.run}


def _left(attempt: Attempt, new: set[Path]) -> str | None:
    """What is wrong with the files that were written."""
    kept, here = Path("kept.csv"), Path().resolve()
    for path in new:
        if not path.resolve().is_relative_to(here) and not any(".." in word for word in attempt.words):
            return f"a file outside the folder: {path}"
        if path.name.startswith(".") and path.is_file():
            return f"an unfinished file is left: {path}"
    if kept.exists() and kept.read_text() != KEPT and not kept.read_text().endswith("\n"):
        return "kept.csv is neither the old nor the new file"
    return None

"""Common parts of several commands: the case and its storage, events, control, output."""

import json
import math
import os
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from stabctl.controllers import Controller, Law
    from stabctl.model.case import Case
    from stabctl.model.unusual import UnusualData
    from stabctl.simulation.events import Event

EVERY = 30.0  # s   between two lines of progress
LONG = 60.0  # s   left, from which that is said as soon as it is known
SETTLED = 1.0  # s   after which the pace is measured; what a store has comes before


def warn(sentences: Sequence[str], verbose: bool) -> None:
    """Print the first warning and the number of the others on stderr, or all of them."""
    from stabctl._util.errors import one_line

    with suppress(OSError):  # nobody reads it
        for sentence in sentences if verbose else sentences[:1]:
            print("stabctl: warning:", one_line(sentence), file=sys.stderr)
        if len(sentences) > 1 and not verbose:
            more = "another warning" if len(sentences) == 2 else f"{len(sentences) - 1} more warnings"
            print(f"stabctl: {more}; --verbose prints all {len(sentences)}.", file=sys.stderr)


def tell(found: "UnusualData", case: str, verbose: bool) -> None:
    """Print on stderr how many values of a case are unusual and how to see them, or all of them."""
    from stabctl._util.errors import one_line

    with suppress(OSError):  # nobody reads it
        for sentence in found.sentences() if verbose else filter(None, [found.told(case)]):
            print("stabctl:", one_line(sentence), file=sys.stderr)


def lag(time: str | float, case: "Case") -> float:
    """The lag (s) of the devices, checked."""
    from stabctl._util.errors import StudyError
    from stabctl._util.units import seconds

    found = seconds(time, case.frequency_hz)
    if found < 0:
        raise StudyError(f"--lag {found:g} s is not allowed; it must be at least 0.")
    return found


def events(
    case: "Case", opened: Iterable[str] | None, machines: Iterable[str] | None, loads: Iterable[str] | None
) -> "tuple[Event, ...]":
    """What --open, --trip-machine and --load-step describe."""
    from stabctl.simulation.events import LoadStep, Open, TripMachine, event

    kinds = (Open, opened), (TripMachine, machines), (LoadStep, loads)
    return tuple(event(text, case.frequency_hz, kind) for kind, texts in kinds for text in texts or ())


def file(path: Path | None, *endings: str) -> None:
    """Reject a file that cannot be written, before any work is done."""
    from stabctl._util import files
    from stabctl._util.errors import StudyError

    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise StudyError(f"The file {path.name!r} must end in {' or '.join(endings)}.")
    if not path.parent.is_dir():
        raise StudyError(f"There is no folder {str(path.parent)!r} to write {path.name!r} to; create it first.")
    if path.is_dir():
        raise StudyError(f"{path} is a folder; give a file name.")
    if path.exists() and not os.access(path, os.W_OK):
        raise StudyError(f"{path} is not writable; choose another file.")
    files.check(path)


def folder(path: Path | None) -> None:
    """Reject a folder that cannot be created or written to, before any work is done."""
    from stabctl._util.errors import StudyError

    if path is None:
        return
    there = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    if not there.is_dir():
        raise StudyError(f"Cannot write to {path} because {there} is a file; give a folder.")
    try:
        os.rmdir(tempfile.mkdtemp(dir=there))
    except OSError:
        raise StudyError(f"Cannot write to {path} because {there} is not writable; choose another folder.") from None


def controllers(names: list[str] | None) -> "list[Controller | Law]":
    """The controllers and laws in these files."""
    from stabctl.io import control_files

    found = [control_files.load(name) for name in names or ()]
    warn([sentence for one in found for sentence in getattr(one, "warnings", ())], True)
    return found


def impedance(text: str) -> complex:
    """A fault impedance written as R,X (pu)."""
    from stabctl._util.errors import StudyError

    try:
        r, x = (float(part) for part in text.split(","))
    except ValueError:
        r = x = float("nan")
    if not (abs(complex(r, x)) < float("inf") and r >= 0):
        raise StudyError(
            f"--fault-impedance {text!r} is not allowed; write R,X in pu, such as 0.01,0.05, with R at least 0."
        )
    return complex(r, x)


def print_json(record: dict[str, Any]) -> None:
    """One JSON object on stdout; infinities and NaN become null."""
    print(json.dumps(_plain(record), allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def console(stderr: bool = False) -> "Console":
    """Where tables (stdout) and progress (stderr) go."""
    from rich.console import Console

    class Open(Console):
        def on_broken_pipe(self) -> None:
            raise  # the BrokenPipeError, which the command line handles

    return Open(stderr=stderr, highlight=False, markup=False)


class Lines(AbstractContextManager["Lines"]):
    """Progress as lines on stderr: every half minute, and once, after the first runs, if much time is left."""

    def __init__(self, text: str, total: float | None) -> None:
        self.text, self.total = text, total
        self.began = time.monotonic()
        self.done, self.remark, self.said = 0.0, "", False
        self.first = self.began, 0.0  # instant and amount done then, after which the pace is measured
        self._ended = threading.Event()
        threading.Thread(target=self._repeat, daemon=True).start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def __call__(self, done: float | None, remark: str = "") -> None:
        """So much is done."""
        self.done, self.remark, now = done or 0.0, remark, time.monotonic()
        if now - self.began < SETTLED:
            self.first = now, self.done
        elif not self.said and self.left() > LONG:
            self.say()

    def left(self) -> float:
        """Time left at the pace so far, s; 0 if it is not known."""
        since, before = self.first
        if self.total is None or self.done <= before:
            return 0.0
        return (self.total - self.done) * (time.monotonic() - since) / (self.done - before)

    def say(self) -> None:
        """Print a line."""
        self.said, left = True, self.left()
        share = "" if self.total is None else f" {100 * self.done / self.total:.0f} %"
        more = f", about {duration(left)} left" if left else ""
        with suppress(OSError):  # nobody reads it
            remark = f" {self.remark}" if self.remark else ""
            print(
                f"stabctl: {self.text}{remark}:{share} after {duration(time.monotonic() - self.began)}{more}",
                file=sys.stderr,
                flush=True,
            )

    def _repeat(self) -> None:
        while not self._ended.wait(EVERY):
            self.say()


def duration(s: float) -> str:
    """A duration in words: 50 s, 4 min, 2.5 h."""
    return f"{s:.0f} s" if s < 120 else f"{s / 60:.0f} min" if s < 7200 else f"{s / 3600:.1f} h"


@contextmanager
def progress(text: str, total: float | None) -> Iterator[Any]:
    """A progress bar on stderr if it is a terminal, lines if not; yields a function of (amount done, remark)."""
    if not sys.stderr.isatty():
        with Lines(text, total) as lines:
            yield lines
        return
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total)
        yield lambda done, said="": bar.update(task, completed=done, description=f"{text} {said}".rstrip())

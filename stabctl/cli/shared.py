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
    from rich.table import Table

    from stabctl.controllers import Controller, Law
    from stabctl.judgment import Criteria
    from stabctl.model.case import Case
    from stabctl.simulation.events import Event

EVERY = 30.0  # s   between two lines of progress
LONG = 60.0  # s   left, from which that is said as soon as it is known
WIDEST = 1000  # characters of a line
SETTLED = 1.0  # s   after which the pace is measured; what a store has comes before


def warn(sentences: Sequence[str], verbose: bool, told: Sequence[str] = ()) -> None:
    """Print the first warning, how many others there are and what else is told, in one line on stderr; or all of it."""
    from stabctl._util.errors import one_line
    from stabctl._util.wording import together

    warnings = together(sentences)
    shown = [f"warning: {one_line(sentence)}" for sentence in (warnings if verbose else warnings[:1])]
    if len(warnings) > 1 and not verbose:
        shown = [f"{shown[0]} (1 of {len(warnings)} warnings; --verbose prints all.)"]
    shown += map(one_line, told)
    with suppress(OSError):  # nobody reads it
        for line in shown if verbose else filter(None, [" ".join(shown)]):
            print("stabctl:", line, file=sys.stderr)


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


def criteria(name: str | None) -> "Criteria | None":
    """The criteria of performance of this name or file, if there is one."""
    if name is None:
        return None
    from stabctl.judgment import criteria as named

    return named(name)


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


def written(paths: "Iterable[Path | None]", as_json: bool = False) -> None:
    """Say which files were written, unless JSON is printed."""
    for path in paths:
        if path is not None and not as_json:
            console().print(f"written: {path}")


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
    """Where tables (stdout) and progress (stderr) go.

    On a terminal a table is as wide as it needs to be for whole words. Elsewhere its rows are lines whose cells are
    separated by tabs, no line is wrapped, and an empty line separates two tables.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    class Open(Console):
        after_table = False

        def on_broken_pipe(self) -> None:
            raise  # the BrokenPipeError, which the command line handles

        def print(self, *objects: Any, **how: Any) -> None:
            """Print tables and texts."""
            for one in objects:
                if not self.is_terminal:
                    apart = "\n" if self.after_table and isinstance(one, Table) else ""
                    self.file.write(f"{apart}{tabbed(one) if isinstance(one, Table) else one}\n")
                    self.file.flush()  # somebody may wait for it, as for the address of a page
                    self.after_table = isinstance(one, Table)
                    continue
                if not isinstance(one, Table):
                    super().print(one, **how)
                    continue
                one.box, one.show_edge, one.pad_edge, one.padding = box.SIMPLE_HEAD, False, False, (0, 1, 0, 0)
                least, most = self.measure(one, options=self.options.update(width=WIDEST))
                one.width = min(most, max(least, self.width))
                with self.capture() as drawn:
                    super().print(one, soft_wrap=True)
                self.file.write("".join(f"{line.rstrip()}\n" for line in drawn.get().splitlines()))

    return Open(stderr=stderr, highlight=False, markup=False)


def tabbed(table: "Table") -> str:
    """A table as lines: its title, if it has one, the heads of its columns, its rows; cells between tabs."""
    rows = [[column.header for column in table.columns], *zip(*(c.cells for c in table.columns), strict=True)]
    shown = [rows[0]] if table.show_header and any(map(str, rows[0])) else []
    lines = ["\t".join(" ".join(str(cell).split()) for cell in row) for row in [*shown, *rows[1:]]]
    return "\n".join([*([str(table.title)] if table.title else []), *lines])


class Lines(AbstractContextManager["Lines"]):
    """Progress as lines on stderr: every half minute, and once, after the first runs, if much time is left."""

    def __init__(self, text: str, total: float | None) -> None:
        self.text, self.total = text, total
        self.began = time.monotonic()
        self.done, self.remark, self.said = 0.0, "", False
        self.first = self.began, 0.0  # instant and amount done then, after which the pace is measured
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._repeat, daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(1.0)  # a line may be half written

    def __call__(self, done: float | None, remark: str = "") -> None:
        """So much is done."""
        self.done, self.remark, now = done or 0.0, remark, time.monotonic()
        if now - self.began < SETTLED or not done:
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

"""What a study found: numbers beside the paper's, tables, pictures, further pages, text.

A script runs its study with `present`, which keeps the records in a JSON file. The answers of a long study are `Kept`
until the code changes, so that an interrupted study continues where it ended.
"""

import argparse
import hashlib
import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import stabctl
from reproduction.comparison import Comparison, Printed
from stabctl._util import files
from stabctl._util.errors import StabctlError, StudyError, sentence
from stabctl.view.figures import style
from stabctl.view.pages import pattern

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


DPI = 130
PREFIX = "kept-"
PROGRESS = "progress: "  # begins the lines on stderr that are not errors
BETWEEN = 30.0  # s   between two messages on one answer
Tell = Callable[[object], None]  # says how far something is


@dataclass(frozen=True)
class Table:
    """Results for which the paper has no number."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def shown(self) -> pattern.Table:
        """The table of a page."""
        return pattern.table(self.heads, self.rows)


@dataclass(frozen=True)
class Picture:
    """A picture in the folder of the reports."""

    file: str
    title: str
    alt: str  # what the picture shows, for those who cannot see it
    caption: str = ""
    of: tuple[str, ...] = ()  # the paper's figures that show the same


@dataclass(frozen=True)
class Study:
    """What one study found. `section` is the paper's; empty for results beyond the paper."""

    title: str
    section: str = ""
    text: tuple[str, ...] = ()  # paragraphs
    comparisons: tuple[Comparison, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    pages: Mapping[str, str] = field(default_factory=dict)  # title -> file

    @property
    def notes(self) -> tuple[str, ...]:
        """The remarks of the comparisons, each once."""
        return tuple(dict.fromkeys(c.remark for c in self.comparisons if c.remark))

    def __str__(self) -> str:
        return "\n".join((self.title, *map(str, self.comparisons)))

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, dictionaries, numbers and text."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Return the study of which `to_dict` gave the data."""
        compared = (Comparison(Printed(**c["printed"]), c["ours"], c["remark"]) for c in data["comparisons"])
        tables = (Table(t["title"], tuple(t["heads"]), tuple(map(tuple, t["rows"]))) for t in data["tables"])
        pictures = (Picture(**p | {"of": tuple(p["of"])}) for p in data["pictures"])
        parts = tuple(compared), tuple(tables), tuple(pictures)
        return cls(data["title"], data["section"], tuple(data["text"]), *parts, data["pages"])


def draw(drawn: "Figure | Axes", path: Path, title: str, *, alt: str, caption: str = "", of: str = "") -> Picture:
    """Save a figure; `of` names the paper's figures that show the same, as in "17, 18"."""
    style.save(drawn, path, DPI)
    return Picture(
        path.name, title, alt, caption, tuple(f"Figure {number.strip()}" for number in of.split(",") if number)
    )


def present(study: Callable[[Path], Study | Iterable[Study]]) -> None:
    """Run the study of the current script: SCRIPT [REPORTS]. An error is one line on stderr and exit code 2."""
    os.environ.setdefault("MPLBACKEND", "agg")
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("reports", nargs="?", type=Path, default=Path("reports"), help="folder of the results")
    script, folder = Path(sys.argv[0]), parser.parse_args().reports
    try:
        folder.mkdir(parents=True, exist_ok=True)
        found = study(folder)
        studies = (found,) if isinstance(found, Study) else tuple(found)
        write(path_for(script, folder), studies)
    except (StabctlError, OSError) as error:
        print("stabctl:", sentence(error), file=sys.stderr)
        sys.exit(2)
    for record in studies:
        show(record, folder)


def show(study: Study, folder: Path) -> None:
    """Print a study."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else 120)
    console.print(study.title, style="bold")
    for paragraph in study.text:
        console.print(paragraph)
    if study.comparisons:
        table = Table("in the paper", "quantity", "paper", "ours", "unit", "", "note")
        for c in study.comparisons:
            p, note = c.printed, str(study.notes.index(c.remark) + 1) if c.remark else ""
            table.add_row(p.where, p.what, p.text, c.shown, p.unit, str(c.verdict), note)
        console.print(table)
    for number, note in enumerate(study.notes, 1):
        console.print(f"{number}: {note}")
    for given in study.tables:
        table = Table(*given.heads, title=given.title, title_justify="left")
        for row in given.rows:
            table.add_row(*row)
        console.print(table)
    for file in (*(p.file for p in study.pictures), *study.pages.values()):
        console.print(f"wrote {folder / file}")


def path_for(script: Path, folder: Path) -> Path:
    """Return where the records of a script are kept: for sims/omib.py, sims_omib.json in the folder."""
    script = script.resolve()
    return folder / f"{script.parent.name}_{script.stem}.json"


def write(path: Path, studies: Sequence[Study]) -> None:
    """Write the records of one script."""
    files.replace(path, json.dumps([s.to_dict() for s in studies], indent=1, ensure_ascii=False))


def read(path: Path) -> tuple[Study, ...]:
    """Return the records of one script. Raises StudyError if the file is missing or damaged."""
    try:
        return tuple(map(Study.from_dict, json.loads(path.read_text(encoding="utf-8"))))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StudyError(f"{path.name} does not contain records of a study ({error}). Run its script again.") from None


class Kept:
    """Answers by name, in a folder that belongs to this version of the code.

    Parameters
    ----------
    script : str
        The file of the study; with another text of it, its answers are not used again.
    reports : Path
        Folder of the reports.
    """

    def __init__(self, script: str, reports: Path) -> None:
        path = Path(script)
        self.folder = reports / f"{PREFIX}{_code()}"  # also for the stores of jobs
        self.folder.mkdir(parents=True, exist_ok=True)
        self._file = self.folder / f"{path.stem}-{_digest(path.read_bytes())}.json"
        self._known: dict[str, Any] = json.loads(self._file.read_text("utf-8")) if self._file.exists() else {}
        self._name = path.stem

    def __call__(self, name: str, compute: Callable[[Tell], Any]) -> Any:
        """The answer of this name, as JSON gives it back; it is computed if it is not known.

        Parameters
        ----------
        name
            What is computed, in words.
        compute
            Returns the answer; it is given a function to say how far it is.
        """
        if name in self._known:
            self._say(f"{name}: kept")
            return self._known[name]
        began = said = time.monotonic()

        def tell(state: object) -> None:
            nonlocal said
            if time.monotonic() > said + BETWEEN:
                said = time.monotonic()
                self._say(f"{name}: {state}, {said - began:.0f} s")

        self._say(f"{name} ...")
        self._known[name] = json.loads(json.dumps(compute(tell)))
        files.replace(self._file, json.dumps(self._known, indent=1))
        self._say(f"{name}: {time.monotonic() - began:.0f} s")
        return self._known[name]

    def _say(self, text: str) -> None:
        print(f"{PROGRESS}{self._name}: {text}", file=sys.stderr, flush=True)


def clear(reports: Path) -> None:
    """Remove the answers of all studies, of this and other versions of the code."""
    for folder in reports.glob(f"{PREFIX}*"):
        shutil.rmtree(folder, ignore_errors=True)


@cache
def _code() -> str:
    """A name for the text of the package, its cases included."""
    top = Path(stabctl.__file__).parent
    paths = sorted(p for p in top.rglob("*") if p.suffix in (".py", ".csv", ".toml"))
    return _digest(*(text for p in paths for text in (p.relative_to(top).as_posix().encode(), p.read_bytes())))


def _digest(*texts: bytes) -> str:
    found = hashlib.sha256()
    for text in texts:
        found.update(len(text).to_bytes(8, "big") + text)
    return found.hexdigest()[:12]

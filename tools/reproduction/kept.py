"""Answers of a long study, kept until the code changes, so that an interrupted study continues where it ended."""

import hashlib
import json
import shutil
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import stabctl
from stabctl._util import files

PREFIX = "kept-"
PROGRESS = "progress: "  # begins the lines on stderr that are not errors
Tell = Callable[[object], None]  # says how far something is
BETWEEN = 30.0  # s   between two messages on one answer


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

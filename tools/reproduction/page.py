"""The page index.html: every table and figure of the paper beside ours, and studies beyond the paper."""

import base64
import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from stabctl.report import document

from . import summary
from .comparison import Verdict
from .paper import RESULTS
from .study import Picture, Study

MARKS = {Verdict.AS_PRINTED: "=", Verdict.CLOSE: "≈", Verdict.DIFFERS: "≠", Verdict.GIVEN: "·"}
TYPES = {".png": "image/png", ".svg": "image/svg+xml"}


class Ran(NamedTuple):
    """A script that was run: its studies, or a sentence on how it failed."""

    script: str  # sims/omib.py
    seconds: float
    studies: tuple[Study, ...] = ()
    failure: str = ""


class About(NamedTuple):
    """When and where the studies ran."""

    date: str
    machine: str
    seconds: float
    left_out: tuple[str, ...] = ()  # scripts that run with --full only


def page(ran: Sequence[Ran], folder: Path, about: About) -> str:
    """Return the page, with the pictures that are in the folder embedded."""
    found = sorted(((s, r) for r in ran for s in r.studies), key=lambda pair: order(pair[0]))
    studies = [study for study, _ in found]
    environment = document.environment(Path(__file__).parent / "templates")
    return environment.get_template("reproduction.html").render(
        title="Reproduction of the paper",
        about=about,
        counts=summary.counts(studies),
        differing=summary.with_verdict(studies, Verdict.DIFFERS),
        failed=[r for r in ran if r.failure],
        contents=[(study, summary.agreement(study)) for study in studies],
        entries=summary.entries(studies),
        sections=[_section(study, r, folder) for study, r in found],
        marks=MARKS,
        anchor=anchor,
    )


def order(study: Study) -> tuple[bool, list[int], str]:
    """Sort key: sections of the paper in its order, then studies beyond it."""
    return not study.section, [int(n) for n in re.findall(r"\d+", study.section)], study.title


def anchor(text: str) -> str:
    """Return the id of an element of the page."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def _section(study: Study, r: Ran, folder: Path) -> dict[str, Any]:
    """A study with its surroundings on the page."""
    return {
        "study": study,
        "ran": r,
        "pictures": [_picture(p, folder) for p in study.pictures],
        "pages": {what: file for what, file in study.pages.items() if (folder / file).is_file()},
    }


def _picture(p: Picture, folder: Path) -> dict[str, Any]:
    """A picture with its caption; without data if the file cannot be read."""
    of = ", ".join(p.of)
    shows = " ".join(f"The paper's {name}: {RESULTS.get(name, 'not among its results')}." for name in p.of)
    about = {"picture": p, "title": f"{of}: {p.title}" if of else p.title, "shows": shows, "source": "", "size": None}
    file = folder / p.file
    try:
        data = file.read_bytes()
    except OSError:
        return about
    size = struct.unpack(">II", data[16:24]) if file.suffix == ".png" else None
    return about | {"source": f"data:{TYPES[file.suffix]};base64,{base64.b64encode(data).decode()}", "size": size}

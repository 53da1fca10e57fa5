"""The page index.html: every table and figure of the paper beside ours, and studies beyond the paper."""

import base64
import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from reproduction.comparison import Comparison, Verdict
from reproduction.paper import RESULTS
from reproduction.study import Picture, Study
from stabctl.view.pages import document

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
        counts=counts(studies),
        differing=with_verdict(studies, Verdict.DIFFERS),
        failed=[r for r in ran if r.failure],
        contents=[(study, agreement(study)) for study in studies],
        entries=entries(studies),
        sections=[_section(study, r, folder) for study, r in found],
        marks=MARKS,
        anchor=anchor,
    )


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


def order(study: Study) -> tuple[bool, list[int], str]:
    """Sort key: sections of the paper in its order, then studies beyond it."""
    return not study.section, [int(n) for n in re.findall(r"\d+", study.section)], study.title


def anchor(text: str) -> str:
    """Return the id of an element of the page."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


class Found(NamedTuple):
    """A comparison and the study it belongs to."""

    comparison: Comparison
    study: Study


def with_verdict(studies: Sequence[Study], verdict: Verdict) -> list[Found]:
    """Return the comparisons with a verdict."""
    return [Found(c, s) for s in studies for c in s.comparisons if c.verdict is verdict]


def counts(studies: Sequence[Study]) -> list[tuple[int, str]]:
    """Return how many results agree, and how well."""
    close = with_verdict(studies, Verdict.CLOSE)
    within = max((100 * abs(c.relative) for c, _ in close), default=0.0)
    return [
        (len(with_verdict(studies, Verdict.AS_PRINTED)), "results equal the paper's in every digit or word"),
        (len(close), f"more agree within {within:.2g} %" if within else "more agree within 1 %"),
        (len(with_verdict(studies, Verdict.DIFFERS)), "differ"),
        (len(with_verdict(studies, Verdict.GIVEN)), "inputs taken from the paper"),
    ]


def agreement(study: Study) -> str:
    """Return how many results of a study agree; empty if it compares none."""
    results = [c.verdict for c in study.comparisons if c.verdict is not Verdict.GIVEN]
    agree = len(results) - results.count(Verdict.DIFFERS)
    return f"{agree} of {len(results)} agree" if results else ""


class Entry(NamedTuple):
    """A table or figure of the paper, and the study that reproduces it."""

    name: str
    shows: str
    study: Study | None


def entries(studies: Sequence[Study]) -> list[Entry]:
    """Return every table and figure of the paper that has results, each with the first study that shows it."""
    places: dict[str, Study] = {}
    for study in studies:
        shown = {c.printed.where for c in study.comparisons} | {name for p in study.pictures for name in p.of}
        for name in RESULTS:
            if any(re.match(rf"{name}\b", where) for where in shown):
                places.setdefault(name, study)
    return [Entry(name, shows, places.get(name)) for name, shows in RESULTS.items()]

"""A RAW file as records: its sections are recognized by their order and by the records `0` that end them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import orders, sections
from .lexer import Line, Place, lines, number, split, whole
from .sections import SECTIONS, Unmodeled

_END = re.compile(r"""\s*(['"]?)0\1\s*(?:/|$|[A-Za-z])""")
_QUIT = re.compile(r"\s*[Qq]\s*$")


@dataclass
class Raw:
    """The records of a RAW file, each with its place."""

    path: Path
    version: int
    base_mva: float
    frequency_hz: float
    title: str
    sections: dict[str, list[tuple[Any, Place]]] = field(default_factory=dict)
    unmodeled: list[Unmodeled] = field(default_factory=list)

    def of(self, section: str) -> list[tuple[Any, Place]]:
        """The records of a section."""
        return self.sections.get(section, [])


def read(path: Path) -> Raw:
    """The records of a RAW file. Raises `CaseError` with line and field for the first that cannot be read."""
    rows = lines(path)
    texts = iter([(i, text) for i, text in enumerate(rows, 1) if i <= 4 or not text.lstrip().startswith("@!")])
    head = next(((i, text) for i, text in texts if not text.startswith("@!")), (1, ""))
    titles = [next(texts, (0, ""))[1].strip() for _ in range(2)]
    found = list(texts)
    raw = _header(path, split(head[1], Place(path, head[0])), titles, found)
    numbered = ((Place(path, i), text) for i, text in found if text.strip() and not text.lstrip().startswith("@!"))
    before = ""
    for section in SECTIONS[max(v for v in SECTIONS if v <= raw.version)]:
        ended = _section(raw, section, numbered, before)
        if ended is None:
            break
        before = ended
    return raw


def _header(path: Path, line: Line, titles: list[str], rest: list[tuple[int, str]]) -> Raw:
    texts = line.fields + [""] * 6
    base = number(texts[1], line.place, "SBASE") if texts[1] else 100.0
    frequency = number(texts[5], line.place, "BASFRQ") if texts[5] else 60.0
    version = whole(texts[2], line.place, "REV") if texts[2] else _version(path, rest)
    if not 29 <= version <= orders.NEWEST:
        raise line.place.error(f"version {version} of RAW files is not supported; save it as 30 to 35.", "REV")
    for name, value in (("SBASE", base), ("BASFRQ", frequency)):
        if not value > 0:
            raise line.place.error(f"{value:g} is not allowed; it must be more than 0.", name)
    title = " ".join("".join(c if c.isprintable() else "?" for c in " ".join(titles)).split())
    return Raw(path, version, base, frequency, title)


def _version(path: Path, rest: list[tuple[int, str]]) -> int:
    """The version of a file that does not give it: a bus had 11 fields up to version 30."""
    for i, text in rest:
        if text.strip():
            return 30 if len(split(text, Place(path, i)).fields) == 11 else 33
    return 33


def _section(raw: Raw, section: str, texts: Iterator[tuple[Place, str]], before: str) -> str | None:
    """Read a section up to its end record, which it returns; None at the end of the file.

    A copy of the record `before` that ended the section before, with its titles, is passed over.
    """
    found = raw.sections.setdefault(section, [])
    for place, text in texts:
        if _END.match(text):
            if text.strip() == before and "END" in before.upper():
                continue
            return text.strip()
        if _QUIT.match(text):
            return None
        line = split(text, place)

        def more(place: Place = place) -> Line:
            at, text = next(texts, (place, "0"))
            if _END.match(text) or _QUIT.match(text):
                raise place.error("the record is not complete; the lines that belong to it are missing.")
            return split(text, at)

        record = sections.record(section, raw.version, line, more)
        if isinstance(record, Unmodeled):
            raw.unmodeled.append(record)
        elif record is not None:
            found.append((record, place))
    return None

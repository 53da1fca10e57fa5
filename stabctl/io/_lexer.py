"""Lines of a text file with their places, and the fields of a line of a PSS/E file.

Fields are separated by commas or blanks, quoted if they hold either, up to a slash.
"""

import re
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import CaseError, shown

from .table import LARGEST_FILE

_PARTS = r"""\s+ | '([^']*(?:'[^'/]*)*?)'(?={end}) | "([^"]*(?:"[^"/]*)*?)"(?={end})
    | (,) | (/) | ([^\s,/'"][^\s,/]*) | (['"])"""  # a slash after a quote within a quoted field ends the record
_COMMAS = re.compile(_PARTS.format(end=r"\s*[,/]|\s*$"), re.VERBOSE)
_BLANKS = re.compile(_PARTS.format(end=r"[\s,/]|$"), re.VERBOSE)
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?", re.ASCII)


class Place(NamedTuple):
    """A line of a file."""

    path: Path
    line: int

    def error(self, text: str, field: str = "") -> CaseError:
        """The error with a sentence about this line, or a field of it."""
        return CaseError(f"{self}{f', field {field}' if field else ''}: {text}")

    def __str__(self) -> str:
        return f"{self.path} line {self.line}"


class Line(NamedTuple):
    """The fields of a line, empty where a value is left out, and the position after the slash that ends them."""

    place: Place
    fields: list[str]
    end: int | None


def lines(path: Path) -> list[str]:
    """The lines of a file; bytes that are not UTF-8 are shown as a replacement character. Raises `CaseError`."""
    try:
        if not path.is_file():
            raise CaseError(f"{path}: there is no such file.")
        if path.stat().st_size > LARGEST_FILE:
            raise CaseError(f"{path}: the file has more than {LARGEST_FILE / 1e6:g} MB, the largest that is read.")
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: it cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def split(text: str, place: Place, commas: bool = True, start: int = 0) -> Line:
    """The fields of a line from a position; with `commas`, one must follow a quoted field if they are separated by any.

    What follows the slash is a comment and changes nothing. Raises `CaseError` for a quote that is not closed.
    """
    fields: list[str] = []
    filled = False  # whether the field before the next comma has a value
    for match in (_COMMAS if commas and _separated(text) else _BLANKS).finditer(text, start):
        single, double, comma, slash, plain, quote = match.groups()
        if slash:
            return Line(place, fields, match.end())
        if quote:
            raise place.error(f"the quote in {shown(text[match.start() :])} is not closed, or no comma follows it.")
        if comma:
            if not filled:
                fields.append("")
            filled = False
        elif (value := next((v for v in (single, double, plain) if v is not None), None)) is not None:
            fields.append("".join(c if c.isprintable() else "?" for c in value).strip())
            filled = True
    return Line(place, fields, None)


def _separated(text: str) -> bool:
    """Whether commas separate the fields before the slash."""
    ends = (m for m in _BLANKS.finditer(text) if m[3] or m[4] or m[6]) if "," in text else iter(())
    first = next(ends, None)
    return first is not None and first[3] is not None


def number(text: str, place: Place, field: str) -> float:
    """A number in Fortran's notation. Raises `CaseError`."""
    if not NUMBER.fullmatch(text):
        raise place.error(f"{shown(text)} is not a number.", field)
    return float(text.replace("d", "e").replace("D", "e"))


def whole(text: str, place: Place, field: str) -> int:
    """A whole number, which may be written 1.0. Raises `CaseError`."""
    value = number(text, place, field)
    if not (abs(value) < 1e12 and value == int(value)):
        raise place.error(f"{shown(text)} is not a whole number.", field)
    return int(value)

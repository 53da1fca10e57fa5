"""Lines of a text file with their places, and the fields of a line of a PSS/E file.

Fields are separated by commas or blanks, and the two may mix. Blanks around a comma belong to it; between two commas
with nothing else is an empty field. A field in quotes may hold commas, blanks and slashes. A slash outside quotes ends
the record.
"""

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from stabctl._util.errors import CaseError, shown

from .table import LARGEST_FILE


def _pattern(quoted: str, end: str, word: str) -> re.Pattern[str]:
    """A field without quotes, in single or in double quotes Q, a comma, a slash, or what is none of them; no blanks."""
    fields = " | ".join(f"{q}({quoted.replace('Q', q)}){q}(?={end})" for q in "'\"")
    return re.compile(rf"({word}) | {fields} | (,) | (/) | (\S)", re.VERBOSE)


_FREE = _pattern(r"[^Q]*(?:(?<![\s,])Q[^Q/]*)*?", r"[\s,/]|$", r"""[^\s,/'"](?:[^\s,/]*[^\s,/'"])?(?=[\s,/]|$)""")
# with an apostrophe before a blank, '26' Drop ', a quoted field has no comma or slash in it, and one must follow
_APOSTROPHES = _pattern(r"[^Q]*|[^Q,/]*(?:Q[^Q,/]*)*?", r"\s*[,/]|\s*$", r"""[^\s,/'"][^\s,/]*""")
_WINDOWS = {b: bytes([b]).decode("cp1252", "ignore") or chr(b) for b in range(0x80, 0xA0)}  # others as in Latin-1
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
    """The fields of a line, empty where a value is left out."""

    place: Place
    fields: list[str]
    end: int | None  # the position after the slash that ends them
    filled: bool = False  # whether the last is followed by no comma
    joined: frozenset[int] = frozenset()  # unquoted with only blanks before the next unquoted, on a line with commas

    def check_text(self, i: int, field: str) -> None:
        """Raise `CaseError` if a field that may be text and the next may be one, a name without quotes."""
        pair = self.fields[i : i + 2]
        if i in self.joined and not all(map(NUMBER.fullmatch, pair)):
            text = f"{shown(' '.join(pair))} may be one field or two; put quotes around texts, or a comma between them."
            raise self.place.error(text, field)


def lines(path: Path) -> list[str]:
    """The lines of a file in UTF-8, in UTF-16 if it says so, or else in Windows-1252. Raises `CaseError`."""
    text, _ = _decoded(path)
    if not text.strip():
        raise CaseError(f"{path}: the file is empty.")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def not_utf8(*paths: str | Path | None) -> list[str]:
    """A sentence for every file that is read as Windows-1252. Raises `CaseError`."""
    read = [path for path in paths if path is not None and not _decoded(Path(path))[1]]
    return [f"{path}: it is read as Windows-1252, because it is not UTF-8." for path in read]


def _decoded(path: Path) -> tuple[str, bool]:
    """The text of a file, and whether it is Unicode."""
    try:
        if not path.is_file():
            raise CaseError(f"{path}: {'it is no file' if path.exists() else 'there is no such file'}.")
        if path.stat().st_size > LARGEST_FILE:
            raise CaseError(f"{path}: the file has more than {LARGEST_FILE / 1e6:g} MB, the largest that is read.")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: it cannot be read ({getattr(error, 'strerror', None) or error}).") from None
    if data[:2] in (BOM_UTF16_LE, BOM_UTF16_BE):
        return data.decode("utf-16", errors="replace"), True
    try:
        return data.decode("utf-8-sig"), True
    except UnicodeDecodeError:
        return data.decode("latin-1").translate(_WINDOWS), False


def split(text: str, place: Place, start: int = 0, filled: bool = False) -> Line:
    """The fields of a line from a position; `filled` if a field is before it that no comma follows.

    What follows the slash changes nothing. Raises `CaseError` for a quote that is not closed.
    """
    with suppress(CaseError):
        return _split(_FREE, text, place, start, filled)
    return _split(_APOSTROPHES, text, place, start, filled)


def _split(pattern: re.Pattern[str], text: str, place: Place, start: int, filled: bool) -> Line:
    fields: list[str] = []
    joined: list[int] = []
    commas = word = False  # whether there are commas; whether the field before has no quotes and no comma follows it
    end = None
    for match in pattern.finditer(text, start):
        plain, single, double, comma, slash, other = match.groups()
        if slash:
            end = match.end()
            break
        if other:
            part = text[match.start() : match.start() + 50]
            raise place.error(f"the quote in {shown(part)} is not closed, or no comma follows it.")
        if comma:
            if not filled:
                fields.append("")
            commas, filled, word = True, False, False
        else:
            if word and plain:
                joined.append(len(fields) - 1)
            value = plain or single or double or ""
            fields.append("".join(c if c.isprintable() else "?" for c in value).strip())
            filled, word = True, plain is not None
    return Line(place, fields, end, filled, frozenset(joined if commas else ()))


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

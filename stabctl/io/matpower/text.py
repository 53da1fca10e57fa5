"""The assignments of a MATPOWER file, each with its place. A file that holds code is refused: nothing is run.

`matpowercaseframes` searches the text for `mpc.bus = [ ... ];` and passes over everything else, also over a line that
changes the data afterwards. It is therefore given one assignment at a time, comments removed, a row to a line, after
a check that the file holds nothing but assignments of data.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from matpowercaseframes import reader

from stabctl.errors import shown

from ..psse.lexer import Place, lines

_ASSIGNMENT = re.compile(r"\s*mpc\.([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)\s*=\s*")
_HARMLESS = re.compile(r"(?:function\s+mpc\s*=\s*\w+|end|endfunction|return)[;,]?")
_OLD = re.compile(r"function\s*\[")
_PIECE = re.compile(r"""'(?:[^'\n]|'')*'|"[^"\n]*"|\.\.\.|(?:[^'"%;,=()\[\]{}.]|\.(?!\.\.))+|.""", re.DOTALL)
_SCALAR = re.compile(r"""\s*('(?:[^'\n]|'')*'|"[^"\n]*"|[^\s;,'"]+)\s*(?:[;,]|$)""")
_CLOSING = {"[": "]", "{": "}"}


class Row(NamedTuple):
    """A row of a matrix, as text, and its line in the file."""

    text: str
    place: Place


class Assignment(NamedTuple):
    """`mpc.name = value`: the rows of a matrix or a cell array, or one row for a scalar."""

    name: str
    place: Place
    opening: str  # [, { or nothing
    rows: list[Row]

    def parsed(self) -> list[list[int | float | str]]:
        """The rows as `matpowercaseframes` reads them; what is no number remains text."""
        closing = _CLOSING.get(self.opening, "")
        body = "\n".join(row.text for row in self.rows)
        text = f"mpc.{self.name} = {self.opening}\n{body}\n{closing};" if closing else f"mpc.{self.name} = {body};"
        return reader.parse_file(self.name, text) or []

    def strings(self) -> list[str]:
        """The quoted texts of a cell array, one for each row."""
        return [row.text.strip().strip("'\"").replace("''", "'").strip() for row in self.rows]


def assignments(path: Path) -> dict[str, Assignment]:
    """The assignments of a file by name. Raises `CaseError` with the line for anything else in it."""
    found: dict[str, Assignment] = {}
    code = _code(path)
    for place, text in code:
        rest = text
        while rest.strip(" \t;,"):
            match = _ASSIGNMENT.match(rest)
            if match is None:
                if _HARMLESS.fullmatch(rest.strip()):
                    break
                raise _refused(place, rest)
            rest = rest[match.end() :]
            made, rest = _value(match[1], place, rest, code)
            if made.name in found:
                raise place.error(f"mpc.{made.name} is assigned again, first in line {found[made.name].place.line}.")
            found[made.name] = made
    return found


def _code(path: Path) -> Iterator[tuple[Place, str]]:
    """The lines of the file without comments. Raises `CaseError` for a block comment that is not closed."""
    blocks: list[Place] = []  # where those that are open begin
    for i, line in enumerate(lines(path), 1):
        marker = line.strip()
        if marker == "%{":
            blocks.append(Place(path, i))
        elif marker == "%}":
            del blocks[-1:]
        elif not blocks:
            yield Place(path, i), _without_comment(line)
    if blocks:
        raise blocks[0].error("the block comment %{ is not closed; write %} on a line of its own after it.")


def _without_comment(line: str) -> str:
    if "%" not in line:
        return line
    for piece in _PIECE.finditer(line):
        if piece[0] == "%":
            return line[: piece.start()]
    return line


def _value(name: str, place: Place, rest: str, code: Iterator[tuple[Place, str]]) -> tuple[Assignment, str]:
    """The assignment of the value that begins with the text, and what follows on its last line."""
    opening = rest[:1]
    if opening not in _CLOSING:
        match = _SCALAR.match(rest)
        if match is None:
            raise _refused(place, f"mpc.{name} = {rest}")
        return Assignment(name, place, "", [Row(match[1], place)]), rest[match.end() :]
    made = Assignment(name, place, opening, [])
    begun, at, rest, here = "", place, rest[1:], place
    while True:
        for piece in _PIECE.finditer(rest):
            c = piece[0]
            if c == _CLOSING[opening] or c == ";":
                if begun.strip():
                    made.rows.append(Row(begun, at))
                begun = ""
                if c != ";":
                    return made, _end(here, rest[piece.end() :])
            elif c == "...":
                break
            elif c in "[]{}=()":
                raise here.error(f"{c!r} is not allowed within mpc.{name}; it must contain data only.")
            else:
                at = at if begun.strip() else here
                begun += " " if c == "," else _plain(c)
        else:
            if begun.strip():
                made.rows.append(Row(begun, at))
            begun = ""
        following = next(code, None)
        if following is None:
            raise place.error(f"mpc.{name} is not closed by {_CLOSING[opening]!r}.")
        here, rest = following
        if _ASSIGNMENT.match(rest):
            raise place.error(f"mpc.{name} is not closed by {_CLOSING[opening]!r} before line {here.line}.")


def _plain(piece: str) -> str:
    """A piece of a row without what `matpowercaseframes` takes for a comment or the end of a row."""
    return "".join(c if c.isprintable() and c not in "%;" else " " for c in piece)


def _end(place: Place, rest: str) -> str:
    """What follows a bracket, which must be the end of the statement."""
    text = rest.lstrip()
    if text and text[0] not in ";,":
        raise _refused(place, rest)
    return text


def _refused(place: Place, text: str) -> Exception:
    if _OLD.match(text.strip()):
        return place.error("this is a file of MATPOWER version 1; load and save it in MATPOWER (loadcase, savecase).")
    return place.error(
        f"{shown(text.strip())} is not data but code, which is not run; save the case with MATPOWER's savecase."
    )

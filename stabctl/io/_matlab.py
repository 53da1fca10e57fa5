"""The assignments of a MATLAB file that holds data: matrices, cell arrays and scalars, each with its line.

Nothing is run. What is no assignment of data is handed over as text, for the caller to understand or to refuse.
"""

import re
from collections.abc import Container, Iterator
from pathlib import Path
from typing import NamedTuple

from ._lexer import Place, lines

_PIECE = re.compile(r"""'(?:[^'\n]|'')*'|"[^"\n]*"|\.\.\.|(?:[^'"%;,=()\[\]{}.]|\.(?!\.\.))+|.""", re.DOTALL)
_SCALAR = re.compile(r"""\s*('(?:[^'\n]|'')*'|"[^"\n]*"|[^\s;,'"(]+)\s*(?:[;,]|$)""")
CLOSING = {"[": "]", "{": "}"}


class Row(NamedTuple):
    """A row of a matrix, as text, and its line in the file."""

    text: str
    place: Place


class Assignment(NamedTuple):
    """`name = value`: the rows of a matrix or a cell array, or one row for a scalar."""

    name: str
    place: Place
    opening: str  # [, { or nothing
    rows: list[Row]


def assigns(path: Path, name: str) -> bool:
    """Whether a line of a file begins with `name = `."""
    return any(re.match(rf"\s*{re.escape(name)}\s*=", line) for line in lines(path))


class Code(NamedTuple):
    """A statement, or what of it is on a line, that is no assignment of data."""

    text: str
    place: Place


def statements(path: Path, prefix: str, wanted: Container[str] | None = None) -> Iterator[Assignment | Code]:
    """The statements of a file in order.

    Parameters
    ----------
    path
        The file.
    prefix
        What the names of data begin with, "mpc." or nothing. It is no part of `Assignment.name`.
    wanted
        Names of the matrices that are read, by default all. Others may hold anything.

    Raises
    ------
    CaseError
        If the file cannot be read, or a bracket or comment is not closed.
    """
    begins = re.compile(rf"\s*{re.escape(prefix)}([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)\s*=(?!=)\s*")
    code = _code(path)
    for place, text in code:
        rest = text
        while rest := rest.lstrip(" \t;,"):
            match = begins.match(rest)
            scalar = _SCALAR.match(rest, match.end()) if match else None
            if match and rest[match.end() : match.end() + 1] in CLOSING:
                made, rest, place = _matrix(
                    prefix, match[1], place, rest[match.end() :], code, begins, wanted is None or match[1] in wanted
                )
                yield made
            elif match and scalar:
                yield Assignment(match[1], place, "", [Row(scalar[1], place)])
                rest = rest[scalar.end() :]
            else:
                end = _end(rest)
                yield Code(rest[:end].strip(), place)
                rest = rest[end:]


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


def _matrix(
    prefix: str,
    name: str,
    place: Place,
    rest: str,
    code: Iterator[tuple[Place, str]],
    begins: re.Pattern[str],
    wanted: bool,
) -> tuple[Assignment, str, Place]:
    """The matrix or cell array that begins with the text, what follows on its last line, and this line."""
    opening, rest = rest[0], rest[1:]
    made = Assignment(name, place, opening, [])
    begun, at, here, depth = "", place, place, 0  # brackets that are open within it
    while True:
        for piece in _PIECE.finditer(rest):
            c = piece[0]
            if not wanted and (c in "[{" or (c in "]}" and depth)):
                depth += 1 if c in "[{" else -1
            elif c in (CLOSING[opening], ";"):
                if begun.strip():
                    made.rows.append(Row(begun, at))
                begun = ""
                if c != ";":
                    return made, rest[piece.end() :].lstrip(), here
            elif c == "...":
                begun += " "
                break
            elif c in "[]{}=()" and wanted:
                raise here.error(f"{c!r} is not allowed within {prefix}{name}; it must contain data only.")
            else:
                at = at if begun.strip() else here
                begun += " " if c == "," else _plain(c)
        else:
            if begun.strip():
                made.rows.append(Row(begun, at))
            begun = ""
        following = next(code, None)
        if following is None:
            raise place.error(f"{prefix}{name} is not closed by {CLOSING[opening]!r}.")
        here, rest = following
        if begins.match(rest):
            raise place.error(f"{prefix}{name} is not closed by {CLOSING[opening]!r} before line {here.line}.")


def _end(text: str) -> int:
    """Where the statement that begins with the text ends, after its semicolon."""
    depth = 0
    for piece in _PIECE.finditer(text):
        if piece[0] in "([{":
            depth += 1
        elif piece[0] in ")]}":
            depth -= 1
        elif piece[0] == ";" and depth <= 0:
            return piece.end()
    return len(text)


def _plain(piece: str) -> str:
    """A piece of a row without what `matpowercaseframes` takes for a comment or the end of a row."""
    return "".join(c if c.isprintable() and c not in "%;" else " " for c in piece)

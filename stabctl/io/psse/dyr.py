"""A DYR file as records: bus, kind of model, ID, constants, up to a slash."""

import re
from pathlib import Path
from typing import NamedTuple

from stabctl.errors import CaseError

from .lexer import NUMBER, Place, lines, split, whole

USER = "USRMDL"  # a record of a user-written model: its name, six numbers that describe it, then its constants
HEAD = 7
_NEXT = re.compile(r"\s*\d+\s+['\"]\S*\s+\S")  # another record after a slash; anything else is a comment


class Record(NamedTuple):
    """A record of a DYR file; the constants are texts."""

    place: Place
    bus: int | None  # None for a record that does not begin with a bus number
    kind: str
    id: str
    constants: tuple[str, ...]


def read(path: Path) -> list[Record]:
    """The records of a DYR file. Raises `CaseError` with the line for the first that cannot be read."""
    found: list[Record] = []
    fields: list[str] = []
    start: Place | None = None
    for i, text in enumerate(lines(path), 1):
        if not text.strip() or (not fields and text.lstrip().startswith(("@!", "//"))):
            continue
        place, at = Place(path, i), 0
        while True:
            line = split(text, place, commas=False, start=at)
            start = start if fields else place
            fields += line.fields
            if line.end is None:
                break
            if fields and start:
                found.append(_record(start, fields))
            fields, at = [], line.end
            if not _NEXT.match(text, at):
                break
    if fields and start:
        raise start.error("the record has no slash at its end.")
    return found


def _record(place: Place, fields: list[str]) -> Record:
    numeric = NUMBER.fullmatch(fields[0]) is not None
    if not numeric:  # such as the name of a DC line
        kind = next((f for f in fields[1:2]), fields[0])
        return Record(place, None, kind.upper(), "", tuple(fields[2:]))
    if len(fields) < 3:
        raise CaseError(f"{place}: a record needs a bus number, the name of a model and an ID.")
    kind, constants = fields[1].upper(), fields[3:]
    if kind == USER and len(constants) >= HEAD:
        kind, constants = constants[0].upper(), constants[HEAD:]
    return Record(place, whole(fields[0], place, "bus"), kind, fields[2] or "1", tuple(constants))

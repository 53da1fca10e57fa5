"""A RAW file as records: its sections in the order of every version, and the fields of their records.

Sections are recognized by their order, and by the records `0` that end them.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, get_type_hints

from .._lexer import Line, Place, lines, number, split, whole
from .._table_builder import POWER_LOW
from .records import (
    Area,
    Branch,
    Bus,
    Converter,
    DcLine,
    Generator,
    Impedances,
    Load,
    Shunt,
    Switch,
    SwitchedShunt,
    Transformer,
    Winding,
)

NEWEST = 35  # version that is read
_END = re.compile(r"""\s*(['"]?)0\1\s*(?:/|$|[A-Za-z])""")
_ZEROS = re.compile(r"""\s*(['"]?)0\1(?:[\s,]+0)*[\s,]*(?:/|$)""")  # the same with further fields, empty or 0
_PQBRAK = re.compile(r"\bPQBRAK\s*=\s*([^\s,/]+)", re.IGNORECASE)
LEAST_LOW = 0.01  # pu   in place of PQBRAK = 0, so that the network always has a solution
_QUIT = re.compile(r"\s*[Qq]\s*$")
_NETWORK = "bus", "load", "generator", "branch", "transformer"  # sections that no network is whole without
_FIRST = "bus load {}generator branch {}transformer area dc vsc "
_LAST = "impedance_correction multiterminal_dc multisection_line zone transfer owner facts"


# the first version with this order -> the sections in order
SECTIONS: Mapping[int, tuple[str, ...]] = MappingProxyType(
    {
        version: tuple(text.split())
        for version, text in {
            29: _FIRST.format("", "") + "switched_shunt " + _LAST,
            31: _FIRST.format("shunt ", "") + _LAST + " switched_shunt",
            32: _FIRST.format("shunt ", "") + _LAST + " switched_shunt gne",
            33: _FIRST.format("shunt ", "") + _LAST + " switched_shunt gne induction_machine",
            34: "system " + _FIRST.format("shunt ", "switch ") + _LAST + " switched_shunt gne induction_machine",
        }.items()
    }
)


class Unmodeled(NamedTuple):
    """A record that is read and not modeled."""

    kind: str
    name: str
    place: Place


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
    power_low: float = POWER_LOW  # pu   PQBRAK
    cut: str = ""  # that the file ends before all data of the network, in a sentence

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
    if not 29 <= version <= NEWEST:
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

    No section begins twice: a copy of the record `before` that says which one it begins is passed over.
    """
    found = raw.sections.setdefault(section, [])
    tables = section == "impedance_correction"  # whose records may continue with a line of zeros
    for place, text in texts:
        if _END.match(text) or (_ZEROS.match(text) and not tables):
            if text.strip() == before and "BEGIN" in before.upper():
                continue
            return text.strip()
        if _QUIT.match(text):
            return None
        line = split(text, place)
        if section == "system" and (low := _PQBRAK.search(text)):
            raw.power_low = max(number(low[1], place, "PQBRAK"), LEAST_LOW)

        def more(place: Place = place) -> Line:
            at, text = next(texts, (place, "0"))
            if _END.match(text) or _QUIT.match(text):
                raise place.error("the record is not complete; the lines that belong to it are missing.")
            return split(text, at)

        record = begin_record(section, raw.version, line, more)
        if isinstance(record, Unmodeled):
            raw.unmodeled.append(record)
        elif record is not None:
            found.append((record, place))
    if section in _NETWORK:
        raw.cut = f"{raw.path}: the file ends in its {section} data without the record 0 behind them; is it cut off?"
    return None


class TransformerRecord(NamedTuple):
    """A transformer with two or three windings."""

    head: Transformer
    z: Impedances
    windings: tuple[Winding, ...]


class DcLineRecord(NamedTuple):
    """A two-terminal DC line."""

    head: DcLine
    rectifier: Converter
    inverter: Converter


_ONE_LINE = {
    "bus": Bus,
    "load": Load,
    "shunt": Shunt,
    "generator": Generator,
    "branch": Branch,
    "switch": Switch,
    "switched_shunt": SwitchedShunt,
    "area": Area,
}
NAMED = {
    "vsc": "VSC DC line",
    "multiterminal_dc": "multi-terminal DC line",
    "facts": "FACTS device",
    "gne": "GNE device",
    "induction_machine": "induction machine",
}
STATUS = {"vsc": 1, "facts": 3, "induction_machine": 2}  # place of MDC, MODE and STAT: 0 is out of service


def begin_record(section: str, version: int, line: Line, more: Callable[[], Line]) -> Any:
    """The record that begins on a line; None where the section is not used.

    Parameters
    ----------
    section, version
        The section, and the version of the file.
    line
        The line.
    more
        Gives the next lines that belong to the record.

    Raises
    ------
    CaseError
        With line and field if it cannot be read.
    """
    if section in _ONE_LINE:
        return read_fields(_ONE_LINE[section], line, version)
    if section in _SEVERAL_LINES:
        return _SEVERAL_LINES[section](version, line, more)
    if section in NAMED:
        _skip(version, section, line, more)
        in_service = STATUS.get(section) is None or (line.fields[STATUS[section] :] or ["1"])[0] != "0"
        return Unmodeled(NAMED[section], line.fields[0] if line.fields else "", line.place) if in_service else None
    return None


def _transformer(version: int, line: Line, more: Callable[[], Line]) -> TransformerRecord:
    head = read_fields(Transformer, line, version)
    z = read_fields(Impedances, more(), version)
    windings = tuple(read_fields(Winding, more(), version) for _ in range(3 if head.K else 2))
    return TransformerRecord(head, z, windings)


def _dc(version: int, line: Line, more: Callable[[], Line]) -> DcLineRecord:
    ends = (read_fields(Converter, more(), version) for _ in range(2))
    return DcLineRecord(read_fields(DcLine, line, version), *ends)


_SEVERAL_LINES: Mapping[str, Callable[..., Any]] = MappingProxyType({"transformer": _transformer, "dc": _dc})


def _skip(version: int, section: str, line: Line, more: Callable[[], Line]) -> None:
    """Pass over the further lines of a record that is not modeled."""
    texts = line.fields + [""] * 20
    if section in ("multiterminal_dc", "gne"):
        line.check_text(0, "NAME")
        line.check_text(1, "MODEL")
    if section == "vsc":
        count = 2
    elif section == "multiterminal_dc":
        count = sum(whole(texts[i], line.place, name) for i, name in ((1, "NCONV"), (2, "NDCBS"), (3, "NDCLN")))
    elif section == "gne":
        terminals = whole(texts[2], line.place, "NTERM")
        kinds = [texts[3 + max(terminals, 0) + i] for i in range(3)] if terminals < 10 else []
        count = 1 + sum(-(-whole(text or "0", line.place, "NREAL") // 10) for text in kinds)
    else:
        count = 0
    for _ in range(count):
        more()


def read_fields(record: type, line: Line, version: int) -> Any:
    """The record on a line; a field that is left out has its default. Raises `CaseError`."""
    given: dict[str, Any] = {}
    for i, ((name, kind), text) in enumerate(zip(_order(record, version), line.fields, strict=False)):
        if kind in (None, str):
            line.check_text(i, name or str(i + 1))
        if text and name:
            given[name] = text if kind is str else _value(kind, text, line.place, name)
    for name in record.__annotations__:
        if name not in given and name not in record._field_defaults:  # type: ignore[attr-defined]
            raise line.place.error("it is left out and has no default.", name)
    return record(**given)


@cache
def _order(record: type, version: int) -> tuple[tuple[str, Any], ...]:
    """Name and type of the fields in order; the name of a field that is not used is empty."""
    kinds = get_type_hints(record)
    known = ORDERS[record]
    names = known[max(v for v in known if v <= version)].split()
    return tuple(("", None) if name == "_" else (name, kinds[name]) for name in names)


def _value(kind: type, text: str, place: Place, name: str) -> float:
    return whole(text, place, name) if kind is int else number(text, place, name)


_RATES = " ".join("_" * 12)
_WINDING = "WINDV NOMV ANG _ _ _ COD _ _ _ _ _ _ TAB"


# record -> the first version with this order -> the fields in order; `_` is read and not used
ORDERS: Mapping[type, Mapping[int, str]] = MappingProxyType(
    {
        Bus: {29: "I NAME BASKV IDE GL BL AREA ZONE VM VA OWNER", 31: "I NAME BASKV IDE AREA ZONE OWNER VM VA"},
        Load: {
            29: "I ID STATUS AREA ZONE PL QL IP IQ YP YQ OWNER",
            34: "I ID STATUS AREA ZONE PL QL IP IQ YP YQ OWNER _ _ DGENP DGENQ DGENM",
        },
        Shunt: {31: "I ID STATUS GL BL"},
        Generator: {
            29: "I ID PG QG QT QB VS IREG MBASE ZR ZX RT XT GTAP STAT",
            35: "I ID PG QG QT QB VS IREG _ MBASE ZR ZX RT XT GTAP STAT",
        },
        Branch: {29: "I J CKT R X B _ _ _ GI BI GJ BJ ST", 34: f"I J CKT R X B _ {_RATES} GI BI GJ BJ ST"},
        Switch: {34: f"I J CKT X {_RATES} STAT"},
        Transformer: {29: "I J K CKT CW CZ CM MAG1 MAG2 _ NAME STAT"},
        Impedances: {29: "R12 X12 SBASE12 R23 X23 SBASE23 R31 X31 SBASE31"},
        Winding: {
            29: _WINDING,
            34: f"WINDV NOMV ANG {_RATES} COD _ _ _ _ _ _ TAB",
            35: f"WINDV NOMV ANG {_RATES} COD _ _ _ _ _ _ _ TAB",
        },
        SwitchedShunt: {
            29: "I MODSW _ _ _ _ _ BINIT",
            32: "I MODSW _ STAT _ _ _ _ _ BINIT",
            35: "I _ MODSW _ STAT _ _ _ _ _ _ BINIT",
        },
        Area: {29: "I ISW"},
        DcLine: {29: "NAME MDC RDC SETVL VSCHD _ RCOMP"},
        Converter: {29: "IP NB ANMX ANMN RC XC EBAS TR TAP"},
    }
)

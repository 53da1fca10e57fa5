"""A RAW file as records: its sections are recognized by their order and by the records `0` that end them."""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from stabctl.errors import CaseError

from . import records
from .lexer import Line, Place, lines, number, split, whole

_END = re.compile(r"""\s*(['"]?)0\1\s*(?:/|$|[A-Za-z])""")
_QUIT = re.compile(r"\s*[Qq]\s*$")
_FIRST = "bus load {}generator branch {}transformer area dc vsc "
_LAST = "impedance_correction multiterminal_dc multisection_line zone transfer owner facts"
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
_ONE_LINE = {
    "bus": records.Bus,
    "load": records.Load,
    "shunt": records.Shunt,
    "generator": records.Generator,
    "branch": records.Branch,
    "switch": records.Switch,
    "switched_shunt": records.SwitchedShunt,
}
NAMED = {
    "vsc": "VSC DC line",
    "multiterminal_dc": "multi-terminal DC line",
    "facts": "FACTS device",
    "gne": "GNE device",
    "induction_machine": "induction machine",
}


class Transformer(NamedTuple):
    """A transformer with two or three windings."""

    head: records.Transformer
    z: records.Impedances
    windings: tuple[records.Winding, ...]


class DcLine(NamedTuple):
    """A two-terminal DC line."""

    head: records.DcLine
    rectifier: records.Converter
    inverter: records.Converter


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
    threshold: float = 1e-4  # pu   reactance up to which a branch without resistance has no impedance
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
    if not 29 <= version <= records.NEWEST:
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

        if section in _ONE_LINE:
            found.append((records.read(_ONE_LINE[section], line, raw.version), place))
        elif section in _SEVERAL_LINES:
            found.append((_SEVERAL_LINES[section](raw.version, line, more), place))
        elif section == "system":
            _system(raw, line)
        elif section in NAMED:
            _skip(raw.version, section, line, more)
            raw.unmodeled.append(Unmodeled(NAMED[section], line.fields[0] if line.fields else "", place))
    return None


def _transformer(version: int, line: Line, more: Callable[[], Line]) -> Transformer:
    head = records.read(records.Transformer, line, version)
    z = records.read(records.Impedances, more(), version)
    windings = tuple(records.read(records.Winding, more(), version) for _ in range(3 if head.K else 2))
    return Transformer(head, z, windings)


def _dc(version: int, line: Line, more: Callable[[], Line]) -> DcLine:
    ends = (records.read(records.Converter, more(), version) for _ in range(2))
    return DcLine(records.read(records.DcLine, line, version), *ends)


_SEVERAL_LINES: Mapping[str, Callable[..., Any]] = MappingProxyType({"transformer": _transformer, "dc": _dc})


def _skip(version: int, section: str, line: Line, more: Callable[[], Line]) -> None:
    """Pass over the further lines of a record that is not modeled."""
    texts = line.fields + [""] * 20
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


def _system(raw: Raw, line: Line) -> None:
    """A line of the section of system-wide data: of it the threshold of zero-impedance lines is used."""
    for text in line.fields:
        name, _, value = text.partition("=")
        if name.strip().upper() == "THRSHZ" and value:
            raw.threshold = number(value.strip(), line.place, "THRSHZ")


def check_same(raw: Raw) -> None:
    """Raise the first bus, or other element, that appears twice."""
    seen: dict[int, Place] = {}
    for bus, place in raw.of("bus"):
        if bus.I in seen:
            raise CaseError(f"{place}: bus {bus.I} appears twice, first in line {seen[bus.I].line}.")
        seen[bus.I] = place

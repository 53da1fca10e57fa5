"""Sections of a RAW file: their order in every version, and the record that begins on a line of each."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from . import orders, records
from .lexer import Line, Place, whole

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


def record(section: str, version: int, line: Line, more: Callable[[], Line]) -> Any:
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
        return orders.read(_ONE_LINE[section], line, version)
    if section in _SEVERAL_LINES:
        return _SEVERAL_LINES[section](version, line, more)
    if section in NAMED:
        _skip(version, section, line, more)
        return Unmodeled(NAMED[section], line.fields[0] if line.fields else "", line.place)
    return None


def _transformer(version: int, line: Line, more: Callable[[], Line]) -> Transformer:
    head = orders.read(records.Transformer, line, version)
    z = orders.read(records.Impedances, more(), version)
    windings = tuple(orders.read(records.Winding, more(), version) for _ in range(3 if head.K else 2))
    return Transformer(head, z, windings)


def _dc(version: int, line: Line, more: Callable[[], Line]) -> DcLine:
    ends = (orders.read(records.Converter, more(), version) for _ in range(2))
    return DcLine(orders.read(records.DcLine, line, version), *ends)


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

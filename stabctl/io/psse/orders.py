"""The order of the fields of the records of a RAW file, in every version."""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, get_type_hints

from .lexer import Line, Place, number, whole
from .records import (
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

NEWEST = 35
_RATES = " ".join("_" * 12)
_WINDING = "WINDV NOMV ANG _ _ _ _ _ _ _ _ _ _ TAB"

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
            34: f"WINDV NOMV ANG {_RATES} _ _ _ _ _ _ _ TAB",
            35: f"WINDV NOMV ANG {_RATES} _ _ _ _ _ _ _ _ TAB",
        },
        SwitchedShunt: {
            29: "I _ _ _ _ _ _ BINIT",
            32: "I _ _ STAT _ _ _ _ _ BINIT",
            35: "I _ _ _ STAT _ _ _ _ _ _ BINIT",
        },
        DcLine: {29: "NAME MDC RDC SETVL VSCHD _ RCOMP"},
        Converter: {29: "IP NB ANMX ANMN RC XC EBAS TR TAP"},
    }
)


@cache
def _order(record: type, version: int) -> tuple[tuple[str, Any], ...]:
    """Name and type of the fields in order; the name of a field that is not used is empty."""
    kinds = get_type_hints(record)
    known = ORDERS[record]
    names = known[max(v for v in known if v <= version)].split()
    return tuple(("", None) if name == "_" else (name, kinds[name]) for name in names)


def read(record: type, line: Line, version: int) -> Any:
    """The record on a line; a field that is left out has its default. Raises `CaseError`."""
    given: dict[str, Any] = {}
    for (name, kind), text in zip(_order(record, version), line.fields, strict=False):
        if text and name:
            given[name] = text if kind is str else _value(kind, text, line.place, name)
    for name in record.__annotations__:
        if name not in given and name not in record._field_defaults:  # type: ignore[attr-defined]
            raise line.place.error("it is left out and has no default.", name)
    return record(**given)


def _value(kind: type, text: str, place: Place, name: str) -> float:
    return whole(text, place, name) if kind is int else number(text, place, name)

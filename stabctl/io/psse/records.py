"""Records of a RAW file with PSS/E's names and defaults, and the order of their fields in every version."""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple, get_type_hints

from .lexer import Line, Place, number, whole

NEWEST = 35


class Bus(NamedTuple):
    """A bus; `GL` and `BL` are its shunt up to version 30."""

    I: int
    NAME: str = ""
    BASKV: float = 0.0
    IDE: int = 1
    AREA: int = 1
    ZONE: int = 1
    OWNER: int = 1
    VM: float = 1.0
    VA: float = 0.0
    GL: float = 0.0
    BL: float = 0.0


class Load(NamedTuple):
    """A load: constant power, current and admittance; distributed generation (v34) reduces it."""

    I: int
    ID: str = "1"
    STATUS: int = 1
    PL: float = 0.0
    QL: float = 0.0
    IP: float = 0.0
    IQ: float = 0.0
    YP: float = 0.0
    YQ: float = 0.0
    DGENP: float = 0.0
    DGENQ: float = 0.0
    DGENM: int = 0


class Shunt(NamedTuple):
    """A fixed shunt."""

    I: int
    ID: str = "1"
    STATUS: int = 1
    GL: float = 0.0
    BL: float = 0.0


class Generator(NamedTuple):
    """A generator, with its source impedance and its step-up transformer."""

    I: int
    ID: str = "1"
    PG: float = 0.0
    QG: float = 0.0
    QT: float = 9999.0
    QB: float = -9999.0
    VS: float = 1.0
    IREG: int = 0
    MBASE: float = 0.0
    ZR: float = 0.0
    ZX: float = 1.0
    RT: float = 0.0
    XT: float = 0.0
    GTAP: float = 1.0
    STAT: int = 1


class Branch(NamedTuple):
    """A circuit of a line, with its line shunts."""

    I: int
    J: int
    X: float
    CKT: str = "1"
    R: float = 0.0
    B: float = 0.0
    GI: float = 0.0
    BI: float = 0.0
    GJ: float = 0.0
    BJ: float = 0.0
    ST: int = 1


class Switch(NamedTuple):
    """A system switching device (v34)."""

    I: int
    J: int
    CKT: str = "1"
    X: float = 0.0
    STAT: int = 1


class Transformer(NamedTuple):
    """The first line of a transformer."""

    I: int
    J: int
    K: int = 0
    CKT: str = "1"
    CW: int = 1
    CZ: int = 1
    CM: int = 1
    MAG1: float = 0.0
    MAG2: float = 0.0
    NAME: str = ""
    STAT: int = 1


class Impedances(NamedTuple):
    """The second line of a transformer."""

    X12: float
    R12: float = 0.0
    SBASE12: float = 0.0
    R23: float = 0.0
    X23: float = 0.0
    SBASE23: float = 0.0
    R31: float = 0.0
    X31: float = 0.0
    SBASE31: float = 0.0


class Winding(NamedTuple):
    """A winding of a transformer; `WINDV` is 0 if it is left out."""

    WINDV: float = 0.0
    NOMV: float = 0.0
    ANG: float = 0.0
    TAB: int = 0


class SwitchedShunt(NamedTuple):
    """A switched shunt."""

    I: int
    STAT: int = 1
    BINIT: float = 0.0


class DcLine(NamedTuple):
    """The first line of a two-terminal DC line."""

    NAME: str
    MDC: int = 0
    RDC: float = 0.0
    SETVL: float = 0.0
    VSCHD: float = 0.0
    RCOMP: float = 0.0


class Converter(NamedTuple):
    """A converter of a two-terminal DC line: bus, bridges in series, firing angles, commutation, transformer."""

    IP: int
    NB: int = 1
    ANMX: float = 0.0
    ANMN: float = 0.0
    RC: float = 0.0
    XC: float = 0.0
    EBAS: float = 0.0
    TR: float = 1.0
    TAP: float = 1.0


_RATES = " ".join("_" * 12)
_WINDING = "WINDV NOMV ANG _ _ _ _ _ _ _ _ _ _ TAB"

# record -> the first version with this order -> the fields in order; `_` is read and not used
ORDERS: Mapping[type, Mapping[int, str]] = MappingProxyType(
    {
        Bus: {29: "I NAME BASKV IDE GL BL AREA ZONE VM VA OWNER", 31: "I NAME BASKV IDE AREA ZONE OWNER VM VA"},
        Load: {
            29: "I ID STATUS _ _ PL QL IP IQ YP YQ",
            34: "I ID STATUS _ _ PL QL IP IQ YP YQ _ _ _ DGENP DGENQ DGENM",
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

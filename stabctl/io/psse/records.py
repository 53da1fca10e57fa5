"""Records of a RAW file with PSS/E's names and defaults."""

from typing import NamedTuple


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
    AREA: int = 0
    ZONE: int = 0
    OWNER: int = 0


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
    COD: int = 0
    TAB: int = 0


class SwitchedShunt(NamedTuple):
    """A switched shunt."""

    I: int
    MODSW: int = 1
    STAT: int = 1
    BINIT: float = 0.0


class Area(NamedTuple):
    """An area; `ISW` is the swing bus that controls its interchange, or 0."""

    I: int
    ISW: int = 0


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

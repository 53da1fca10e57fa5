"""The network of a RAW file as rows of the tables of a case: buses, shunts, lines, loads."""

from collections.abc import Sequence
from typing import Any

from stabctl.model.tables import Branch, Bus, Load

from ..table_builder import ISOLATED, KINDS, POWER_LOW, TableBuilder
from .lexer import Place
from .raw import Raw


class Network(TableBuilder):
    """Rows of the tables of a case while they are collected from a RAW file.

    Attributes
    ----------
    raw : Raw
        The file.
    internal : dict of int to str
        Star buses of transformers and terminals behind step-up transformers, which the file does not number.
    step_up : set of int
        Buses whose generators are behind step-up transformers.
    """

    def __init__(self, raw: Raw) -> None:
        super().__init__(raw.base_mva)
        self.raw = raw
        self.internal: dict[int, str] = {}
        self.step_up: set[int] = set()
        self._numbers: dict[int, Place] = {}
        self._circuits: dict[tuple[frozenset[int], str], Place] = {}
        for bus, place in raw.of("bus"):
            self._bus(bus, place)

    def _bus(self, bus: Any, place: Place) -> None:
        if bus.I in self._numbers:
            raise place.error(f"bus {bus.I} appears twice, first in line {self._numbers[bus.I].line}.", "I")
        self._numbers[bus.I] = place
        if bus.IDE == ISOLATED:
            return
        if bus.IDE not in KINDS:
            raise place.error(f"{bus.IDE} is not a type of bus; it must be 1, 2, 3 or 4.", "IDE")
        labels = (bus.NAME, bus.AREA, bus.ZONE, bus.OWNER)
        self.add("buses", Bus(bus.I, KINDS[bus.IDE], bus.VM, bus.VA, bus.GL, bus.BL, bus.BASKV, *labels), place)

    def new_number(self) -> int:
        """A number that no bus and no machine has."""
        self._next = self._next or 10 ** len(str(max(self._numbers, default=1)))
        return super().new_number()

    def new_bus(self, bus: Bus, what: str, place: Place) -> None:
        """Add a bus that the file does not number."""
        self.internal[bus.bus] = what
        self.add("buses", bus, place)

    def has(self, number: int, place: Place, field: str = "I") -> bool:
        """Whether a bus is in service. Raises `CaseError` if there is no such bus."""
        if number in self.at:
            return True
        if number in self._numbers:
            return False
        raise place.error(f"there is no bus {number}.", field)

    def circuit(self, branch: Branch, place: Place) -> None:
        """Add a branch of the file."""
        key, id = (frozenset((branch.from_bus, branch.to_bus)), branch.circuit), branch.circuit
        if key in self._circuits:
            name, first = f"{branch.from_bus}-{branch.to_bus}", self._circuits[key].line
            self.corrections.append(f"{place}: circuit {id} of {name} is already in line {first}; both are kept.")
        self._circuits.setdefault(key, place)
        self.branch(branch, place)

    def stepped_up(self) -> set[int]:
        """Buses whose generators are behind step-up transformers."""
        return self.step_up


def read(raw: Raw) -> Network:
    """Buses, shunts, lines and loads of a RAW file. Raises `CaseError` with line and field for the first mistake."""
    net = Network(raw)
    for shunt, place in raw.of("shunt"):
        if net.has(shunt.I, place) and shunt.STATUS:
            net.shunt(shunt.I, shunt.GL, shunt.BL)
    for shunt, place in raw.of("switched_shunt"):
        if net.has(shunt.I, place) and shunt.STAT:
            net.shunt(shunt.I, 0.0, shunt.BINIT)
    for k, place in raw.of("branch"):
        i, j = abs(k.I), abs(k.J)  # the sign of a bus number once said where the line is metered
        if net.has(i, place) and net.has(j, place, "J") and k.ST:
            ends = (k.GI, k.BI, k.GJ, k.BJ)
            net.circuit(Branch(i, j, k.R, k.X, k.B, 1.0, 0.0, k.CKT, *ends), place)
    for k, place in raw.of("switch"):
        if net.has(k.I, place) and net.has(k.J, place, "J") and k.STAT:
            net.circuit(Branch(k.I, k.J, 0.0, k.X, circuit=k.CKT), place)
    for load, place in raw.of("load"):
        if net.has(load.I, place) and load.STATUS:
            for row in _loads(load):
                net.add("loads", row, place)
    return net


def _loads(load: Any) -> Sequence[Load]:
    """Its constant power, constant current and constant admittance, each a row if it is not zero."""
    p, q = load.PL, load.QL
    if load.DGENM:
        p, q = p - load.DGENP, q - load.DGENQ
    rows = (
        Load(load.I, p, q, 1.0, 1.0, v_low=POWER_LOW, id=load.ID),
        Load(load.I, load.IP, load.IQ, 0.0, 0.0, 1.0, 1.0, v=1.0, id=load.ID),
        Load(load.I, load.YP, -load.YQ, v=1.0, id=load.ID),
    )
    return [row for row in rows if row.p or row.q]

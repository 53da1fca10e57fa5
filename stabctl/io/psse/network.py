"""The network of a RAW file as rows of the tables of a case, each with its place in the file."""

from collections.abc import Sequence
from typing import Any, Literal

from stabctl.model.tables import Branch, Bus, Load

from .lexer import Place
from .raw import Raw

ISOLATED = 4
KINDS: dict[int, Literal["pq", "pv", "swing"]] = {1: "pq", 2: "pv", 3: "swing"}
NO_IMPEDANCE = 1e-5  # pu   reactance given to a branch without impedance
POWER_LOW = 0.7  # pu   voltage below which PSS/E changes constant-power loads (PQBRAK)


class Network:
    """Rows of the tables of a case while they are collected.

    Attributes
    ----------
    raw : Raw
        The file.
    rows, places : dict
        Rows of every table, and the place of each in the file.
    corrections : list of str
        What was changed, one sentence each.
    joined : list of pairs of int
        Buses joined by a branch without impedance.
    internal : dict of int to str
        Star buses of transformers and terminals behind step-up transformers, which the file does not number.
    step_up : list of int
        Rows of the branches that are step-up transformers of generators.
    """

    def __init__(self, raw: Raw) -> None:
        self.raw = raw
        self.rows: dict[str, list[Any]] = {"buses": [], "branches": [], "machines": [], "loads": []}
        self.places: dict[str, list[Place]] = {table: [] for table in self.rows}
        self.corrections: list[str] = []
        self.joined: list[tuple[int, int]] = []
        self.internal: dict[int, str] = {}
        self.step_up: list[int] = []
        self._at: dict[int, int] = {}  # row of every bus in service
        self._numbers: dict[int, Place] = {}
        self._circuits: dict[tuple[frozenset[int], str], Place] = {}
        for bus, place in raw.of("bus"):
            self._bus(bus, place)
        self._next = 10 ** len(str(max(self._numbers, default=1)))

    def _bus(self, bus: Any, place: Place) -> None:
        if bus.I in self._numbers:
            raise place.error(f"bus {bus.I} appears twice, first in line {self._numbers[bus.I].line}.", "I")
        self._numbers[bus.I] = place
        if bus.IDE == ISOLATED:
            return
        if bus.IDE not in KINDS:
            raise place.error(f"{bus.IDE} is not a type of bus; it must be 1, 2, 3 or 4.", "IDE")
        labels = (bus.NAME, bus.AREA, bus.ZONE, bus.OWNER)
        self._at[bus.I] = len(self._at)
        self.add("buses", Bus(bus.I, KINDS[bus.IDE], bus.VM, bus.VA, bus.GL, bus.BL, bus.BASKV, *labels), place)

    def add(self, table: str, row: Any, place: Place) -> None:
        """Add a row."""
        self.rows[table].append(row)
        self.places[table].append(place)

    def new_number(self) -> int:
        """A number that no bus and no machine has."""
        self._next += 1
        return self._next

    def new_bus(self, bus: Bus, what: str, place: Place) -> None:
        """Add a bus that the file does not number."""
        self._at[bus.bus] = len(self._at)
        self.internal[bus.bus] = what
        self.add("buses", bus, place)

    def bus(self, number: int) -> Bus:
        """The row of a bus in service."""
        return self.rows["buses"][self._at[number]]

    def change(self, number: int, **values: Any) -> None:
        """Change the row of a bus."""
        self.rows["buses"][self._at[number]] = self.bus(number)._replace(**values)

    def has(self, number: int, place: Place, field: str = "I") -> bool:
        """Whether a bus is in service. Raises `CaseError` if there is no such bus."""
        if number in self._at:
            return True
        if number in self._numbers:
            return False
        raise place.error(f"there is no bus {number}.", field)

    def shunt(self, number: int, g: float, b: float) -> None:
        """Add a shunt (MW, Mvar at 1 pu) to a bus."""
        bus = self.bus(number)
        self.change(number, g=bus.g + g, b=bus.b + b)

    def leave_out(self, buses: set[int]) -> None:
        """Remove buses with everything at them."""
        for table, rows in self.rows.items():
            ends = "from_bus" if table == "branches" else "bus"
            kept = [i for i, row in enumerate(rows) if getattr(row, ends) not in buses]
            self.rows[table] = [rows[i] for i in kept]
            self.places[table] = [self.places[table][i] for i in kept]
        self._at = {b.bus: i for i, b in enumerate(self.rows["buses"])}

    def branch(self, branch: Branch, place: Place) -> None:
        """Add a branch; one without impedance gets a small one."""
        ends, id = frozenset((branch.from_bus, branch.to_bus)), branch.circuit
        if (ends, id) in self._circuits:
            first = self._circuits[ends, id].line
            name = f"{branch.from_bus}-{branch.to_bus}"
            self.corrections.append(f"{place}: circuit {id} of {name} is already in line {first}; both are kept.")
        self._circuits.setdefault((ends, id), place)
        if branch.r == 0 and abs(branch.x) <= self.raw.threshold:
            self.joined.append((branch.from_bus, branch.to_bus))
        if branch.r == 0 and abs(branch.x) < NO_IMPEDANCE:
            name = f"{branch.from_bus}-{branch.to_bus} ckt {id}"
            self.corrections.append(f"{place}: {name} has no impedance and gets x = {NO_IMPEDANCE:g} pu.")
            branch = branch._replace(x=NO_IMPEDANCE)
        self.add("branches", branch, place)


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
            net.branch(Branch(i, j, k.R, k.X, k.B, 1.0, 0.0, k.CKT, *ends), place)
    for k, place in raw.of("switch"):
        if net.has(k.I, place) and net.has(k.J, place, "J") and k.STAT:
            net.branch(Branch(k.I, k.J, 0.0, k.X, circuit=k.CKT), place)
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

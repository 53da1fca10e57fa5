"""Tables of a case while a reader fills them, each row with its place in the file."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from stabctl._util.errors import CaseError
from stabctl.model import naming, powerflow, tables
from stabctl.model.case import Case
from stabctl.model.checks import RowError
from stabctl.model.tables import Branch, Bus, ElementKind, OutOfService, Tables

from ._lexer import Place

KINDS: dict[int, Literal["pq", "pv", "swing"]] = {1: "pq", 2: "pv", 3: "swing"}
ISOLATED = 4
NO_IMPEDANCE = 1e-5  # pu on 100 MVA   reactance given to a branch without impedance
POWER_LOW = 0.7  # pu   voltage below which PSS/E changes constant-power loads (PQBRAK)
AT_LIMIT = 0.01  # Mvar   distance from a reactive limit
SAME_VOLTAGE = 1e-4  # pu   distance of the stored voltage from the set-point
SOLVED = 0.01  # pu   power missing at a bus whose stored voltage is a solution
SHOWN = 5  # buses in a sentence
ACTS_ON = {"stabilizer": "exciter", "plant control": "electrical control"}  # role -> role of what it acts on


class TableBuilder:
    """Rows of the tables of a case, and what was decided on the way.

    Attributes
    ----------
    rows, places : dict
        Rows of every table, and the place of each in the file.
    corrections : list of str
        What was changed, one sentence each.
    base_mva : float, MVA
        Base of the system.
    no_impedance : float, pu
        Reactance given to such a branch.
    """

    def __init__(self, base_mva: float) -> None:
        self.base_mva = base_mva
        self.no_impedance = NO_IMPEDANCE * base_mva / 100
        self.rows: dict[str, list[Any]] = {
            table: [] for table in ("buses", "branches", "machines", "loads", "out_of_service")
        }
        self.places: dict[str, list[Any]] = {table: [] for table in self.rows}
        self.corrections: list[str] = []
        self.at: dict[int, int] = {}  # row of every bus in service
        self._next = 0

    def add(self, table: str, row: Any, place: Any) -> None:
        """Add a row."""
        if table == "buses":
            self.at[row.bus] = len(self.at)
        self.rows[table].append(row)
        self.places[table].append(place)

    def leave(
        self, element: ElementKind, place: Any, bus: int, to_bus: int = 0, third_bus: int = 0, id: str = ""
    ) -> None:
        """Keep the name of an element that is out of service."""
        self.add("out_of_service", OutOfService(element, bus, to_bus, third_bus, id), place)

    def new_number(self) -> int:
        """A number that no bus and no machine has."""
        if not self._next:
            self._next = 10 ** len(str(max(self.at, default=1)))
        self._next += 1
        return self._next

    def bus(self, number: int) -> Bus:
        """The row of a bus in service."""
        return self.rows["buses"][self.at[number]]

    def change(self, number: int, **values: Any) -> None:
        """Change the row of a bus."""
        self.rows["buses"][self.at[number]] = self.bus(number)._replace(**values)

    def shunt(self, number: int, g: float, b: float) -> None:
        """Add a shunt (MW, Mvar at 1 pu) to a bus."""
        bus = self.bus(number)
        self.change(number, g=bus.g + g, b=bus.b + b)

    def branch(self, branch: Branch, place: Any) -> None:
        """Add a branch; one without impedance gets a small one."""
        if branch.r == 0 and abs(branch.x) < self.no_impedance:
            name = f"{branch.from_bus}-{branch.to_bus} ckt {branch.circuit}"
            self.corrections.append(f"{place}: {name} has no impedance and gets x = {self.no_impedance:g} pu.")
            branch = branch._replace(x=self.no_impedance)
        self.add("branches", branch, place)

    def drawn(self) -> np.ndarray:
        """Power (MVA) that the network and the loads draw from every bus at the stored voltages."""
        buses, branches, loads = (tuple(self.rows[table]) for table in ("buses", "branches", "loads"))
        network = Tables("", buses, branches, (), {}, loads, base_mva=self.base_mva)
        return powerflow.at_stored_voltages(network)[1] * self.base_mva

    def limited(self, bus: Bus, held: float, units: Sequence[tuple[complex, float, float]], drawn: complex) -> bool:
        """Whether reactive limits keep the generators of a bus from holding a voltage (pu).

        They do if the stored voltage is above it while all produce their least Mvar, or below it while all produce
        their most, and if it is part of a solution: their power is what is drawn from the bus.

        Parameters
        ----------
        bus, held
            The bus, and the voltage.
        units
            Of every generator, what it produces (MVA), and its least and most Mvar.
        drawn
            What the network and the loads draw from the bus (MVA).
        """
        least = all(abs(S.imag - low) <= AT_LIMIT for S, low, _ in units)
        most = all(abs(S.imag - high) <= AT_LIMIT for S, _, high in units)
        beyond = (least and bus.v > held + SAME_VOLTAGE) or (most and bus.v < held - SAME_VOLTAGE)
        solved = abs(drawn - sum(S for S, _, _ in units)) <= SOLVED * self.base_mva
        return bus.kind == "pv" and beyond and solved

    def fix(self, bus: int, noun: str, place: Any) -> None:
        """Make a bus whose generators are limited a pq bus."""
        self.change(bus, kind="pq")
        text = "at their reactive limit in the stored solution, so their reactive power is fixed."
        self.corrections.append(f"{place}: the {noun} at bus {bus} are {text}")

    def leave_out(self, buses: set[int]) -> None:
        """Remove buses with everything at them; of buses and machines, the names are kept."""
        named: dict[str, ElementKind] = {"machines": "machine", "buses": "bus"}
        for table in ("branches", "loads", "machines", "buses"):
            end = "from_bus" if table == "branches" else "bus"
            found = list(zip(self.rows[table], self.places[table], strict=True))
            self.rows[table], self.places[table] = [], []
            for row, place in found:
                if getattr(row, end) not in buses:
                    self.add(table, row, place)
                elif table in named:
                    self.leave(named[table], place, row.bus, id=row.name)
        self.at = {b.bus: i for i, b in enumerate(self.rows["buses"])}

    def idle(self) -> None:
        """Make every bus that has no machine a pq bus."""
        with_machine = {m.bus for m in self.rows["machines"]}
        for bus, place in zip(list(self.rows["buses"]), self.places["buses"], strict=True):
            if bus.kind != "pq" and bus.bus not in with_machine:
                self.change(bus.bus, kind="pq")
                if bus.bus not in self.stepped_up():
                    self.corrections.append(f"{place}: bus {bus.bus} has no machine in service and holds no voltage.")

    def reference(self) -> None:
        """Make the first bus with a voltage set-point the swing bus if there is none."""
        held = [k for k, bus in enumerate(self.rows["buses"]) if bus.kind != "pq"]
        if held and all(self.rows["buses"][k].kind == "pv" for k in held):
            number, place = self.rows["buses"][held[0]].bus, self.places["buses"][held[0]]
            self.change(number, kind="swing")
            text = f"there is no reference bus with a generator; bus {number} becomes it."
            self.corrections.append(f"{place}: {text}")

    def stepped_up(self) -> set[int]:
        """Buses whose machines are behind step-up transformers that the reader added."""
        return set()

    def storage_buses(self) -> None:
        """Give every machine a bus for a storage device: the high-voltage side if only a transformer is at it."""
        joined: dict[int, list[int]] = defaultdict(list)
        for k in self.rows["branches"]:
            line = k.b > 0 and k.tap == 1 and k.phase == 0  # whatever the rated voltages
            for a, b in ((k.from_bus, k.to_bus), (k.to_bus, k.from_bus)):
                joined[a].append(a if line else b)
        for k, m in enumerate(self.rows["machines"]):
            others = set(joined[m.bus])
            if len(others) == 1 and (high := others.pop()) and self.bus(high).rated > self.bus(m.bus).rated > 0:
                self.rows["machines"][k] = m._replace(storage_bus=high)

    def islands(self) -> np.ndarray:
        """The island (from 0) of every bus."""
        ends = np.array([(self.at[k.from_bus], self.at[k.to_bus]) for k in self.rows["branches"]], int).reshape(-1, 2)
        links = sp.csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(self.at),) * 2)
        return connected_components(links, directed=False)[1]

    def settle_islands(self, source: str) -> list[str]:
        """Keep one swing bus in every island, and leave out islands without one; returns a sentence for each."""
        of_bus = {b.bus: int(i) for b, i in zip(self.rows["buses"], self.islands(), strict=True)}
        swing: dict[int, int] = {}
        for bus, place in zip(list(self.rows["buses"]), self.places["buses"], strict=True):
            if bus.kind != "swing":
                continue
            first = swing.setdefault(of_bus[bus.bus], bus.bus)
            if first != bus.bus:
                self.change(bus.bus, kind="pv")
                text = f"bus {bus.bus} is a second swing bus beside {first}; it holds its voltage and stored power."
                self.corrections.append(f"{place}: {text}")
        gone: dict[int, list[int]] = {}
        for number, island in of_bus.items():
            if island not in swing:
                gone.setdefault(island, []).append(number)
        self.leave_out({bus for buses in gone.values() for bus in buses})
        sentences = []
        for buses in gone.values():
            shown = ", ".join(map(str, buses[:SHOWN])) + (
                f" and {len(buses) - SHOWN} more" if len(buses) > SHOWN else ""
            )
            noun = "bus" if len(buses) == 1 else "buses"
            sentences.append(f"{source}: {noun} {shown} left out: not connected to a swing bus.")
        return sentences

    def case(self, path: Path, of_devices: Mapping[str, list[Any]] = MappingProxyType({}), **parts: Any) -> Case:
        """The case with these rows; a mistake in one is reported with its place.

        `of_devices`: places of the rows of device tables; `parts`: what else a case has.
        """
        parts |= {table: tuple(rows) for table, rows in self.rows.items()}
        places = {**self.places, **of_devices}
        try:
            return Case(name=path.stem, **parts)
        except RowError as error:
            at = places.get(error.table, [])
            place = at[error.row] if error.row < len(at) else path
            first = at[error.first] if error.first is not None and error.first < len(at) else place
            text = error.text.replace("{rows}", f"{first} and {place}")
            raise CaseError(f"{place}, {error.column}: {text}") from None
        except CaseError as error:
            raise CaseError(f"{path}: {error}") from None


def without_owner(
    rows: Mapping[str, dict[Any, Any]], places: Mapping[str, list[Place]], names: Mapping[int, str]
) -> list[str]:
    """Leave out the controls that act on a control which has no model: its stabilizers, its plant control."""
    said = []
    for role, owner in ACTS_ON.items():
        known = {naming.number(key) for model in tables.of_role(owner) for key in rows.get(model, {})}
        for model in tables.of_role(role):
            for key, place in zip(list(rows.get(model, ())), list(places.get(model, ())), strict=True):
                if (number := naming.number(key)) not in known:
                    del rows[model][key]
                    places[model].remove(place)
                    said.append(f"{place}: {model} of {names[number]} left out, because its {owner} has no model.")
    return said

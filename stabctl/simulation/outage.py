"""A contingency from the elements that are lost: where its fault is, and what is opened and tripped with it."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from stabctl.model import naming, network, powerflow
from stabctl.model.case import Case
from stabctl.model.tables import Bus

from .contingency import Contingency
from .events import Event, TripMachine

NONE: Mapping[int, complex] = {}


class Element(NamedTuple):
    """A branch with its ends and rows, or a machine or bus with the place of its fault."""

    name: str
    ends: tuple[int, ...]  # the places of a fault
    rows: tuple[int, ...] = ()  # of the branches opened
    machines: tuple[int, ...] = ()

    @property
    def at(self) -> int:
        """The first end."""
        return self.ends[0]


class Outages:
    """The contingencies of a case by the elements that are lost."""

    def __init__(self, case: Case) -> None:
        self.case = case

    @cached_property
    def net(self) -> network.Network:
        """The network before them."""
        return network.build(self.case)

    @cached_property
    def voltage(self) -> np.ndarray:
        """The voltages (pu) before them."""
        return np.abs(powerflow.solve(self.case).V)

    @cached_property
    def loaded(self) -> list[int]:
        """Rows of the buses with a load or the terminal of a link."""
        ends = (end for link in self.case.links for end in (link.from_bus, link.to_bus))
        return sorted({self.case.row_of_bus[bus] for bus in (*(load.bus for load in self.case.loads), *ends)})

    def contingency(
        self,
        fault: int,
        branches: Iterable[int] = (),
        machines: Iterable[int] = (),
        *,
        name: str,
        impedance: complex = 0j,
        after: Iterable[Event] = (),
        events: Iterable[Event] = (),
    ) -> Contingency:
        """A fault at a bus, cleared by opening branches (rows) and tripping machines, and those that are cut off."""
        rows = tuple(dict.fromkeys(branches))
        tripped = dict.fromkeys((*machines, *self.cut_off(rows)))
        trip = tuple(naming.circuit(self.case, row) for row in rows)
        later = (*(TripMachine(self.case.called[number], 0.0) for number in tripped), *after)
        return Contingency(str(fault), trip=trip, impedance=impedance, after=later, events=tuple(events), name=name)

    def cut_off(self, branches: tuple[int, ...]) -> tuple[int, ...]:
        """The machines in parts that opening branches cuts off without a load or link: they feed nothing, and trip."""
        island = network.islands(self.net, network.without(sorted(branches)))
        number = np.bincount(island)  # of buses
        if (left := number[island] == self.whole).all():
            return ()
        fed = left | np.isin(island, [*island[self.loaded], number.argmax()])
        return tuple(m.machine for m in self.case.machines if not fed[self.case.row_of_bus[m.bus]])

    @cached_property
    def whole(self) -> np.ndarray:
        """Number of buses in the island of every bus, before them."""
        island = network.islands(self.net)
        return np.bincount(island)[island]

    @cached_property
    def beside(self) -> dict[int, list[int]]:
        """Rows of the branches at every bus."""
        found: dict[int, list[int]] = {b.bus: [] for b in self.case.buses}
        for row, k in enumerate(self.case.branches):
            for end in {k.from_bus, k.to_bus}:
                found[end].append(row)
        return found

    def of(self, elements: Sequence[Element], name: str, impedance: Mapping[int, complex] = NONE) -> list[Contingency]:
        """A fault at each end of the first element, through an impedance by bus; all of them are lost."""
        rows = [row for one in elements for row in one.rows]
        machines = [number for one in elements for number in one.machines]
        ends = dict.fromkeys(elements[0].ends)
        return [
            self.contingency(
                end,
                rows,
                machines,
                name=f"{name}, fault at bus {end}" if len(ends) > 1 else name,
                impedance=impedance.get(end, 0j),
            )
            for end in ends
        ]

    @cached_property
    def branches(self) -> tuple[Element, ...]:
        """The branches; a transformer with three windings is one, and a step-up inside a machine's record none."""
        found = []
        for row, k in enumerate(self.case.branches):
            star = next((end for end in k[:2] if naming.star(self._bus(end))), None)
            rows = (row,) if star is None else tuple(self.beside[star])
            ends = tuple(end for r in rows for end in self.case.branches[r][:2] if end != star)
            if row == rows[0] and all(self.seen(end) == end for end in ends):
                of_three = "-".join(map(str, ends)) + (
                    f" ckt {naming.quoted(k.circuit)}" if k.circuit not in ("", "1") else ""
                )
                told = str(naming.circuit(self.case, row)) if star is None else of_three
                found.append(Element(f"branch {told}", ends, rows))
        return tuple(found)

    @cached_property
    def machines(self) -> tuple[Element, ...]:
        """The machines, with a fault at the high side of the step-up transformer."""
        return tuple(Element(f"machine {m.called}", (m.storage_bus,), (), (m.machine,)) for m in self.case.machines)

    @cached_property
    def buses(self) -> tuple[Element, ...]:
        """The buses that a file of the network numbers."""
        return tuple(
            Element(
                f"bus {b.bus}",
                (b.bus,),
                tuple(self.beside[b.bus]),
                tuple(m.machine for m in self.case.machines if m.bus == b.bus),
            )
            for b in self.case.buses
            if not naming.internal(b)
        )

    def seen(self, number: int) -> int:
        """The bus itself; for a terminal behind the step-up transformer of a machine's record, the bus of that."""
        return naming.behind(self._bus(number))

    def _bus(self, number: int) -> Bus:
        return self.case.buses[self.case.row_of_bus[number]]

"""Contingencies by the categories of NERC TPL-001-5, Table 1, as far as a case of buses and branches has them.

The faults of P1 and P6 are three-phase, those of P2, P4, P5 and P7 single line to ground (SLG). In the positive
sequence an SLG fault is an impedance Z2 + Z0 to ground. Cases have no data of the other sequences; by convention
Z2 = Z0 = Z1, the Thevenin impedance of the bus, so it is 2 Z1. The numbers of the categories are those of Table 1; they
were not compared word by word with the published text.

    P1    P1.1 machine, P1.2 line, P1.3 transformer, P1.4 shunt: lost after a fault at each end, or at its bus
    P2.2  bus: a fault at it opens all its branches and trips its machines; so do faults inside breakers, P2.3 and P2.4,
          as the arrangement of breakers is not known
    P4    stuck breaker: as P2.2 at every bus with several branches, after a delay; their far ends open then, too
    P5    failure of a relay: as P1 and, P5.5, P2.2, but with SLG faults and after a delay
    P6.1  line: lost after a fault at a bus, where another line at this bus has been open for 5 s
    P7.1  two lines between the same buses: lost together

Not represented: P1.5 and P7.2 (HVDC links are not tripped), P2.1 (there is no fault, hence no clearing time), P3 (needs
another dispatch), and P6 with a transformer or shunt.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from itertools import combinations

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import cycles
from stabctl._util.wording import near
from stabctl.model.case import Case
from stabctl.model.naming import Circuit, circuits
from stabctl.model.short_circuit import impedances
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Open, SwitchShunt
from stabctl.simulation.outage import NONE, Element, Outages

from .screen_result import lines

CATEGORIES = "P1", "P2", "P4", "P5", "P6", "P7"
OPEN_BEFORE = 5.0  # s   that a line of P6 is open before the fault


def contingencies(case: Case, word: str) -> list[Contingency]:
    """The contingencies of a category, `P1`, or with a clearing time of its own, `P4@15cyc`. Raises `StudyError`."""
    name, at, clear = (part.strip() for part in word.partition("@"))
    if name.upper() == "P3":
        raise StudyError(
            "P3 is not represented, because another dispatch follows the loss of a machine; set the power of the "
            "others, as in case.trip_machine(3).set('machines.2.p', '200MW').screen(faults='P1')."
        )
    if name.upper() not in CATEGORIES:
        raise StudyError(f"{shown(word)} is no category of contingencies; {near(name.upper(), CATEGORIES, 'they are')}")
    if at and not cycles(clear, case.frequency_hz) > 0:
        raise StudyError(f"The clearing time of {shown(word)} is not above 0; write {name}@15cyc.")
    found = getattr(_Categories(case), name.lower())()
    return [replace(one, clear=clear) if at else one for one in found]


class _Categories:
    """The contingencies of a case, by category."""

    def __init__(self, case: Case) -> None:
        self.case, self.outages = case, Outages(case)

    def p1(self) -> Iterator[Contingency]:
        return self._single("P1", NONE)

    def p2(self) -> Iterator[Contingency]:
        return self._buses("P2.2", 1)

    def p4(self) -> Iterator[Contingency]:
        return self._buses("P4", 2)

    def p5(self) -> Iterator[Contingency]:
        yield from self._single("P5", self.slg)
        yield from self._buses("P5.5", 1)

    def p6(self) -> Iterator[Contingency]:
        """Two lines at a bus, one after the other; one that alone splits the network is in no pair."""
        here: dict[int, list[Element]] = {}
        for line in self._lines(lines(self.case).bridges):
            for end in line.ends:
                here.setdefault(end, []).append(line)
        for bus, several in here.items():
            for out, lost in ((a, b) for a in several for b in several if a is not b):
                before = Open(self.names[out.rows[0]], 0.0)
                cut = self.outages.cut_off((*out.rows, *lost.rows))
                name = f"P6.1 {_line(lost)} after {_line(out)}, fault at bus {bus}"
                lone = self.outages.contingency(bus, lost.rows, cut, name=name)
                yield replace(lone, at=OPEN_BEFORE, events=(before,))

    def p7(self) -> Iterator[Contingency]:
        """Every two lines between the same buses."""
        for pair in combinations(self._lines(()), 2):
            if {*pair[0].ends} == {*pair[1].ends}:
                yield from self._of(pair, f"P7.1 {_line(pair[0])} and {_line(pair[1])}", self.slg)

    def _single(self, category: str, through: Mapping[int, complex]) -> Iterator[Contingency]:
        """The loss of one element; of equal parallel lines, of the first."""
        known = lines(self.case)
        twins, every = {*known.twins}, {*known.screened, *known.bridges}
        for one in self.outages.machines:
            yield from self._of([one], f"{category}.1 {one.name}", through)
        for of_lines, number in ((True, 2), (False, 3)):
            for one in self.outages.branches:
                circuit = self.names[one.rows[0]]
                if circuit not in twins and (circuit in every) == of_lines:
                    what = _line(one) if of_lines else one.name.replace("branch", "transformer", 1)
                    yield from self._of([one], f"{category}.{number} {what}", through)
        for b in self.case.buses:
            if b.g or b.b:
                name, off = f"{category}.4 shunt at bus {b.bus}", SwitchShunt(b.bus, 0.0, -b.g, -b.b)
                for fault in self._of([Element(name, (b.bus,))], name, through):
                    yield replace(fault, after=(off,))

    def _buses(self, category: str, least: int) -> Iterator[Contingency]:
        """An SLG fault at every bus with so many branches, that opens them."""
        for one in self.outages.buses:
            if len(one.rows) >= least:
                yield from self._of([one], f"{category} {one.name}", self.slg)

    def _of(self, elements: Iterable[Element], name: str, through: Mapping[int, complex]) -> list[Contingency]:
        """The loss of elements; buses that no machine feeds have no SLG fault."""
        found = self.outages.of(list(elements), name, through)
        return [one for one in found if np.isfinite(one.impedance)]

    def _lines(self, without: Iterable[Circuit]) -> list[Element]:
        known = lines(self.case)
        wanted = {*known.screened, *known.twins, *known.bridges} - {*without}
        return [one for one in self.outages.branches if self.names[one.rows[0]] in wanted]

    @cached_property
    def names(self) -> list[Circuit]:
        """The circuit of every branch."""
        return circuits(self.case.branches)

    @cached_property
    def slg(self) -> Mapping[int, complex]:
        """Bus -> impedance of its SLG fault, pu."""
        Z1 = impedances(self.case)[0]
        return {b.bus: complex(2 * max(z.real, 0.0), 2 * z.imag) for b, z in zip(self.case.buses, Z1, strict=True)}


def _line(one: Element) -> str:
    return one.name.replace("branch", "line", 1)

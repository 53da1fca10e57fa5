"""The network of a RAW file as rows: buses, loads, shunts, lines, generators, transformers, DC lines.

Generators become machines, at a terminal of their own behind a step-up transformer. Transformers become branches, with
turns ratios and impedances from their codes CW, CZ and CM; one with three windings becomes a star. Two-terminal DC
lines become injections of the power that their converters draw at the stored voltages. The voltage of a converter is

    Vdc = N (1.35 E cos(angle) - 3/pi Xc I - 2 Rc I),   E = EBAS V TR / TAP,   1.35 short for 3 sqrt(2)/pi,

and its power factor (Vdc + 2 N Rc I) / (1.35 N E). Source: Kundur, Power System Stability and Control, section 10.2.
"""

import cmath
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from stabctl.model.tables import Branch, Bus, Load, Machine

from .._lexer import Place
from .._table_builder import ISOLATED, KINDS, SAME_VOLTAGE, TableBuilder
from .raw import DcLineRecord, Raw, TransformerRecord, Unmodeled
from .records import Converter

OUT = {0: (1, 2, 3), 1: (), 2: (2,), 3: (3,), 4: (1,)}  # STAT -> windings out of service
BLOCKED, POWER, CURRENT = 0, 1, 2  # MDC: control mode of a DC line


class Network(TableBuilder):
    """Rows of the tables of a case while they are collected from a RAW file.

    Attributes
    ----------
    raw : Raw
        The file.
    step_up : set of int
        Buses whose generators are behind step-up transformers.
    """

    def __init__(self, raw: Raw) -> None:
        super().__init__(raw.base_mva)
        self.raw = raw
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
            return self.leave("bus", place, bus.I, id=bus.NAME)
        if bus.IDE not in KINDS:
            raise place.error(f"{bus.IDE} is not a type of bus; it must be 1, 2, 3 or 4.", "IDE")
        labels = (bus.NAME, bus.AREA, bus.ZONE, bus.OWNER)
        self.add("buses", Bus(bus.I, KINDS[bus.IDE], bus.VM, bus.VA, bus.GL, bus.BL, bus.BASKV, *labels), place)

    def new_number(self) -> int:
        """A number that no bus and no machine has."""
        self._next = self._next or 10 ** len(str(max(self._numbers, default=1)))
        return super().new_number()

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
    for shunt, place in _once("shunt", raw.of("shunt")):
        if net.has(shunt.I, place) and shunt.STATUS:
            net.shunt(shunt.I, shunt.GL, shunt.BL)
        else:
            net.leave("shunt", place, shunt.I, id=shunt.ID)
    for shunt, place in raw.of("switched_shunt"):
        if net.has(shunt.I, place) and shunt.STAT:
            net.shunt(shunt.I, 0.0, shunt.BINIT)
        else:
            net.leave("shunt", place, shunt.I)
    for k, place in raw.of("branch"):
        i, j = abs(k.I), abs(k.J)  # the sign of a bus number once said where the line is metered
        if net.has(i, place) and net.has(j, place, "J") and k.ST:
            ends = (k.GI, k.BI, k.GJ, k.BJ)
            net.circuit(Branch(i, j, k.R, k.X, k.B, 1.0, 0.0, k.CKT, *ends), place)
        else:
            net.leave("branch", place, i, j, id=k.CKT)
    for k, place in raw.of("switch"):
        if net.has(k.I, place) and net.has(k.J, place, "J") and k.STAT:
            net.circuit(Branch(k.I, k.J, 0.0, k.X, circuit=k.CKT), place)
        else:
            net.leave("branch", place, k.I, k.J, id=k.CKT)
    for load, place in _once("load", raw.of("load")):
        if net.has(load.I, place) and load.STATUS:
            for row in _loads(load, raw.power_low):
                net.add("loads", row, place)
        else:
            net.leave("load", place, load.I, id=load.ID)
    return net


def _once(noun: str, records: Iterable[tuple[Any, Place]]) -> Iterator[tuple[Any, Place]]:
    """Records of a bus and an identifier. Raises `CaseError` for one that is in service twice."""
    seen: dict[tuple[int, str], Place] = {}
    for one, place in records:
        first = seen.setdefault((one.I, one.ID), place) if one.STATUS else place
        if first is not place:
            raise place.error(f"{noun} {one.I}/{one.ID} appears twice, first in line {first.line}.", "ID")
        yield one, place


def _loads(load: Any, low: float) -> Sequence[Load]:
    """Its constant power, constant current and constant admittance, each a row if it is not zero."""
    p, q = load.PL, load.QL
    if load.DGENM:
        p, q = p - load.DGENP, q - load.DGENQ
    rows = (
        Load(load.I, p, q, 1.0, 1.0, v_low=low, id=load.ID),
        Load(load.I, load.IP, load.IQ, 0.0, 0.0, 1.0, 1.0, v=1.0, id=load.ID),
        Load(load.I, load.YP, -load.YQ, v=1.0, id=load.ID),
    )
    return [row for row in rows if row.p or row.q]


class Source(NamedTuple):
    """What the records of dynamic models need of a generator: its machine and source impedance, pu on MBASE."""

    machine: int
    ra: float
    x: float
    place: Place


def read_generators(net: Network) -> dict[tuple[int, str], Source]:
    """Add the generators in service. Returns them by bus and ID.

    Raises `CaseError` with line and field for the first mistake.
    """
    at: dict[int, list[tuple[Any, Place]]] = defaultdict(list)
    seen: dict[tuple[int, str], Place] = {}
    for g, place in net.raw.of("generator"):
        if (g.I, g.ID) in seen:
            raise place.error(f"machine {g.I}/{g.ID} appears twice, first in line {seen[g.I, g.ID].line}.", "ID")
        seen[g.I, g.ID] = place
        if net.has(g.I, place) and g.STAT:
            at[g.I].append((g, place))
        else:
            net.leave("machine", place, g.I, id=f"{g.I}/{g.ID}")
    found: dict[tuple[int, str], Source] = {}
    drawn = net.drawn()
    for bus, units in at.items():
        _bus_kind(net, bus, units, drawn[net.at[bus]])
        for k, (g, place) in enumerate(units):
            number = net.new_number() if k else bus
            base = g.MBASE or net.raw.base_mva
            terminal = _terminal(net, g, base, place) if g.XT or g.RT else None
            p, q = (g.PG, g.QG) if terminal is None else terminal[1:]
            where = bus if terminal is None else terminal[0]
            net.add("machines", Machine(number, where, base, p, bus, q, f"{bus}/{g.ID}"), place)
            found[bus, g.ID] = Source(number, g.ZR, g.ZX, place)
    net.idle()
    net.storage_buses()
    return found


def _bus_kind(net: Network, bus: int, units: list[tuple[Any, Place]], drawn: complex) -> None:
    """The voltage held at a bus with machines, or that their reactive power is fixed."""
    row, (first, place) = net.bus(bus), units[0]
    if row.kind == "pq":
        return
    held = [g.VS for g, _ in units]
    if max(held) - min(held) > SAME_VOLTAGE:
        net.corrections.append(f"{place}: the machines at bus {bus} have several VS; the first holds: {first.VS:g} pu.")
    if first.IREG not in (0, bus):
        net.corrections.append(
            f"{place}: machine {bus}/{first.ID} regulates bus {first.IREG}; it holds its stored terminal voltage."
        )
    elif net.limited(row, first.VS, [(complex(g.PG, g.QG), g.QB, g.QT) for g, _ in units], drawn):
        net.fix(bus, "machines", place)
    else:
        net.change(bus, v=first.VS)


def _terminal(net: Network, g: Any, base: float, place: Place) -> tuple[int, float, float]:
    """Add the terminal behind a step-up transformer (RT + jXT, GTAP) that delivers PG and QG to the bus.

    Returns its number, and the active and reactive power produced there (MW, Mvar).
    """
    row, system = net.bus(g.I), net.raw.base_mva
    if not g.GTAP > 0:
        raise place.error(f"{g.GTAP:g} is not allowed; it must be more than 0.", "GTAP")
    z = complex(g.RT, g.XT) * system / base
    V = cmath.rect(row.v, math.radians(row.angle)) / g.GTAP
    I = (complex(g.PG, g.QG) / system / V).conjugate()
    behind = V + z * I
    S = behind * I.conjugate() * system
    number, held = net.new_number(), row.kind
    labels = (f"terminal {g.I}/{g.ID}", *row[8:])
    angle = math.degrees(cmath.phase(behind))
    net.add("buses", Bus(number, held, abs(behind), angle, 0.0, 0.0, 0.0, *labels), place)
    net.step_up.add(g.I)
    net.circuit(Branch(g.I, number, z.real, z.imag, 0.0, g.GTAP, circuit=g.ID), place)
    return number, S.real, S.imag


def read_transformers(net: Network) -> None:
    """Add the transformers of a RAW file. Raises `CaseError` with line and field for the first mistake."""
    for t, place in net.raw.of("transformer"):
        for name, allowed in (("CW", (1, 2, 3)), ("CZ", (1, 2, 3)), ("CM", (1, 2)), ("STAT", tuple(OUT))):
            if (code := getattr(t.head, name)) not in allowed:
                choices = ", ".join(map(str, allowed))
                raise place.error(f"{code} is not allowed; it must be one of {choices}.", name)
        for w in t.windings:
            if w.TAB and t.head.STAT:
                net.raw.unmodeled.append(
                    Unmodeled(f"impedance correction table {w.TAB}", f"{t.head.I}-{t.head.J}", place)
                )
        (_three_windings if t.head.K else _two_windings)(net, t, place)


def _two_windings(net: Network, t: TransformerRecord, place: Place) -> None:
    i, j = abs(t.head.I), abs(t.head.J)
    in_service = net.has(i, place) and net.has(j, place, "J") and t.head.STAT
    if not in_service:
        return net.leave("branch", place, i, j, id=t.head.CKT)
    first, second = (_ratio(net, t.head, w, bus, place) for w, bus in zip(t.windings, (i, j), strict=True))
    z = _impedance(net, t.head, place, t.z.R12, t.z.X12, t.z.SBASE12) * second**2
    phase = t.windings[0].ANG - t.windings[1].ANG
    magnetizing = _magnetizing(net, t, i, place)
    net.circuit(
        Branch(i, j, z.real, z.imag, 0.0, first / second, phase, t.head.CKT, magnetizing.real, magnetizing.imag), place
    )


def _three_windings(net: Network, t: TransformerRecord, place: Place) -> None:
    buses = abs(t.head.I), abs(t.head.J), abs(t.head.K)
    inside = [net.has(bus, place, name) for bus, name in zip(buses, "IJK", strict=True)]
    on = [k for k in range(3) if inside[k] and k + 1 not in OUT[t.head.STAT]]
    if not on:
        return net.leave("branch", place, *buses, id=t.head.CKT)
    z = t.z
    pairs = ((z.R12, z.X12, z.SBASE12), (z.R23, z.X23, z.SBASE23), (z.R31, z.X31, z.SBASE31))
    z12, z23, z31 = (_impedance(net, t.head, place, *pair) for pair in pairs)
    star, name = net.new_number(), "-".join(map(str, buses))
    branches = []
    for k, own in enumerate(((z12 + z31 - z23) / 2, (z12 + z23 - z31) / 2, (z23 + z31 - z12) / 2)):
        if k not in on:
            continue
        winding, bus = t.windings[k], buses[k]
        ratio = _ratio(net, t.head, winding, bus, place)
        ends = _magnetizing(net, t, bus, place) if k == 0 else 0j
        values = (0.0, ratio, winding.ANG, t.head.CKT, ends.real, ends.imag)
        branches.append(Branch(bus, star, own.real, own.imag, *values))
    V = _star_voltage(net, branches)
    labels = (f"star {name}", *net.bus(buses[on[0]])[8:])
    net.add("buses", Bus(star, "pq", abs(V), math.degrees(cmath.phase(V)), 0.0, 0.0, 0.0, *labels), place)
    for branch in branches:
        net.circuit(branch, place)


def _star_voltage(net: Network, branches: Sequence[Branch]) -> complex:
    """Voltage of a star point (pu) at which its currents sum to zero. The stored VMSTAR is not always a solution."""
    sources, total = 0j, 0j
    for k in branches:
        y = 1 / (complex(k.r, k.x) or 1j * net.no_impedance)
        bus = net.bus(k.from_bus)
        sources += y * cmath.rect(bus.v / k.tap, math.radians(bus.angle - k.phase))
        total += y
    V = sources / total if total else 1 + 0j
    return V if 0.01 <= abs(V) <= 100 else 1 + 0j


def _ratio(net: Network, head: Any, w: Any, bus: int, place: Place) -> float:
    """Turns ratio of a winding, pu of the base voltage of its bus."""
    if head.CW == 1 or not w.WINDV:
        ratio = w.WINDV or 1.0
    elif head.CW == 2:
        ratio = w.WINDV / _base_kv(net, bus, place, "CW = 2")
    else:
        ratio = w.WINDV * (w.NOMV / _base_kv(net, bus, place, "CW = 3") if w.NOMV else 1.0)
    if not 0.01 <= ratio <= 100:
        raise place.error(
            f"the turns ratio {ratio:g} at bus {bus} is not allowed; it must be from 0.01 to 100.", "WINDV"
        )
    return ratio


def _impedance(net: Network, head: Any, place: Place, r: float, x: float, base: float) -> complex:
    """Impedance between two windings, pu on the system base."""
    system = net.raw.base_mva
    base = base or system
    if not base > 0:
        raise place.error(f"{base:g} MVA is not allowed; it must be more than 0.", "SBASE")
    if head.CZ == 1:
        return complex(r, x)
    if head.CZ == 3:  # r is the load loss in W, x the size of the impedance
        r = r * 1e-6 / base
        if x * x < r * r:
            raise place.error("the load loss gives a resistance above the impedance.", "R")
        x = math.copysign(math.sqrt(x * x - r * r), x)
    return complex(r, x) * system / base


def _magnetizing(net: Network, t: TransformerRecord, bus: int, place: Place) -> complex:
    """Magnetizing admittance at the bus of the first winding, pu on the system base."""
    g, b = t.head.MAG1, t.head.MAG2
    if t.head.CM == 1 or not (g or b):
        return complex(g, b)
    system, nominal = net.raw.base_mva, t.windings[0].NOMV
    g = g * 1e-6 / system  # the no-load loss in W; b is the exciting current on the winding's own base
    size = b * (t.z.SBASE12 or system) / system
    if size < g:
        raise place.error("the no-load loss gives a conductance above the exciting admittance.", "MAG1")
    scale = (_base_kv(net, bus, place, "CM = 2") / nominal) ** 2 if nominal else 1.0
    return scale * complex(g, -math.sqrt(size * size - g * g))


def _base_kv(net: Network, bus: int, place: Place, why: str) -> float:
    kv = net.bus(bus).rated
    if not kv > 0:
        raise place.error(f"bus {bus} has no base voltage (BASKV), which {why} needs.")
    return kv


def read_dc_lines(net: Network) -> None:
    """Add the DC lines of a RAW file. Raises `CaseError` with line and field for the first mistake."""
    for line, place in net.raw.of("dc"):
        if line.head.MDC not in (BLOCKED, POWER, CURRENT):
            raise place.error(f"{line.head.MDC} is not allowed; it must be 0, 1 or 2.", "MDC")
        both = [net.has(end.IP, place, name) for end, name in ((line.rectifier, "IPR"), (line.inverter, "IPI"))]
        if line.head.MDC == BLOCKED or not all(both):
            continue
        current, at_rectifier, at_inverter = _operation(line, place)
        drawn = [
            _drawn(net, line.rectifier, current, at_rectifier),
            _drawn(net, line.inverter, -current, at_inverter),
        ]
        for end, S in zip((line.rectifier, line.inverter), drawn, strict=True):
            if S:
                row = Load(end.IP, S.real, S.imag, 1.0, 1.0, v_low=net.raw.power_low, id=f"DC {line.head.NAME}")
                net.add("loads", row._replace(kind="hvdc"), place)
        reactive = " and ".join(f"{S.imag:.4g}" for S in drawn)
        net.corrections.append(
            f"{place}: DC line {line.head.NAME} is a constant-power injection at buses {line.rectifier.IP} and "
            f"{line.inverter.IP}, {drawn[0].real:.4g} MW drawn and {-drawn[1].real:.4g} MW delivered, with "
            f"{reactive} Mvar drawn."
        )


def _operation(line: DcLineRecord, place: Place) -> tuple[float, float, float]:
    """Current (kA), and voltages at rectifier and inverter (kV)."""
    head = line.head
    if not head.VSCHD > 0:
        raise place.error(f"{head.VSCHD:g} kV is not allowed; it must be more than 0.", "VSCHD")
    at_inverter, rise = head.VSCHD, head.RDC  # the inverter's voltage is VSCHD - RCOMP I, the rectifier's RDC I higher
    drop = head.RCOMP
    if head.MDC == CURRENT:
        current = abs(head.SETVL) / 1000
    else:
        power, slope = abs(head.SETVL), (rise - drop if head.SETVL > 0 else -drop)
        square = at_inverter**2 + 4 * slope * power
        if square < 0:
            raise place.error(f"{power:g} MW cannot be transmitted at {at_inverter:g} kV.", "SETVL")
        current = 2 * power / (at_inverter + math.sqrt(square))
    at_inverter -= drop * current
    return current, at_inverter + rise * current, at_inverter


def _drawn(net: Network, end: Converter, current: float, voltage: float) -> complex:
    """Power (MVA) that a converter draws at a direct current (kA, negative in an inverter) and voltage (kV).

    Its reactive part is 0 if the transformer data do not give the power factor.
    """
    ideal = 3 * math.sqrt(2) / math.pi * end.NB * end.EBAS * net.bus(end.IP).v * end.TR / (end.TAP or 1.0)
    behind = voltage + 2 * end.NB * end.RC * current  # of the commutating resistances
    active = behind * current
    return complex(active, abs(active) * math.tan(math.acos(behind / ideal)) if 0 < behind < ideal else 0.0)

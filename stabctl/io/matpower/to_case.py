"""A case from a MATPOWER file: buses, loads, shunts, branches, DC lines and generators as rows of its tables."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, NamedTuple

from stabctl._util.errors import CaseError, StudyError, shown
from stabctl._util.units import quantity
from stabctl._util.validation import checks_arguments
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Load, Machine
from stabctl.model.typical import POWER_FACTOR, Kind, Known, with_typical_machines

from .._lexer import Place, not_utf8
from .._table_builder import ISOLATED, KINDS, POWER_LOW, TableBuilder
from ..psse.dyr import Unsupported
from . import mpc
from .mpc import Mpc

FREQUENCY = 60.0  # Hz   the file does not hold it
COSTS = ("gencost", "dclinecost", "areas", "gen_name", "branch_name")  # no part of the network


class Import(NamedTuple):
    """What was read from a MATPOWER file.

    Attributes
    ----------
    case : Case
        The system.
    corrections : tuple of str
        What was changed or replaced, one sentence each.
    unsupported : tuple of Unsupported
        Tables that are not modeled.
    known : dict of int to Known
        Kind and rating of every generator, by machine number.
    """

    case: Case
    corrections: tuple[str, ...]
    unsupported: tuple[Unsupported, ...]
    known: dict[int, Known]


@checks_arguments
def read_matpower(
    path: str | Path, *, frequency: float | str = FREQUENCY, machines: Literal["typical"] | None = None
) -> Case:
    """Read a system from a MATPOWER case file (version 2). The file is read as data: no code in it is run.

    Parameters
    ----------
    path : str or Path
        The file, ending in .m.
    frequency : float or str, Hz
        Rated frequency, which the file does not hold: 50 or "50Hz".
    machines : {"typical"}, optional
        Give every generator a typical machine, exciter and governor (see `with_typical_machines`), of the kind that
        mpc.genfuel and mpc.gentype say. Without it the case has no dynamic models: its power flow can be solved.

    Returns
    -------
    Case
        With the bus numbers and names of the file; generators are named 30/1, circuits 7-8 ckt 2. Demands are
        constant-power loads. What was corrected or left out is in its `notes`.

    Raises
    ------
    CaseError
        For the first mistake, with file, line and field.
    StudyError
        If an argument is not allowed.

    Examples
    --------
    >>> case = st.read_matpower("nine.m", frequency=50, machines="typical")
    >>> len(case.buses), case.frequency_hz
    (9, 50.0)
    """
    if machines not in (None, "typical"):
        raise StudyError(f"machines = {shown(machines)} is not allowed; the only choice is typical.")
    found = read(path, frequency=frequency)
    return with_typical_machines(found.case, found.known) if machines else found.case


def read(path: str | Path, *, frequency: float | str = FREQUENCY) -> Import:
    """What `read_matpower` reads without typical machines, with what was corrected and left out."""
    hertz = quantity(frequency, "Hz")
    file = mpc.read(Path(path))
    net = read_network(file)
    apart = net.settle_islands(str(path))
    if not net.rows["machines"]:
        raise CaseError(f"{path}: no generator in service is connected to a reference bus; a case needs one.")
    costs = [name for name in file.unread if name in COSTS]
    said = [f"{path}: not represented: {', '.join(costs)}."] if costs else []
    corrections = (*not_utf8(path), *net.corrections, *_isolated(file), *apart, *said)
    others = {name: place for name, place in file.unread.items() if name not in COSTS}
    unsupported = tuple(Unsupported(f"mpc.{name}", place, "it is not modeled") for name, place in others.items())
    case = net.case(
        Path(path),
        devices={},
        base_mva=file.base_mva,
        frequency_hz=hertz,
        title=f"MATPOWER case {Path(path).stem}",
        source=f"MATPOWER {Path(path).name}",
        notes=(*corrections, *map(str, unsupported)),
    )
    return Import(case, corrections, unsupported, unit_kind(net))


def _isolated(file: Mpc) -> Iterator[str]:
    """A sentence for every bus of type 4 at which something is in service, which is left out with it."""
    used = {g.GEN_BUS for g, _ in file.of("gen") if g.GEN_STATUS > 0}
    used |= {end for k, _ in file.of("branch") if k.BR_STATUS for end in (k.F_BUS, k.T_BUS)}
    for bus, place in file.of("bus"):
        if bus.BUS_TYPE == ISOLATED and (bus.PD or bus.QD or bus.BUS_I in used):
            what = f"bus {bus.BUS_I} is isolated (type 4)"
            yield f"{place}: {what} and left out with what is in service at it, as in MATPOWER."


class Network(TableBuilder):
    """Rows of the tables of a case while they are collected from a MATPOWER file.

    Attributes
    ----------
    file : Mpc
        The file.
    row_of : dict of int to int
        Row of mpc.gen (from 0) of every machine.
    """

    def __init__(self, file: Mpc) -> None:
        super().__init__(file.base_mva)
        self.file = file
        self.row_of: dict[int, int] = {}
        self._lines: dict[int, Place] = {}
        names = file.labels.get("bus_name", [""] * len(file.tables["bus"]))
        for (bus, place), name in zip(file.of("bus"), names, strict=True):
            self._bus(bus, name, place)

    def _bus(self, bus: mpc.Bus, name: str, place: Place) -> None:
        if bus.BUS_I in self._lines:
            raise place.error(f"bus {bus.BUS_I} appears twice, first in line {self._lines[bus.BUS_I].line}.", "BUS_I")
        self._lines[bus.BUS_I] = place
        if bus.BUS_TYPE == ISOLATED:
            return self.leave("bus", place, bus.BUS_I, id=name)
        if bus.BUS_TYPE not in KINDS:
            raise place.error(f"{bus.BUS_TYPE} is not a type of bus; it must be 1, 2, 3 or 4.", "BUS_TYPE")
        voltage = (bus.VM, bus.VA, bus.GS, bus.BS, bus.BASE_KV)
        self.add("buses", Bus(bus.BUS_I, KINDS[bus.BUS_TYPE], *voltage, name, bus.BUS_AREA, bus.ZONE), place)
        if bus.PD or bus.QD:
            self.add("loads", Load(bus.BUS_I, bus.PD, bus.QD, 1.0, 1.0, v_low=POWER_LOW, id="1"), place)

    def new_number(self) -> int:
        """A number that no bus and no machine has."""
        self._next = self._next or 10 ** len(str(max(self._lines, default=1)))
        return super().new_number()

    def has(self, number: int, place: Place, field: str) -> bool:
        """Whether a bus is in service. Raises `CaseError` if there is no such bus."""
        if number not in self._lines:
            raise place.error(f"there is no bus {number}.", field)
        return number in self.at


def read_network(file: Mpc) -> Network:
    """The network of a MATPOWER file. Raises `CaseError` with line and field for the first mistake."""
    net = Network(file)
    _branches(net)
    _dc_lines(net)
    _generators(net)
    net.idle()
    net.reference()
    net.storage_buses()
    return net


def _branches(net: Network) -> None:
    """Lines and transformers; circuits between two buses are numbered from 1, those out of service included."""
    count: Counter[frozenset[int]] = Counter()
    for k, place in net.file.of("branch"):
        ends = frozenset((k.F_BUS, k.T_BUS))
        count[ends] += 1
        there = net.has(k.F_BUS, place, "F_BUS"), net.has(k.T_BUS, place, "T_BUS")
        if all(there) and k.BR_STATUS:
            row = Branch(k.F_BUS, k.T_BUS, k.BR_R, k.BR_X, k.BR_B, k.TAP or 1.0, k.SHIFT, str(count[ends]))
            net.branch(row, place)
        else:
            net.leave("branch", place, k.F_BUS, k.T_BUS, id=str(count[ends]))


def _dc_lines(net: Network) -> None:
    """DC lines as injections: PF is drawn at the from bus, PF - (LOSS0 + LOSS1 PF) is delivered at the to bus."""
    for k, (line, place) in enumerate(net.file.of("dcline"), 1):
        there = net.has(line.F_BUS, place, "F_BUS"), net.has(line.T_BUS, place, "T_BUS")
        if not line.BR_STATUS or not all(there):
            continue
        delivered = line.PF - (line.LOSS0 + line.LOSS1 * line.PF)
        for bus, p, q in ((line.F_BUS, line.PF, -line.QF), (line.T_BUS, -delivered, -line.QT)):
            if p or q:
                net.add("loads", Load(bus, p, q, 1.0, 1.0, v_low=POWER_LOW, id=f"DC {k}", kind="hvdc"), place)
        net.corrections.append(
            f"{place}: the DC line from {line.F_BUS} to {line.T_BUS} is a constant-power injection at its ends, "
            f"{line.PF:.4g} MW drawn and {delivered:.4g} MW delivered; MATPOWER leaves it out without toggle_dcline."
        )


def _generators(net: Network) -> None:
    """Generators in service as machines; dispatchable loads as loads."""
    at: dict[int, list[tuple[mpc.Gen, Place]]] = defaultdict(list)
    count: Counter[int] = Counter()
    for row, (g, place) in enumerate(net.file.of("gen")):
        count[g.GEN_BUS] += 1
        id, dispatchable = str(count[g.GEN_BUS]), g.PMIN < 0 and g.PMAX == 0
        if not net.has(g.GEN_BUS, place, "GEN_BUS") or g.GEN_STATUS <= 0:
            called = f"G{id}" if dispatchable else f"{g.GEN_BUS}/{id}"
            net.leave("load" if dispatchable else "machine", place, g.GEN_BUS, id=called)
            continue
        if dispatchable:
            if g.PG or g.QG:
                net.add("loads", Load(g.GEN_BUS, -g.PG, -g.QG, 1.0, 1.0, v_low=POWER_LOW, id=f"G{id}"), place)
            said = f"the dispatchable load at bus {g.GEN_BUS} is a constant-power load"
            if net.bus(g.GEN_BUS).kind != "pq":
                said += "; in MATPOWER it also holds the voltage of the bus, at VG"
            net.corrections.append(f"{place}: {said}.")
            continue
        number = net.new_number() if at[g.GEN_BUS] else g.GEN_BUS
        base = g.MBASE if g.MBASE > 0 else net.file.base_mva
        machine = Machine(number, g.GEN_BUS, base, g.PG, g.GEN_BUS, g.QG, f"{g.GEN_BUS}/{id}")
        at[g.GEN_BUS].append((g, place))
        net.add("machines", machine, place)
        net.row_of[number] = row
    drawn = net.drawn()
    for bus, units in at.items():
        _voltage(net, bus, [g for g, _ in units], drawn[net.at[bus]], units[-1][1])


def _voltage(net: Network, bus: int, units: list[mpc.Gen], drawn: complex, place: Place) -> None:
    """The voltage held at a bus: VG of its last generator, as in MATPOWER; or that their reactive power is fixed."""
    row, held = net.bus(bus), units[-1].VG
    if row.kind == "pq":
        return
    if net.limited(row, held, [(complex(g.PG, g.QG), g.QMIN, g.QMAX) for g in units], drawn):
        net.fix(bus, "generators", place)
        return
    net.change(bus, v=held)
    if len({g.VG for g in units}) > 1:
        net.corrections.append(
            f"{place}: the generators at bus {bus} have different VG; that of the last is used, {held:g} pu."
        )


# Kinds of generators by the fuel and type that some files give (genfuels and gentypes of MATPOWER).
FUELS: dict[str, Kind] = {
    "nuclear": "nuclear",
    "hydro": "hydro",
    "hydrops": "hydro",
    "ng": "gas",
    "wind": "converter",
    "solar": "converter",
    "ess": "converter",
    "battery": "converter",
    "coal": "steam",
    "biomass": "steam",
    "geothermal": "steam",
    "refuse": "steam",
    "wood": "steam",
}
TYPES: dict[str, Kind] = {
    "HY": "hydro",
    "PS": "hydro",
    "GT": "gas",
    "CT": "gas",
    "IC": "gas",
    "JE": "gas",
    "ST": "steam",
    "CA": "steam",
    "WT": "converter",
    "WS": "converter",
    "PV": "converter",
    "BA": "converter",
    "SC": "condenser",
}


def unit_kind(net: Network) -> dict[int, Known]:
    """What the file says about every machine, by its number."""
    fuels, types = (net.file.labels.get(name, []) for name in ("genfuel", "gentype"))
    found = {}
    for number, row in net.row_of.items():
        g = net.file.tables["gen"][row][0]
        of_fuel = FUELS.get(fuels[row].lower()) if fuels else None
        of_type = TYPES.get(types[row].upper()) if types else None
        kind = of_type if of_fuel in (None, "gas", "steam") and of_type else of_fuel
        found[number] = Known(kind or ("steam" if g.PMAX > 0 else None), _rating(g, net.file.base_mva))
    return found


def _rating(g: mpc.Gen, base_mva: float) -> float:
    """MBASE, unless it is left at the base of the system; then what PMAX needs at the usual power factor."""
    if g.MBASE not in (0, base_mva):
        return max(g.MBASE, 0.0)
    return g.PMAX / POWER_FACTOR if 0 < g.PMAX < math.inf else 0.0

"""Unusual data: values outside the ranges of `usual_values.csv`, and values that do not fit the others of their case.

They are legal and used as given. A wrong unit or base is a factor of 10 to 1000, which leaves the range of the value
itself, of a ratio that no base changes (x1d/xd, H*x1d), of the values of the same parameter in the same case, or of the
power flow. Where the file holds a solved power flow, a wrong branch, load or dispatch leaves power at its buses.
"""

import csv
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.errors import PowerFlowError
from stabctl._util.schema import fields
from stabctl._util.tabular import Tabular
from stabctl._util.wording import counted, enumerated

from . import naming, network, powerflow, tables
from .case import Case, as_case

if TYPE_CHECKING:
    import pandas as pd

TABLE = Path(__file__).with_name("usual_values.csv")
LIKE = ("exciter", "governor", "stabilizer")  # roles whose devices are compared with each other
ALONE = 6.0  # factor between a value and the nearest of the other values of the same parameter
SURGE = 2.2  # the same for surge impedances of lines of one rated voltage
FEWEST_ALIKE = 3  # values that are compared
NOUNS = {"buses": "bus", "branches": "branch", "loads": "load"}  # of other tables: machine
IDEAL = 1e-4  # pu   transient reactance up to which a machine is an ideal voltage source
UNBALANCED = 0.05  # of the power that passes through a bus; of the base below 1 pu
MOST_UNBALANCED, FEWEST_BUSES = 3, 6  # more buses out of balance, or fewer buses: the voltages are no solution


class Usual(NamedTuple):
    """One row of `usual_values.csv`: what is usual for a quantity.

    Attributes
    ----------
    of : str
        A table, a device model, or a role of device models.
    quantity : str
        A column, a product or ratio of two columns, or a quantity that is computed.
    low, high : float
        The usual range.
    unit : str
        Unit of the quantity, empty if it has none.
    but : tuple of float
        Values outside that have a meaning of their own, such as 0 for an open circuit.
    likely : str
        The likely mistake.
    """

    of: str
    quantity: str
    low: float
    high: float
    unit: str
    but: tuple[float, ...]
    likely: str

    def value(self, row: Mapping[str, float]) -> float | None:
        """The quantity of a row; None if the row does not have it."""
        over, _, under = self.quantity.partition("/")
        names = (*over.split("*"), *((under,) if under else ()))
        if any(name not in row for name in names) or (under and not row[under]):
            return None
        return math.prod(row[name] for name in over.split("*")) / (row[under] if under else 1.0)

    @property
    def parts(self) -> frozenset[str]:
        """The columns of which it consists."""
        return frozenset(self.quantity.replace("*", "/").split("/"))


@cache
def usual() -> tuple[Usual, ...]:
    """The rows of `usual_values.csv`, one for each quantity."""
    with TABLE.open(newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    computed = (*NOUNS, "machines")
    return tuple(
        Usual(
            row["of"], quantity, float(row["low"]), float(row["high"]), row["unit"],
            tuple(map(float, row["but"].split())), row["likely"],
        )
        for row in rows
        for quantity in ([row["quantities"]] if row["of"] in computed else row["quantities"].split())
    )  # fmt: skip


class Finding(NamedTuple):
    """An unusual value.

    Attributes
    ----------
    table : str
        Table of the case.
    object : str
        What it belongs to: machine 30/1, branch 7-8, bus 7.
    quantity, unit : str
        Its column, or how it is computed from columns, and its unit.
    value, low, high : float
        The value and the usual range.
    likely : str
        The likely mistake.
    """

    table: str
    object: str
    quantity: str
    value: float
    unit: str
    low: float
    high: float
    likely: str


@dataclass(frozen=True, repr=False, eq=False)
class UnusualData(Tabular):
    """The unusual data of a case.

    Attributes
    ----------
    name : str
        Name of the case.
    findings : tuple of Finding
        The unusual values; none if everything is usual.
    """

    name: str
    findings: tuple[Finding, ...]

    def __len__(self) -> int:
        return len(self.findings)

    @property
    def df(self) -> "pd.DataFrame":
        """One row per unusual value."""
        import pandas as pd

        return pd.DataFrame(self.findings, columns=list(Finding._fields))

    def plain(self) -> dict[str, Any]:
        """As a dictionary of numbers, texts and lists, as `stabctl check --json` prints it."""
        return {"case": self.name, "unusual": [found._asdict() for found in self.findings]}

    def told(self, case: str) -> str:
        """The line about them in other commands; empty if there are none."""
        return f"{counted(len(self), 'unusual value')}: stabctl check {case}" if self.findings else ""

    def sentences(self) -> list[str]:
        """One sentence for the values of all objects with the same quantity, range and likely mistake."""
        alike: dict[tuple[Any, ...], list[Finding]] = defaultdict(list)
        for found in self.findings:
            alike[found.table, found.quantity, found.low, found.high, found.likely].append(found)
        return [_sentence(together) for together in alike.values()]

    def __str__(self) -> str:
        if not self.findings:
            return f"{self.name}: no unusual values."
        return "\n".join((f"{self.name}: {counted(len(self), 'unusual value')}.", *self.sentences()))


def _sentence(alike: list[Finding]) -> str:
    first, values = alike[0], sorted(found.value for found in alike)
    size = f"{values[0]:.4g}" if values[0] == values[-1] else f"{values[0]:.4g} to {values[-1]:.4g}"
    unit = f" {first.unit}" if first.unit else ""
    noun = first.object.partition(" ")[0]
    owners = enumerated(noun, (found.object.partition(" ")[2] for found in alike))
    return f"{first.table}, {owners}: {first.quantity} = {size}{unit}, usually {_range(first)}{unit}; {first.likely}"


def _range(found: Finding) -> str:
    if found.low == found.high:
        return f"{found.low:.4g}"
    return f"{found.low:.4g} to {found.high:.4g}"


def check(base: Any, *, balance: bool = True) -> UnusualData:
    """Find unusual data: values that are legal, but far from what is usual for their quantity or in their case.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    balance : bool
        Also look for buses whose power does not balance at the voltages of the bus table, if these are a solved power
        flow. Not useful for a case whose loads or dispatch were changed on purpose.

    Returns
    -------
    UnusualData

    Examples
    --------
    >>> st.load("two_area").set("genrou.1.H", 1500).check()
    """
    case = as_case(base)
    found = [f for table, rows in _rows(case).items() for f in _outside(table, rows)]
    found += [f for alone in (_unlike(case), _surge(case)) for f in alone if _new(f, found)]
    found += _unbalanced(case) if balance else ()
    return UnusualData(case.name, tuple(found))


def _new(finding: Finding, known: Iterable[Finding]) -> bool:
    return all((finding.object, finding.quantity) != (one.object, one.quantity) for one in known)


Rows = dict[str, dict[str, float]]  # object -> quantities


def _rows(case: Case) -> dict[str, Rows]:
    """Table -> rows with what can be compared; infinite machines are left out."""
    found: dict[str, Rows] = {model: _devices(case, model) for model in case.devices}
    return found | _network(case)


def _devices(case: Case, model: str) -> Rows:
    noun = {"load": "load", "shunt": "bus"}.get(tables.role(model), "machine")
    rows = case.devices[model].items()
    infinite = _infinite(case)
    return {
        f"{noun} {key if noun != 'machine' else case.machine(naming.number(key)).called}": par._asdict()
        for key, par in rows
        if noun != "machine" or naming.number(key) not in infinite
    }


def _infinite(case: Case) -> frozenset[int]:
    """Machines that stand for an infinite bus: no inertia constant, or next to no reactance."""
    rows = (row for model in tables.of_role("machine") for row in case.devices.get(model, {}).items())
    return frozenset(naming.number(key) for key, par in rows if par.H == 0 or par.x1d <= IDEAL)


def _network(case: Case) -> dict[str, Rows]:
    """Rows of buses, branches, machines and loads, with what the power flow says if it has a solution."""
    buses = {f"bus {b.bus}": {"v": b.v} for b in case.buses}
    star = {b.bus for b in case.buses if b.name.startswith("star ")}
    names = naming.circuit_names(case.branches)
    branches: Rows = {}
    for name, k in zip(names, case.branches, strict=True):
        row = {"r": k.r, "x": abs(k.x), "b": k.b, "tap": k.tap}
        branches[f"branch {name}"] = {"tap": k.tap} if {k.from_bus, k.to_bus} & star else row
    machines = {f"machine {m.called}": row for m, row in zip(case.machines, _units(case), strict=True)}
    ratings = sum(m.base for m in case.machines)
    rated = bool(case.devices) and not _infinite(case) and any(m.base != case.base_mva for m in case.machines)
    loads = zip(naming.keys(case, "loads"), case.loads, strict=True)
    shares = {f"load {key}": {"share of all ratings": load.p / ratings} for key, load in loads if rated}
    try:
        flow = powerflow.solve(case)
    except PowerFlowError:
        return {"buses": buses, "branches": branches, "machines": machines, "loads": shares}
    net = network.build(case)
    for row, V in zip(buses.values(), flow.V, strict=True):
        row["solved voltage"] = float(abs(V))
    across = np.abs(np.angle(flow.V[net.frm] / net.ratio / flow.V[net.to], deg=True))
    for row, angle in zip(branches.values(), across, strict=True):
        row["angle across it"] = float(angle)
    for row, S, m in zip(machines.values(), flow.S, case.machines, strict=True):
        if "loading" in row:
            row["loading"] = float(abs(S)) * case.base_mva / m.base
    return {"buses": buses, "branches": branches, "machines": machines, "loads": shares}


def _units(case: Case) -> Iterator[dict[str, float]]:
    """Loading of every machine with a model, and x of its transformer; a base that is that of the system is no rating."""
    models = tables.of_role(*tables.UNIT_ROLES)
    modeled = {naming.number(key) for model in models for key in case.devices.get(model, {})}
    infinite, at = _infinite(case), defaultdict(list)
    for k in case.branches:
        at[k.from_bus].append(k)
        at[k.to_bus].append(k)
    for m in case.machines:
        row: dict[str, float] = {}
        if m.machine in modeled - infinite:
            if m.base != case.base_mva:
                row["loading"] = abs(m.p) / m.base
            if len(at[m.bus]) == 1:
                row["x of its transformer"] = at[m.bus][0].x * m.base / case.base_mva
        yield row


def _outside(table: str, rows: Rows) -> Iterator[Finding]:
    """Values outside their range; of a product or ratio only if none of its columns is outside by itself."""
    role = tables.role(table) if table in tables.models() else ""
    rules = [rule for rule in usual() if rule.of in (table, role)]
    for object, row in rows.items():
        named: set[str] = set()
        for rule in sorted(rules, key=lambda rule: len(rule.parts)):
            value = rule.value(row)
            if value is None or rule.low <= value <= rule.high or value in rule.but or named & rule.parts:
                continue
            named |= rule.parts
            yield Finding(table, object, rule.quantity, value, rule.unit, rule.low, rule.high, rule.likely)


def _unlike(case: Case) -> Iterator[Finding]:
    """Values of a parameter far from those of all other devices of the same model."""
    for model in case.devices:
        if tables.role(model) not in LIKE:
            continue
        rows = _devices(case, model)
        for f in fields(tables.models()[model].Par).values():
            if f.kind is float:
                unit = "" if f.unit == "-" else f.unit
                yield from _alone(model, f.name, unit, {o: row[f.name] for o, row in rows.items()}, ALONE)


def _surge(case: Case) -> Iterator[Finding]:
    """Lines whose surge impedance is far from that of all others of their rated voltage."""
    rated = {b.bus: b.rated for b in case.buses}
    groups: dict[float, dict[str, float]] = defaultdict(dict)
    for name, k in zip(naming.circuit_names(case.branches), case.branches, strict=True):
        if k.x > 0 and k.b > 0 and rated[k.from_bus] == rated[k.to_bus]:
            groups[rated[k.from_bus]][f"branch {name}"] = math.sqrt(k.x / k.b)
    for values in groups.values():
        yield from _alone("branches", "surge impedance sqrt(x/b)", "pu", values, SURGE)


def _alone(table: str, quantity: str, unit: str, values: Mapping[str, float], factor: float) -> Iterator[Finding]:
    """The largest and the smallest of at least three values, if it is that far from the nearest other one."""
    order = sorted((v, o) for o, v in values.items() if v > 0)
    if len(order) < FEWEST_ALIKE:
        return
    for (value, object), nearest, farthest in ((order[-1], order[-2], order[0]), (order[0], order[1], order[-1])):
        ratio = value / nearest[0]
        if max(ratio, 1 / ratio) >= factor:
            low, high = sorted((nearest[0], farthest[0]))
            likely = f"the others of this case have {low:.4g}" + (f" to {high:.4g}" if high > low else "")
            yield Finding(table, object, quantity, value, unit, low, high, likely)


def _unbalanced(case: Case) -> Iterator[Finding]:
    """Buses with a mismatch of active power where the voltages of all others are a solved power flow."""
    n = len(case.buses)
    angles = np.deg2rad([b.angle for b in case.buses])
    if n < FEWEST_BUSES or np.ptp(angles) == 0:
        return
    net = network.build(case)
    V = np.array([b.v for b in case.buses]) * np.exp(1j * angles)
    Y = network.admittance(net)
    drawn = powerflow.demand(case).real
    made = np.zeros(n)
    np.add.at(made, net.machine_bus, np.array([m.p for m in case.machines]) / case.base_mva)
    mismatch = (V * (Y @ V).conj()).real + drawn - made
    flow = powerflow.PowerFlow(case, V, np.zeros(len(case.machines)), 0).branch_power.real
    passing = np.abs(drawn) + np.abs(made)
    for k, end in enumerate((net.frm, net.to)):
        np.add.at(passing, end, np.abs(flow[:, k]))
    limit = np.maximum(UNBALANCED * passing / 2, 0.01)
    limit[[b.kind == "swing" for b in case.buses]] = np.inf
    out = np.flatnonzero(np.abs(mismatch) > limit)
    if len(out) > MOST_UNBALANCED:
        return
    for i in out.tolist():
        size = float(mismatch[i]) * case.base_mva
        likely = "is r or x of a branch there, a load or a dispatch in another unit?"
        yield Finding("buses", f"bus {case.buses[i].bus}", "mismatch at stored voltages", size, "MW", 0.0, 0.0, likely)

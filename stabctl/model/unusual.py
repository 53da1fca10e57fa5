"""Unusual data: values outside the ranges of `usual_values.csv`, and values that do not fit the others of their case.

They are legal and used as given. A wrong unit or base leaves the range of the value itself, of a ratio that no base
changes (x1d/xd, H*x1d), of the same parameter of the other devices, or of the power flow. If the voltages of the bus
table are a solved power flow, a wrong branch, load or dispatch leaves power at its buses.
"""

import csv
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import suppress
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
IDEAL = 1e-4  # pu   transient reactance up to which a machine is an ideal voltage source
UNBALANCED, LEAST = 0.05, 0.01  # mismatch: of the power that passes through a bus; pu
MOST_UNBALANCED, FEWEST_BUSES = 3, 6  # more buses out of balance, or fewer buses: the voltages are no solution
NEAR_BUS = "is r, x or b of a branch there, a shunt, a load or a dispatch in another unit?"
Rows = dict[str, dict[str, float]]  # object, such as machine 30/1 -> quantities


class Usual(NamedTuple):
    """What is usual for a quantity: a row of `usual_values.csv`, with its columns."""

    of: str
    quantity: str
    low: float
    high: float
    unit: str
    but: tuple[float, ...]
    likely: str

    @property
    def columns(self) -> list[str]:
        """The columns of which it consists, the divisor last."""
        return self.quantity.replace("*", "/").split("/")

    def value(self, row: Mapping[str, float]) -> float:
        """The quantity of a row; NaN if the row does not have it."""
        parts = [row.get(name, math.nan) for name in self.columns]
        if "/" in self.quantity:
            return parts[0] / parts[1] if parts[1] else math.nan
        return math.prod(parts)


@cache
def usual() -> tuple[Usual, ...]:
    """The rows of `usual_values.csv`, one for each quantity; those of one column first."""
    found = []
    with TABLE.open(newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            but = tuple(map(float, row["but"].split()))
            rest = float(row["low"]), float(row["high"]), row["unit"], but, row["likely"]
            found += [Usual(row["of"], name, *rest) for name in row["quantities"].split("; ")]
    return tuple(sorted(found, key=lambda one: len(one.columns)))


class Finding(NamedTuple):
    """An unusual value.

    Attributes
    ----------
    table, object : str
        Table of the case, and what the value belongs to: machine 30/1, branch 7-8, bus 7.
    quantity, unit : str
        Its column, or how it is computed, and its unit.
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
        The unusual values.

    Examples
    --------
    >>> found = st.load("two_area").set("genrou.1.H", 1500).check()
    >>> found.df[["table", "object", "quantity", "value"]]
        table     object quantity   value
    0  genrou  machine 1        H  1500.0
    """

    name: str
    findings: tuple[Finding, ...]

    @property
    def df(self) -> "pd.DataFrame":
        """One row per unusual value."""
        import pandas as pd

        return pd.DataFrame(self.findings, columns=list(Finding._fields))

    def plain(self) -> dict[str, Any]:
        """As a dictionary of numbers, texts and lists, as `stabctl check --json` prints it."""
        return {"case": self.name, "unusual": [found._asdict() for found in self.findings]}

    def told(self, case: str) -> str:
        """The line about them in other commands; empty if there are none.

        Parameters
        ----------
        case : str
            The case as `stabctl check` takes it.

        Examples
        --------
        >>> st.load("two_area").set("genrou.1.H", 1500).check().told("two_area")
        '1 unusual value: stabctl check two_area'
        """
        return f"{counted(len(self.findings), 'unusual value')}: stabctl check {case}" if self.findings else ""

    def sentences(self) -> list[str]:
        """One sentence for the values of all objects with the same quantity, range and likely mistake."""
        alike: dict[tuple[Any, ...], list[Finding]] = defaultdict(list)
        for found in self.findings:
            alike[found._replace(object="", value=0.0)].append(found)
        return [_sentence(together) for together in alike.values()]

    def __str__(self) -> str:
        head = counted(len(self.findings), "unusual value") if self.findings else "no unusual values"
        return "\n".join((f"{self.name}: {head}.", *self.sentences()))


def _sentence(alike: list[Finding]) -> str:
    first, values = alike[0], [found.value for found in alike]
    unit = f" {first.unit}" if first.unit else ""
    owners = enumerated(first.object.partition(" ")[0], (found.object.partition(" ")[2] for found in alike))
    size, usually = _range(min(values), max(values)), _range(first.low, first.high)
    return f"{first.table}, {owners}: {first.quantity} = {size}{unit}, usually {usually}{unit}; {first.likely}"


def _range(low: float, high: float) -> str:
    return " to ".join(dict.fromkeys((f"{low:.4g}", f"{high:.4g}")))


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
    >>> print(st.load("two_area").set("genrou.1.H", 1500).check())
    two_area: 1 unusual value.
    genrou, machine 1: H = 1500 s, usually 1 to 30 s; is it on the base of the system, or stored energy in MW s?
    """
    case = as_case(base)
    rows = {model: _devices(case, model) for model in case.devices} | _network(case)
    found = [f for table, of in rows.items() for f in _outside(table, of)]
    known = {(f.object, f.quantity) for f in found}
    found += [f for f in _unlike(case) if (f.object, f.quantity) not in known]
    return UnusualData(case.name, (*found, *(_unbalanced(case) if balance else ())))


def _outside(table: str, rows: Rows) -> Iterator[Finding]:
    """Values outside their range; of a product or ratio only if none of its columns is outside by itself."""
    role = tables.role(table) if table in tables.models() else ""
    rules = [rule for rule in usual() if rule.of in (table, role)]
    for object, row in rows.items():
        named: set[str] = set()
        for rule in rules:
            value = rule.value(row)
            outside = value < rule.low or value > rule.high
            if outside and value not in rule.but and not named & {*rule.columns}:
                named |= {*rule.columns}
                yield Finding(table, object, rule.quantity, value, rule.unit, rule.low, rule.high, rule.likely)


def _devices(case: Case, model: str) -> Rows:
    """Parameters of the devices of a model; machines that stand for infinite buses are left out."""
    noun, left = {"load": "load", "shunt": "bus"}.get(tables.role(model), "machine"), _infinite(case)
    if noun != "machine":
        return {f"{noun} {key}": par._asdict() for key, par in case.devices[model].items()}
    rows = ((naming.number(key), par) for key, par in case.devices[model].items())
    return {f"machine {case.machine(number).called}": par._asdict() for number, par in rows if number not in left}


def _infinite(case: Case) -> frozenset[int]:
    """Machines that stand for an infinite bus: no inertia constant, or next to no reactance."""
    rows = (row for model in tables.of_role("machine") for row in case.devices.get(model, {}).items())
    return frozenset(naming.number(key) for key, par in rows if not par.H or par.x1d <= IDEAL)


def _network(case: Case) -> dict[str, Rows]:
    """Rows of buses, branches, machines with a model, and loads, with what the power flow says if it has a solution."""
    V, S = np.full(len(case.buses), np.nan, complex), np.array([m.p for m in case.machines]) / case.base_mva
    with suppress(PowerFlowError):
        flow = powerflow.solve(case)
        V, S = flow.V, flow.S
    net, star = network.build(case), {b.bus for b in case.buses if naming.star(b)}
    voltages = zip(case.buses, np.abs(V).tolist(), strict=True)
    found: dict[str, Rows] = {"buses": {f"bus {b.bus}": {"v": b.v, "solved voltage": v} for b, v in voltages}}
    across = np.abs(np.angle(V[net.frm] / net.ratio * V[net.to].conj(), deg=True)).tolist()
    found["branches"], at = {}, defaultdict(list)
    for name, k, angle in zip(naming.circuits(case.branches), case.branches, across, strict=True):
        of_star = {"r": math.nan, "x": math.nan} if {k.from_bus, k.to_bus} & star else {}
        row = {"r": k.r, "x": abs(k.x), "b": k.b, "tap": k.tap, "angle across it": angle} | of_star
        found["branches"][f"branch {name}"] = row
        at[k.from_bus].append(k)
        at[k.to_bus].append(k)
    models, infinite = tables.of_role(*tables.UNIT_ROLES), _infinite(case)
    modeled = {naming.number(key) for model in models for key in case.devices.get(model, {})} - infinite
    found["machines"], total = {}, sum(m.base for m in case.machines)
    shared: dict[int, float] = defaultdict(float)  # MVA of the machines at a bus, which share a transformer
    for m in case.machines:
        shared[m.bus] += m.base
    for m, s in zip(case.machines, np.abs(S).tolist(), strict=True):
        rated = {"loading": s * case.base_mva / m.base} if m.base != case.base_mva else {}
        alone = len(at[m.bus]) == 1
        step_up = {"x of its transformer": at[m.bus][0].x * shared[m.bus] / case.base_mva} if alone else {}
        found["machines"] |= {f"machine {m.called}": rated | step_up} if m.machine in modeled else {}
    known = modeled and not infinite and any(m.base != case.base_mva for m in case.machines)
    loads = zip(naming.keys(case, "loads"), case.loads, strict=True)
    found["loads"] = {f"load {key}": {"share of all ratings": load.p / total} for key, load in loads if known}
    return found


def _unlike(case: Case) -> Iterator[Finding]:
    """Parameters far from those of all other devices of their model, lines from the others of their rated voltage."""
    for model in (model for model in case.devices if tables.role(model) in LIKE):
        rows = _devices(case, model)
        for f in fields(tables.models()[model].Par).values():
            if f.kind is float:
                yield from _alone(model, f.name, f.unit, {object: row[f.name] for object, row in rows.items()}, ALONE)
    rated = {b.bus: b.rated for b in case.buses}
    lines: dict[float, dict[str, float]] = defaultdict(dict)
    for name, k in zip(naming.circuits(case.branches), case.branches, strict=True):
        if k.x > 0 and k.b > 0 and rated[k.from_bus] == rated[k.to_bus]:
            lines[rated[k.from_bus]][f"branch {name}"] = math.sqrt(k.x / k.b)
    for values in lines.values():
        yield from _alone("branches", "surge impedance sqrt(x/b)", "pu", values, SURGE)


def _alone(table: str, quantity: str, unit: str, values: Mapping[str, float], factor: float) -> Iterator[Finding]:
    """The largest and the smallest of at least three values, if it is that far from the nearest other one."""
    order = sorted((value, object) for object, value in values.items() if value > 0)
    if len(order) < FEWEST_ALIKE:
        return
    for (value, object), near, far in ((order[-1], order[-2], order[0]), (order[0], order[1], order[-1])):
        if max(value / near[0], near[0] / value) >= factor:
            low, high = sorted((near[0], far[0]))
            likely = f"the others of this case have {_range(low, high)}"
            yield Finding(table, object, quantity, value, "" if unit == "-" else unit, low, high, likely)


def _unbalanced(case: Case) -> Iterator[Finding]:
    """Buses with a mismatch, of reactive power if nothing holds the voltage; those of all others are a power flow."""
    if len(case.buses) < FEWEST_BUSES or len({b.angle for b in case.buses}) == 1:
        return
    V, mismatch = powerflow.at_stored_voltages(case)
    made = np.array([complex(m.p, m.q) for m in case.machines]) / case.base_mva
    flow = powerflow.PowerFlow(case, V, made, 0).branch_power
    net, demand = network.build(case), powerflow.demand(case)
    through = np.stack([np.abs(demand.real), np.abs(demand)], axis=1)  # active and apparent power
    for end, power in ((net.frm, flow[:, 0]), (net.to, flow[:, 1]), (net.machine_bus, made)):
        np.add.at(through, end, np.stack([np.abs(power.real), np.abs(power)], axis=1))
    limit = np.maximum(UNBALANCED * through / 2, LEAST)
    known = np.array([(b.kind != "swing", b.kind == "pq") for b in case.buses])
    parts = np.stack([mismatch.real, mismatch.imag], axis=1)
    out = known & (np.abs(parts) > limit)
    out[:, 1] &= out.any(axis=1).sum() <= MOST_UNBALANCED
    for i, part in np.argwhere(out).tolist() if out[:, 0].sum() <= MOST_UNBALANCED else ():
        bus, value, unit = f"bus {case.buses[i].bus}", float(parts[i, part]) * case.base_mva, ("MW", "Mvar")[part]
        yield Finding("buses", bus, "mismatch at stored voltages", value, unit, 0.0, 0.0, NEAR_BUS)

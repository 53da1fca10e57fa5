"""The devices of a system as flat tables, and the order in which they are called.

A call is a run of neighboring rows of one family. Whole families are ordered by what they read and write; where that
has a cycle, its families are taken apart into rows. Only a cycle of rows is an algebraic loop.
"""

import sys
from collections.abc import Iterable, Sequence
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from itertools import pairwise
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from stabctl import devices
from stabctl._util import alongside, jit
from stabctl.errors import EquilibriumError

from . import family
from .family import BOTH, CURRENT, INPUTS, LOCAL, OUTPUT, RATES, SOURCE, STEP


class Family(NamedTuple):
    """The devices of one model in a system."""

    name: str
    device: ModuleType
    w: np.ndarray  # (devices, width) i64   places, see `family`
    k: np.ndarray  # (devices, constants)
    keys: tuple[str, ...]  # what each is called, e.g. "machine 3"

    def __reduce__(self) -> tuple[Any, ...]:
        where = self.device.__name__, self.device.__file__
        return _family, (self.name, *where, self.w, self.k, self.keys)


def _family(name: str, module: str, file: str, *rest: Any) -> Family:
    """A family that comes from another process; a device registered there is registered here too."""
    if module not in sys.modules and not module.startswith("stabctl."):
        devices.register(file)
    return Family(name, import_module(module), *rest)


class Program(NamedTuple):
    """What a compiled caller needs of all devices. Its type is the same for every system."""

    w: np.ndarray  # (i64) the families' tables of places, one after the other
    k: np.ndarray  # (f64) the families' tables of constants
    source: np.ndarray  # (calls, 5)  address, op, devices, start in w, start in k; once before the voltages are solved
    current: np.ndarray  # at every iteration of the voltages
    sweep: np.ndarray  # all outputs and rates
    step: np.ndarray  # sampled devices


Node = tuple[int, int, tuple[int, ...]]  # family, operation, rows


def ordered(families: Sequence[Family]) -> list[Node]:
    """Outputs and rates of all devices, so that every signal is made before it is read.

    Raises `EquilibriumError` where devices wait for each other's outputs (an algebraic loop), naming them.
    """
    nodes: list[Node] = []
    for i, one in enumerate(families):
        ops = [op for op in family.equations(one.device) if op in (OUTPUT, BOTH, RATES)]
        nodes += [(i, op, tuple(range(len(one.w)))) for op in ops if len(one.w)]
    while True:
        graph = _graph(families, nodes)
        try:
            sorter = TopologicalSorter(graph)
            sorter.prepare()
            out: list[Node] = []
            while sorter.is_active():
                batch = sorter.get_ready()
                out += _merged(nodes[n] for n in batch)
                sorter.done(*batch)
            return out
        except CycleError as error:
            cycle = {nodes[n] for n in error.args[1]}
            if all(len(rows) == 1 for _, _, rows in cycle):
                names = [
                    f"{families[nodes[n][0]].name} of {families[nodes[n][0]].keys[nodes[n][2][0]]}"
                    for n in error.args[1]
                ]
                raise EquilibriumError(f"These devices form an algebraic loop: {' <- '.join(names)}.") from None
            single: list[Node] = [(i, op, (row,)) for i, op, rows in cycle for row in rows]
            nodes = [n for n in nodes if n not in cycle] + single


def _graph(families: Sequence[Family], nodes: Sequence[Node]) -> dict[int, set[int]]:
    """Nodes -> the nodes whose outputs they read, which may be a node itself."""
    size = 1 + max((int(f.w.max(initial=0)) + family.shape(f.device)[2] for f in families), default=0)
    maker = np.full(size, -1)
    for n, (i, op, rows) in enumerate(nodes):
        if op != RATES:
            maker[_written(families[i], rows)] = n
    return {n: set(maker[_read(families[i], op, rows)].tolist()) - {-1} for n, (i, op, rows) in enumerate(nodes)}


def _written(one: Family, rows: Sequence[int]) -> np.ndarray:
    outputs = family.shape(one.device)[2]
    return (one.w[list(rows), -1][:, None] + np.arange(outputs)).ravel()


def _read(one: Family, op: int, rows: Sequence[int]) -> np.ndarray:
    device = one.device
    names = [name for equation in family.equations(device)[op] for name in family.reads(device, equation)]
    at = [INPUTS + family.fields(device, "Input").index(name) for name in dict.fromkeys(names)]
    places = one.w[np.ix_(list(rows), at)].ravel()
    own = op == RATES and "y" in family.arguments(device, "derivatives")
    return np.r_[places, _written(one, rows)] if own else places


def _merged(nodes: Iterable[Node]) -> list[Node]:
    """The same with the rows of one family and operation together."""
    found: dict[tuple[int, int], list[int]] = {}
    for i, op, rows in nodes:
        found.setdefault((i, op), []).extend(rows)
    return [(i, op, tuple(sorted(rows))) for (i, op), rows in sorted(found.items())]


def program(families: Sequence[Family], scalar: type = float) -> Program:
    """The tables and calls of a system as simulated, for real or complex numbers; addresses are those of this process.

    A complex program has no rates: it serves the voltages, which are solved with derivatives.
    """
    tables, sweep = _Tables(families, scalar), ordered(families)
    if scalar is complex:
        sweep = _outputs(sweep)
    currents = [*_heard(families, sweep), *_all(families, CURRENT)]
    nodes = _all(families, SOURCE), currents, sweep, _all(families, STEP)
    return Program(*tables.constants, *(tables.calls(one) for one in nodes))


def local_program(families: Sequence[Family]) -> Program:
    """The same for derivatives: `sweep` makes all outputs, `step` all local derivatives."""
    tables, none = _Tables(families, complex), np.zeros((0, 5), np.int64)
    every = [(i, LOCAL, tuple(range(len(f.w)))) for i, f in enumerate(families)]
    return Program(*tables.constants, none, none, tables.calls(_outputs(ordered(families))), tables.calls(every))


def _outputs(sweep: Iterable[Node]) -> list[Node]:
    """The outputs of a sweep alone, as a complex program makes them."""
    return [(i, OUTPUT, rows) for i, op, rows in sweep if op != RATES]


def _all(families: Sequence[Family], op: int) -> list[Node]:
    """All devices that have an operation."""
    return [
        (i, op, tuple(range(len(f.w)))) for i, f in enumerate(families) if len(f.w) and op in family.equations(f.device)
    ]


class _Tables:
    """The tables of all families, one after the other, and where each begins."""

    def __init__(self, families: Sequence[Family], scalar: type) -> None:
        self._families, self._address = families, _addresses(families, scalar)
        self._w = np.cumsum([0, *(f.w.size for f in families)]).tolist()
        self._k = np.cumsum([0, *(f.k.size for f in families)]).tolist()
        w = np.concatenate([np.zeros(0, np.int64), *(f.w.ravel() for f in families)])
        self.constants = w, np.concatenate([np.zeros(0), *(f.k.ravel() for f in families)])

    def calls(self, nodes: Iterable[Node]) -> np.ndarray:
        """Rows of a program: neighboring rows of a family are one call."""
        out = []
        for i, op, rows in nodes:
            width, constants = self._families[i].w.shape[1], self._families[i].k.shape[1]
            cut = [0, *(j for j in range(1, len(rows)) if rows[j] != rows[j - 1] + 1), len(rows)]
            for a, b in pairwise(cut):
                places = self._w[i] + width * rows[a], self._k[i] + constants * rows[a]
                out.append((self._address[i], op, b - a, *places))
        return np.array(out, np.int64).reshape(-1, 5)


def near(families: Sequence[Family]) -> np.ndarray:
    """Places of the buses and inputs of the devices that are called at every iteration of the voltages."""
    out = [np.zeros(0, np.int64)]
    draws = [(i, CURRENT, range(len(f.w))) for i, f in enumerate(families) if CURRENT in family.equations(f.device)]
    for i, _, rows in [*_heard(families, ordered(families) if draws else ()), *draws]:
        _, inputs, _, buses = family.shape(families[i].device)
        columns = [*(family.BUS, family.BUS2)[:buses], *range(INPUTS, INPUTS + inputs)]
        out.append(families[i].w[np.ix_(list(rows), columns)].ravel())
    return np.unique(np.concatenate(out))


def _addresses(families: Sequence[Family], scalar: type) -> list[int]:
    """Addresses of the families' loops, which are compiled where their machine code is not on disk."""
    new = [f.device.NAME for f in families if len(f.w) and not family.on_disk(f.name, f.device, scalar)]
    if new:
        alongside.start("stabctl.simulation.stepper:advance", "stabctl.simulation.prepare")
    with jit.compiling(new) as done:
        out = []
        for f in families:
            out.append(family.address(f.name, f.device, scalar) if len(f.w) else 0)
            if f.device.NAME in new:
                done()
    return out


def _heard(families: Sequence[Family], sweep: Sequence[Node]) -> list[Node]:
    """The part of `sweep` whose outputs the currents read: they are made anew at every iteration of the voltages."""
    draws = [f for f in families if CURRENT in family.equations(f.device) and len(f.w)]
    wanted = np.concatenate([np.zeros(0, int), *(_read(f, CURRENT, range(len(f.w))) for f in draws)])
    out: list[Node] = []
    for i, op, rows in reversed(sweep):
        if op == RATES or not family.shape(families[i].device)[2]:
            continue
        written = _written(families[i], rows).reshape(len(rows), -1)
        keep = tuple(np.array(rows)[np.isin(written, wanted).any(axis=1)].tolist())
        if keep:
            out.insert(0, (i, op, keep))
            needed = op if op in family.equations(families[i].device) else BOTH
            wanted = np.r_[wanted, _read(families[i], needed, keep)]
    return out

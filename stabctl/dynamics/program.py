"""The calls of all devices of a system for compiled code, in an order in which each signal is computed before use.

A call covers consecutive rows of one family. Families are ordered by the signals that they read and write; families in
a cycle are split into rows. Only a cycle of rows is an algebraic loop.
"""

from collections.abc import Container, Iterable, Sequence
from functools import partial
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stabctl import devices
from stabctl._util import jit
from stabctl._util.errors import EquilibriumError
from stabctl._util.words import record

from . import _codegen, family
from .family import BOTH, CURRENT, FRAME, INPUTS, LOCAL, OUTPUT, RATES, SOURCE, STEP, Family

Node = tuple[int, int, tuple[int, ...]]  # family, operation, rows


@record
class Program(NamedTuple):
    """What compiled code needs to call all devices. The type is the same for every system."""

    w: np.ndarray  # (i64) the families' tables of places, one after the other
    k: np.ndarray  # (f64) the families' tables of constants
    source: np.ndarray  # (calls, 5)  address, op, devices, start in w, start in k; once before the voltages are solved
    current: np.ndarray  # at every iteration of the voltages
    sweep: np.ndarray  # all outputs and rates
    step: np.ndarray  # devices that decide at every step
    sense: np.ndarray  # the outputs that sampled controllers and devices that decide at every step read
    frame: np.ndarray  # sampled controllers
    bits: np.ndarray  # (frame) the bit of the rate of each


def program(families: Sequence[Family]) -> Program:
    """The tables and calls of a system as simulated; addresses are those of this process."""
    tables, sweep = _Tables(families, float), _ordered(families)
    frames, steps = _all_of(families, FRAME), _all_of(families, STEP)
    return Program(
        *tables.constants,
        source=tables.calls(_all_of(families, SOURCE)),
        current=tables.calls(_currents(families, sweep)),
        sweep=tables.calls(sweep),
        step=tables.calls(steps),
        sense=tables.calls(_makers(families, sweep, [*frames, *steps])),
        frame=tables.calls(frames),
        bits=np.array([1 << int(families[i].k[0, -1]) for i, _, _ in frames], np.int64),
    )


def complex_currents(families: Sequence[Family]) -> np.ndarray:
    """The calls of `Program.current` for complex numbers, which give derivatives."""
    nodes = _currents(families, _outputs(_ordered(families)))
    return _Tables(families, complex, {i for i, _, _ in nodes}).calls(nodes)


def local_program(families: Sequence[Family]) -> Program:
    """The same for derivatives: `sweep` makes all outputs, `step` all local derivatives."""
    tables, none = _Tables(families, complex), np.zeros((0, 5), np.int64)
    every = [(i, LOCAL, tuple(range(len(f.w)))) for i, f in enumerate(families)]
    outputs = tables.calls(_outputs(_ordered(families)))
    return Program(*tables.constants, none, none, outputs, tables.calls(every), none, none, np.zeros(0, np.int64))


def near(families: Sequence[Family]) -> np.ndarray:
    """Places of the buses and inputs of the devices that are called at every iteration of the voltages."""
    out = [np.zeros(0, np.int64)]
    for i, _, rows in _currents(families, _ordered(families) if _all_of(families, CURRENT) else ()):
        _, inputs, _, buses = family.size(families[i])
        columns = [*(family.BUS, family.BUS2)[:buses], *range(INPUTS, INPUTS + inputs)]
        out.append(families[i].w[np.ix_(list(rows), columns)].ravel())
    return np.unique(np.concatenate(out))


class _Tables:
    """The tables of all families, one after the other, and where each begins."""

    def __init__(self, families: Sequence[Family], scalar: type, called: Container[int] | None = None) -> None:
        used = [len(f.w) > 0 and (called is None or i in called) for i, f in enumerate(families)]
        self._families, self._address = families, _addresses(families, scalar, used)
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


def _addresses(families: Sequence[Family], scalar: type, used: Sequence[bool]) -> list[int]:
    """Addresses of the loops of the families that are used; they are compiled if their machine code is not on disk."""
    calls = [f for f, is_used in zip(families, used, strict=True) if is_used]
    new = [f.device.name for f in calls if not _codegen.on_disk(f.name, f.device, scalar)]
    if new and jit.start("stabctl.simulation.stepper:advance", "stabctl.simulation.prepare"):
        likely = devices.every()["esd"]
        jit.meanwhile += [partial(_codegen.address, "esd", likely, kind) for kind in (complex, float)]
    with jit.compiling(new) as done:
        out = []
        for f, is_used in zip(families, used, strict=True):
            out.append(_codegen.address(f.name, f.device, scalar) if is_used else 0)
            if is_used and f.device.name in new:
                done()
    return out


def _outputs(sweep: Iterable[Node]) -> list[Node]:
    """The outputs of a sweep alone, as a complex program makes them."""
    return [(i, OUTPUT, rows) for i, op, rows in sweep if op != RATES]


def _ordered(families: Sequence[Family]) -> list[Node]:
    """Calls for the outputs and derivatives of all devices, in an order in which every signal is computed before use.

    Raises `EquilibriumError`, naming the devices, if they form an algebraic loop.
    """
    nodes: list[Node] = []
    for i, one in enumerate(families):
        ops = [op for op in family.operations(one) if op in (OUTPUT, BOTH, RATES)] if len(one.w) else []
        nodes += [(i, op, tuple(range(len(one.w)))) for op in ops]
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
                names = [_called(families[nodes[n][0]], nodes[n][2][0]) for n in error.args[1]]
                raise EquilibriumError(
                    f"These devices form an algebraic loop: {' <- '.join(names)}; add a lag to one of them."
                ) from None
            single: list[Node] = [(i, op, (row,)) for i, op, rows in cycle for row in rows]
            nodes = [n for n in nodes if n not in cycle] + single


def _merged(nodes: Iterable[Node]) -> list[Node]:
    """The same with the rows of one family and operation together."""
    found: dict[tuple[int, int], list[int]] = {}
    for i, op, rows in nodes:
        found.setdefault((i, op), []).extend(rows)
    return [(i, op, tuple(sorted(rows))) for (i, op), rows in sorted(found.items())]


def _called(one: Family, row: int) -> str:
    """What a device is called: `sexs of machine 1`, `controller pod`."""
    return f"controller {one.keys[row]}" if one.device.role == "controller" else f"{one.name} of {one.keys[row]}"


def _graph(families: Sequence[Family], nodes: Sequence[Node]) -> dict[int, set[int]]:
    """For each node, the nodes whose outputs it reads, which may include itself."""
    size = 1 + max(int(f.w.max(initial=0)) + family.size(f)[2] for f in families if len(f.w))
    maker = np.full(size, -1)
    for n, (i, op, rows) in enumerate(nodes):
        if op != RATES:
            maker[_written(families[i], rows)] = n
    return {n: set(maker[_read(families[i], op, rows)].tolist()) - {-1} for n, (i, op, rows) in enumerate(nodes)}


def _currents(families: Sequence[Family], sweep: Sequence[Node]) -> list[Node]:
    """The currents, and the part of `sweep` whose outputs they read: made anew at every iteration of the voltages."""
    draws = _all_of(families, CURRENT)
    return [*_makers(families, sweep, draws), *draws]


def _makers(families: Sequence[Family], sweep: Sequence[Node], readers: Iterable[Node]) -> list[Node]:
    """The part of `sweep` that makes what the readers read, directly or through others."""
    wanted = np.concatenate([np.zeros(0, int), *(_read(families[i], op, rows) for i, op, rows in readers)])
    out: list[Node] = []
    for i, op, rows in reversed(sweep):
        if op == RATES or not family.size(families[i])[2]:
            continue
        written = _written(families[i], rows).reshape(len(rows), -1)
        keep = tuple(np.array(rows)[np.isin(written, wanted).any(axis=1)].tolist())
        if keep:
            out.insert(0, (i, op, keep))
            needed = op if op in family.operations(families[i]) else BOTH
            wanted = np.r_[wanted, _read(families[i], needed, keep)]
    return out


def _all_of(families: Sequence[Family], op: int) -> list[Node]:
    """All devices that have an operation."""
    return [(i, op, tuple(range(len(f.w)))) for i, f in enumerate(families) if len(f.w) and op in family.operations(f)]


def _written(one: Family, rows: Sequence[int]) -> np.ndarray:
    """Places of the outputs of these devices."""
    outputs = family.size(one)[2]
    return (one.w[list(rows), -1][:, None] + np.arange(outputs)).ravel()


def _read(one: Family, op: int, rows: Sequence[int]) -> np.ndarray:
    """Places that an operation of these devices reads; rates may read the outputs of their own device."""
    places = family.read(one, op, rows)
    own = op == RATES and "y" in one.device.arguments("derivatives")
    return np.r_[places, _written(one, rows)] if own else places

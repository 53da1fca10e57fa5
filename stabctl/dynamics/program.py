"""The calls of all devices of a system, for compiled code."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from stabctl._util import jit

from . import loop
from .family import CURRENT, FRAME, LOCAL, OUTPUT, RATES, SOURCE, STEP
from .order import Node, all_of, ordered, read_by_currents, read_by_frames
from .tables import Family


class Program(NamedTuple):
    """What compiled code needs to call all devices. The type is the same for every system."""

    w: np.ndarray  # (i64) the families' tables of places, one after the other
    k: np.ndarray  # (f64) the families' tables of constants
    source: np.ndarray  # (calls, 5)  address, op, devices, start in w, start in k; once before the voltages are solved
    current: np.ndarray  # at every iteration of the voltages
    sweep: np.ndarray  # all outputs and rates
    step: np.ndarray  # devices that decide at every step
    sense: np.ndarray  # the outputs that sampled controllers read
    frame: np.ndarray  # sampled controllers
    bits: np.ndarray  # (frame) the bit of the rate of each


def program(families: Sequence[Family], scalar: type = float) -> Program:
    """The tables and calls of a system as simulated, for real or complex numbers; addresses are those of this process.

    A complex program has no rates: it serves the voltages, which are solved with derivatives.
    """
    tables, sweep = _Tables(families, scalar), ordered(families)
    if scalar is complex:
        sweep = _outputs(sweep)
    frames = all_of(families, FRAME)
    return Program(
        *tables.constants,
        source=tables.calls(all_of(families, SOURCE)),
        current=tables.calls([*read_by_currents(families, sweep), *all_of(families, CURRENT)]),
        sweep=tables.calls(sweep),
        step=tables.calls(all_of(families, STEP)),
        sense=tables.calls(read_by_frames(families, sweep)),
        frame=tables.calls(frames),
        bits=np.array([1 << int(families[i].k[0, -1]) for i, _, _ in frames], np.int64),
    )


def local_program(families: Sequence[Family]) -> Program:
    """The same for derivatives: `sweep` makes all outputs, `step` all local derivatives."""
    tables, none = _Tables(families, complex), np.zeros((0, 5), np.int64)
    every = [(i, LOCAL, tuple(range(len(f.w)))) for i, f in enumerate(families)]
    outputs = tables.calls(_outputs(ordered(families)))
    return Program(*tables.constants, none, none, outputs, tables.calls(every), none, none, np.zeros(0, np.int64))


def _outputs(sweep: Iterable[Node]) -> list[Node]:
    """The outputs of a sweep alone, as a complex program makes them."""
    return [(i, OUTPUT, rows) for i, op, rows in sweep if op != RATES]


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


def _addresses(families: Sequence[Family], scalar: type) -> list[int]:
    """Addresses of the families' loops, which are compiled if their machine code is not on disk."""
    new = [f.device.name for f in families if len(f.w) and not loop.on_disk(f.name, f.device, scalar)]
    if new:
        jit.start("stabctl.simulation.stepper:advance", "stabctl.simulation.prepare")
    with jit.compiling(new) as done:
        out = []
        for f in families:
            out.append(loop.address(f.name, f.device, scalar) if len(f.w) else 0)
            if f.device.name in new:
                done()
    return out

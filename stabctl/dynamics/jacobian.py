"""Exact derivatives of the system, from the blocks of its devices.

Every device is differentiated at its own terminals by complex step (h = 1e-30), one variable at a time. The blocks are
assembled by the places of their signals, and the outputs, which never form a loop, are eliminated:

    y = E z + F y    ->    y = (1 + F + F^2 + ...) E z,    F nilpotent.

Where the entries go is worked out once for all systems of one structure, which differ only in the parameters of their
devices, as in a sweep or a design. The matrices are sparse, but dense arrays if the system is small, because handling a
few sparse entries takes longer.
"""

from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl._util.errors import StudyError

from . import family
from .assembly import System
from .family import Family, Limits
from .layout import Layout
from .perform import evaluate
from .program import Program, local_program

SMALL = 60_000  # equations times signals up to which the matrices are dense
MOST = 16  # structures kept
Matrix: TypeAlias = Any  # csr_matrix or csc_matrix, or an array if the system is small
_known: dict[Hashable, "Pattern"] = {}


class Derivatives(NamedTuple):
    """Values and derivatives at a point; columns are the places of [states | voltages | set-points]."""

    rates: np.ndarray  # (states) 1/s
    outputs: np.ndarray  # (outputs)
    currents: np.ndarray  # (buses) complex, pu, into the network
    of_rates: Matrix
    of_outputs: Matrix
    of_currents: Matrix  # real and imaginary part per bus
    of_injections: Matrix  # the same per device that injects a current, in the order of the families
    injections: np.ndarray  # (injections) complex, pu


class Equations:
    """The equations of a system, which can be evaluated and differentiated at any point."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.families = [f for f in system.families if len(f.w) and f.device.step is None]
        self.pattern = _pattern(self.families, system.layout)
        k = np.concatenate([np.zeros(0), *(f.k.ravel() for f in self.families)])
        self.program: Program = self.pattern.program._replace(k=k)
        self.rows, self.columns = self.pattern.rows, self.pattern.columns
        self.injections, self.injecting = self.pattern.injections, self.pattern.injecting
        self.small = self.pattern.total * system.layout.size <= SMALL
        self._on = system.island[system.unit_bus] if len(system.unit_bus) else np.zeros(1, np.int64)

    def at(self, s: np.ndarray, k: np.ndarray | None = None) -> Derivatives:
        """Values and derivatives at s (real; its outputs are brought up to date).

        Parameters
        ----------
        s
            All signals (layout.size).
        k
            Parameters of all devices, in place of those of the program.
        """
        layout = self.system.layout
        J, values = self._matrix(s, k)
        outputs = slice(layout.nx, layout.nx + layout.outputs)
        direct, through = J[:, : layout.step], J[:, layout.first_output : layout.first_memory]
        of_outputs = term = direct[outputs]
        for _ in range(layout.outputs):
            term = through[outputs] @ term
            if not filled(term, 0).any():
                break
            of_outputs = of_outputs + term
        whole = direct + through @ of_outputs if layout.outputs else direct
        first = outputs.stop
        of_injections, injections = whole[first:], values[first:]
        return Derivatives(
            values[: layout.nx],
            values[outputs],
            (self._gather @ injections).view(complex),
            whole[: layout.nx],
            of_outputs,
            self._gather @ of_injections,
            of_injections,
            injections.view(complex),
        )

    @property
    def _gather(self) -> sp.csr_matrix:
        """Sums the injections of every bus, real and imaginary part."""
        kept = self.pattern.kept
        if "gather" not in kept:
            bus = self.injecting - self.system.layout.nx
            at = np.stack([bus, bus + 1], 1).ravel()
            shape = 2 * self.system.layout.buses, len(at)
            kept["gather"] = sp.csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=shape)
        return kept["gather"]

    def _matrix(self, s: np.ndarray, k: np.ndarray | None) -> tuple[Matrix, np.ndarray]:
        """The derivatives of `entries` as a matrix, and the values."""
        entries, values = self.entries(s, k)
        shape = self.pattern.total, self.system.layout.size
        return matrix(entries, (self.rows, self.columns), shape, self.small), values

    def entries(
        self, s: np.ndarray, k: np.ndarray | None = None, *, swept: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives with respect to the variables of each device, one per entry of the pattern, and the values.

        Rows are [rates | outputs | injections], columns all signals, outputs included; s as in `at`. If not `swept`,
        every device reads the outputs that s holds: a change of one device then changes its own rows only.
        """
        layout, pattern = self.system.layout, self.pattern
        z, f = s.astype(complex), np.zeros(pattern.starts[-1], complex)
        p = self.program if k is None else self.program._replace(k=k)
        p = p if swept else p._replace(sweep=p.sweep[:0])
        output, rate = evaluate(p, pattern.starts, z, f, self._on)
        if output >= 0 or rate >= 0:
            raise StudyError(self._divided(p.sweep[output] if output >= 0 else p.step[rate], p, z, f))
        s[layout.first_output : layout.first_memory] = z.real[layout.first_output : layout.first_memory]
        values = np.zeros(pattern.total)
        values[pattern.answers] = f.real[pattern.values]
        return f.imag[pattern.slopes] / family.TINY, values

    def _divided(self, call: np.ndarray, p: Program, z: np.ndarray, f: np.ndarray) -> str:
        """Which device of a call divides by zero, in words."""
        address, op, count, w, k = call.tolist()
        ends = np.cumsum([one.w.size for one in self.families])
        one = self.families[int(np.searchsorted(ends, w, side="right"))]
        row = (w - int(ends[self.families.index(one)]) + one.w.size) // one.w.shape[1]
        nothing = np.zeros(1, np.int64)
        for j in range(count):
            alone = np.array([[address, op, 1, w + j * one.w.shape[1], k + j * one.k.shape[1]]])
            if evaluate(p._replace(sweep=alone, step=alone[:0]), nothing, z, f, self._on)[0] == 0:
                row += j
                break
        return f"{one.device.name} of {one.keys[row]} divides by zero; check its equations and its parameters."

    def held(self, s: np.ndarray, rates: np.ndarray, limits: Limits) -> np.ndarray:
        """States (mask) that are at a limit and driven beyond it."""
        x, f, per = s[limits.state], rates[limits.state], s[limits.scale]
        stopped = ((x >= limits.high * per) & (f > 0)) | ((x <= limits.low * per) & (f < 0))
        out = np.zeros(len(rates), bool)
        out[limits.state[stopped]] = True
        return out


def _pattern(families: Sequence[Family], layout: Layout) -> "Pattern":
    """The pattern of a system, shared by all systems of its structure."""
    key = layout.size, *((f.name, f.device, family.size(f), f.w.tobytes()) for f in families)
    found = _known.get(key)
    if found is None:
        found = Pattern(families, layout)
        while len(_known) >= MOST:
            _known.pop(next(iter(_known)), None)
        _known[key] = found
    return found


class Pattern:
    """Rows and columns of the entries of the local blocks in [rates | outputs | injections] and the signals.

    Attributes
    ----------
    program
        Calls that make all outputs and all local derivatives; with the constants of the first system.
    rows, columns
        Row and column of every entry.
    starts
        Where the blocks of each family begin.
    slopes, values
        Places of the entries in the blocks; those of the rates, outputs and injections themselves.
    answers
        Rows of these values.
    injections, injecting
        Family -> its injections; places of the bus voltage of every injection.
    device
        Number of the device of every row, counted through the families; -1: none.
    total
        Number of rows.
    kept
        What follows from the pattern, by name.
    """

    def __init__(self, families: Sequence[Family], layout: Layout) -> None:
        self.program: Program = local_program(families)
        self.kept: dict[str, Any] = {}
        self.injections: dict[str, slice] = {}
        rows, columns, places, injection, starts = [], [], [], 0, [0]
        slopes, values, all_answers, numbers = [], [], [], []
        first = layout.nx + layout.outputs
        for f in families:
            states, inputs, outputs, buses = family.size(f)
            n, j = len(f.w), np.arange(len(f.w))[:, None]
            bus = f.w[:, [family.BUS, family.BUS2][:buses]]
            voltages = (bus[:, :, None] + np.arange(2)).reshape(n, 2 * buses)
            x = f.w[:, [family.STATE]] + np.arange(states)
            variables = np.hstack([x, f.w[:, family.INPUTS : family.INPUTS + inputs], voltages])
            y = f.w[:, [-1]] - layout.first_output + layout.nx + np.arange(outputs)
            g = first + 2 * (injection + buses * j) + np.arange(2 * buses)
            answers = np.hstack([x, y, g])
            self.injections[f.name] = slice(injection, injection + buses * n)
            injection += buses * n
            places.append(bus.ravel())
            shape = (n, variables.shape[1], answers.shape[1])
            columns.append(np.broadcast_to(variables[:, :, None], shape).ravel())
            rows.append(np.broadcast_to(answers[:, None, :], shape).ravel())
            all_answers.append(answers.ravel())
            numbers += [answers.shape[1]] * n
            blocks = starts[-1] + np.arange(n * (shape[1] + 1) * shape[2]).reshape(n, shape[1] + 1, shape[2])
            slopes.append(blocks[:, :-1].ravel())
            values.append(blocks[:, -1].ravel())
            starts.append(starts[-1] + blocks.size)
        self.rows, self.columns = np.concatenate(rows), np.concatenate(columns)
        self.starts, self.answers = np.array(starts, np.int64), np.concatenate(all_answers)
        self.slopes, self.values = np.concatenate(slopes), np.concatenate(values)
        self.injecting = np.concatenate(places)
        self.total = first + 2 * injection
        self.device = np.full(self.total, -1)
        self.device[self.answers] = np.repeat(np.arange(len(numbers)), numbers)


def matrix(entries: np.ndarray, at: tuple[np.ndarray, np.ndarray], shape: tuple[int, int], dense: bool) -> Matrix:
    """The matrix with these entries at these rows and columns; those of one place are added up."""
    if dense:
        return np.bincount(at[0] * shape[1] + at[1], entries, shape[0] * shape[1]).reshape(shape)
    live = entries != 0
    return sp.csr_matrix((entries[live], (at[0][live], at[1][live])), shape=shape)


def filled(M: Matrix, axis: int) -> np.ndarray:
    """Which columns (axis 0) or rows (axis 1) have an entry."""
    return np.asarray(abs(M).sum(axis)).ravel() != 0


def solver(M: Matrix) -> Callable[[np.ndarray], np.ndarray]:
    """The function b -> inv(M) b."""
    return partial(np.linalg.solve, M) if isinstance(M, np.ndarray) else splu(M.tocsc()).solve


def solved(M: Matrix, b: np.ndarray) -> np.ndarray:
    """inv(M) b."""
    return solver(M)(b)


def array(M: Matrix) -> np.ndarray:
    """A matrix as a dense array."""
    return M if isinstance(M, np.ndarray) else M.toarray()

"""Exact derivatives of the system, from the blocks of its devices.

Every device is differentiated at its own terminals by complex step (h = 1e-30), one variable at a time. The blocks are
assembled by the places of their signals, and the outputs, which never form a loop, are eliminated:

    y = E z + F y    ->    y = (1 + F + F^2 + ...) E z,    F nilpotent.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from . import family
from .assembly import System
from .evaluate import evaluate
from .limits import Limits
from .program import Program, local_program


class Derivatives(NamedTuple):
    """Values and derivatives at a point; columns are the places of [states | voltages | set-points]."""

    rates: np.ndarray  # (states) 1/s
    outputs: np.ndarray  # (outputs)
    currents: np.ndarray  # (buses) complex, pu, into the network
    of_rates: sp.csr_matrix
    of_outputs: sp.csr_matrix
    of_currents: sp.csr_matrix  # real and imaginary part per bus
    of_injections: sp.csr_matrix  # the same per device that injects a current, in the order of the families
    injections: np.ndarray  # (injections) complex, pu


class Equations:
    """The equations of a system, which can be evaluated and differentiated at any point."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.families = [f for f in system.families if len(f.w) and not hasattr(f.device, "step")]
        self.program: Program = local_program(self.families)
        self._shapes = [family.shape(f.device) for f in self.families]
        counts = [len(f.w) * self._rows(k) * self._columns(k) for k, f in enumerate(self.families)]
        self._starts = np.cumsum([0, *counts]).astype(np.int64)
        self._on = np.zeros(max(len(system.unit_bus), 1), np.int64)
        self._pattern()

    def _rows(self, k: int) -> int:
        states, inputs, _, buses = self._shapes[k]
        return states + inputs + 2 * buses + 1

    def _columns(self, k: int) -> int:
        states, _, outputs, buses = self._shapes[k]
        return states + outputs + 2 * buses

    def _pattern(self) -> None:
        """Rows and columns of every entry of the blocks in [rates | outputs | injections] and s."""
        layout, rows, columns, where, injection = self.system.layout, [], [], [], 0
        places: list[np.ndarray] = []
        self.injections: dict[str, slice] = {}
        first = layout.nx + layout.outputs
        for k, f in enumerate(self.families):
            states, inputs, outputs, buses = self._shapes[k]
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
            where.append(answers)
        self.rows, self.columns = np.concatenate(rows), np.concatenate(columns)
        self._answers = [a.ravel() for a in where]
        self._total = first + 2 * injection
        self.injecting = np.concatenate(places)  # places of the bus voltage of every injection

    @cached_property
    def _gather(self) -> sp.csr_matrix:
        """Sums the injections of every bus, real and imaginary part."""
        bus = self.injecting - self.system.layout.nx
        at = np.stack([bus, bus + 1], 1).ravel()
        shape = 2 * self.system.layout.buses, len(at)
        return sp.csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=shape)

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
        while through.nnz and term.nnz:
            term = through[outputs] @ term
            of_outputs = of_outputs + term
        whole = (direct + through @ of_outputs).tocsr() if through.nnz else direct.tocsr()
        first = outputs.stop
        of_injections = whole[first:]
        injections = values[first:]
        return Derivatives(
            values[: layout.nx],
            values[outputs],
            (self._gather @ injections).view(complex),
            whole[: layout.nx],
            of_outputs.tocsr(),
            (self._gather @ of_injections).tocsr(),
            of_injections,
            injections.view(complex),
        )

    def entries(self, s: np.ndarray, k: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives with respect to the variables of each device, one per entry of the pattern, and the values.

        Rows are [rates | outputs | injections], columns all signals, outputs included; s as in `at`.
        """
        layout = self.system.layout
        z, f = s.astype(complex), np.zeros(self._starts[-1], complex)
        p = self.program if k is None else self.program._replace(k=k)
        evaluate(p, self._starts, z, f, self._on)
        s[layout.first_output : layout.first_memory] = z.real[layout.first_output : layout.first_memory]
        values, slopes = np.zeros(self._total), []
        for i, one in enumerate(self.families):
            block = f[self._starts[i] : self._starts[i + 1]].reshape(len(one.w), self._rows(i), self._columns(i))
            values[self._answers[i]] = block[:, -1].real.ravel()
            slopes.append(block[:, :-1].imag.ravel())
        return np.concatenate(slopes) / family.TINY, values

    def _matrix(self, s: np.ndarray, k: np.ndarray | None) -> tuple[sp.csr_matrix, np.ndarray]:
        """The same as a matrix."""
        data, values = self.entries(s, k)
        live = data != 0
        entries = data[live], (self.rows[live], self.columns[live])
        return sp.csr_matrix(entries, shape=(self._total, self.system.layout.size)), values

    def held(self, s: np.ndarray, rates: np.ndarray, limits: Limits) -> np.ndarray:
        """States (mask) that are at a limit and driven beyond it."""
        x, f, per = s[limits.state], rates[limits.state], s[limits.scale]
        stopped = ((x >= limits.high * per) & (f > 0)) | ((x <= limits.low * per) & (f < 0))
        out = np.zeros(len(rates), bool)
        out[limits.state[stopped]] = True
        return out

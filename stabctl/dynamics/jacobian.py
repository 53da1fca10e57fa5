"""Exact derivatives of the system, from the blocks of its devices.

Every device is differentiated at its own terminals by complex step (h = 1e-30), one variable at a time. The blocks are
assembled by the places of their signals, and the outputs, which never form a loop, are eliminated:

    y = E z + F y    ->    y = (1 + F + F^2 + ...) E z,    F nilpotent.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from . import family
from .assembly import System
from .evaluate import evaluate
from .limits import Limits
from .matrix import Matrix, filled, matrix
from .pattern import pattern
from .program import Program

SMALL = 60_000  # equations times signals up to which the matrices are dense


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
        self.pattern = pattern(self.families, system.layout)
        k = np.concatenate([np.zeros(0), *(f.k.ravel() for f in self.families)])
        self.program: Program = self.pattern.program._replace(k=k)
        self.rows, self.columns = self.pattern.rows, self.pattern.columns
        self.injections, self.injecting = self.pattern.injections, self.pattern.injecting
        self.small = self.pattern.total * system.layout.size <= SMALL
        self._on = np.zeros(max(len(system.unit_bus), 1), np.int64)

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

    def entries(self, s: np.ndarray, k: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives with respect to the variables of each device, one per entry of the pattern, and the values.

        Rows are [rates | outputs | injections], columns all signals, outputs included; s as in `at`.
        """
        layout, pattern = self.system.layout, self.pattern
        z, f = s.astype(complex), np.zeros(pattern.starts[-1], complex)
        p = self.program if k is None else self.program._replace(k=k)
        evaluate(p, pattern.starts, z, f, self._on)
        s[layout.first_output : layout.first_memory] = z.real[layout.first_output : layout.first_memory]
        values = np.zeros(pattern.total)
        values[pattern.answers] = f.real[pattern.values]
        return f.imag[pattern.slopes] / family.TINY, values

    def _matrix(self, s: np.ndarray, k: np.ndarray | None) -> tuple[Matrix, np.ndarray]:
        """The same as a matrix."""
        entries, values = self.entries(s, k)
        shape = self.pattern.total, self.system.layout.size
        return matrix(entries, (self.rows, self.columns), shape, self.small), values

    def held(self, s: np.ndarray, rates: np.ndarray, limits: Limits) -> np.ndarray:
        """States (mask) that are at a limit and driven beyond it."""
        x, f, per = s[limits.state], rates[limits.state], s[limits.scale]
        stopped = ((x >= limits.high * per) & (f > 0)) | ((x <= limits.low * per) & (f < 0))
        out = np.zeros(len(rates), bool)
        out[limits.state[stopped]] = True
        return out

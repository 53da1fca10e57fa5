"""The linearized system with its voltages still in it, sparse.

x' = fx x + fv v + fu u        state rates
0  = gx x + gv v + gu u        current balance of every bus, gv = (devices) - Y
y  = hx x + hv v + hu u
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.dynamics import layout
from stabctl.dynamics.operating_point import OperatingPoint

from . import inputs as ins
from . import local, outputs, refuse
from .signals import INPUTS, OUTPUTS, Signal, chosen


@dataclass(frozen=True, repr=False)
class Descriptor:
    """Sparse matrices (csc) of the linearized equations; x the states that live, v the voltages (re, im per bus)."""

    point: OperatingPoint
    fx: sp.csc_matrix
    fv: sp.csc_matrix
    gx: sp.csc_matrix
    gv: sp.csc_matrix
    fu: sp.csc_matrix
    gu: sp.csc_matrix
    hx: sp.csc_matrix
    hv: sp.csc_matrix
    hu: sp.csc_matrix
    places: tuple[layout.Place, ...]  # of the states
    rows: np.ndarray  # places of the states in z
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.point.case.name

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Labels of the states."""
        return layout.unique(layout.label(self.point.case, place) for place in self.places)

    def speeds(self) -> np.ndarray:
        """Places (machines) of the speeds among the states."""
        return layout.of_machines(self.places, "omega", len(self.point.case.machines))

    def angles(self) -> np.ndarray:
        """Places (machines) of the angles among the states."""
        return layout.of_machines(self.places, "delta", len(self.point.case.machines))

    def __str__(self) -> str:
        shape = f"{len(self.rows)} states, {self.gv.shape[0]} voltages"
        filled = self.fx.nnz + self.fv.nnz + self.gx.nnz + self.gv.nnz
        return f"linearized {self.point.case.name}: {shape}, {filled} entries"

    __repr__ = __str__


def descriptor(point: OperatingPoint, inputs: Iterable[str | Signal] = (), outputs: Iterable[str | Signal] = ()) -> Descriptor:
    """Sparse descriptor matrices of an operating point, exact (complex step on the simulated equations).

    `LinearizationError` where the point is no equilibrium (naming the state that moves most) or rests on a limit;
    `StudyError` for unknown signals. States nobody reads and that stand still (bypassed blocks) are left out, and so is
    the energy of a store: the integral of its power, read by no equation.
    """
    case, n = point.case, len(point.V)
    u, y = chosen(case, inputs, INPUTS), chosen(case, outputs, OUTPUTS)
    alone = local.private(point.plant)
    b = local.at(alone, point.z)
    J = local.derivatives(alone, b)
    refuse.moving(point, alone, b)
    refuse.limited(point, alone)
    F = local.assemble(alone, J, n)
    nx = F.shape[0] - 2 * n
    whole = layout.states(point.plant)
    S, network = F[:, : nx + 2 * n], local.real(point.admittance())
    filled = S.astype(bool).tocsr()
    read = np.diff(filled[:, :nx].tocsc().indptr) > 0
    live = (np.diff(filled.indptr)[:nx] > 0) | read
    live &= np.array([p.name != "energy" for p in whole], bool)
    rows = np.flatnonzero(live)
    fx, fv = F[rows][:, rows], F[rows, nx : nx + 2 * n]
    gx, gv = F[nx:, rows], (F[nx:, nx : nx + 2 * n] - network).tocsc()
    fu, gu = _inputs(point, F, rows, nx, u)
    parts = (fx, fv, gx, gv, fu, gu)
    hx, hv, hu = _outputs(point, parts, rows, nx, y)
    return Descriptor(point, *parts, hx, hv, hu, tuple(whole[k] for k in rows), rows, u, y)


def _inputs(
    point: OperatingPoint, F: sp.csc_matrix, rows: np.ndarray, nx: int, signals: tuple[Signal, ...]
) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    fu = sp.lil_matrix((len(rows), len(signals)))
    gu = sp.lil_matrix((F.shape[0] - nx, len(signals)))
    for k, signal in enumerate(signals):
        place = ins.place(point, signal)
        if place is None:
            bus = ins.draw(point, signal).bus
            gu[2 * bus : 2 * bus + 2, k] = ins.slopes(point, signal)[:, None]
        else:
            fu[:, k], gu[:, k] = F[rows, place], F[nx:, place]
    return fu.tocsc(), gu.tocsc()


def _outputs(
    point: OperatingPoint, parts: tuple[sp.csc_matrix, ...], rows: np.ndarray, nx: int, signals: tuple[Signal, ...]
) -> tuple[sp.csc_matrix, ...]:
    """Slopes of the outputs. The rate of a bus angle is that of its voltage, v' = -inv(gv) gx x'."""
    fx, fv, gx, gv, fu, _ = parts
    hx, hv = np.zeros((len(signals), len(rows))), np.zeros((len(signals), gv.shape[0]))
    hu = np.zeros((len(signals), fu.shape[1]))
    column = np.full(nx, -1)
    column[rows] = np.arange(len(rows))
    factor = splu(gv.T.tocsc()) if any(s.kind == "frequency" for s in signals) else None
    for k, signal in enumerate(signals):
        if signal.kind == "frequency":
            v, slope = outputs.angle_rate(point, signal.place)
            along = np.zeros(gv.shape[0])
            along[v - nx] = slope(point.z[v])
            rate = -(gx.T @ factor.solve(along))
            hx[k], hv[k], hu[k] = rate @ fx, rate @ fv, rate @ fu
            continue
        reading = outputs.reading(point, signal)
        slopes = reading.slopes(point.z)
        state = reading.places < nx
        hx[k, column[reading.places[state]]] = slopes[state]
        hv[k, reading.places[~state] - nx] = slopes[~state]
    return sp.csc_matrix(hx), sp.csc_matrix(hv), sp.csc_matrix(hu)

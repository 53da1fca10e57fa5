"""The linearized system as sparse matrices, with the bus voltages as algebraic variables.

x' = fx x + fv v + fu u        state derivatives
0  = gx x + gv v + gu u        current balance of every bus, gv = (devices) - Y
y  = hx x + hv v + hu u        outputs
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.dynamics import inputs as ins
from stabctl.dynamics import layout, outputs
from stabctl.dynamics.extended import extended
from stabctl.dynamics.jacobian import Derivatives
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen

from . import refuse


@dataclass(frozen=True, repr=False)
class Descriptor:
    """Sparse matrices (csc) of the linearized equations; x are the active states, v the voltages (re, im per bus)."""

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
    places: tuple[layout.StatePlace, ...]  # of the states
    rows: np.ndarray  # places of the states in s
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.point.case.name

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Labels of the states."""
        return layout.unique(place.label for place in self.places)

    def speeds(self) -> np.ndarray:
        """Indices (rotor units) of the speeds among the states."""
        return self.angles() + 1

    def angles(self) -> np.ndarray:
        """Indices (rotor units) of the angles among the states."""
        return np.searchsorted(self.rows, self.point.rotors.angle)

    def __str__(self) -> str:
        shape = f"{len(self.rows)} states, {self.gv.shape[0]} voltages"
        filled = self.fx.nnz + self.fv.nnz + self.gx.nnz + self.gv.nnz
        return f"linearized {self.point.case.name}: {shape}, {filled} entries"

    __repr__ = __str__


def descriptor(
    point: OperatingPoint, inputs: Iterable[str | Signal] = (), outputs: Iterable[str | Signal] = ()
) -> Descriptor:
    """Sparse descriptor matrices of an operating point, exact (complex step on the simulated equations).

    States that are constant and appear in no equation (bypassed blocks) are left out, and so is the energy of a storage
    device that no output reads: it is the integral of its power and appears in no other equation.

    Parameters
    ----------
    point : OperatingPoint
        The operating point.
    inputs, outputs : iterable of str or Signal
        Signals, as in `linearize`.

    Returns
    -------
    Descriptor

    Raises
    ------
    LinearizationError
        If the point is not an equilibrium, or a device is exactly at a limit; names the state or the limit.
    StudyError
        If a signal is not known.
    """
    case = point.case
    u, y = chosen(case, inputs, INPUTS), chosen(case, outputs, OUTPUTS)
    point = extended(point, u, y)
    lay = point.layout
    d = point.equations.at(point.s.copy())
    Y = point.admittance()
    refuse.moving(point, d, Y)
    refuse.limited(point)
    nx, nv = lay.nx, lay.first_setpoint
    filled = sp.vstack([d.of_rates, d.of_currents], format="csr").astype(bool)
    live = (np.diff(filled.indptr)[:nx] > 0) | (np.diff(filled[:, :nx].tocsc().indptr) > 0)
    read = refuse.energies(point, y)
    live &= np.array([(p.table, p.name) != ("esd", "energy") or k in read for k, p in enumerate(lay.states)], bool)
    rows = np.flatnonzero(live)
    fx, fv = d.of_rates[rows][:, rows].tocsc(), d.of_rates[rows][:, nx:nv].tocsc()
    gx, gv = d.of_currents[:, rows].tocsc(), (d.of_currents[:, nx:nv] - real(Y)).tocsc()
    fu, gu = _inputs(point, d, rows, u)
    parts = (fx, fv, gx, gv, fu, gu)
    hx, hv, hu = _outputs(point, d, parts, rows, u, y)
    return Descriptor(point, *parts, hx, hv, hu, tuple(lay.states[k] for k in rows), rows, u, y)


def real(Y: sp.csc_matrix) -> sp.csc_matrix:
    """Real form (2n, 2n) of a complex admittance, real and imaginary parts interleaved."""
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])
    return sp.csc_matrix(sp.kron(Y.real, np.eye(2)) + sp.kron(Y.imag, turned))


def _inputs(
    point: OperatingPoint, d: Derivatives, rows: np.ndarray, signals: tuple[Signal, ...]
) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    fu = sp.lil_matrix((len(rows), len(signals)))
    gu = sp.lil_matrix((d.of_currents.shape[0], len(signals)))
    for k, signal in enumerate(signals):
        place = ins.place(point, signal)
        fu[:, k] = d.of_rates[rows][:, [place]].toarray()
        gu[:, k] = d.of_currents[:, [place]].toarray()
    return fu.tocsc(), gu.tocsc()


def _outputs(
    point: OperatingPoint,
    d: Derivatives,
    parts: tuple[sp.csc_matrix, ...],
    rows: np.ndarray,
    ins_of: tuple[Signal, ...],
    signals: tuple[Signal, ...],
) -> tuple[sp.csc_matrix, ...]:
    """Derivatives of the outputs. The rate of a bus angle follows from that of its voltage, v' = -inv(gv) gx x'."""
    fx, fv, gx, gv, fu, _ = parts
    nx = point.layout.nx
    hx, hv = np.zeros((len(signals), len(rows))), np.zeros((len(signals), gv.shape[0]))
    hu = np.zeros((len(signals), fu.shape[1]))
    factor = cache(lambda: splu(gv.T.tocsc()))
    for k, signal in enumerate(signals):
        if signal.kind == "frequency":
            v, slope = outputs.angle_rate(point, signal.number)
            along = np.zeros(gv.shape[0])
            along[v - nx] = slope(point.s[v])
            rate = -(gx.T @ factor().solve(along))
            hx[k], hv[k], hu[k] = rate @ fx, rate @ fv, rate @ fu
            continue
        reading = outputs.reading(point, signal)
        if reading is None:
            row = d.of_outputs[outputs.place(point, signal) - point.layout.first_output].toarray().ravel()
        else:
            row = np.zeros(point.layout.step)
            row[reading.places] = reading.slopes(point.s)
        hx[k], hv[k] = row[rows], row[nx : point.layout.first_setpoint]
        hu[k] = [row[ins.place(point, s)] for s in ins_of]
    return sp.csc_matrix(hx), sp.csc_matrix(hv), sp.csc_matrix(hu)

"""The linearized system as sparse matrices, with the bus voltages as algebraic variables.

x' = fx x + fv v + fu u        state derivatives
0  = gx x + gv v + gu u        current balance of every bus, gv = (devices) - Y
y  = hx x + hv v + hu u        outputs
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.dynamics import layout, outputs, storage
from stabctl.dynamics.inputs import extended, place
from stabctl.dynamics.jacobian import Derivatives, Matrix, array, filled
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen
from stabctl.model.case import Case

from . import _linearization_checks


class Parts(NamedTuple):
    """The matrices of the linearized equations, dense if the system is small."""

    fx: Matrix
    fv: Matrix
    gx: Matrix
    gv: Matrix
    fu: Matrix
    gu: Matrix
    hx: Matrix
    hv: Matrix
    hu: Matrix


def _sparse(name: str) -> "cached_property[sp.csc_matrix]":
    """One of the parts as a sparse matrix."""
    return cached_property(lambda d: sp.csc_matrix(getattr(d.parts, name)))


@dataclass(frozen=True, repr=False)
class Descriptor:
    """Sparse matrices (csc) of the linearized equations; x are the active states, v the voltages (re, im per bus)."""

    point: OperatingPoint
    parts: Parts
    places: tuple[layout.StatePlace, ...]  # of the states
    rows: np.ndarray  # their indices in s
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]

    fx, fv, gx, gv = (_sparse(name) for name in ("fx", "fv", "gx", "gv"))
    fu, gu = (_sparse(name) for name in ("fu", "gu"))
    hx, hv, hu = (_sparse(name) for name in ("hx", "hv", "hu"))

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.point.case.name

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Labels of the states."""
        return layout.unique(place.label for place in self.places)

    def speeds(self) -> np.ndarray:
        """Indices of the speeds among the states, of the rotors whose speed is a state."""
        speed = self.point.rotors.speed
        return np.searchsorted(self.rows, speed[speed < self.point.layout.nx])

    def angles(self) -> np.ndarray:
        """Indices (rotor units) of the angles among the states."""
        return np.searchsorted(self.rows, self.point.rotors.angle)

    def __str__(self) -> str:
        shape = f"{len(self.rows)} states, {self.gv.shape[0]} voltages"
        entries = self.fx.nnz + self.fv.nnz + self.gx.nnz + self.gv.nnz
        return f"linearized {self.point.case.name}: {shape}, {entries} entries"

    __repr__ = __str__


def descriptor(
    point: Case | OperatingPoint, inputs: Iterable[str | Signal] = (), outputs: Iterable[str | Signal] = ()
) -> Descriptor:
    """Sparse descriptor matrices of an operating point, exact (complex step on the simulated equations).

    States that are constant and appear in no equation (bypassed blocks), or that limits hold, are left out. So is
    the energy of a storage device that no output reads: the integral of its power, in no other equation.

    Parameters
    ----------
    point : Case or OperatingPoint
        The operating point; a case is initialized first.
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
    point = operating_point(point)
    case = point.case
    u, y = chosen(case, inputs, INPUTS), chosen(case, outputs, OUTPUTS)
    point = extended(point, u, y)
    lay = point.layout
    d = point.equations.at(point.s.copy())
    Y = point.real_admittance()
    _linearization_checks.moving(point, d, Y)
    _linearization_checks.limited(point)
    nx, nv = lay.nx, lay.first_setpoint
    live = filled(d.of_rates, 1) | filled(d.of_rates[:, :nx], 0) | filled(d.of_currents[:, :nx], 0)
    read = _linearization_checks.energies(point, y)
    energy = [k for k, p in enumerate(lay.states) if storage.is_energy(p.table, p.name) and k not in read]
    live[energy] = live[_linearization_checks.kept(point)] = False
    rows = np.flatnonzero(live)
    given = np.array([place(point, signal) for signal in u], int)
    rates, currents, v = d.of_rates[rows], d.of_currents, slice(nx, nv)
    fx, fv, fu = rates[:, rows], rates[:, v], rates[:, given]
    gx, gv, gu = currents[:, rows], currents[:, v] - Y, currents[:, given]
    found = _outputs(point, d, (fx, fv, gx, gv, fu), rows, given, y)
    return Descriptor(point, Parts(fx, fv, gx, gv, fu, gu, *found), tuple(lay.states[k] for k in rows), rows, u, y)


def _outputs(
    point: OperatingPoint,
    d: Derivatives,
    parts: tuple[Matrix, ...],
    rows: np.ndarray,
    inputs: np.ndarray,
    signals: tuple[Signal, ...],
) -> tuple[np.ndarray, ...]:
    """Derivatives of the outputs. The rate of a bus angle follows from v' = -inv(gv) gx x', with constant inputs."""
    fx, fv, gx, gv, fu = parts
    nx = point.layout.nx
    hx, hv = np.zeros((len(signals), len(rows))), np.zeros((len(signals), gv.shape[0]))
    hu = np.zeros((len(signals), len(inputs)))
    factor = cache(lambda: splu(sp.csc_matrix(gv.T)))
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
            row = array(d.of_outputs[[outputs.place(point, signal) - point.layout.first_output]]).ravel()
        else:
            places, slopes = reading.places, reading.slopes(point.s)
            made = places >= point.layout.first_output  # speeds of virtual rotors
            row = slopes[made] @ d.of_outputs[places[made] - point.layout.first_output]
            row[places[~made]] += slopes[~made]
        hx[k], hv[k] = row[rows], row[nx : point.layout.first_setpoint]
        hu[k] = row[inputs]
    return hx, hv, hu

"""The nonlinear system for python-control, with the names and deviations of its linear model."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError

from . import inputs as ins
from . import local, outputs
from .descriptor import Descriptor, descriptor
from .model import eliminated
from .signals import Signal

if TYPE_CHECKING:
    import control

TOLERANCE = 1e-12  # pu   largest current mismatch of a bus


def nonlinear(
    point: OperatingPoint, inputs: Iterable[str | Signal] = (), outputs: Iterable[str | Signal] = ()
) -> "control.NonlinearIOSystem":
    """The simulated equations as a python-control system; states, inputs and outputs are deviations from the point.

    It bears the names of `linearize`, so that one takes the other's place in an interconnection. Signals and errors as
    there; `StudyError` during a simulation where the network has no voltages.
    """
    import control

    d = descriptor(point, inputs, outputs)
    model, motion = eliminated(d), Motion(d)
    labels = {k: [name.replace(".", " ") for name in getattr(model, k)] for k in ("states", "inputs", "outputs")}
    return control.NonlinearIOSystem(
        lambda t, x, u, params: motion.rates(x, u),
        lambda t, x, u, params: motion.outputs(x, u),
        name=model.name.replace(".", " "),
        **labels,
    )


class Motion:
    """State rates and outputs of the nonlinear system at deviations (x, u) from its point."""

    def __init__(self, d: Descriptor) -> None:
        point = d.point
        self._d, self._point = d, point
        self._alone = local.private(point.plant)
        self._Y = point.admittance()
        self._nx = len(point.z) - 2 * len(point.V) - 2 * len(point.case.machines) - len(point.case.storage)
        self._factor = splu(d.gv)
        self._places = [ins.place(point, s) for s in d.inputs]
        self._draws = [ins.draw(point, s) if p is None else None for s, p in zip(d.inputs, self._places, strict=True)]
        self._readings = [None if s.kind == "frequency" else outputs.reading(point, s) for s in d.outputs]
        self._start = np.array([0.0 if r is None else r.value(point.z[r.places]) for r in self._readings])

    def rates(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """State rates (1/s)."""
        return self._settled(x, u)[1][self._d.rows]

    def outputs(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Outputs, less their value at the point."""
        z, f = self._settled(x, u)
        out = np.empty(len(self._readings))
        for k, reading in enumerate(self._readings):
            out[k] = self._frequency(k, z, f) if reading is None else reading.value(z[reading.places])
        return out - self._start

    def _settled(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z with the voltages at which the currents balance, and f there."""
        z = self._point.z.copy()
        x, u = np.asarray(x, float), np.asarray(u, float)
        z[self._d.rows] += x
        for place, value in zip(self._places, u, strict=True):
            if place is not None:
                z[place] += value
        v = z[self._nx : self._nx + 2 * len(self._point.V)]
        v -= self._factor.solve(self._d.gx @ x + self._d.gu @ u)
        factor, before = self._factor, np.inf
        for _ in range(60):
            b = local.at(self._alone, z)
            f = local.values(self._alone, b)
            miss = self._miss(f, v, u)
            now = np.abs(miss).max()
            if now < TOLERANCE:
                return z, f
            if not np.isfinite(now):
                break
            if now > 0.3 * before:
                factor = splu(self._slopes(z))
            before = now
            v -= factor.solve(miss)
        raise StudyError("The network has no voltages at this state; the disturbance is too large for it.")

    def _miss(self, f: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        V = v.view(complex)
        current = local.currents(self._alone, f, len(V)) - self._Y @ V
        for d, value in zip(self._draws, u, strict=True):
            if d is not None:
                current[d.bus] += value * d.current_of(V[d.bus])
        return current.view(float)

    def _slopes(self, z: np.ndarray) -> sp.csc_matrix:
        """gv at z: the devices by complex step; what inputs draw is left out, which only slows Newton."""
        J = np.zeros((len(self._alone.columns), len(self._alone.owner)))
        J[-2:] = local.voltage_slopes(self._alone, local.at(self._alone, z))
        F = local.assemble(self._alone, J, len(self._point.V))
        return (F[self._nx :, self._nx : self._nx + 2 * len(self._point.V)] - local.real(self._Y)).tocsc()

    def _frequency(self, k: int, z: np.ndarray, f: np.ndarray) -> float:
        """Rate of the angle of a bus over wb, from v' = -inv(gv) gx x'."""
        n = 2 * len(self._point.V)
        alone, rows = self._alone, self._d.rows
        F = local.assemble(alone, local.derivatives(alone, local.at(alone, z)), len(self._point.V))
        gv = F[self._nx :, self._nx : self._nx + n] - local.real(self._Y)
        rate = -splu(gv.tocsc()).solve(F[self._nx :, rows] @ f[rows])
        v, slope = outputs.angle_rate(self._point, self._d.outputs[k].place)
        return float(slope(z[v]) @ rate[v - self._nx])

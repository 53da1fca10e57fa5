"""The nonlinear system for python-control, with the signals of its linear model."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl._util.errors import StudyError
from stabctl.dynamics import outputs
from stabctl.dynamics.inputs import place
from stabctl.dynamics.jacobian import Derivatives
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal
from stabctl.model.case import Case

from .descriptor import Descriptor, descriptor
from .model import eliminated

if TYPE_CHECKING:
    import control

TOLERANCE = 1e-12  # pu on 100 MVA   largest current mismatch of a bus


def nonlinear(
    point: Case | OperatingPoint, inputs: Iterable[str | Signal] = (), outputs: Iterable[str | Signal] = ()
) -> "control.NonlinearIOSystem":
    """Return the simulated equations as a python-control system, in deviations from the operating point.

    States, inputs and outputs have the same labels as in `linearize`, so the two models are interchangeable.

    Parameters
    ----------
    point : Case or OperatingPoint
        The operating point; a case is initialized first.
    inputs, outputs : iterable of str or Signal
        Signals, as in `linearize`.

    Returns
    -------
    control.NonlinearIOSystem

    Raises
    ------
    LinearizationError, StudyError
        As `linearize` does; also a `StudyError` while simulating, if the network equations have no solution.
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
    """State derivatives and outputs of the nonlinear system at deviations (x, u) from its operating point."""

    def __init__(self, d: Descriptor) -> None:
        point = d.point
        self._d, self._point, self._equations, self._layout = d, point, point.equations, point.layout
        self._Y = point.admittance()
        self._real = point.real_admittance()
        self._factor = splu(d.gv)
        self._places = [place(point, s) for s in d.inputs]
        self._readings = [None if s.kind == "frequency" else outputs.value(point, s) for s in d.outputs]
        self._start = np.array([0.0 if r is None else r(point.s) for r in self._readings])

    def rates(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """State derivatives (1/s)."""
        s, d = self._settled(x, u)
        rates = np.where(self._equations.held(s, d.rates, self._point.system.limits), 0.0, d.rates)
        return rates[self._d.rows]

    def outputs(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Outputs, as deviations from the operating point."""
        s, d = self._settled(x, u)
        out = np.empty(len(self._readings))
        for k, reading in enumerate(self._readings):
            out[k] = self._frequency(k, s, d) if reading is None else reading(s)
        return out - self._start

    def _settled(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, Derivatives]:
        """All signals, with the voltages at which the currents balance, and the values and derivatives there."""
        s = self._point.s.copy()
        x, u = np.asarray(x, float), np.asarray(u, float)
        s[self._d.rows] += x
        s[self._places] += u
        v = s[self._layout.voltages]
        v -= self._factor.solve(self._d.gx @ x + self._d.gu @ u)
        factor, before = self._factor, np.inf
        for _ in range(60):
            d = self._equations.at(s)
            miss = (d.currents - self._Y @ v.view(complex)).view(float)
            now = np.abs(miss).max()
            if now < TOLERANCE * 100 / self._point.case.base_mva:
                return s, d
            if not np.isfinite(now):
                break
            if now > 0.3 * before:
                factor = splu(self._slopes(d))
            before = now
            v -= factor.solve(miss)
        raise StudyError("The network equations have no solution at this state; use a smaller disturbance.")

    def _slopes(self, at: Derivatives) -> sp.csc_matrix:
        """gv there."""
        return sp.csc_matrix(at.of_currents[:, self._layout.voltages] - self._real)

    def _frequency(self, k: int, s: np.ndarray, at: Derivatives) -> float:
        """Rate of the angle of a bus over wb, from v' = -inv(gv) gx x'."""
        rows, nx = self._d.rows, self._layout.nx
        rate = -splu(self._slopes(at)).solve(at.of_currents[:, rows] @ at.rates[rows])
        v, slope = outputs.angle_rate(self._point, self._d.outputs[k].number)
        return float(slope(s[v]) @ rate[v - nx])

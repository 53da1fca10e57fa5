"""The quadratic cost of a regulator in engineering units, on states without the angle reference.

J = integral of (sum of (deviation of the speeds / speed)^2 + sum of (angle to COI / angle)^2
                 + sum of (output / effort)^2) dt
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signal_kinds import INPUTS, OUTPUTS
from stabctl.dynamics.signals import Signal, chosen
from stabctl.errors import StudyError, shown
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.model import Linear
from stabctl.smallsignal.modes import Modes
from stabctl.units import hertz, radians

from . import riccati
from .requirement import least_ratio
from .robustness import Robustness, plant, robustness

FLOOR = 1e-6  # weight of every state, relative to that of the speeds, which makes all of them observed


@dataclass(frozen=True)
class Weights:
    """What counts as much as one `effort` of an output: a speed (Hz), and an angle (rad; None: angles are free)."""

    speed: str | float = 0.1
    angle: str | float | None = None
    effort: float = 1.0

    def __post_init__(self) -> None:
        for name, value in (("speed", hertz(self.speed)), ("effort", self.effort), ("angle", self.radians)):
            if name == "angle" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not 1e-9 <= value <= 1e9:
                raise StudyError(f"{name} = {shown(getattr(self, name))} is not allowed; give 1e-9 to 1e9.")

    @property
    def radians(self) -> float | None:
        """The angle, rad."""
        return None if self.angle is None else radians(self.angle)


@dataclass(frozen=True)
class Quadratic:
    """A linear model with the cost x' Q x + |u / effort|^2; `basis` (all states, states) leaves out the rotation.

    Attributes
    ----------
    modes
        The modes of the model, whose inputs are u.
    C, D
        The signals that are read, C x + D u.
    """

    modes: Modes
    basis: np.ndarray
    Q: np.ndarray
    C: np.ndarray
    D: np.ndarray

    @property
    def model(self) -> Linear:
        """The linear model."""
        return self.modes.linear

    @property
    def A(self) -> np.ndarray:
        """Matrix of the states."""
        return np.asarray(self.basis.T @ self.model.A @ self.basis)

    @property
    def B(self) -> np.ndarray:
        """Matrix of the inputs."""
        return np.asarray(self.basis.T @ self.model.B)

    def optimal(self, effort: float) -> np.ndarray:
        """The gain K (inputs, all states) of the feedback of all states, u = K x. Raises `StudyError` if none."""
        B = self.B
        try:
            X = riccati.continuous(self.A, effort**2 * B @ B.T, self.Q)
        except np.linalg.LinAlgError:
            raise StudyError(
                f"No state feedback through {', '.join(self.model.inputs)} stabilizes {self.model.name}."
            ) from None
        return np.asarray(-(effort**2) * B.T @ X @ self.basis.T)

    def closed(self, K: np.ndarray) -> np.ndarray:
        """Matrix of the states with the feedback u = K x."""
        return np.asarray(self.A + self.B @ K @ self.basis)

    def robustness(self, K: np.ndarray) -> Robustness:
        """Margins of the feedback u = K x."""
        n, p = self.model.B.shape
        states = plant(self.modes, np.eye(n), np.zeros((n, p)))
        return robustness(lambda w: -K @ states(w), least_ratio(np.linalg.eigvals(self.closed(K))))


def driven(point: OperatingPoint, outputs: str | Sequence[str]) -> tuple[Signal, ...]:
    """The inputs that a regulator drives. Raises `StudyError` if there is none."""
    found = chosen(point.case, outputs, INPUTS)
    if not found:
        raise StudyError(f"{point.case.name} has no input {outputs!r}; choose other outputs for the regulator.")
    return found


def weighed(point: OperatingPoint, weights: Weights) -> tuple[tuple[Signal, ...], np.ndarray]:
    """The signals that the cost weighs, and the size of each that counts as much as one effort."""
    scales = {"deviation": hertz(weights.speed) / point.case.frequency_hz}
    if weights.radians:
        scales["angle"] = weights.radians
    found = chosen(point.case, list(scales), OUTPUTS)
    return found, np.array([scales[s.kind] for s in found])


def quadratic(
    point: OperatingPoint, drives: Sequence[Signal], weights: Weights, reads: Sequence[Signal] = ()
) -> Quadratic:
    """The cost at an operating point, and the signals that a regulator reads there."""
    swings, scale = weighed(point, weights)
    seen = tuple(dict.fromkeys([*reads, *swings]))
    model = closed_loop(point, inputs=drives, outputs=seen)
    basis = sl.qr(model.rotation()[:, None])[0][:, 1:]  # orthogonal to the rotation of all angles
    Z = model.C[[seen.index(s) for s in swings]] @ basis / scale[:, None]
    Q = Z.T @ Z
    Q = Q + FLOOR * np.trace(Q) / len(Q) * np.eye(len(Q))
    rows = [seen.index(s) for s in reads]
    return Quadratic(model.modes(), basis, Q, model.C[rows], model.D[rows])

"""Linear-quadratic regulators: cost in engineering units, Riccati equation, margins, and the result.

The cost of a regulator is

    J = integral of (sum of (deviation of the speeds / speed)^2 + sum of (angle to COI / angle)^2
                     + sum of (output / effort)^2) dt

that is, of x' Q x + u' R u for the states x and the outputs u of the regulator, the inputs of the plant
x' = A x + B u.

The margins hold in every input at once. With the loop gain L at the inputs of the plant, the return difference 1 + L,
and T = L (1 + L)^-1, the loop stays stable with

    gains from 1/(1 + a) to 1/(1 - a),   a = least singular value of 1 + L(jw), at most 1,
    delays t with |exp(-jwt) - 1| s(T(jw)) < 1 at all w,   s the largest singular value,

also with different gains, or delays up to t, in every input. A regulator on all states with equal efforts has a = 1.
Source: N. Lehtomaki, N. Sandell, M. Athans, Robustness results in linear-quadratic Gaussian based multivariable control
designs, IEEE Trans. Automatic Control 26, 1981.

The algebraic Riccati equations

    continuous   A' X + X A - X G X + Q = 0
    discrete     A' X (1 + G X)^-1 A + Q = X,       G = B R^-1 B'

are solved by doubling, which takes a tenth of the time of Schur vectors for hundreds of states; the Cayley transform
makes the continuous one discrete. Source: E. Chu, H. Fan, W. Lin, A structure-preserving doubling algorithm for
continuous-time algebraic Riccati equations, Linear Algebra and its Applications 396, 2005.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import scipy.linalg as sl
from scipy.optimize import minimize_scalar

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import hertz, radians
from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.margins import AROUND
from stabctl.smallsignal.model import Linear, grid
from stabctl.smallsignal.modes import Modes

from .result import Design, least, least_ratio

Loop = Callable[[float], np.ndarray]  # a response at a frequency in rad/s
FLOOR = 1e-6  # weight of every state, relative to that of the speeds, which makes all of them observed
HZ = (0.01, 100.0)  # between which margins are sought
ROUND = 1e-3  # below 1 by which the return difference of an optimal loop may fall by rounding
SHIFT = 10.0  # 1/s   of the Cayley transform; must not be an eigenvalue of A
MOST = 60  # doublings
ENOUGH = 1e-14  # relative change of X of the last doubling


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
class Robustness:
    """Margins of a loop; gains and delays may differ from input to input.

    Attributes
    ----------
    damping
        Smallest damping ratio of 0.1 to 3 Hz.
    gain_down, gain_up
        Factors of the gains that the loop withstands; inf if any.
    delay_s
        Delay that the loop withstands, s.
    """

    damping: float
    gain_down: float
    gain_up: float
    delay_s: float

    def __str__(self) -> str:
        up = "any" if np.isinf(self.gain_up) else f"{self.gain_up:.3g}"
        late = "any" if np.isinf(self.delay_s) else f"{1e3 * self.delay_s:.3g} ms"
        return f"damping ratio {self.damping:.4f}, gain margin {self.gain_down:.3g} to {up}, delay margin {late}"


@dataclass(frozen=True)
class Quadratic:
    """A linear model, and the cost x' Q x + |u / effort|^2; `basis` (all states, states) leaves out all that rests.

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
            X = continuous_riccati(self.A, effort**2 * B @ B.T, self.Q)
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
        s = np.linalg.eigvals(self.closed(K))
        return robustness(lambda w: -K @ states(w), s, least_ratio(s))


@dataclass(frozen=True, repr=False)
class Regulator(Design):
    """A regulator, and the state feedback that it approximates.

    Attributes
    ----------
    full
        Margins of the feedback of all states.
    own
        Margins of the regulator itself, in the full model.

    Examples
    --------
    >>> found = st.design.lqr(st.load("two_area_thyristor"), inputs="angle, speed", storage="50MW")
    >>> round(found.full.damping, 3), round(found.own.damping, 3)
    (0.102, 0.102)
    """

    full: Robustness | None = None
    own: Robustness | None = None

    @classmethod
    def of_cost(cls, cost: Quadratic, one: Controller, after: Modes, **more: Any) -> Self:
        """The regulator for a cost; its aim is reached if the smallest damping ratio increases.

        Parameters
        ----------
        cost : Quadratic
            The cost and the plant.
        one : Controller
            The regulator.
        after : Modes
            Modes with the regulator.
        **more
            Other fields, such as `full` and `own`.

        Returns
        -------
        Regulator
        """
        return cls((one,), (cost.modes,), (after,), least(after)[0] > least(cost.modes)[0], **more)

    def __str__(self) -> str:
        text = super().__str__()
        if self.full is not None:
            text += f"\nall states: {self.full}"
        if self.own is not None and self.own != self.full:
            text += f"\ngiven inputs: {self.own}"
        return text

    __repr__ = __str__


def driven(point: OperatingPoint, outputs: str | Sequence[str]) -> tuple[Signal, ...]:
    """The inputs that a regulator drives. Raises `StudyError` if there is none."""
    found = chosen(point.case, outputs, INPUTS)
    if not found:
        raise StudyError(f"{point.case.name} has no input {outputs!r}; choose other outputs for the regulator.")
    return found


def quadratic(
    point: OperatingPoint, drives: Sequence[Signal], weights: Weights, reads: Sequence[Signal] = ()
) -> Quadratic:
    """The cost at an operating point, and the signals that a regulator reads there."""
    swings, scale = weighed(point, weights)
    seen = tuple(dict.fromkeys([*reads, *swings]))
    model = closed_loop(point, inputs=drives, outputs=seen)
    constant = ~np.hstack([model.A, model.B]).any(axis=1)
    out = np.hstack([model.rotation(), np.eye(len(model.A))[:, constant]])
    basis = sl.qr(out)[0][:, out.shape[1] :]  # orthogonal to the rotations of all angles and to what nothing moves
    Z = model.C[[seen.index(s) for s in swings]] @ basis / scale[:, None]
    Q = Z.T @ Z
    Q = Q + FLOOR * np.trace(Q) / len(Q) * np.eye(len(Q))
    rows = [seen.index(s) for s in reads]
    return Quadratic(model.modes(), basis, Q, model.C[rows], model.D[rows])


def weighed(point: OperatingPoint, weights: Weights) -> tuple[tuple[Signal, ...], np.ndarray]:
    """The signals that the cost weighs, and the size of each that counts as much as one effort."""
    scales = {"deviation": hertz(weights.speed) / point.case.frequency_hz}
    if weights.radians:
        scales["angle"] = weights.radians
    found = chosen(point.case, list(scales), OUTPUTS)
    return found, np.array([scales[s.kind] for s in found])


def robustness(loop: Loop, poles: np.ndarray, damping: float, fastest: float = HZ[1]) -> Robustness:
    """Margins of a stable loop.

    Parameters
    ----------
    loop : callable
        The loop gain L (inputs, inputs), with the sign of a negative feedback, at a frequency in rad/s.
    poles : array, 1/s
        Eigenvalues of the closed loop, near which margins are least.
    damping : float
        Smallest damping ratio of the loop.
    fastest : float, Hz
        Highest frequency; half of the rate of a sampled loop.
    """

    def difference(hz: float) -> float:
        L = loop(2 * np.pi * hz)
        return min(1.0, float(np.linalg.svd(np.eye(len(L)) + L, compute_uv=False)[-1]))

    def late(hz: float) -> float:
        L = loop(2 * np.pi * hz)
        size = float(np.linalg.norm(L @ np.linalg.inv(np.eye(len(L)) + L), 2))
        return float(np.arcsin(1 / (2 * size)) / (np.pi * hz)) if size > 0.5 else np.inf

    hz = grid(poles, HZ[0], fastest, AROUND)
    smallest, delay = _least(difference, hz), _least(late, hz)
    up = np.inf if smallest > 1 - ROUND else 1 / (1 - smallest)
    return Robustness(damping, 1 / (1 + smallest), up, delay)


def _least(value: Callable[[float], float], hz: np.ndarray) -> float:
    """The least value between frequencies, of which some are near every narrow minimum."""
    v = np.array([value(f) for f in hz])
    low = np.flatnonzero((v[1:-1] <= v[:-2]) & (v[1:-1] <= v[2:]) & (v[1:-1] < 2 * v.min())) + 1
    between = [minimize_scalar(value, bounds=(hz[k - 1], hz[k + 1]), method="bounded").fun for k in low]
    return float(min([v.min(), *between]))


def plant(modes: Modes, C: np.ndarray, D: np.ndarray, rate: int | None = None) -> Loop:
    """Response (signals, inputs) of y = C x + D u at a frequency in rad/s.

    Parameters
    ----------
    modes : Modes
        All modes of the plant, whose inputs are u.
    C, D : (signals, states) and (signals, inputs) arrays
        The outputs.
    rate : int, 1/s, optional
        Frames per second at which u is held and y read, with the u before.
    """
    s = modes.eigenvalues
    moving = s != 0  # but for the rotation of all angles, which no feedback reads
    s = s[moving]
    left, right = (modes.left.conj().T @ modes.linear.B)[moving], (C @ modes.right)[:, moving]
    if rate is None:
        return lambda w: (right / (1j * w - s)) @ left + D
    step = np.exp(s / rate)
    left = left * ((step - 1) / s)[:, None]
    return lambda w: (right / (np.exp(1j * w / rate) - step)) @ left + D * np.exp(-1j * w / rate)


def continuous_riccati(A: np.ndarray, G: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """The stabilizing solution of the continuous equation. Raises `numpy.linalg.LinAlgError` if there is none."""
    one = np.eye(len(A))
    shifted = A - SHIFT * one
    inverse = np.linalg.inv(shifted)
    W = np.linalg.inv(shifted.T + Q @ inverse @ G)
    return discrete_riccati(one + 2 * SHIFT * W.T, 2 * SHIFT * inverse @ G @ W, 2 * SHIFT * W @ Q @ inverse)


def discrete_riccati(A: np.ndarray, G: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """The stabilizing solution of the discrete equation: the limit of X, whose horizon every step doubles.

    Raises `numpy.linalg.LinAlgError` if there is none.
    """
    one, X = np.eye(len(A)), Q
    for _ in range(MOST):
        with np.errstate(over="ignore", invalid="ignore"):
            M = np.linalg.inv(one + G @ X)
            change = A.T @ X @ M @ A
            A, G, X = A @ M @ A, _symmetric(G + A @ M @ G @ A.T), _symmetric(X + change)
        if not np.isfinite(X).all():
            break
        if np.abs(change).max() <= ENOUGH * np.abs(X).max():
            return X
    raise np.linalg.LinAlgError("no stabilizing solution")


def _symmetric(X: np.ndarray) -> np.ndarray:
    return np.asarray(X + X.T) / 2

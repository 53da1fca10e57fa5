"""Linear-quadratic-Gaussian regulator: a sampled controller with its own state estimator.

The plant is reduced to a few states x, x+ a frame later. Its inputs u are held for a frame and d frames late; w and v
are the noises of the loads and of the measurements y:

    x+ = P x + G u(k - d) + w,    y = C x + D u(k - 1 - d) + v

    estimate    xf = x + L (y - C x - D u(k - 1 - d)),    L = S C' (C S C' + V)^-1
    regulator   u = -K [xf; u(k - 1) ... u(k - d)],       K = (R + H' X H)^-1 H' X F
    prediction  x+ = P xf + G u(k - d)

S and X solve the discrete Riccati equations of the noise and of the cost, V is the covariance of v, R the weight of u,
and F, H are P, G with the outputs under way, u(k - 1) ... u(k - d), among the states. Source: K. Astrom, B. Wittenmark,
Computer Controlled Systems, 3rd ed. 1997, chapter 11.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import expm

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import megawatts
from stabctl.controllers.controller import Controller
from stabctl.controllers.timing import checked_frames, duration
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import INPUTS, OUTPUTS, SPEEDS, Signal, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.interconnection import held
from stabctl.smallsignal.reduce import Reduced, balanced, kept_modes

from .lqr import stable
from .quadratic import Regulator, Weights, discrete_riccati, driven, plant, quadratic, robustness, weighed
from .result import least

NOISE = 2e-3  # standard deviation of a measurement, rad or pu
SPEED_NOISE = 5e-3  # Hz
LIMITED = (
    "The design ignores the limits of the outputs, and the estimator does not know when they act; check the regulator "
    "by simulation."
)
CONSTANT = 1e-12  # of the largest row of [A B]: a state that nothing moves
DROPPED = 1e-3  # of the sum of the Hankel singular values that the reduction drops, by default


def lqg(
    base: "Case | OperatingPoint",
    outputs: str | Sequence[str] = "order",
    inputs: str | Sequence[str] = "deviation",
    *,
    rate: int = 60,
    delay: str | float = 0.0,
    speed: str | float = 0.1,
    angle: str | float | None = None,
    effort: float = 1.0,
    disturbance: str | float = "10MW",
    noise: float = 1.0,
    order: int | None = None,
    limits: tuple[float, float] | float | None = None,
    storage: "Fleet | None" = None,
    name: str = "lqg",
) -> Regulator:
    """Design a sampled regulator with its own state estimator, from measurements to some inputs.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    outputs : str or sequence of str
        Inputs of the system that it drives, such as "order".
    inputs : str or sequence of str
        Signals that it reads, such as "deviation", "flow:7-8" or "bus_frequency".
    rate : int, 1/s
        Frames per second.
    delay : str or float, s
        Time from measurement to output, which the estimator knows; a whole number of frames.
    speed, angle, effort
        Weights, as in `lqr`.
    disturbance : str or float, MW
        Random change of the load at every machine within a second (standard deviation).
    noise : float
        Noise of the measurements: 1 is 5 mHz for speeds and frequencies, 2 mrad for angles, 0.002 pu otherwise.
    order : int, optional
        States of the reduced plant; by default 99.9 % of the sum of the Hankel singular values is kept.
    limits : pair of float, optional
        Limits of the outputs. The design ignores them, and the estimator takes every output as given in full, so its
        states are wrong while an output is at a limit; check such a regulator by simulation.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    name : str
        Name of the controller.

    Returns
    -------
    Regulator
        With the margins of the continuous feedback of all states, and of the regulator in the full model.

    Raises
    ------
    StudyError
        If the system cannot be stabilized with these inputs and measurements.

    Examples
    --------
    >>> found = st.design.lqg(st.load("two_area_thyristor"), storage="50MW", delay="50ms")
    >>> print(found)
    1 controller: smallest damping ratio of 0.1 to 3 Hz: -0.0087 without, 0.1015 with.
    all states: damping ratio 0.1015, gain margin 0.5 to any, delay margin 253 ms
    given inputs: damping ratio 0.1015, gain margin 0.537 to 7.28, delay margin 253 ms
    """
    point = operating_point(base, storage)
    drives, weights = driven(point, outputs), Weights(speed, angle, effort)
    reads = chosen(point.case, inputs, OUTPUTS)
    if not reads:
        raise StudyError(f"{point.case.name} has no signal {inputs!r}; choose other inputs for the regulator.")
    late = duration("delay", delay)
    power = megawatts(disturbance)
    if not 0 < power <= 1e6:
        raise StudyError(f"disturbance = {shown(disturbance)} is not allowed; give more than 0 and at most 1e6 MW.")
    frames = checked_frames(name, rate, late)
    if isinstance(noise, bool) or not isinstance(noise, int | float) or not 1e-6 <= noise <= 1e6:
        raise StudyError(f"noise = {shown(noise)} is not allowed; give a number from 1e-6 to 1e6.")
    if order is not None and (isinstance(order, bool) or not isinstance(order, int) or order < 1):
        raise StudyError(f"order = {shown(order)} is not a number of states; give at least 1.")
    scales = _Scales(effort, power / point.case.base_mva, noise * _noise(point, reads))
    small = _reduced(point, drives, reads, scales, weights, order)
    bounds: Any = (-np.inf, np.inf) if limits is None else limits
    matrices = compensator(small, len(drives), len(reads), rate, frames, name)
    bare = Controller(
        tuple(s.name for s in reads), tuple(s.name for s in drives), *matrices,
        name=name, rate=rate, delay=late, limits=bounds,
    )  # fmt: skip
    one = replace(bare, B=bare.B / scales.noise, C=effort * bare.C, D=effort * bare.D / scales.noise)
    cost, after = quadratic(point, drives, weights, reads), stable(point, one)
    seen = plant(cost.modes, cost.C, cost.D, rate)
    own = robustness(lambda w: -response(one, w) @ seen(w), after.eigenvalues, least(after)[0], rate / 2)
    said = () if limits is None else (LIMITED,)
    return Regulator.of_cost(cost, one, after, full=cost.robustness(cost.optimal(effort)), own=own, remarks=said)


@dataclass(frozen=True)
class _Scales:
    """Units in which inputs and measurements of the plant are about 1."""

    effort: float
    power: float  # pu
    noise: np.ndarray


def _noise(point: OperatingPoint, reads: Sequence[Signal]) -> np.ndarray:
    hz = point.case.frequency_hz
    return np.array([SPEED_NOISE / hz if s.kind in SPEEDS else NOISE for s in reads])


def _reduced(
    point: OperatingPoint,
    drives: Sequence[Signal],
    reads: Sequence[Signal],
    scales: _Scales,
    weights: Weights,
    order: int | None,
) -> Reduced:
    """The plant with scaled inputs [u, load changes] and outputs [y, cost], without rotations and constant states."""
    loads = chosen(point.case, list(dict.fromkeys(f"storage:{m.storage_bus}" for m in point.case.machines)), INPUTS)
    swings, sizes = weighed(point, weights)
    seen = tuple(dict.fromkeys([*reads, *swings]))
    driven = list(dict.fromkeys([*drives, *loads]))
    model = closed_loop(point, inputs=driven, outputs=seen)
    rows, columns = [seen.index(s) for s in (*reads, *swings)], [driven.index(s) for s in (*drives, *loads)]
    ins = np.repeat([scales.effort, scales.power], [len(drives), len(loads)])
    outs = np.r_[scales.noise, sizes][:, None]
    labels = tuple(s.label for s in reads), tuple(f"cost {s.label}" for s in swings)
    scaled = replace(
        model, B=model.B[:, columns] * ins, C=model.C[rows] / outs, D=model.D[rows][:, columns] * ins / outs,
        inputs=tuple(model.inputs[i] for i in columns), outputs=labels[0] + labels[1],
    )  # fmt: skip
    modes = replace(model.modes(), linear=scaled)
    loose, n = len(kept_modes(modes)), len(scaled.states)
    if order is None and loose == n:
        order = n
    elif order is None:
        hankel = balanced(modes, loose + 1).hankel
        left = hankel.sum() - np.cumsum(hankel)
        order = loose + int(np.argmax(left <= DROPPED * hankel.sum())) + 1
    small = balanced(modes, order)
    moved = np.abs(np.hstack([small.A, small.B])).max(axis=1)
    own = [k for k in range(modes.references, len(moved)) if moved[k] > CONSTANT * moved.max()]
    names = tuple(small.states[k] for k in own)
    return replace(small, A=small.A[np.ix_(own, own)], B=small.B[own], C=small.C[:, own], states=names)


def compensator(
    model: Reduced, p: int, m: int, rate: int, d: int, name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Matrices of estimator and regulator for p inputs and m measurements, all scaled, d frames late."""
    T, n = 1 / rate, len(model.A)
    B, load, C, z, D = model.B[:, :p], model.B[:, p:], model.C[:m], model.C[m:], model.D[:m, :p]
    P, G = held(model.A, B, T)
    spread = _covariance(model.A, load @ load.T, T)
    seen = np.eye(m) + model.D[:m, p:] @ model.D[:m, p:].T / T
    # the states of the regulator: x, then u(k - 1) ... u(k - d)
    F, H, Q = np.zeros((n + d * p, n + d * p)), np.zeros((n + d * p, p)), np.zeros((n + d * p, n + d * p))
    F[:n, :n], Q[:n, :n] = P, T * z.T @ z
    if d:
        F[:n, n + (d - 1) * p :] = G
        F[n + p :, n : n + (d - 1) * p] = np.eye((d - 1) * p)
        H[n : n + p] = np.eye(p)
    else:
        H = G
    try:
        X = discrete_riccati(F, H @ H.T / T, Q)
        S = discrete_riccati(P.T, C.T @ np.linalg.solve(seen, C), spread)
    except np.linalg.LinAlgError:
        raise StudyError(
            f"{name}: the signals that it reads and drives do not stabilize {model.name}; choose more of them."
        ) from None
    K = np.linalg.solve(T * np.eye(p) + H.T @ X @ H, H.T @ X @ F)
    L = np.linalg.solve(C @ S @ C.T + seen, C @ S).T
    # the states of the controller: x, then u(k - 1) ... u(k - 1 - d)
    size = n + (d + 1) * p
    old = np.eye(size)[n + d * p :]  # u(k - 1 - d)
    filtered = np.hstack([np.eye(n) - L @ C, np.zeros((n, size - n))]) - L @ D @ old
    line = np.eye(size)[n : n + d * p]
    u, uy = -K[:, :n] @ filtered - K[:, n:] @ line, -K[:, :n] @ L
    acting, acting_y = (u, uy) if d == 0 else (np.eye(size)[n + (d - 1) * p : n + d * p], np.zeros((p, m)))
    A = np.vstack([P @ filtered + G @ acting, u, np.eye(size)[n : n + d * p]])
    return A, np.vstack([P @ L + G @ acting_y, uy, np.zeros((d * p, m))]), u, uy


def _covariance(A: np.ndarray, W: np.ndarray, T: float) -> np.ndarray:
    """Integral of exp(A t) W exp(A' t) over T. Source: C. Van Loan, IEEE Trans. Automatic Control 23, 1978."""
    n = len(A)
    M = expm(np.block([[-A, W], [np.zeros((n, n)), A.T]]) * T)
    return np.asarray(M[n:, n:].T @ M[:n, n:])


def response(c: Controller, w: float) -> np.ndarray:
    """Response (outputs, inputs) of a sampled controller with its delay at w (rad/s)."""
    z = np.exp(1j * w / (c.rate or 1))
    return np.asarray((c.C @ np.linalg.solve(z * np.eye(len(c.A)) - c.A, c.B) + c.D) * z**-c.frames)

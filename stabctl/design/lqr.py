"""Linear-quadratic regulator: feedback of all states or of measurements that minimizes swings and control effort.

A regulator that reads a few signals y = C x takes the gain whose output differs least from that of all states, in the
mean square of the motion of the optimal loop under white noise of the power of every machine:

    K_y = K P C' (C P C')^-1,    P the covariance of the states.

Source: R. Kosut, Suboptimal control of linear time-invariant systems subject to control structure constraints, IEEE
Trans. Automatic Control 15, 1970 (minimum error excitation).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.linalg as sl

from stabctl._util.errors import StudyError
from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import OUTPUTS, Signal, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes

from .quadratic import Quadratic, Regulator, Weights, driven, plant, quadratic, robustness
from .result import GROWING, least


def lqr(
    base: "Case | OperatingPoint",
    outputs: str | Sequence[str] = "order",
    inputs: str | Sequence[str] | None = None,
    *,
    speed: str | float = 0.1,
    angle: str | float | None = None,
    effort: float = 1.0,
    storage: "Fleet | None" = None,
    limits: tuple[float, float] | float | None = None,
    name: str = "lqr",
) -> Regulator:
    """Design a regulator that drives some inputs.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    outputs : str or sequence of str
        Inputs of the system that it drives, such as "order".
    inputs : str or sequence of str, optional
        Signals that it reads, such as "angle, speed", which an estimator gives; by default all states.
    speed : str or float, Hz
        Speed deviation from the other machines that counts as much as one `effort`.
    angle : str or float, rad, optional
        Angle to the COI that counts as much as one `effort`; by default angles are free.
    effort : float
        Size of an output, in the unit of the input driven (ratings, for orders).
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    limits : pair of float, optional
        Limits of the outputs.
    name : str
        Name of the controller.

    Returns
    -------
    Regulator
        With the margins of the feedback of all states, and of the regulator if it reads less.

    Raises
    ------
    StudyError
        If the system cannot be stabilized with these inputs.

    Examples
    --------
    >>> print(st.design.lqr(st.load("two_area_thyristor"), storage="50MW", speed="100mHz"))
    1 controller: smallest damping ratio of 0.1 to 3 Hz: -0.0087 without, 0.1015 with.
    """
    point = operating_point(base, storage)
    drives, reads = driven(point, outputs), () if inputs is None else chosen(point.case, inputs, OUTPUTS)
    cost = quadratic(point, drives, Weights(speed, angle, effort), reads)
    K = cost.optimal(effort)
    if inputs is None:
        one = _static([f"state:{label}" for label in cost.model.states], drives, K, limits, name)
        after = stable(point, one)
        return Regulator.of_cost(cost, one, after)
    K_y = _projected(cost, K)
    one = _static([s.name for s in reads], drives, K_y, limits, name)
    after, seen = stable(point, one), plant(cost.modes, cost.C, cost.D)
    own = robustness(lambda w: -K_y @ seen(w), after.eigenvalues, least(after)[0])
    return Regulator.of_cost(cost, one, after, full=cost.robustness(K), own=own)


def _projected(cost: Quadratic, K: np.ndarray) -> np.ndarray:
    """The gain (outputs, signals) that comes nearest to K x in the optimal loop."""
    speeds, rotors = cost.model.speeds(), cost.model.point.rotors
    H = rotors.inertia[rotors.speed < cost.model.point.layout.nx]
    noise = cost.basis[speeds] / H[:, None]
    P = sl.solve_continuous_lyapunov(cost.closed(K), -noise.T @ noise)
    C = (cost.C + cost.D @ K) @ cost.basis
    return np.asarray(K @ cost.basis @ P @ C.T @ np.linalg.pinv(C @ P @ C.T, rcond=1e-10, hermitian=True))


def _static(inputs: Sequence[str], drives: Sequence[Signal], K: np.ndarray, limits: Any, name: str) -> Controller:
    p, m = K.shape
    bounds = (-np.inf, np.inf) if limits is None else limits
    none = np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0))
    return Controller(tuple(inputs), tuple(s.name for s in drives), *none, K, name=name, limits=bounds)


def stable(point: OperatingPoint, one: Controller) -> Modes:
    """The modes with the regulator. Raises `StudyError` if one of them grows."""
    modes = closed_loop(point, one).modes()
    if (modes.eigenvalues.real > GROWING).any():
        raise StudyError(
            f"{one.name} does not stabilize {point.case.name} with {', '.join(one.inputs[:4])}"
            + (" ..." if len(one.inputs) > 4 else "") + "; give more inputs, or change the weights."
        )  # fmt: skip
    return modes

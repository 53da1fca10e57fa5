"""Linear-quadratic regulator: state feedback that minimizes the swings and the effort.

    J = integral of (sum of (deviation of the speeds / speed_s)^2 + sum of (output / effort)^2) dt

The angle reference, which no input moves, is removed by projection, so the gains read only angles against each other.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.linalg as sl

from stabctl.controllers.controller import Controller
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, chosen
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.model import linearize
from stabctl.units import hertz

from .result import Design, least

FLOOR = 1e-6  # weight of every state, relative to that of the speeds, which makes all of them observed


def lqr(
    base: "Case | OperatingPoint",
    outputs: str | Sequence[str] = "order",
    *,
    speed: str | float = 0.1,
    effort: float = 1.0,
    storage: "Fleet | None" = None,
    limits: tuple[float, float] | float | None = None,
    name: str = "lqr",
) -> Design:
    """Design a state feedback that drives some inputs.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    outputs : str or sequence of str
        Inputs of the system that it drives, such as "order".
    speed : str or float, Hz
        Speed deviation from the center of inertia that counts as much as one `effort`.
    effort : float
        Size of an output, in the unit of the input driven (ratings, for orders).
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    limits : pair of float, optional
        Limits of the outputs.
    name : str
        Name of the controller.

    Returns
    -------
    Design

    Raises
    ------
    StudyError
        If the system cannot be stabilized with these inputs.
    """
    point = operating_point(base, storage)
    drives = chosen(point.case, outputs, INPUTS)
    if not drives:
        raise StudyError(f"{point.case.name} has no input {outputs!r}; choose what the regulator drives.")
    model = linearize(point, drives, "deviation")
    r = model.rotation()
    basis = sl.null_space(r[None, :] / np.linalg.norm(r))  # orthogonal to the rotation of all angles
    A, B, C = basis.T @ model.A @ basis, basis.T @ model.B, model.C @ basis
    scale = hertz(speed) / point.case.frequency_hz
    Q = C.T @ C / scale**2
    Q = Q + FLOOR * np.trace(Q) / len(Q) * np.eye(len(Q))
    try:
        P = sl.solve_continuous_are(A, B, Q, np.eye(B.shape[1]) / effort**2)
    except np.linalg.LinAlgError:
        raise StudyError(
            f"No state feedback through {', '.join(s.label for s in drives)} stabilizes {point.case.name}."
        ) from None
    K = -(effort**2) * B.T @ P @ basis.T
    n, p = 0, len(drives)
    names = tuple(f"{s.kind}:{s.place}" for s in drives)
    bounds: Any = (-np.inf, np.inf) if limits is None else limits
    one = Controller(
        tuple(f"state:{label}" for label in model.states), names,
        np.zeros((n, n)), np.zeros((n, len(model.states))), np.zeros((p, n)), K, name=name, limits=bounds,
    )  # fmt: skip
    before, after = closed_loop(point).modes(), closed_loop(point, one).modes()
    return Design((one,), (before,), (after,), least(after)[0] > least(before)[0])

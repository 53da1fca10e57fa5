"""The matrices of a controller as it acts: with the Pade approximation of its delay, and of a Python function."""

from typing import NamedTuple

import numpy as np

from .controller import PADE, Controller
from .python_law import slopes


class Matrices(NamedTuple):
    """x' (or x+) = A x + B y, u = C x + D y."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


def realized(c: Controller, names: tuple[str, ...], rest: np.ndarray, outputs: int) -> Matrices:
    """The matrices of a controller.

    Parameters
    ----------
    c : Controller
        The controller; a Python function is linearized.
    names
        Names of its inputs.
    rest
        Values of the inputs at the operating point.
    outputs
        Number of outputs.
    """
    if c.law is not None:
        return Matrices(*slopes(c.law, names, rest, c.start, outputs, c.name))
    own = Matrices(c.A, c.B, c.C, c.D)
    return own if c.rate or not c.delay else _after(own, pade(c.delay, outputs))


def pade(delay: float, channels: int, order: int = PADE) -> Matrices:
    """Pade approximation exp(-s T) = N(-sT) / N(sT) of a delay (s) in every channel, in controllable form.

    Source: G. Golub, C. Van Loan, Matrix Computations, 4th ed., section 9.3.1.
    """
    c = [1.0]
    for k in range(1, order + 1):
        c.append(c[-1] * (order - k + 1) / (k * (2 * order - k + 1)))
    q = np.array([c[k] * delay**k for k in range(order + 1)]) / (c[order] * delay**order)
    p = q * [(-1) ** k for k in range(order + 1)]
    A, B = np.zeros((order, order)), np.zeros((order, 1))
    A[:-1, 1:], A[-1], B[-1] = np.eye(order - 1), -q[:-1], 1.0
    D = p[-1]
    C = (p[:-1] - D * q[:-1])[None]
    one = np.eye(channels)
    return Matrices(np.kron(one, A), np.kron(one, B), np.kron(one, C), D * one)


def _after(first: Matrices, last: Matrices) -> Matrices:
    """Two systems in series."""
    n, m = len(first.A), len(last.A)
    A = np.block([[first.A, np.zeros((n, m))], [last.B @ first.C, last.A]])
    return Matrices(A, np.vstack([first.B, last.B @ first.D]), np.hstack([last.D @ first.C, last.C]), last.D @ first.D)


def anti_windup(c: Controller, states: int) -> np.ndarray:
    """Matrix L (states, outputs) of the anti-windup, x' = ... + L (limited - unlimited output); of a frame if sampled.

    Its time constant is `tracking`; L = C+ / tracking, C+ the pseudoinverse of C. Zero without tracking, and of the
    states of a delay, which follow those of the controller.
    """
    L = np.zeros((states, len(c.C)))
    if c.tracking:
        L[: len(c.A)] = np.linalg.pinv(c.C) * (1 - np.exp(-1 / (c.rate * c.tracking)) if c.rate else 1 / c.tracking)
    return L

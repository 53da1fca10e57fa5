"""A damper with several inputs and weights to be found: each input through a washout and a chain of equal lags.

    u = sum over inputs i and k = 0 ... order of  x_ik  sTw/(1+sTw)  1/(1+s/w)^k  y_i

The output is linear in the weights x, so the derivatives of the eigenvalues are exact. With lags enough, the sum is any
filter with poles at w: it advances, delays and selects frequencies.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.controllers.from_control import tustin


def damper(
    inputs: tuple[str, ...], output: str, order: int, *, corner: float, washout: float, rate: int | None, **more: Any
) -> tuple[Callable[[np.ndarray], list[Controller]], int]:
    """The controller with some weights, and the number of weights.

    Parameters
    ----------
    inputs, output
        What it reads and drives.
    order
        Lags in the chain of every input.
    corner
        Corner frequency w of the lags, rad/s.
    washout
        Time constant of the washout, s.
    rate
        Frames per second; None if it is continuous.
    **more
        Other fields of `Controller`.
    """
    A, B, C, D = _chain(order, corner, washout)
    each = np.eye(len(inputs))
    A, B, C, D = (np.kron(each, M) for M in (A, B, C, D))
    if rate is not None:
        A, B, C, D = tustin(A, B, C, D, rate)

    def make(x: np.ndarray) -> list[Controller]:
        return [Controller(inputs, (output,), A, B, x[None] @ C, x[None] @ D, rate=rate, **more)]

    return make, len(C)


def _chain(order: int, corner: float, washout: float) -> tuple[np.ndarray, ...]:
    """States [low-pass of the washout, lags], outputs [washed out, after every lag]."""
    n = order + 1
    A, B = np.zeros((n, n)), np.zeros((n, 1))
    C, D = np.eye(n), np.zeros((n, 1))
    A[0, 0] = B[0, 0] = 1 / washout
    A[0, 0], C[0, 0], D[0, 0] = -1 / washout, -1.0, 1.0
    for k in range(1, n):
        A[k] = corner * C[k - 1]
        A[k, k] -= corner
        B[k] = corner * D[k - 1]
    return A, B, C, D

"""Closed loops with varying gains; the system is linearized once."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.named import named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal.closed_loop import ClosedLoop, joined
from stabctl.smallsignal.interconnection import plant_of

Make = Callable[[np.ndarray], Sequence[Controller]]  # controllers of some gains

RELATIVE = 1e-3  # step of the differences, relative to the size of a gain


class Loop:
    """An operating point with controllers of given inputs and outputs, whose gains may change."""

    def __init__(self, point: OperatingPoint, controllers: Sequence[Controller]) -> None:
        self.point = point
        self._own = [named(point, c) for c in controllers]
        self._plant = plant_of(point, self._own)

    def closed(self, controllers: Sequence[Controller]) -> ClosedLoop:
        """The closed loop with controllers of the same inputs and outputs."""
        return joined(self._plant, [replace(n, controller=c) for n, c in zip(self._own, controllers, strict=True)])

    def eigenvalues(self, controllers: Sequence[Controller]) -> np.ndarray:
        """Eigenvalues (1/s) of the closed loop, without those of the angle reference and of emptying delay lines."""
        return self.closed(controllers).eigenvalues()

    def slopes(self, make: Make, x: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues s (modes, 1/s) at gains x, and their derivatives ds/dx = w^H (dA/dx) v (modes, gains).

        Source: P. Kundur, Power System Stability and Control, 1994, section 12.2.4. With sampled controllers s =
        log(z) / T, and the derivative is divided by z.
        """
        closed = self.closed(make(x))
        modes = closed.modes()
        found = np.empty((len(modes), len(x)), complex)
        for k, size in enumerate(RELATIVE * scale):
            step = np.zeros(len(x))
            step[k] = size
            dA = (self.closed(make(x + step)).A - self.closed(make(x - step)).A) / (2 * size)
            found[:, k] = np.einsum("ik,ij,jk->k", modes.left.conj(), dA, modes.right, optimize=True)
        if closed.period:
            found /= np.exp(modes.eigenvalues * closed.period)[:, None]
        return modes.eigenvalues, found

"""Tuning of the gains of a damper for the worst of several closed loops: one, or several by linear programs.

Every operating point is linearized once; only the gains of its closed loop change.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog

from stabctl.controllers.controller import Controller
from stabctl.dynamics.named import named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal.closed_loop import ClosedLoop, joined
from stabctl.smallsignal.interconnection import plant_of

from .result import Requirement, ratios

Make = Callable[[np.ndarray], Sequence[Controller]]  # controllers of some gains
RELATIVE = 1e-3  # step of the differences, relative to the size of a gain
STEPS = 60  # linear programs at most
FIRST, SMALLEST, LARGEST = 0.3, 1e-4, 3.0  # change of a gain in one step, relative to its scale
NEAREST = 0.3  # damping ratio above the worst up to which a mode takes part in a step
ENOUGH = 0.99  # of the largest gain, after a step that is the last
MORE = 0.001  # damping ratio beyond what is asked, so that the gains can then be reduced


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
        """Eigenvalues (1/s) of the closed loop, as its `eigenvalues`."""
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


@dataclass(frozen=True)
class Scenario:
    """An operating point, a factor of all gains, and what is asked there."""

    loop: Loop
    factor: float
    requirement: Requirement

    def spare(self, make: Make, x: np.ndarray) -> float:
        """Least spare damping of a mode at gains x."""
        return float(self.requirement.spare(self.loop.eigenvalues(make(self.factor * x))).min(initial=np.inf))

    def rows(self, make: Make, x: np.ndarray, scale: np.ndarray, below: float) -> tuple[np.ndarray, np.ndarray]:
        """Spare damping of the modes that have less than `below`, and its derivatives with respect to the gains."""
        s, slopes = self.loop.slopes(make, self.factor * x, scale)
        spare = self.requirement.spare(s)
        near = (spare < below) & (s.imag >= 0)
        s, ds = s[near], self.factor * slopes[near]
        size = np.abs(s)[:, None]
        return spare[near], -(ds.real + ratios(s)[:, None] * (s.conj()[:, None] * ds).real / size) / size


def common(scenarios: Sequence[Scenario], make: Make, unit: np.ndarray, gains: np.ndarray) -> tuple[np.ndarray, float]:
    """The smallest of ascending gains, times `unit`, with which nothing is missing, or the best; and what it spares."""

    def spare(gain: float) -> float:
        return worst(scenarios, make, gain * unit)

    best, low = (spare(0.0), 0.0), 0.0
    for gain in map(float, gains) if best[0] < 0 else ():
        found = spare(gain)
        best = max(best, (found, gain))
        if found >= 0:
            high = gain
            for _ in range(6):
                middle = (low + high) / 2
                low, high = (low, middle) if spare(middle) >= 0 else (middle, high)
            best = spare(high), high
            break
        if found < best[0] - 0.1:
            break
        low = gain
    return best[1] * unit, best[0]


def worst(scenarios: Sequence[Scenario], make: Make, x: np.ndarray) -> float:
    """Least spare damping of all scenarios."""
    return min(one.spare(make, x) for one in scenarios)


def separate(
    scenarios: Sequence[Scenario],
    make: Make,
    x: np.ndarray,
    scale: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Gains, each its own, with which nothing is missing, and the largest relative to its scale is small.

    Every step is a linear program on the derivatives of the eigenvalues: first it raises the least spare damping, then,
    once nothing is missing, it lowers the largest gain. A step that does not help is repeated with a smaller change.

    The outputs that `make` gives are linear in the gains x; `scale` is the size of a gain that matters. Returned are
    the gains, and the least spare damping.
    """
    change = FIRST

    def merit(spare: float, x: np.ndarray) -> tuple[bool, float]:
        return spare >= 0, -float(np.abs(x / scale).max()) if spare >= 0 else spare

    each = [one.spare(make, x) for one in scenarios]
    spare = min(each)
    for _ in range(STEPS):
        below = max(spare, 0.0) + NEAREST
        active = [one for one, has in zip(scenarios, each, strict=True) if has < max(spare, 0.0) + 0.1]
        rows = [one.rows(make, x, scale, below) for one in active[:20]]
        has, slopes = np.concatenate([r[0] for r in rows]), np.concatenate([r[1] for r in rows]) * scale
        while change > SMALLEST:
            new = x + scale * _step(has, slopes, x / scale, change, spare >= 0)
            found = [one.spare(make, new) for one in scenarios]
            if merit(min(found), new) > merit(spare, x):
                break
            change /= 3
        else:
            break
        level, less = (float(np.abs(gains / scale).max()) for gains in (x, new))
        done = spare >= 0 and less > ENOUGH * level
        x, each, spare, change = new, found, min(found), min(2 * change, LARGEST)
        if done:
            break
    return x, spare


def _step(has: np.ndarray, slopes: np.ndarray, x: np.ndarray, most: float, enough: bool) -> np.ndarray:
    """Change of the gains, each by `most` at most, all relative to their scale, by a linear program [change, level]."""
    n = len(x)
    bounds = [(-most, most)] * n
    if enough:  # the least level >= |x + change|, with the modes kept
        one = np.eye(n)
        A = np.block([[-slopes, np.zeros((len(has), 1))], [one, -np.ones((n, 1))], [-one, -np.ones((n, 1))]])
        b = np.r_[has - np.minimum(has, MORE / 2), -x, x]
        found = linprog(np.r_[np.zeros(n), 1.0], A, b, bounds=[*bounds, (0, None)])
    else:  # the largest level below all modes
        found = linprog(
            np.r_[np.zeros(n), -1.0], np.hstack([-slopes, np.ones((len(has), 1))]), has, bounds=[*bounds, (None, MORE)]
        )
    return found.x[:n] if found.x is not None else np.zeros(n)

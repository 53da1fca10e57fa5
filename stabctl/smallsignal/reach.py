"""All fronts at a point of the s-plane: their phases, and how far each may be continued.

Around s0, a front is N(s0 + h) = N0 (1 + E(h)), E(h) = h E1 + h^2 E2 + ... While the Frobenius norm of E (after any
scaling) is at most F < 1, N is regular, and

    |log det(1 + E) - tr E| <= -log(1 - F) - F

because the eigenvalues e of E satisfy sum |e|^2 <= F^2. This limits the phase of det N between points.
"""

from typing import NamedTuple

import numpy as np

from .units import TERMS, Series

SLACK = 1.5  # rad   largest error of the predicted phase, below pi / 2
HALVINGS = 8  # of the interval in which the reach is sought
HUGE = 1e200  # in place of an infinite bound, so that it times 0 is 0


class Front(NamedTuple):
    """One front at a point."""

    phase: float  # of det N0
    inverse: np.ndarray  # of N0
    traces: np.ndarray  # (TERMS) of E1, E2, ...
    scale: np.ndarray  # (n)
    norms: np.ndarray  # (TERMS) of the scaled E
    weights: list[np.ndarray]  # (units) of every group: what the rest of their series adds to the norm of E, at most


class Through(NamedTuple):
    """How areas enter the separators: the norms of into, and of the terms of N(s)^-1 out, both scaled."""

    area: np.ndarray  # places among the fronts
    outer: np.ndarray  # (areas)
    inner: np.ndarray  # (areas, TERMS + 1)


class Fronts:
    """All fronts at a point: the areas, and last the separators, if there are any."""

    def __init__(self, fronts: list[Front], seen: list[Series], through: Through | None) -> None:
        self.seen, self.through = seen, through
        self.phase = np.array([front.phase for front in fronts])
        self.traces = np.array([front.traces for front in fronts]).reshape(-1, TERMS)
        self.norms = np.array([front.norms for front in fronts]).reshape(-1, TERMS)
        self.sizes = np.array([len(front.scale) for front in fronts])
        self.weights = [np.array(group) for group in zip(*(front.weights for front in fronts), strict=True)]

    def turn(self, h: complex) -> np.ndarray:
        """Predicted changes of the phases, Im tr E(h)."""
        return (self.traces @ h ** np.arange(1, TERMS + 1)).imag

    def slack(self, r: float) -> np.ndarray:
        """Largest errors of the predicted phases, |h| <= r."""
        rest = np.zeros(len(self.phase))
        for weights, group in zip(self.weights, self.seen, strict=True):
            rest += weights @ np.minimum(group.rest(r), HUGE)
        F = self.norms @ r ** np.arange(1, TERMS + 1) + rest
        if self.through is not None:
            more = self._later(self.through, r, F, rest)
            rest[-1] += more
            F[-1] += more
        inside = F < 1
        F = np.where(inside, F, 0)
        return np.where(inside, -np.log1p(-F) - F + np.sqrt(self.sizes) * rest, np.inf)

    def _later(self, through: Through, r: float, F: np.ndarray, rest: np.ndarray) -> float:
        """Bound of the norm of what the series of the eliminated areas leave out.

        x_j = -(E1 x_(j-1) + E2 x_(j-2) + ...), so with the norms X of all terms left out, x of the terms known and F
        of E, X <= F X + (the products of E and x known that are of higher order).
        """
        area, outer, inner = through
        F, rest = F[area], rest[area]
        if not (F < 1).all():
            return np.inf
        power = r ** np.arange(TERMS + 1)
        later = np.cumsum((power * inner)[:, ::-1], axis=1)  # of the last, the last two, ... terms known
        higher = (power[1:] * self.norms[area] * later[:, :TERMS]).sum(axis=1) + rest * later[:, TERMS]
        return float((outer * higher / (1 - F)).sum())

    def reach(self) -> float:
        """Distance (1/s) within which every front is regular and its phase is known to `SLACK`."""
        far = 1 / float(self.norms[:, 0].max())
        if self.slack(far).max() <= SLACK:
            return far
        low, high = 0.0, far
        for _ in range(HALVINGS):
            r = (low + high) / 2
            low, high = (r, high) if self.slack(r).max() <= SLACK else (low, r)
        return low

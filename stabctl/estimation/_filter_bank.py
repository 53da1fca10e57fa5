"""Extended Kalman filters of all machines and seeds: one filterpy filter each, or all at once with the same numbers.

    predict   x = f(x), P = F P F' + Q
    gate      y = z - h(x) (wrapped), S = h P h' + R, NIS = y^2/S; a report beyond the 0.999 quantile of chi-square(1)
              is rejected; after `rejections` in a row, lost ones included, the next is accepted with a larger
              covariance (P + y^2 reset)
    update    K = P h'/S, x = x + K y, P = (1 - K h) P (1 - K h)' + K R K', h = dh/dx
A lost report is a prediction without an update.
"""

from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import chdtri

from ._kernels import correct, propagate
from ._swing import STATES

GATE = float(chdtri(1, 0.001))  # 0.999 quantile of chi-square with one degree of freedom


class Seen(NamedTuple):
    """Measured angles, arrays (seeds, machines)."""

    angle: np.ndarray  # rad
    expected: np.ndarray  # rad   h(x)
    slope: np.ndarray  # (seeds, machines, 5)   dh/dx
    variance: np.ndarray  # rad^2
    received: np.ndarray  # bool


class FilterBank(Protocol):
    """Filters of (seeds, machines)."""

    @property
    def x(self) -> np.ndarray:
        """States (seeds, machines, 5)."""
        ...

    @property
    def P(self) -> np.ndarray:
        """Covariances (seeds, machines, 5, 5)."""
        ...

    @property
    def gain(self) -> np.ndarray:
        """K of the last update (seeds, machines, 5), 0 without one."""
        ...

    @property
    def doubt(self) -> np.ndarray:
        """Square of the innovation (seeds, machines) where the last report was rejected, else 0."""
        ...

    def predict(self, x: np.ndarray, F: np.ndarray, Q: np.ndarray) -> None:
        """Advance one frame, to the states x (seeds, machines, 5); F and Q (seeds, machines, 5, 5)."""
        ...

    def update(self, seen: Seen) -> np.ndarray:
        """Use the angles that were received; the NIS (seeds, machines), NaN if lost."""
        ...

    def restart(self, x: np.ndarray, P: np.ndarray) -> None:
        """Go on from these states and covariances."""
        ...


class Batched:
    """All filters at once, in compiled loops."""

    def __init__(self, x: np.ndarray, P: np.ndarray, reset: np.ndarray, rejections: int) -> None:
        self.x, self.P, self._reset, self._limits = x.copy(), P.copy(), reset, (GATE, rejections)
        self._rejected = np.zeros(x.shape[:2], int)
        self.S = np.ones(x.shape[:2])  # variances of the last innovations
        self.gain, self.doubt = np.zeros(x.shape), np.zeros(x.shape[:2])
        self._half = np.zeros((STATES, STATES))

    def predict(self, x: np.ndarray, F: np.ndarray, Q: np.ndarray) -> None:
        """As in `FilterBank`."""
        self.x = x.copy()
        propagate(self.P, F, Q, self._half)

    def update(self, seen: Seen) -> np.ndarray:
        """As in `FilterBank`."""
        nis = np.empty(self.S.shape)
        correct(self.x, self.P, seen, self._rejected, self._reset, self._limits, nis, self.S, self.gain, self.doubt)
        return nis

    def restart(self, x: np.ndarray, P: np.ndarray) -> None:
        """As in `FilterBank`."""
        self.x, self.P = x, P


class Filterpy:
    """One `filterpy.kalman.ExtendedKalmanFilter` per machine and seed."""

    def __init__(self, x: np.ndarray, P: np.ndarray, reset: np.ndarray, rejections: int) -> None:
        from filterpy.kalman import ExtendedKalmanFilter

        class Filter(ExtendedKalmanFilter):
            def predict_x(self, u: float = 0) -> None:
                self.x = self.to

        self.shape, self._reset, self._rejections = x.shape[:2], reset, rejections
        self.gain, self.doubt = np.zeros(x.shape), np.zeros(x.shape[:2])
        self._rejected = np.zeros(self.shape, int)
        self.filters = {}
        for at in np.ndindex(self.shape):
            ekf = self.filters[at] = Filter(dim_x=STATES, dim_z=1)
            ekf.x, ekf.P = x[at].copy(), P[at].copy()

    @property
    def x(self) -> np.ndarray:
        """States (seeds, machines, 5)."""
        return np.array([ekf.x for ekf in self.filters.values()]).reshape(*self.shape, STATES)

    @property
    def P(self) -> np.ndarray:
        """Covariances (seeds, machines, 5, 5)."""
        return np.array([ekf.P for ekf in self.filters.values()]).reshape(*self.shape, STATES, STATES)

    def predict(self, x: np.ndarray, F: np.ndarray, Q: np.ndarray) -> None:
        """As in `FilterBank`."""
        for at, ekf in self.filters.items():
            ekf.F, ekf.Q = F[at], Q[at]
            ekf.to = x[at]
            ekf.predict()

    def update(self, seen: Seen) -> np.ndarray:
        """As in `FilterBank`."""
        nis, self.gain = np.full(self.shape, np.nan), np.zeros(self.gain.shape)
        for at, ekf in self.filters.items():
            if not seen.received[at]:
                self._rejected[at] = min(self._rejected[at] + 1, self._rejections)
                continue
            h, R = seen.slope[at], seen.variance[at]
            y = wrapped(seen.angle[at] - seen.expected[at])
            nis[at] = y * y / (h @ ekf.P @ h + R)
            if nis[at] > GATE:
                if self._rejected[at] < self._rejections:
                    self._rejected[at] += 1
                    self.doubt[at] = y * y
                    continue
                ekf.P = ekf.P + np.diag(y * y * self._reset[at[1]])
            self._rejected[at], self.doubt[at] = 0, 0.0
            ekf.update(
                np.array([seen.angle[at]]),
                HJacobian=lambda x, row=h: row[None, :],
                Hx=lambda x, value=seen.expected[at]: np.array([value]),
                R=np.array([[R]]),
                residual=lambda z, expected: wrapped(z - expected),
            )
            self.gain[at] = ekf.K[:, 0]
        return nis

    def restart(self, x: np.ndarray, P: np.ndarray) -> None:
        """As in `FilterBank`."""
        for at, ekf in self.filters.items():
            ekf.x, ekf.P = x[at], P[at]


ENGINES: dict[str, type[Batched | Filterpy]] = {"batched": Batched, "filterpy": Filterpy}


def wrapped(angle: np.ndarray) -> np.ndarray:
    """An angle (rad) within -pi..pi."""
    return angle - 2 * np.pi * np.rint(angle / (2 * np.pi))

"""Kalman filters of all machines and seeds: one filterpy filter each, or all at once with the same numbers.

    predict   x = F x + B u,  P = F P F' + Q
    gate      y = z - h x (wrapped), S = h P h' + R, NIS = y^2/S; a report beyond the 0.999 quantile of chi-square(1) is
              rejected; after two rejections in a row the third is accepted with a larger covariance (P + y^2 reset)
    update    K = P h'/S, x = x + K y, P = (1 - K h) P (1 - K h)' + K R K', h = [1 0 0 1]
A lost report is a prediction without an update.
"""

from typing import Protocol

import numpy as np
from scipy.special import chdtri

from .noise import REJECTED, SwingModel

GATE = float(chdtri(1, 0.001))  # 0.999 quantile of chi-square with one degree of freedom
h = np.array([[1.0, 0.0, 0.0, 1.0]])


class Bank(Protocol):
    """Filters of (seeds, machines)."""

    x: np.ndarray  # (seeds, machines, 4)
    P: np.ndarray  # (seeds, machines, 4, 4)

    def predict(self, u: np.ndarray, F: np.ndarray, Q: np.ndarray) -> None:
        """Advance one frame; u (seeds, machines, 4) as in `SwingModel`, F and Q (seeds, machines, 4, 4)."""
        ...

    def update(self, z: np.ndarray, R: np.ndarray, received: np.ndarray) -> np.ndarray:
        """Use the angles z (rad, variance R) that were received; the NIS (seeds, machines), NaN if lost."""
        ...

    def accept_next(self, where: np.ndarray) -> None:
        """Let these filters accept the next report unconditionally."""
        ...


class Batched:
    """All filters at once, in numpy."""

    def __init__(self, model: SwingModel, x: np.ndarray, P: np.ndarray) -> None:
        self.model, self.x, self.P = model, x.copy(), P.copy()
        self._rejected = np.zeros(x.shape[:2], int)

    def predict(self, u: np.ndarray, F: np.ndarray, Q: np.ndarray) -> None:
        """As in `Bank`."""
        self.x = (F @ self.x[..., None] + self.model.B @ u[..., None])[..., 0]
        self.P = F @ self.P @ F.swapaxes(-1, -2) + Q

    def update(self, z: np.ndarray, R: np.ndarray, received: np.ndarray) -> np.ndarray:
        """As in `Bank`."""
        row = self.P[..., 0] + self.P[..., 3]  # h P
        S = row[..., 0] + row[..., 3] + R
        y = wrapped(z - self.x[..., 0] - self.x[..., 3])
        nis = y * y / S
        accepted, beyond = received, received & (nis > GATE)
        if beyond.any():
            reset = beyond & (self._rejected >= REJECTED)
            accepted = received & (~beyond | reset)
            self.P += (reset * y * y)[..., None, None] * self.model.reset
            row = self.P[..., 0] + self.P[..., 3]
            S = row[..., 0] + row[..., 3] + R
        self._rejected = (self._rejected + beyond) * ~accepted
        gain = accepted / S
        K = gain[..., None] * row
        self.x += K * np.where(accepted, y, 0.0)[..., None]
        # (1 - K h) P (1 - K h)' + K R K' = P - p p'/S if K = p/S, p = P h'
        self.P -= K[..., :, None] * row[..., None, :]
        return np.where(received, nis, np.nan)

    def accept_next(self, where: np.ndarray) -> None:
        """As in `Bank`."""
        self._rejected = np.where(where, REJECTED, self._rejected)


class Filterpy:
    """One `filterpy.kalman.KalmanFilter` per machine and seed."""

    def __init__(self, model: SwingModel, x: np.ndarray, P: np.ndarray) -> None:
        from filterpy.kalman import KalmanFilter

        self.model, self.shape = model, x.shape[:2]
        self._rejected = np.zeros(self.shape, int)
        self.filters = {}
        for at in np.ndindex(self.shape):
            kf = self.filters[at] = KalmanFilter(dim_x=4, dim_z=1, dim_u=4)
            kf.B, kf.H = model.B[at[1]], h
            kf.inv = np.reciprocal  # the innovation is a scalar
            kf.x, kf.P = x[at].reshape(4, 1).copy(), P[at].copy()

    @property
    def x(self) -> np.ndarray:
        """States (seeds, machines, 4)."""
        return np.array([kf.x[:, 0] for kf in self.filters.values()]).reshape(*self.shape, 4)

    @property
    def P(self) -> np.ndarray:
        """Covariances (seeds, machines, 4, 4)."""
        return np.array([kf.P for kf in self.filters.values()]).reshape(*self.shape, 4, 4)

    def predict(self, u: np.ndarray, F: np.ndarray, Q: np.ndarray) -> None:
        """As in `Bank`."""
        for at, kf in self.filters.items():
            kf.predict(u=u[at].reshape(4, 1), F=F[at], Q=Q[at])

    def update(self, z: np.ndarray, R: np.ndarray, received: np.ndarray) -> np.ndarray:
        """As in `Bank`."""
        nis = np.full(self.shape, np.nan)
        for at, kf in self.filters.items():
            if not received[at]:
                kf.update(None)
                continue
            x, P = kf.x, kf.P
            seen = x[0, 0] + x[3, 0]
            y = wrapped(z[at] - seen)
            nis[at] = y * y / (P[0, 0] + P[0, 3] + P[3, 0] + P[3, 3] + R[at])
            if nis[at] > GATE:
                if self._rejected[at] < REJECTED:
                    self._rejected[at] += 1
                    kf.update(None)
                    continue
                kf.P = P + y * y * self.model.reset[at[1]]
            self._rejected[at] = 0
            kf.update(np.array([[seen + y]]), R=np.array([[R[at]]]), H=h)
        return nis

    def accept_next(self, where: np.ndarray) -> None:
        """As in `Bank`."""
        self._rejected[where] = REJECTED


ENGINES = {"batched": Batched, "filterpy": Filterpy}


def wrapped(angle: np.ndarray) -> np.ndarray:
    """An angle (rad) within -pi..pi."""
    return angle - 2 * np.pi * np.rint(angle / (2 * np.pi))

"""Turbine governors as the estimators know them: the change of mechanical power that follows from the speed.

    clip(Pref - K s, Pmin, Pmax) - Pref -> 1/(1+sTs) (1+sT3)/(1+sTc) (1+sT4)/(1+sT5) -> g   (`devices.governors.tgov`)

Pref is what the filter knows as its state Pm; the power of the turbine is Pm + g.
"""

import numpy as np
from scipy.linalg import expm

from stabctl.devices.blocks.lags import SHORT

GOVERNOR = ("K", "Ts", "Tc", "T3", "T4", "T5", "Pmax", "Pmin")


class Governors:
    """The governors of all machines, advanced a frame of the length T at a time; K = 0 without one.

    Parameters
    ----------
    constants : dict of (machines,) arrays
        `GOVERNOR`, as in the table `tgov`.
    T : float, s
        Length of a frame.
    """

    def __init__(self, constants: dict[str, np.ndarray], T: float) -> None:
        self.at = np.flatnonzero(constants["K"] > 0)
        c = {name: constants[name][self.at] for name in GOVERNOR}
        self._K, self._low, self._high, n = c["K"], c["Pmin"], c["Pmax"], len(self.at)
        whole = np.zeros((n, 4, 4))  # states and demand
        signal = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))  # as a row over states and demand
        for row, (lead, lag) in enumerate(((0 * c["Ts"], c["Ts"]), (c["T3"], c["Tc"]), (c["T4"], c["T5"]))):
            acts = (lag >= SHORT)[:, None]
            lag, own = np.maximum(lag, SHORT)[:, None], np.eye(4)[row]
            whole[:, row] = acts * (signal - own) / lag
            signal = np.where(acts, own + lead[:, None] / lag * (signal - own), signal)
        whole = expm(whole * T) if n else whole
        self._A, self._B, self._C = whole[:, :3, :3], whole[:, :3, 3], signal
        self.x: np.ndarray | None = None

    def step(self, slip: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Advance a frame with this speed (pu) and reference (pu machine); g at its end (seeds, machines)."""
        s, Pref, out = slip[:, self.at], reference[:, self.at], np.zeros(slip.shape)
        demand = np.minimum(np.maximum(-self._K * s, np.minimum(self._low - Pref, 0)), np.maximum(self._high - Pref, 0))
        x = np.zeros((*s.shape, 3)) if self.x is None else self.x
        self.x = (self._A @ x[..., None])[..., 0] + self._B * demand[..., None]
        out[:, self.at] = (self._C[:, :3] * self.x).sum(-1) + self._C[:, 3] * demand
        return out

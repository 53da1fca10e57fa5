"""Turbine governors as the estimators know them: the change of mechanical power that follows from the speed.

    clip(Pref - K s, Pmin, Pmax) - Pref -> 1/(1+sTs) (1+sT3)/(1+sTc) (1+sT4)/(1+sT5) -> g   (`devices.governors.tgov`)

Pref is what the filter knows as its state Pm; the power of the turbine is Pm + g.
"""

import numpy as np
from scipy.linalg import expm

from stabctl._util.jit import entry
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
        self._droop, n = np.stack([c["K"], c["Pmin"], c["Pmax"]]), len(self.at)
        whole = np.zeros((n, 4, 4))  # states and demand
        signal = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))  # as a row over states and demand
        for row, (lead, lag) in enumerate(((0 * c["Ts"], c["Ts"]), (c["T3"], c["Tc"]), (c["T4"], c["T5"]))):
            acts = (lag >= SHORT)[:, None]
            lag, own = np.maximum(lag, SHORT)[:, None], np.eye(4)[row]
            whole[:, row] = acts * (signal - own) / lag
            signal = np.where(acts, own + lead[:, None] / lag * (signal - own), signal)
        self._A, self._C = expm(whole * T) if n else whole, signal
        self.x: np.ndarray | None = None

    def step(self, slip: np.ndarray, reference: np.ndarray) -> np.ndarray:
        """Advance a frame with this speed (pu) and reference (pu machine); g at its end (seeds, machines)."""
        out = np.zeros(slip.shape)
        if self.x is None:
            self.x = np.zeros((len(slip), len(self.at), 4))
        govern(slip, reference, self.at, self._droop, self._A, self._C, self.x, out)
        return out


@entry
def govern(slip, reference, at, droop, A, C, x, out):
    """Advance the states and demands x (seeds, governors, 4) a frame; g at its end is written into `out`."""
    for k in range(slip.shape[0]):
        for j in range(at.shape[0]):
            i = at[j]
            low, high = min(droop[1, j] - reference[k, i], 0.0), max(droop[2, j] - reference[k, i], 0.0)
            x[k, j, 3] = min(max(-droop[0, j] * slip[k, i], low), high)
            before = x[k, j, 0], x[k, j, 1], x[k, j, 2], x[k, j, 3]
            g = C[j, 3] * x[k, j, 3]
            for a in range(3):
                x[k, j, a] = 0.0
                for b in range(4):
                    x[k, j, a] += A[j, a, b] * before[b]
                g += C[j, a] * x[k, j, a]
            out[k, i] = g

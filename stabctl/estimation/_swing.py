"""The process model of the Kalman filters over a frame: swing equation, governors, and covariance of the process.

State of a machine: x = [delta (rad), s = omega - 1 (pu), Pm (pu machine), e, k (pu)]; input is the air-gap power P, and
a governor adds g to Pm:

    d delta/dt = wb s,   2H omega ds/dt = Pm + g - P - D s,   dPm/dt = white noise of density q = walk^2 (pu^2/s),
    (e, k): the fluxes of `_machine_model`, driven by the current I.

A classical machine has no omega in its swing equation.

Process noise over a frame T has five sources:
    walk   q * integral of h h', h(t) = [wb t^2/4H, t/2H, 1];
    power  (var P + (share (Pm + g - P))^2) * h h', h = [c, d, 0, 0, 0], c = wb T^2/4H, d = T/2H; share is the error
           of the model; the noise of a report acts in the frames before and after it, so that it counts in full;
    flux   var iq * h h', h = [0, 0, 0, response of e and k to iq over a frame];
    jump   P and iq jump by dP and di at an unknown instant since the last report, m frames ago. The share u of this
           time that is left is uniform: delta has moved by -c m^2 u^2 dP, s by -d m u dP, e and k by u times their
           response to di. Means -dP c/3 and -dP d/2 (the same as of a ramp), covariance r r' times that of
           (u^2, u, 0, u, u): var u^2 = 4/45, var u = cov(u, u^2) = 1/12;
    hidden what the power did between two reports beyond that jump (`_report_errors`).

A governor changes the mechanical power with the speed (`devices.governors.tgov`):

    clip(Pref - K (omega - 1), Pmin, Pmax) - Pref -> 1/(1+sTs) (1+sT3)/(1+sTc) (1+sT4)/(1+sT5) -> g

Pref is what the filter knows as its state Pm; the power of the turbine is Pm + g.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from stabctl._util.jit import entry, inline
from stabctl.devices.blocks.lags import SHORT

REJECTED = 1 / 30  # s   for which the gate rejects reports before it accepts one
STATES = 5
JUMP = np.full((STATES, STATES), 1 / 12)
JUMP[0, 0], JUMP[2], JUMP[:, 2] = 4 / 45, 0, 0
HIDDEN = np.eye(5)  # correlation of what the power does between two reports: a pulse at an unknown instant moves
HIDDEN[0, 1] = HIDDEN[1, 0] = np.sqrt(3) / 2  # the speed by 1 and the angle by the time u left, E u / sqrt(E u^2)
HIDDEN[3, 4] = HIDDEN[4, 3] = 1 / 2  # of the two fluxes, assumed


class Swing(NamedTuple):
    """The swing equation over a frame: [delta, s, Pm] = F [delta, s, Pm] + B u, u = [P0, m dP, m^2 dP]."""

    F: np.ndarray  # (machines, 3, 3)
    B: np.ndarray  # (machines, 3, 3)
    walk: np.ndarray  # (machines, 5, 5)   covariance of the random walk
    c: np.ndarray  # (machines) rad/pu   change of the angle per unit of power in a frame
    d: np.ndarray  # (machines)          change of the speed
    reset: np.ndarray  # (machines, 5)   variances added per square of the innovation that the gate accepts at last


def swing(
    H: np.ndarray, D: np.ndarray, *, hz: float, T: float, walk: float, flux: np.ndarray, with_power: bool = True
) -> Swing:
    """The swing equation over a frame; exact except for D T/2H in B.

    When the gate accepts an innovation y after its `rejections`, y may come from an error of the angle, of the
    flux, or of the speed (without measured power, of the acceleration): each gets the variance that explains y alone.

    Parameters
    ----------
    H, D : (machines,) array, s and pu
        Inertia constant and damping.
    hz, T : float
        Frequency (Hz) and length of a frame (s).
    walk : float
        Of the mechanical power: square root of the density, pu/s^0.5.
    flux : (machines,) array
        1 of machines with q-axis fluxes, else 0.
    with_power : bool
        The measured power is an input; without it the model is that of a constant acceleration.
    """
    wb, n = 2 * np.pi * hz, len(H)
    a, b, one = wb / (2 * H), 1 / (2 * H), np.ones(n)
    A, B, Q = np.zeros((3, n, 3, 3))
    A[:, 0, 1], A[:, 1, 1], A[:, 1, 2] = wb, -D * b, b
    c, d = a * T**2 / 2, b * T
    B[:, 0, 0], B[:, 0, 2], B[:, 1, 0], B[:, 1, 1] = -c, -c / 3, -d, -d / 2
    upper = a * a * T**5 / 20, a * b * T**4 / 8, a * T**3 / 6, b * b * T**3 / 3, b * T**2 / 2, one * T
    for i, j, values in zip(*np.triu_indices(3), upper, strict=True):
        Q[:, i, j] = Q[:, j, i] = values
    since = (rejections(T) + 1) * T
    acceleration = 0 * one if with_power else one / (a * since**2)
    reset = np.stack([one, one / (wb * since), acceleration, flux, flux], -1) ** 2
    return Swing(expm(A * T), B, np.pad(walk**2 * Q, ((0, 0), (0, 2), (0, 2))), c, d, reset)


def rejections(T: float) -> int:
    """Reports in a row that the gate rejects before it accepts one, with frames of the length T (s)."""
    return int(REJECTED / T + 1e-9)


@inline
def process_covariance(k, i, model, Q, jump, frames, power, flux, noise, hidden):
    """Write the process covariance of machine i and seed k into Q (seeds, machines, 5, 5).

    Parameters
    ----------
    k, i : int
        Seed and machine.
    model : Swing
        The model, or any record with its c, d and walk.
    Q : (seeds, machines, 5, 5) array
        The result.
    jump, frames : float
        Jump of the power, and frames since it was last known.
    power : float
        Variance of the power over the frame.
    flux, noise : (2) tuple, pu
        Response of e and k to the jump of iq, and to its standard deviation over the frame.
    hidden : (5) tuple, rad and pu
        Standard deviations of the states from what the power did between reports (`MissingReports`).
    """
    c, d, late, size = model.c[i], model.d[i], frames * jump, sqrt(power)
    moved = -c * late * frames, -d * late, 0.0, flux[0], flux[1]
    blurred = c * size, d * size, 0.0, noise[0], noise[1]
    for a in range(STATES):
        for b in range(STATES):
            Q[k, i, a, b] = model.walk[i, a, b] + JUMP[a, b] * moved[a] * moved[b]
            if (a < 3) == (b < 3):  # the noises of power and current are independent
                Q[k, i, a, b] += blurred[a] * blurred[b]
            Q[k, i, a, b] += HIDDEN[a, b] * hidden[a] * hidden[b]


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

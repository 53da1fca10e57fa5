"""The clocks of the PMUs behind computed phasors: constant errors, not noise (Schmidt's consider states).

The phasors of a machine without PMU are sums of reports with parts V_r, I_r. Clock errors b, constant and of known
variance, turn each part by j b_r, and so the measured angle, power and current by

    a b,  a_r = Re((V_r + Z I_r)(1 + j t)/E),   p b,  p_r = -Im(V_r I* + V* I_r),   i b,  i_r = -Im(I_r e^(-j delta)).

The errors b are not estimated, but their covariance C = E[e b'] with the error e of the states is kept. Over a frame
C' = F C + G, where G follows from p and i as the states do from P and iq. An innovation y = a b + v - h e has

    S = h P h' - 2 h C a' + a B a' + R,   K = (P h' - C a')/S,   P' = P - K S K',   C' = C + K (a B - h C),

B the variance of b. This is the usual update with h - a C' P^-1 in place of h and R + a B a' - a C' P^-1 C a' in place
of R (S. F. Schmidt, Application of state-space methods to navigation problems, 1966).
"""

import numpy as np

from .filter_bank import Seen
from .frame_kernels import Constants, Kept
from .instrument import Parts
from .measured import Measured


class Clocks:
    """Covariance C (seeds, machines, 5, clocks) of the states with the clocks; 0 without computed phasors.

    Parameters
    ----------
    known : Constants
        Constants of the machines.
    variance : float, rad^2
        Variance of the angle by which a clock turns the phasors of its PMU.
    """

    def __init__(self, known: Constants, variance: float) -> None:
        self._known, self.variance = known, variance
        self.C: np.ndarray | None = None

    def begin(self, seen: Measured, angle: np.ndarray, turn: np.ndarray, where: np.ndarray) -> np.ndarray:
        """Start with these reports, their power as that of the turbine; the covariance that the clocks add."""
        a, (p, i) = self._of_angle(seen, turn), self._of_input(seen, angle)
        start = np.zeros((*p.shape[:2], 5, p.shape[-1]))
        start[..., 0, :], start[..., 2, :] = a, p
        if self.C is None:
            self.C, self._p, self._i = np.zeros(start.shape), p, i
        self.C[where], self._p[where], self._i[where] = self.variance * start[where], p[where], i[where]
        return self.variance * start @ start.swapaxes(-1, -2) * where[..., None, None]

    def predict(self, F: np.ndarray, seen: Measured, angle: np.ndarray, kept: Kept) -> np.ndarray:
        """Advance a frame, to the predicted angles; what the clocks add to the process covariance."""
        assert self.C is not None
        k, B, here = self._known, self._known.B, seen.frame.received[..., None]
        p, i = (np.where(here, *both) for both in zip(self._of_input(seen, angle), (self._p, self._i), strict=True))
        m = (kept.missing + 1)[..., None, None]
        frames = np.minimum(m[..., 0, 0], len(k.ramp) - 1)
        moved = m * (p - self._p)[..., None, :]
        swing = B[:, :, :1] * self._p[..., None, :] + B[:, :, 1:2] * moved + B[:, :, 2:] * m * moved
        ramp = k.ramp[frames, np.arange(frames.shape[1])][..., None]
        flux = k.drive[..., :1] * self._i[..., None, :] + ramp * (i - self._i)[..., None, :]
        G, carried = np.concatenate([swing, flux], -2), F @ self.C
        both = carried @ G.swapaxes(-1, -2)
        self.C, self._p = carried + self.variance * G, p
        return both + both.swapaxes(-1, -2) + self.variance * G @ G.swapaxes(-1, -2)

    def observe(self, seen: Seen, report: Measured, turn: np.ndarray, P: np.ndarray) -> Seen:
        """What the report says, E ahead of the rotor by `turn`: slope and variance that consider the clocks."""
        assert self.C is not None
        self._a = a = self._of_angle(report, turn)
        self._slope = seen.slope
        shared = (self.C @ a[..., None])[..., 0]
        at, turned = shared.any(-1), np.zeros(shared.shape)
        scale = np.sqrt(np.maximum(np.einsum("...ii->...i", P[at]), 1e-30))
        inverse = np.linalg.pinv(P[at] / scale[..., None] / scale[..., None, :], rcond=1e-12, hermitian=True)
        turned[at] = (inverse @ (shared[at] / scale)[..., None])[..., 0] / scale
        variance = self.variance * (a * a).sum(-1) - (shared * turned).sum(-1)
        return seen._replace(slope=seen.slope - turned, variance=seen.variance + np.maximum(variance, 0.0))

    def settle(self, gain: np.ndarray, seen: Measured, angle: np.ndarray) -> None:
        """Take the update with these gains, to these angles."""
        assert self.C is not None
        left = self.variance * self._a - (self._slope[..., None, :] @ self.C)[..., 0, :]
        self.C = self.C + gain[..., None] * left[..., None, :]
        self.C[seen.frame.received & ~_parts(seen).computed] = 0.0  # a PMU of its own again
        self._i = np.where(seen.frame.received[..., None], self._of_input(seen, angle)[1], self._i)

    def _of(self, parts: np.ndarray) -> np.ndarray:
        """Reports (..., reports) of one PMU added up: voltage and current of a machine have one clock."""
        n = parts.shape[1]
        return np.concatenate([parts[..., :n] + parts[..., n : 2 * n], parts[..., 2 * n :]], -1)

    def _of_angle(self, seen: Measured, turn: np.ndarray) -> np.ndarray:
        """a, where the angle of E is `turn` (rad) ahead of the rotor."""
        parts = _parts(seen)
        tilt = (1 + 1j * np.tan(turn)) / seen.E
        return self._of((parts.V + self._known.impedance[:, None] * parts.I) * tilt[..., None]).real

    def _of_input(self, seen: Measured, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """p and i with the rotors at these angles (rad), pu of the machines."""
        parts, mva = _parts(seen), self._known.mva[:, None]
        S = parts.V * (seen.I.conj())[..., None] + seen.V.conj()[..., None] * parts.I / mva
        return -self._of(S).imag, -self._of(parts.I / mva * np.exp(-1j * angle)[..., None]).imag


def _parts(seen: Measured) -> Parts:
    """The parts of the phasors, of a frame that has computed ones."""
    assert seen.frame.parts is not None
    return seen.frame.parts

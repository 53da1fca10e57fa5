"""The q-axis rotor circuits of machines with subtransient dynamics: they relate the angle of E'' to that of the rotor.

The stator is w (psi''d + j psi''q) exp(j delta) = E'' = V + (ra + j x'') I, where w is 1, or omega with the
speed factor of GENROU, so that

    delta = arg E'' - asin(w psi''q / |E''|).

psi''q follows from the current alone, without field voltage (Kundur, ch. 3-4; names as in `devices.machines.genrou`):

    T'q de/dt = -e - (xq - x'q)(iq + (x'q - x'')/b^2 (e - k - b iq)) - iron,   b = x'q - xl,
    T''q dk/dt = e - k - b iq,   psi''q = a e + (1 - a) k,   a = (x'' - xl)/b,   iq = Re(I exp(-j delta)),
    iron = S(|psi''|)/|psi''| psi''q (xq - xl)/(xd - xl).

A salient pole has x'q = xq and e = 0; a classical machine has no flux, delta = arg E'.
"""

import numpy as np
from scipy.linalg import expm

from .rotor_units import RotorUnits

START = 200  # damped substitutions for the flux at a steady start


class QAxis:
    """The q-axis circuits of all machines over whole frames of the length T.

    Attributes
    ----------
    out : (machines, 2) array
        psi''q = out . (e, k), pu; 0 for classical machines.
    A : (machines, 2, 2) array
        Transition of (e, k) over a frame.
    B : (machines, 2, 2) array
        Response after a frame to constant inputs (iq, iron).
    speed : (machines,) array
        Speed factor, 0 or 1: w = 1 + speed (omega - 1).
    step, ramp : (frames, machines, 2) array
        Response after 0, 1, ... frames to an iq of 1 pu, constant or rising from 0 to 1 over these frames.
    """

    def __init__(self, known: RotorUnits, T: float, frames: int) -> None:
        f, n = known.flux, len(known.H)
        has = f["xq"] > 0
        b = np.where(has, f["x1q"] - f["xl"], 1.0)
        a, k, wide = (f["x2"] - f["xl"]) / b, (f["x1q"] - f["x2"]) / (b * b), f["xq"] - f["x1q"]
        self.speed = f["speed_factor"]
        self.out = np.stack([a, 1 - a], -1) * has[:, None]
        A, B = np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
        A[:, 0, 0], A[:, 0, 1], B[:, 0, 0], B[:, 0, 1] = -1 - wide * k, wide * k, -wide * (1 - k * b), -1
        A[:, 1, 0], A[:, 1, 1], B[:, 1, 0] = 1, -1, -b
        self._rest = -np.linalg.solve(A, B) * has[:, None, None]
        T_circuit = np.stack([f["T1q"], f["T2q"]], -1)
        rate = np.divide(1.0, T_circuit, out=np.zeros((n, 2)), where=T_circuit > 0)[..., None]
        whole = np.zeros((n, 6, 6))
        whole[:, :2, :2], whole[:, :2, 2:4], whole[:, 2:4, 4:] = rate * A * T, rate * B * T, np.eye(2)
        whole = expm(whole)
        self.A, self.B = whole[:, :2, :2].copy(), whole[:, :2, 2:4].copy()
        self.step, self.ramp = np.zeros((frames + 1, n, 2)), np.zeros((frames + 1, n, 2))
        rise = np.zeros((n, 2))  # response to an iq that rises by 1 pu in every frame
        for m in range(1, frames + 1):
            rise = (self.A @ rise[..., None])[..., 0] + (m - 1) * self.B[..., 0] + whole[:, :2, 4]
            self.step[m] = (self.A @ self.step[m - 1][..., None])[..., 0] + self.B[..., 0]
            self.ramp[m] = rise / m
        steep = np.maximum(1.2 * f["S12"], 1e-12)
        ratio = np.sqrt(f["S10"] / steep)
        self.knee = (1 - 1.2 * ratio) / (1 - ratio)
        gap = np.divide(f["xq"] - f["xl"], f["xd"] - f["xl"], out=np.zeros(n), where=has)
        self.slope = steep / (1.2 - self.knee) ** 2 * gap * ((f["S10"] > 0) & (f["S12"] > 0))
        self.saturated = bool(self.slope.any())

    def psi(self, flux: np.ndarray) -> np.ndarray:
        """psi''q (seeds, machines), pu, of the fluxes e and k (seeds, machines, 2)."""
        return self.out[:, 0] * flux[..., 0] + self.out[:, 1] * flux[..., 1]

    def saturation(self, size: np.ndarray) -> np.ndarray:
        """iron over psi''q: S(|psi''|)/|psi''|, S quadratic as in `devices.blocks`, scaled by the air gap."""
        return self.slope * np.maximum(size - self.knee, 0.0) ** 2 / size

    def rest(self, I: np.ndarray, E: np.ndarray) -> np.ndarray:
        """The steady fluxes (seeds, machines, 2) at a current and an internal voltage (pu machine)."""
        size, flux = np.abs(E), np.zeros((*E.shape, 2))
        ratio = self.saturation(size)
        for _ in range(START):
            psi = self.psi(flux)
            iq = np.real(I * np.exp(-1j * (np.angle(E) - turn(psi, size))))
            flux = 0.8 * flux + 0.2 * (self._rest @ np.stack([iq, ratio * psi], -1)[..., None])[..., 0]
        return flux


def turn(psi: np.ndarray, size: np.ndarray) -> np.ndarray:
    """asin(w psi''q / |E''|), rad."""
    return np.arcsin(within(psi / size, 0.99))


def within(x: np.ndarray, limit: float) -> np.ndarray:
    """x between -limit and limit."""
    return np.minimum(np.maximum(x, -limit), limit)

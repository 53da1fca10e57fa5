"""The q-axis flux of machines with subtransient dynamics: it relates the angle of E'' to that of the rotor.

The stator is omega (psi''d + j psi''q) exp(j delta) = E'' = V + (ra + j x'') I, so that

    delta = arg E'' - asin(psi''q / |E''|).

psi''q follows from the current alone, without field voltage (Kundur, ch. 3-4; names as in `devices.machines.genrou`):

    T'q de/dt = -e - (xq - x'q)(iq + (x'q - x'')/b^2 (e - k - b iq)) - iron,   b = x'q - xl,
    T''q dk/dt = e - k - b iq,   psi''q = a e + (1 - a) k,   a = (x'' - xl)/b,   iq = Re(I exp(-j delta)),
    iron = S(|psi''|)/|psi''| psi''q (xq - xl)/(xd - xl).
The time at which a current jumps within a frame is unknown; the resulting flux error, b, is a state of the filter
(`noise.py`). It decays like the response of the flux to a current, by `memory` per frame, and grows with an error of
the angle, which rotates the current: k = -response id / |E''|.
A classical machine has no such flux: delta = arg E'.
Without the flux the error of the speeds of `two_area` after a fault is 25 mHz behind x'', 30 behind x'd and 42 behind
xq; with it 6 mHz. For `wnaps` the errors are 8, 10, 18 and 4 mHz.
"""

import numpy as np
from scipy.linalg import expm

from .rotor_units import RotorUnits

START = 200  # damped substitutions for the flux at a steady start


class Flux:
    """Flux observers (seeds, machines with flux dynamics), advanced one frame at a time with the mean current of it."""

    def __init__(self, known: RotorUnits, T: float, *, I: np.ndarray, E: np.ndarray) -> None:
        f, n = known.flux, len(known.with_flux)
        self.at = slice(None) if n == len(known.H) else known.with_flux
        b = known.flux["x1q"] - known.flux["xl"]
        self._share = (f["x2"] - f["xl"]) / b
        k, wide = (f["x1q"] - f["x2"]) / (b * b), f["xq"] - f["x1q"]
        A, B = np.zeros((n, 2, 2)), np.zeros((n, 2, 2))  # inputs: iq, iron
        A[:, 0, 0], A[:, 0, 1], B[:, 0, 0], B[:, 0, 1] = -1 - wide * k, wide * k, -wide * (1 - k * b), -1
        A[:, 1, 0], A[:, 1, 1], B[:, 1, 0] = 1, -1, -b
        self._rest = -np.linalg.solve(A, B) if n else B
        speed = np.stack([f["T1q"], f["T2q"]], -1)
        speed = np.divide(1.0, speed, out=np.zeros_like(speed), where=speed > 0)[..., None]
        whole = np.zeros((n, 4, 4))
        whole[:, :2, :2], whole[:, :2, 2:] = speed * A, speed * B
        whole = expm(whole * T) if n else whole
        self._A, self._B = whole[:, :2, :2], whole[:, :2, 2:]
        out = np.stack([self._share, 1 - self._share], -1)
        self._response = np.einsum("ni,ni->n", out, self._B[..., 0])
        left = np.einsum("ni,nij,nj->n", out, self._A, self._B[..., 0])
        self._left = np.clip(np.divide(left, self._response, out=np.zeros(n), where=self._response != 0), 0.0, 0.999)
        self._span = 1 / (1 - self._left)
        self.memory = np.zeros(E.shape[1])
        self.memory[self.at] = self._left
        self.coupling = np.zeros(E.shape)
        self._mva = known.mva[self.at]
        steep = np.maximum(1.2 * f["S12"], 1e-12)
        ratio = np.sqrt(f["S10"] / steep)
        self._knee = (1 - 1.2 * ratio) / (1 - ratio)
        self._slope = steep / (1.2 - self._knee) ** 2 * (f["xq"] - f["xl"]) / (f["xd"] - f["xl"]) * (f["S12"] > 0)
        self._start(I, E[:, self.at])

    def turn(self, E: np.ndarray) -> np.ndarray:
        """asin(psi''q / |E''|) (seeds, machines), rad; 0 for classical machines."""
        out = np.zeros(E.shape)
        out[:, self.at] = self._turn(np.abs(E[:, self.at]))
        return out

    def predict(
        self, I: np.ndarray, E: np.ndarray, delta: np.ndarray, *, received: np.ndarray, frames: np.ndarray
    ) -> np.ndarray:
        """Advance one frame.

        Parameters
        ----------
        I, E : (seeds, machines) array, pu
            Currents and internal voltages at the end of the frame.
        delta : (seeds, machines) array, rad
            Predicted rotor angles.
        received, frames : (seeds, machines) array
            Whether a report arrived (otherwise the current is held), and frames since the last one.

        Returns
        -------
        (seeds, machines) array, rad
            f of `noise.process_covariance`.
        """
        at = self.at
        now = np.real(I[:, at] * np.exp(-1j * delta[:, at])) / self._mva
        jump = np.where(received[:, at], now - self.iq, 0.0) * np.minimum(frames[:, at], self._span)
        u = np.empty((*jump.shape, 2, 1))
        u[..., 0, 0], u[..., 1, 0] = self.iq + jump / 2, self._iron
        self.x = self._A @ self.x + self._B @ u
        self.psi = self._psi()
        f = np.zeros(E.shape)
        f[:, at] = self._response * jump / np.abs(E[:, at])
        return f

    def settle(self, I: np.ndarray, E: np.ndarray, delta: np.ndarray, received: np.ndarray) -> None:
        """Keep current and saturation at the estimated angles."""
        at = self.at
        here, size = received[:, at], np.abs(E[:, at])
        now = I[:, at] * np.exp(-1j * delta[:, at]) / self._mva
        self.iq = np.where(here, now.real, self.iq)
        self.coupling[:, at] = np.where(here, self._response * now.imag / size, self.coupling[:, at])
        if self._slope.any():
            self._iron = np.where(here, self._saturation(size) * self.psi, self._iron)

    def _psi(self) -> np.ndarray:
        """psi''q (seeds, machines with flux dynamics), pu."""
        e, k = self.x[..., 0, 0], self.x[..., 1, 0]
        return k + self._share * (e - k)

    def _turn(self, size: np.ndarray) -> np.ndarray:
        return np.arcsin(np.minimum(np.maximum(self.psi / size, -0.999), 0.999))

    def _start(self, I: np.ndarray, E: np.ndarray) -> None:
        """The steady flux at the first phasors."""
        current, size = I[:, self.at] / self._mva, np.abs(E)
        ratio = self._saturation(size)
        self.x, self.psi = np.zeros((*E.shape, 2, 1)), np.zeros(E.shape)
        for _ in range(START):
            delta = np.angle(E) - self._turn(size)
            self.iq = np.real(current * np.exp(-1j * delta))
            self._iron = ratio * self.psi
            self.x = 0.8 * self.x + 0.2 * (self._rest @ np.stack([self.iq, self._iron], -1)[..., None])
            self.psi = self._psi()

    def _saturation(self, flux: np.ndarray) -> np.ndarray:
        """iron over psi''q: S(flux)/flux, S quadratic as in `devices.blocks`, scaled by the air gap."""
        return self._slope * np.maximum(flux - self._knee, 0.0) ** 2 / flux

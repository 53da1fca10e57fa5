"""A decentralized unscented Kalman filter with unknown inputs, for comparison with the estimators of the package.

One machine with a PMU: the terminal voltage is the input, the current is measured, and field voltage and mechanical
power are unknown inputs, estimated with the states as random walks. Engine: filterpy.

After G. Anagnostou and B. C. Pal, "Derivative-free Kalman filtering based approaches to dynamic state estimation for
power systems with unknown inputs", IEEE Trans. Power Syst. 33 (1), 2018; E. Ghahremani and I. Kamwa, "Dynamic state
estimation in power system by applying the extended Kalman filter with unknown inputs to phasor measurements", IEEE
Trans. Power Syst. 26 (4), 2011. These estimate the unknown inputs in a step of their own.
"""

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from stabctl.devices.machines import genrou

STEPS = 4  # of Heun's method in a frame
PROCESS = np.array([1e-5, 1e-5, 1e-3, 1e-3, 1e-3, 1e-3])  # pu (rad)   standard deviation per frame, of the states
WALK = np.array([0.05, 2.0])  # pu/s^0.5   of mechanical power and field voltage


class UnknownInputFilter:
    """The filter of one round-rotor machine.

    Parameters
    ----------
    par : genrou.Par
        Constants of the machine.
    rest : sequence of float
        States at rest, and mechanical power and field voltage (pu).
    angle, magnitude : float
        Standard deviations of the phasors, rad and relative.
    T : float, s
        Length of a frame.
    """

    def __init__(self, par: genrou.Par, rest: np.ndarray, *, angle: float, magnitude: float, T: float) -> None:
        self.par, self.T, self._noise, self._V = par, T, max(angle, magnitude), 0j
        n = len(rest)
        points = MerweScaledSigmaPoints(n, alpha=0.1, beta=2.0, kappa=3.0 - n)
        self.ukf = UnscentedKalmanFilter(n, 2, T, hx=self._current, fx=self._frame, points=points)
        self.ukf.x = np.array(rest, float)
        self.ukf.P = np.diag([4e-6, 1e-8, *[1e-4] * 4, 1e-4, 1e-2])
        self.ukf.Q = np.diag(np.r_[PROCESS**2, WALK**2 * T])

    def step(self, V: complex, I: complex) -> None:
        """Advance a frame and use its phasors, pu of the system."""
        before = self._V or V
        self.ukf.predict(before=before, after=V)
        self._V = V
        size = self._noise * np.hypot(abs(I), abs(V) * self.par.mva / self.par.x2)
        self.ukf.update(np.array([I.real, I.imag]), R=np.eye(2) * size**2)

    def error(self, delta: float, slip: float) -> tuple[float, float]:
        """NEES of angle and speed, and the error of the speed (pu)."""
        e = np.array([self.ukf.x[0] - delta, self.ukf.x[1] - 1 - slip])
        return float(e @ np.linalg.solve(self.ukf.P[:2, :2], e)), float(e[1])

    def _rates(self, x: np.ndarray, V: complex) -> np.ndarray:
        state = genrou.State(*x[:6])
        y = genrou.output(state, genrou.internal(state, self.par), (V.real, V.imag), self.par)
        rates = genrou.derivatives(state, genrou.Input(Efd=x[7], Pm=x[6]), y, self.par)
        return np.array([*rates, 0.0, 0.0])

    def _frame(self, x: np.ndarray, T: float, before: complex, after: complex) -> np.ndarray:
        h = T / STEPS
        for k in range(STEPS):
            here, there = (before + (after - before) * part / STEPS for part in (k, k + 1))
            slope = self._rates(x, here)
            x = x + h / 2 * (slope + self._rates(x + h * slope, there))
        return x

    def _current(self, x: np.ndarray) -> np.ndarray:
        state = genrou.State(*x[:6])
        source = complex(*genrou.source(genrou.internal(state, self.par), self.par))
        I = source - complex(*genrou.admittance(self.par)) * self._V
        return np.array([I.real, I.imag])

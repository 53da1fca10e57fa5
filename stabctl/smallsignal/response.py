"""Transfer functions of linear models at many points of the s- or z-plane."""

import numpy as np
import scipy.linalg as sl

STEPS = 400  # of the grid of frequencies, and
AROUND = np.tan(np.linspace(-1.5, 1.5, 31))  # points around each resonance, in widths


class Response:
    """C (s - A)^-1 B + D at points s; A is brought to upper triangular form (Schur) once.

    Source: A. Laub, IEEE Trans. Automatic Control 26, 1981.
    """

    def __init__(self, A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> None:
        self._T, Z = sl.schur(A, output="complex") if len(A) else (A.astype(complex), A)
        self._B, self._C, self._D = Z.conj().T @ B, C @ Z, D
        self._shifted = np.array(-self._T, order="F")  # s - T: only its diagonal changes
        self._diagonal = np.arange(len(self._T))

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A."""
        return np.diag(self._T)

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Transfer functions (points, outputs, inputs) at points (points), complex."""
        found, at = np.empty((len(s), *self._D.shape), complex), self._diagonal
        for k, point in enumerate(s):
            found[k] = self._D
            if len(at):
                self._shifted[at, at] = point - self.poles
                found[k] += self._C @ sl.solve_triangular(self._shifted, self._B, check_finite=False)
        return found


def grid(poles: np.ndarray, low: float, high: float, around: np.ndarray = AROUND) -> np.ndarray:
    """Frequencies (Hz) between two, dense around the resonances of poles (1/s): at these widths from each."""
    swings = poles[poles.imag > 0]
    near = (swings.imag[:, None] + np.abs(swings.real[:, None]) * around).ravel() / (2 * np.pi)
    return np.unique(np.r_[np.geomspace(low, high, STEPS), near[(near > low) & (near < high)]])

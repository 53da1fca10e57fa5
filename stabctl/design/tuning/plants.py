"""Linear plants of operating points without the angle reference, and their closed loops with controllers.

With the states of the controllers as integrators beside the plant, x' = A x + B z, y = C x + D z and z = K y + e for
the matrix K = [D C; B A] of all controllers. The loop closed, with N = (1 - K D)^-1,

    x' = (A + B N K C) x + B N e,   z = N K C x + N e,   y = (1 - D K)^-1 (C x + D e).

So a change dK adds B N dK (1 - D K)^-1 C to the state matrix: gradients need no more than its vectors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from stabctl.controllers.realization import Matrices, pade
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal.eigen import Eigen, eigen, without
from stabctl.smallsignal.model import linearize

STABLE = 1e-4  # 1/s   real part of an eigenvalue, up to which it is left alone
STEP = 2e-3  # of the logarithm of a parameter of the case, for differences of the fourth order


NOW = Matrices(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1))  # no delay


@dataclass(frozen=True, eq=False)
class Plant:
    """A network with its inputs and outputs.

    Attributes
    ----------
    name
        What it is called in results.
    matrices
        Its matrices, or those at logarithms of the parameters of the case that are tuned.
    """

    name: str
    matrices: Matrices
    varied: Callable[[np.ndarray], Matrices] | None = None

    def at(self, logs: np.ndarray) -> Matrices:
        """The matrices at the parameters of the case."""
        return self.varied(logs) if self.varied and len(logs) else self.matrices

    def slopes(self, logs: np.ndarray) -> list[Matrices]:
        """Their derivatives by each parameter of the case, by differences."""
        found = []
        for e in STEP * np.eye(len(logs)):
            ends = [[self.at(logs + k * e) for k in (size, -size)] for size in (1, 2)]
            near, far = ([up - down for up, down in zip(*pair, strict=True)] for pair in ends)
            found.append(Matrices(*((8 * n - f) / (12 * STEP) for n, f in zip(near, far, strict=True))))
        return found


def plant(point: OperatingPoint, inputs: Sequence[str], outputs: Sequence[str], delays: Sequence[float]) -> Matrices:
    """The matrices of an operating point; `delays` (s) of each output by their Pade approximation."""
    m = linearize(point, list(dict.fromkeys(inputs)), list(dict.fromkeys(outputs)))
    A, B, C = without(m.rotation(), m.A, m.B, m.C)
    rows = [list(dict.fromkeys(outputs)).index(name) for name in outputs]
    C, D = C[rows], m.D[rows]
    if any(delays):
        late = [pade(t, 1) if t else NOW for t in delays]
        a, b, c, d = (block_diag(*parts) for parts in zip(*late, strict=True))
        A = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
        B, C, D = np.vstack([B, b @ D]), np.hstack([d @ C, c]), d @ D
    return Matrices(*(np.ascontiguousarray(M) for M in (A, B, C, D)))


class Loop:
    """A plant with the matrix K of its controllers, closed; A, B and `out`, C and D are those of the text above."""

    def __init__(self, plant: Matrices, K: np.ndarray) -> None:
        n, nu, ny = len(plant.A), plant.B.shape[1], len(plant.C)
        total, order = n + len(K) - nu, len(K) - nu
        self.n, self.nu, self.K = n, nu, K
        B: np.ndarray = np.zeros((total, len(K)))
        C: np.ndarray = np.zeros((ny + order, total))
        B[:n, :nu], B[n:, nu:] = plant.B, np.eye(order)
        C[:ny, :n], C[ny:, n:] = plant.C, np.eye(order)
        self.D: np.ndarray = np.zeros((len(C), len(K)))
        self.N: np.ndarray = np.eye(len(K))
        self.B, self.C = B, C
        if plant.D.any():
            D = self.D.copy()
            D[:ny, :nu] = plant.D
            self.N = np.linalg.inv(self.N - K @ D)
            M = np.eye(len(C)) + D @ self.N @ K  # (1 - D K)^-1
            self.B, self.C, self.D = B @ self.N, M @ C, M @ D
        self.out = K @ self.C  # z of x
        self.A = B @ self.out
        self.A[:n, :n] += plant.A

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Eigenvalues, 1/s."""
        return self.modal.values if "modal" in vars(self) else np.linalg.eigvals(self.A)

    @property
    def stable(self) -> bool:
        """Whether no eigenvalue grows; who asks needs the vectors next."""
        return bool(self.modal.values.real.max() <= STABLE)

    @cached_property
    def modal(self) -> Eigen:
        """Eigenvalues with all vectors."""
        return eigen(self.A, np.zeros((len(self.A), 0)))

    @cached_property
    def _parts(self) -> tuple[np.ndarray, np.ndarray]:
        """How the modes are seen in z (inputs, modes), and moved by e (modes, inputs)."""
        return self.out[: self.nu] @ self.modal.right, self.modal.left.conj().T @ self.B[:, : self.nu]

    def sensitivity(self, w: np.ndarray) -> np.ndarray:
        """S(jw) (frequencies, inputs, inputs): from a signal added to an input, to that input."""
        s, (out, into) = self.modal.values, self._parts
        return self.N[: self.nu, : self.nu] + (out / (1j * w[:, None, None] - s)) @ into

    def alone(self, w: np.ndarray) -> np.ndarray:
        """The diagonal of S (frequencies, inputs): each loop, all others closed."""
        s, (out, into) = self.modal.values, self._parts
        return np.diag(self.N)[: self.nu] + (1 / (1j * w[:, None] - s)) @ (out * into.T).T

    def outer(self, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows left B N and columns (1 - D K)^-1 C right of vectors of the states."""
        return left @ self.B, self.C @ right

"""A sampled regulator with its own state estimator, for a plant whose inputs are held for a frame and d frames late:

    x+ = P x + G u(k - d) + w,    y = C x + D u(k - 1 - d) + v

    estimate    xf = x + L (y - C x - D u(k - 1 - d)),    L = S C' (C S C' + V)^-1
    regulator   u = -K [xf; u(k - 1) ... u(k - d)],       K = (R + H' X H)^-1 H' X F
    prediction  x+ = P xf + G u(k - d)

S and X solve the discrete Riccati equations of the noise and of the cost. Source: K. Astrom, B. Wittenmark, Computer
Controlled Systems, 3rd ed. 1997, chapter 11.
"""

import numpy as np
from scipy.linalg import expm

from stabctl.controllers.controller import Controller
from stabctl.errors import StudyError
from stabctl.smallsignal.frames import held
from stabctl.smallsignal.reduce import Reduced

from . import riccati


def compensator(
    model: Reduced, p: int, m: int, rate: int, d: int, name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Matrices of estimator and regulator for p inputs and m measurements, all scaled, d frames late."""
    T, n = 1 / rate, len(model.A)
    B, load, C, z, D = model.B[:, :p], model.B[:, p:], model.C[:m], model.C[m:], model.D[:m, :p]
    P, G = held(model.A, B, T)
    spread = _covariance(model.A, load @ load.T, T)
    seen = np.eye(m) + model.D[:m, p:] @ model.D[:m, p:].T / T
    # the states of the regulator: x, then u(k - 1) ... u(k - d)
    F, H, Q = np.zeros((n + d * p, n + d * p)), np.zeros((n + d * p, p)), np.zeros((n + d * p, n + d * p))
    F[:n, :n], Q[:n, :n] = P, T * z.T @ z
    if d:
        F[:n, n + (d - 1) * p :] = G
        F[n + p :, n : n + (d - 1) * p] = np.eye((d - 1) * p)
        H[n : n + p] = np.eye(p)
    else:
        H = G
    try:
        X = riccati.discrete(F, H @ H.T / T, Q)
        S = riccati.discrete(P.T, C.T @ np.linalg.solve(seen, C), spread)
    except np.linalg.LinAlgError:
        raise StudyError(
            f"{name}: the signals that it reads and drives do not stabilize {model.name}; choose more of them."
        ) from None
    K = np.linalg.solve(T * np.eye(p) + H.T @ X @ H, H.T @ X @ F)
    L = np.linalg.solve(C @ S @ C.T + seen, C @ S).T
    # the states of the controller: x, then u(k - 1) ... u(k - 1 - d)
    size = n + (d + 1) * p
    old = np.eye(size)[n + d * p :]  # u(k - 1 - d)
    filtered = np.hstack([np.eye(n) - L @ C, np.zeros((n, size - n))]) - L @ D @ old
    line = np.eye(size)[n : n + d * p]
    u, uy = -K[:, :n] @ filtered - K[:, n:] @ line, -K[:, :n] @ L
    acting, acting_y = (u, uy) if d == 0 else (np.eye(size)[n + (d - 1) * p : n + d * p], np.zeros((p, m)))
    A = np.vstack([P @ filtered + G @ acting, u, np.eye(size)[n : n + d * p]])
    return A, np.vstack([P @ L + G @ acting_y, uy, np.zeros((d * p, m))]), u, uy


def _covariance(A: np.ndarray, W: np.ndarray, T: float) -> np.ndarray:
    """Integral of exp(A t) W exp(A' t) over T. Source: C. Van Loan, IEEE Trans. Automatic Control 23, 1978."""
    n = len(A)
    M = expm(np.block([[-A, W], [np.zeros((n, n)), A.T]]) * T)
    return np.asarray(M[n:, n:].T @ M[:n, n:])


def response(c: Controller, w: float) -> np.ndarray:
    """Response (outputs, inputs) of a sampled controller with its delay at w (rad/s)."""
    z = np.exp(1j * w / (c.rate or 1))
    return np.asarray((c.C @ np.linalg.solve(z * np.eye(len(c.A)) - c.A, c.B) + c.D) * z**-c.frames)

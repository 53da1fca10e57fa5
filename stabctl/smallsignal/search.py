"""Selected modes of a large system: shift-invert Arnoldi iterations on the sparse descriptor equations.

(A - s)^-1 b is the x of [fx - s, fv; gx, gv] [x; v] = [b; 0], which takes one sparse factorization per shift s. Arnoldi
iterations find the eigenvalues nearest to the shift first. A region is divided into boxes until each is covered by a
disc around its center in which all eigenvalues are known.
Source: J. Rommes, N. Martins, IEEE Trans. Power Syst. 21 (2006).
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs, splu

from stabctl.errors import StudyError

from .boxes import Box
from .descriptor import Descriptor
from .eigen import Eigen

MOST = 40  # eigenvalues sought around a shift
SLICE = 1.5  # ratio of highest to lowest frequency of the first boxes
SEED = 0  # of the random start vectors
AGREE = 1e-6  # left and right eigenvalues this close, relative to the radius of the disc, are the same
PRECISE = 1e-10  # relative precision of the two searches; the Rayleigh quotient squares it
LOOSE = 1e-3  # relative precision of the search for eigenvalues that were missed
LEAST = 1e-3  # half the diagonal of the smallest box, relative to its frequency
CLEAR = 0.99  # largest radius, relative to the distance from the real axis, where many eigenvalues may coincide

Product = Callable[[np.ndarray], np.ndarray]


class Near(NamedTuple):
    """Eigenvalues within a radius (1/s) of a shift, the nearest first, with their right vectors."""

    shift: complex
    radius: float
    values: np.ndarray
    right: np.ndarray
    forward: Product  # b -> (A - shift)^-1 b
    backward: Product  # and its adjoint


class Disc(NamedTuple):
    """All eigenvalues within a radius (1/s) of a shift, the nearest first; W^H V = 1."""

    shift: complex
    radius: float
    values: np.ndarray
    right: np.ndarray
    left: np.ndarray


def disc(d: Descriptor, shift: complex, count: int = MOST) -> Disc:
    """Up to `count` modes nearest to a shift (1/s), cut off at the widest gap.

    Left and right vectors come from two searches that must agree; a third one, with the known modes deflated, must find
    nothing within the radius. Raises `StudyError` if these checks fail, or if the count is not possible.
    """
    found = _completed(d, _near(d, shift, count))
    if found is None:
        raise StudyError(f"The modes near {shift:.4g} 1/s cannot be separated; choose another shift or count.")
    return found


def band(d: Descriptor, low_hz: float, high_hz: float, damping: tuple[float, float]) -> Eigen:
    """Every mode in a band of frequencies (Hz) and damping ratios, one of each pair, by frequency; w^H v = 1.

    Raises `StudyError` if the band or the damping ratios are not possible.
    """
    if not 0 < low_hz < high_hz < np.inf:
        raise StudyError(
            f"The band from {low_hz:g} to {high_hz:g} Hz is not allowed; it must begin above 0 and not be empty."
        )
    if not -1 < damping[0] < damping[1] < 1:
        raise StudyError(
            f"The damping ratios {damping[0]:g} to {damping[1]:g} are not allowed; give -1 < lowest < highest < 1."
        )
    slopes = tuple(-ratio / np.sqrt(1 - ratio**2) for ratio in reversed(damping))
    steps = int(np.ceil(np.log(high_hz / low_hz) / np.log(SLICE)))
    edges = 2 * np.pi * np.geomspace(low_hz, high_hz, steps + 1)
    most = min(MOST, len(d.rows) // 2, len(d.rows) - 4)
    boxes: list[tuple[Box, Near | None, int]] = [(Box(-np.inf, np.inf, *pair), None, most) for pair in pairwise(edges)]
    known: dict[complex, Disc | None] = {}
    found: list[Eigen] = []
    while boxes:
        whole, near, count = boxes.pop()
        box = whole.fitted(*slopes)
        if box is None:
            continue
        if near is None or (not box.within(near) and box.reach() < near.radius):
            near = _near(d, box.middle(), count)
        if box.within(near):
            if near.shift not in known:
                known[near.shift] = _completed(d, near)
            if (all_of := known[near.shift]) is not None:
                inside = box.holds(all_of.values)
                found.append(Eigen(all_of.values[inside], all_of.right[:, inside], all_of.left[:, inside]))
                continue
            near, count = None, max(min(2, most), count // 2)
        if box.reach() < LEAST * box.top:
            raise StudyError(f"The modes near {box.middle():.4g} 1/s cannot be separated; choose another band.")
        boxes += [(half, near, count) for half in box.halves()]
    values, right, left = (np.concatenate(part, axis=-1) for part in zip(*found, strict=True))
    ratio = values.real / values.imag
    order = np.flatnonzero((ratio >= slopes[0]) & (ratio <= slopes[1]))
    order = order[np.lexsort((values.real[order], values.imag[order]))]
    return Eigen(values[order], right[:, order], left[:, order])


def _near(d: Descriptor, shift: complex, count: int) -> Near:
    n = len(d.rows)
    if n < 5:
        raise StudyError(f"{d.name} has only {n} states, too few to select modes; compute all its modes instead.")
    if not np.isfinite(shift):
        raise StudyError(f"The shift {shift:g} 1/s is not allowed; it must be finite.")
    if not 1 <= count < n - 3:
        raise StudyError(f"{count} modes of {n} states cannot be selected; choose 1 to {n - 4}.")
    forward, backward = _resolvent(d, shift)
    try:
        s, V = _largest(forward, n, count + 1)
    except ArpackError as error:
        raise StudyError(f"The search for modes near {shift:.4g} 1/s failed ({error}); choose another shift.") from None
    away = np.minimum(np.abs(1 / s), CLEAR * abs(shift.imag) or np.inf)
    inner = int((away < away[-1]).sum())
    if not inner:
        return Near(shift, float(away[0]), np.zeros(0, complex), V[:, :0], forward, backward)
    least = min(count // 2, inner - 1)
    m = least + 1 + int((away[least + 1 : inner + 1] / away[least:inner]).argmax())
    return Near(shift, float(np.sqrt(away[m - 1] * away[m])), shift + 1 / s[:m], V[:, :m], forward, backward)


def _completed(d: Descriptor, near: Near) -> Disc | None:
    """The disc with its left vectors; None if they do not match the right ones, or if an eigenvalue was missed."""
    n, V = near.right.shape[0], near.right
    W = V
    try:
        if V.shape[1]:
            s, W = _largest(near.backward, n, V.shape[1])
            if np.abs(1 / s[-1]) > near.radius:
                return None
            W = W @ np.linalg.inv(V.conj().T @ W)
        rest = _largest(lambda b: _without(near.forward(b), V, W), n, 1, LOOSE)[0]
    except (ArpackError, np.linalg.LinAlgError):
        return None
    values = _rayleigh(d, V, W)
    same = np.abs(values - near.values).max(initial=0.0) <= AGREE * near.radius
    if not same or np.abs(1 / rest).min() < (1 - LOOSE) * near.radius:
        return None
    return Disc(near.shift, near.radius, values, V, W)


def _resolvent(d: Descriptor, shift: complex) -> tuple[Product, Product]:
    n, m = len(d.rows), d.gv.shape[0]
    moved: Any = shift * sp.identity(n, format="csc")
    pencil = sp.bmat([[d.fx - moved, d.fv], [d.gx, d.gv]], format="csc")
    try:
        factors = splu(pencil, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1, options={"SymmetricMode": True})
    except RuntimeError:
        raise StudyError(f"The shift {shift:.4g} 1/s is itself an eigenvalue; choose another one nearby.") from None

    def padded(b: np.ndarray) -> np.ndarray:
        return np.r_[b, np.zeros(m)].astype(complex)

    return lambda b: factors.solve(padded(b))[:n], lambda b: factors.solve(padded(b), "H")[:n]  # type: ignore[call-overload]


def _largest(product: Product, n: int, count: int, precision: float = PRECISE) -> tuple[np.ndarray, np.ndarray]:
    """Largest eigenvalues of an operator, the largest first, with their vectors."""
    start = np.random.default_rng(SEED).normal(size=(n, 2)) @ [1, 1j]
    operator = LinearOperator((n, n), matvec=product, dtype=complex)
    s, V = eigs(operator, count, which="LM", v0=product(start), ncv=min(n, 2 * count + 20), tol=precision)
    order = np.argsort(-np.abs(s))
    return s[order], V[:, order]


def _without(x: np.ndarray, V: np.ndarray, W: np.ndarray) -> np.ndarray:
    return x - V @ (W.conj().T @ x)


def _rayleigh(d: Descriptor, V: np.ndarray, W: np.ndarray) -> np.ndarray:
    """w^H A v of every mode; its error is the product of the errors of both vectors."""
    factors, currents = splu(d.gv), d.gx @ V
    moved = d.fx @ V - d.fv @ (factors.solve(currents.real) + 1j * factors.solve(currents.imag))
    return np.einsum("ik,ik->k", W.conj(), moved)

"""Reduced models with the same inputs and outputs: modal reduction, and balanced truncation."""

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral

import numpy as np
import scipy.linalg as sl
from scipy.sparse.csgraph import connected_components

from stabctl._util.errors import StudyError, shown
from stabctl._util.wording import counted
from stabctl.dynamics.layout import unique

from .analysis import analyze
from .model import Linear, Model
from .modes import Modes

CERTAIN = 1e6  # |left| |right| of a mode up to which its vectors are good
UNDAMPED = 1e-8  # relative real part of an eigenvalue that is rounding
NEAR = 1e-2  # relative distance of eigenvalues that are taken together

Matrices = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, repr=False)
class Reduced(Model):
    """A reduced model with the inputs and outputs of the full one."""

    hankel: np.ndarray  # singular values of all balanced states; empty for a modal reduction


def modal(modes: Modes, keep: Iterable[int], static: bool = True) -> Reduced:
    """Keep some modes of a linear model and drop the others.

    Parameters
    ----------
    modes : Modes
        All modes of the full model.
    keep : iterable of int
        Indices of the modes to keep; of a conjugate pair both are kept, as two real states.
    static : bool
        Replace the dropped modes by their static gain -C A^-1 B, so that the response to slow changes is right.

    Returns
    -------
    Reduced

    Raises
    ------
    StudyError
        If there is no such mode, or `keep` is empty.
    """
    linear = modes.linear
    _all(modes)
    chosen = _whole_pairs(modes, keep)
    defective = np.abs(linear.A @ modes.right - modes.right * modes.eigenvalues).max(axis=0) > 1e-6
    if 0 not in chosen and defective[chosen].any():
        chosen = np.r_[0, chosen]
    T, labels = _real_basis(modes, chosen)
    L = _left_basis(modes, chosen)
    A, B, C = L @ linear.A @ T, L @ linear.B, linear.C @ T
    D = linear.D.copy()
    if static:
        rest = [k for k in range(len(modes)) if k not in set(chosen) and modes.eigenvalues[k] != 0]
        answer = modes.observability()[:, rest] / -modes.eigenvalues[rest]
        D = D + (answer @ modes.controllability()[rest]).real
    return Reduced(linear.name, A, B, C, D, labels, linear.inputs, linear.outputs, np.zeros(0))


def reduce(linear: Linear, order: int) -> Reduced:
    """Reduce a linear model to `order` states by balanced truncation; see `balanced`.

    Raises `StudyError` if the model is sampled or delayed, has no inputs or no outputs, or `order` is not possible.

    Parameters
    ----------
    linear : Linear
        The model.
    order : int
        Number of states that remain.

    Examples
    --------
    >>> st.load("two_area").linearize(inputs="vref:2", outputs="speed:2").reduce(10).A.shape
    (10, 10)
    """
    _unsampled(linear)
    return balanced(analyze(linear), order)


def balanced(modes: Modes, order: int) -> Reduced:
    """Reduce a linear model to `order` states by balanced truncation (square-root method).

    Unstable, undamped and zero modes are kept; only the rest is truncated. `hankel` of the result holds the Hankel
    singular values of that part. Twice the sum of those dropped bounds the error at any frequency.

    Parameters
    ----------
    modes : Modes
        All modes of the full model, with inputs and outputs.
    order : int
        Number of states to keep at most: fewer where no more have an effect.

    Returns
    -------
    Reduced

    Raises
    ------
    StudyError
        If the model has no inputs or no outputs, or `order` is not possible.

    References
    ----------
    M. Green, D. Limebeer, Linear Robust Control, ch. 9.
    """
    linear = modes.linear
    _all(modes)
    if not linear.inputs or not linear.outputs:
        raise StudyError(
            f"Balanced reduction of {linear.name} needs inputs and outputs; linearize with inputs='vref' and "
            "outputs='speed', for example."
        )
    loose = kept_modes(modes)
    n, kept = len(linear.states), len(loose)
    if isinstance(order, bool) or not isinstance(order, Integral):
        raise StudyError(f"order = {shown(order)} is not a number of states; give a whole number.")
    least = min(kept + 1, n)
    if not least <= order <= n:
        raise StudyError(
            f"{linear.name} cannot be reduced to {counted(order, 'state')}: of its {n} states, "
            f"{counted(kept, 'unstable, undamped or zero mode')} must be kept; choose an order from {least} to {n}."
        )
    parts = [_block(modes, loose)] if kept else []
    labels = list(_real_basis(modes, loose)[1]) if kept else []
    hankel = np.zeros(0)
    if kept < n:
        part, hankel = _truncated(_block(modes, np.setdiff1d(np.arange(n), loose)), order - kept)
        parts.append(part)
        labels += [f"balanced {k + 1}" for k in range(len(part[0]))]
    matrices = sl.block_diag(*(p[0] for p in parts)), np.vstack([p[1] for p in parts]), np.hstack([p[2] for p in parts])
    return Reduced(linear.name, *matrices, linear.D.copy(), tuple(labels), linear.inputs, linear.outputs, hankel)


def kept_modes(modes: Modes) -> np.ndarray:
    """The modes that a reduction keeps: those that are unstable, undamped or zero, to rounding."""
    s = modes.eigenvalues
    return np.flatnonzero(s.real >= -UNDAMPED * np.maximum(1, np.abs(s)))


def _truncated(matrices: Matrices, order: int) -> tuple[Matrices, np.ndarray]:
    """The balanced states of a stable model with the most effect, `order` at most; all Hankel singular values."""
    A, B, C = matrices
    P, Q = (_factor(sl.solve_continuous_lyapunov(*pair)) for pair in ((A, -B @ B.T), (A.T, -C.T @ C)))
    U, hankel, Vt = np.linalg.svd(Q.T @ P)
    r = min(order, int((hankel > 1e-12 * hankel[0]).sum()))
    root = np.sqrt(hankel[:r])
    right, left = P @ Vt[:r].T / root, (Q @ U[:, :r] / root).T
    return (left @ A @ right, left @ B, C @ right), hankel


def _unsampled(linear: Linear) -> None:
    if getattr(linear, "period", 0) or getattr(linear, "opened", None) is not None:
        raise StudyError(
            f"The closed loop of {linear.name} has sampled or delayed controllers; reduce the linear model of the "
            "system, or the controllers."
        )


def _all(modes: Modes) -> None:
    _unsampled(modes.linear)
    if len(modes) < len(modes.linear.states):
        raise StudyError(
            f"Reducing {modes.linear.name} needs all its modes, not those of a band; analyze its full linear model."
        )


def _whole_pairs(modes: Modes, keep: Iterable[int]) -> np.ndarray:
    given = list(keep) if isinstance(keep, Iterable) else [keep]
    chosen = {int(k) for k in given if isinstance(k, Integral) and 0 <= k < len(modes)}
    if not chosen or len(chosen) < len(set(given)):
        raise StudyError(f"Give at least one mode to keep, with numbers from 0 to {len(modes) - 1}.")
    s = modes.eigenvalues
    for k in list(chosen):
        if s[k].imag:
            chosen.add(k + 1 if s[k].imag > 0 else k - 1)
    return np.array(sorted(chosen))


def _real_basis(modes: Modes, chosen: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Real columns that span the right vectors: Re v and Im v of a pair; their labels."""
    columns, labels = [], []
    for k in chosen:
        s, v = modes.eigenvalues[k], modes.right[:, k]
        if s.imag < 0:
            continue
        text = modes.label(int(k))
        name = f"{text}, {s.imag / (2 * np.pi):.3g} Hz" if s.imag else text
        columns += [v.real, v.imag] if s.imag else [v.real]
        labels += [f"{name}, cosine", f"{name}, sine"] if s.imag else [name]
    return np.column_stack(columns), unique(labels)


def _left_basis(modes: Modes, chosen: np.ndarray) -> np.ndarray:
    """Real rows L with L T = I, T of `_real_basis`: 2 Re w and 2 Im w of a pair."""
    rows = []
    for k in chosen:
        s, w = modes.eigenvalues[k], modes.left[:, k]
        if s.imag < 0:
            continue
        rows += [2 * w.real, 2 * w.imag] if s.imag else [w.real]
    return np.array(rows)


def _block(modes: Modes, chosen: np.ndarray) -> Matrices:
    """A, B, C of some modes, in a real basis.

    Where rounding decides the vectors, as it does where eigenvalues repeat, the basis is one of Schur vectors.
    """
    linear, s = modes.linear, modes.eigenvalues[chosen]
    upper = np.where(s.imag < 0, s.conj(), s)
    near = np.abs(upper[:, None] - upper) < NEAR * np.maximum(1, np.abs(s))
    member = connected_components(near, directed=False)[1]
    condition = (np.linalg.norm(modes.left, axis=0) * np.linalg.norm(modes.right, axis=0))[chosen]
    vague = np.isin(member, member[condition > CERTAIN])
    T, L = [], []
    if not vague.all():
        T, L = [_real_basis(modes, chosen[~vague])[0]], [_left_basis(modes, chosen[~vague])]
    if vague.any():
        right, left = (_invariant(M, modes, chosen[vague]) for M in (linear.A, linear.A.T))
        T.append(right)
        L.append(np.linalg.solve(left.T @ right, left.T))
    basis, dual = np.hstack(T), np.vstack(L)
    return dual @ linear.A @ basis, dual @ linear.B, linear.C @ basis


def _invariant(A: np.ndarray, modes: Modes, some: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the space of some modes of A."""
    s, inside = modes.eigenvalues, np.isin(np.arange(len(modes)), some)
    Z, found = sl.schur(A, sort=lambda re, im: inside[np.abs(s - (re + 1j * im)).argmin()])[1:]
    if found != len(some):
        raise StudyError(
            f"{modes.linear.name} cannot be reduced: rounding decides which modes repeat, as at {s[some[0]]:.4g} 1/s."
        )
    return Z[:, : len(some)]


def _factor(X: np.ndarray) -> np.ndarray:
    """F with F F' = X, for a symmetric X that is positive semidefinite to rounding."""
    values, vectors = np.linalg.eigh((X + X.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0))

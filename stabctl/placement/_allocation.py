"""The allocation of megawatts by Gramians of the electromechanical modes: two convex programs.

The Gramian W_i tells how strongly a megawatt of storage at candidate i acts on the critical modes. An electromechanical
mode s_k with left and right eigenvectors w, v, and c_k = w^H b_i, responds as z' = s_k z + c_k u. With the exponential
weight e^(-a t) of decay rate a, two modes have in common

    W_kl = integral of e^(-2 a t) (e^(s_k t) c_k)(e^(s_l t) c_l)* dt = c_k c_l* / (2 a - s_k - s_l*)

so that |c_k|^2 / (2 a - 2 Re s_k) is the contribution of one mode alone. The real coordinates p = 2 Re z, q = -2 Im z
of every mode (x = p Re v + q Im v) are scaled so that p^2 + q^2 is twice its mean kinetic energy in MW s.

Sizes s (MW) are allocated by one of two programs, which cvxpy and Clarabel solve:

    maximize  lambda_min(W(s))   or   log det W(s),   W(s) = sum s_i W_i,   0 <= s <= cap,   sum s = budget

The first improves the mode that storage controls worst, the second the volume that storage can reach. W is linear in s,
so the programs are written in shares of the budget, and only the caps over the budget are parameters.

Both objectives are concave: with a gradient g_i = <Z, W_i> at s*, no sizes do better than value(s*) + max_s g (s - s*),
a fractional knapsack problem. This bound does not depend on the solver; a solution that misses it is rejected.
"""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal import Mode, Modes, analyze, linearize

from .sensitivity import Candidate, checked

Objective = Literal["min-eigenvalue", "log-det"]
MODES = 6  # number of modes considered
DECAY = 0.5  # 1/s   e^(-2 a t) = 1/e after one second, so the first swings dominate
EQUAL = 1e-6  # 1/s   decay rates this close count as equal
GAP = 1e-3  # largest gap to the bound, relative (of a logarithm: absolute)
NOTHING = 1e-6  # share of the budget that counts as zero
TIGHT = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-10)


@dataclass(frozen=True, eq=False)
class Gramians:
    """Gramian of 1 MW of storage at each candidate; that of sizes s (MW) is W(s) = sum s_i W_i.

    Linear in s because every further megawatt is a device of 1 MW with a signal of its own: inputs scale as sqrt(MW).
    """

    case: str
    candidates: tuple[Candidate, ...]
    modes: tuple[Mode, ...]  # m modes, the one that decays slowest first
    decay: float  # 1/s
    A: np.ndarray  # (2m, 2m) 1/s   z' = A z + B u, the modes alone, without the decay
    B: np.ndarray  # (2m, candidates)   per MW, z in root(MW s)
    W: np.ndarray  # (candidates, 2m, 2m)

    def of(self, sizes: np.ndarray) -> np.ndarray:
        """W(s) (2m, 2m) of sizes (candidates) in MW."""
        return np.tensordot(sizes, self.W, 1)


def gramians(
    point: OperatingPoint,
    candidates: Iterable[tuple[int, int]] | None = None,
    modes: int = MODES,
    decay: float = DECAY,
) -> Gramians:
    """The Gramians of every candidate at an operating point.

    Parameters
    ----------
    point : OperatingPoint
        The system.
    candidates : iterable of (machine, bus), optional
        Possible storage sites; by default every machine's storage bus.
    modes : int
        Number of electromechanical modes, those that decay slowest (of undamped ones the slowest).
    decay : float, 1/s
        a above; 0 for the textbook Gramian.

    Raises
    ------
    StudyError
        If there is no electromechanical mode or no such candidate, or if a mode does not decay within the memory.
    """
    found = checked(point.case, candidates)
    buses = list(dict.fromkeys(c.bus for c in found))
    all_modes = analyze(linearize(point, [f"storage:{bus}" for bus in buses]))
    chosen = critical_modes(all_modes, modes)
    s = all_modes.eigenvalues[chosen]
    if not (s.real - decay < -EQUAL).all():
        worst = chosen[int(s.real.argmax())]
        raise StudyError(
            f"The mode of {all_modes.frequency_hz[worst]:.3f} Hz of {point.case.name} ({all_modes.label(worst)}) does "
            f"not decay, so it has no Gramian with a decay of {decay:g} 1/s; choose one above "
            f"{max(float(s.real.max()), 0.0) + EQUAL:.3g} 1/s."
        )
    H = point.inertia * point.case.base_mva
    scale = np.sqrt(H @ np.abs(all_modes.speeds[:, chosen]) ** 2)
    c = all_modes.controllability()[chosen] * scale[:, None] / point.case.base_mva
    c = c[:, [buses.index(k.bus) for k in found]]
    both, rate = np.r_[c, c.conj()], np.r_[s, s.conj()]
    W = np.einsum("ki,li->ikl", both, both.conj()) / (2 * decay - rate[:, None] - rate.conj())
    real = _real(len(s))
    A, B, W = (real @ np.diag(rate) @ np.linalg.inv(real)).real, (real @ both).real, (real @ W @ real.conj().T).real
    return Gramians(point.case.name, found, tuple(all_modes.mode(k) for k in chosen), float(decay), A, B, W)


def critical_modes(modes: Modes, most: int = MODES) -> list[int]:
    """Numbers of the electromechanical modes that decay slowest."""
    swings = modes.swings()
    if not swings:
        name = modes.linear.point.case.name
        raise StudyError(f"{name} has no electromechanical mode; siting by Gramians needs at least two rotor units.")
    decay = -modes.eigenvalues.real
    return sorted(swings, key=lambda k: (round(float(decay[k]) / EQUAL), modes.frequency_hz[k]))[:most]


def _real(m: int) -> np.ndarray:
    """(2m, 2m) [z, z*] -> (p_1, q_1, p_2, ...), p = z + z*, q = j (z - z*)."""
    eye = np.eye(m)
    return np.stack([np.c_[eye, eye], 1j * np.c_[eye, -eye]], axis=1).reshape(2 * m, 2 * m)


class Allocation(NamedTuple):
    """Sizes of all candidates, and how good they are."""

    sizes: np.ndarray  # (candidates) MW
    value: float  # lambda_min or log det of W(s)
    bound: float  # upper bound of the value for any sizes
    gain: np.ndarray  # (candidates)   gain of the objective per MW, at these sizes


def allocate(g: Gramians, budget_mw: float, caps: np.ndarray, objective: Objective) -> Allocation:
    """Allocate a budget among the candidates of some Gramians.

    Parameters
    ----------
    g : Gramians
        The Gramians.
    budget_mw : float, MW
        Sum of the sizes, more than 0.
    caps : (candidates,) array, MW
        Largest sizes.
    objective : {"min-eigenvalue", "log-det"}
        What is maximized.

    Raises
    ------
    StudyError
        For a budget that exceeds the caps, and if the program has no accurate solution.
    """
    if not budget_mw <= caps.sum():
        raise StudyError(
            f"The budget of {budget_mw:g} MW exceeds the caps of the {len(caps)} candidates, {caps.sum():g} MW in "
            "total; raise the caps, add candidates, or lower the budget."
        )
    try:
        program = AllocationProgram(g.W, objective)
        share = program.solve(np.minimum(caps / budget_mw, 1))
    except np.linalg.LinAlgError:
        share = None
    if share is None or abs(share.sum() - 1) > GAP:
        raise StudyError(_unsolved(g, objective))
    sizes = budget_mw * share
    whole = g.of(sizes)
    least, n = float(np.linalg.eigvalsh(whole)[0]), len(whole)
    if least <= 0:
        raise StudyError(_unsolved(g, objective))
    gain = np.tensordot(g.W, program.gradient(whole), 2)
    best = _knapsack(gain, caps, budget_mw)
    if objective == "log-det":
        value, gap = float(np.linalg.slogdet(whole)[1]), best - n  # <inv(W), W> = n
    else:
        value, gap = least, best - least
    if not gap <= GAP * (1.0 if objective == "log-det" else least):
        raise StudyError(_unsolved(g, objective))
    return Allocation(sizes, value, value + max(gap, 0.0), gain)


class AllocationProgram:
    """One objective over the shares x of the budget: sum x = 1, 0 <= x <= limit. Built once; `limit` is a parameter.

    Written in coordinates in which the Gramian of a uniform fleet is the unit matrix: otherwise its eigenvalues can
    differ by ten orders of magnitude.
    """

    def __init__(self, W: np.ndarray, objective: Objective) -> None:
        """Build the program for Gramians W (candidates, n, n)."""
        import cvxpy as cp

        count, n, _ = W.shape
        self.whitening = np.linalg.inv(np.linalg.cholesky(W.mean(axis=0)))
        white = (self.whitening @ W @ self.whitening.T).reshape(count, -1)
        self.share, self.limit = cp.Variable(count), cp.Parameter(count, nonneg=True)
        whole = cp.reshape(white.T @ self.share, (n, n), order="C")
        constraints = [cp.sum(self.share) == 1, self.share >= 0, self.share <= self.limit]
        self.least = None
        aim: cp.Expression
        if objective == "min-eigenvalue":
            level, unit = cp.Variable(), self.whitening @ self.whitening.T
            self.least = whole >> level * (unit / np.linalg.norm(unit, 2))
            constraints, aim = [self.least, *constraints], level
        else:
            aim = cp.log_det(whole)
        self.problem = cp.Problem(cp.Maximize(aim), constraints)
        if not self.problem.is_dpp():
            raise AssertionError("the program must be convex with its parameters (DPP)")

    def solve(self, limit: np.ndarray) -> np.ndarray | None:
        """The shares (candidates); None if the solver found none."""
        import cvxpy as cp

        self.limit.value = limit
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate solution misses its bound
            try:
                self.problem.solve(solver=cp.CLARABEL, **TIGHT)
            except cp.SolverError:
                return None
        if self.share.value is None or not np.isfinite(self.share.value).all():
            return None
        share = np.clip(self.share.value, 0, limit)
        return np.where(share < NOTHING, 0, share)

    def gradient(self, whole: np.ndarray) -> np.ndarray:
        """Z (n, n) with <Z, W_i> the gradient at W(s): inv(W), or the multiplier of W(s) >= lambda_min, of trace 1."""
        if self.least is None:
            return np.linalg.inv(whole)
        values, vectors = np.linalg.eigh((self.least.dual_value + self.least.dual_value.T) / 2)
        turned = self.whitening.T @ vectors
        Z = turned * np.maximum(values, 0) @ turned.T
        return Z / np.trace(Z)


def _knapsack(gain: np.ndarray, caps: np.ndarray, budget: float) -> float:
    """The maximum of gain @ s over sum s = budget, 0 <= s <= caps: the best candidates first."""
    first = np.argsort(-gain)
    filled = np.minimum(np.cumsum(caps[first]), budget)
    return float(gain[first] @ np.diff(filled, prepend=0))


def _unsolved(g: Gramians, objective: Objective) -> str:
    return (
        f"The {objective} program of {g.case} has no accurate solution: the candidates hardly control some of the "
        f"{len(g.modes)} modes; use fewer modes or more candidates."
    )

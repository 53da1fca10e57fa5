"""A budget of megawatts shared out by the Gramians of the critical swings: two convex programs.

    maximize  lambda_min(W(s))   or   log det W(s),   W(s) = sum s_i W_i,   0 <= s <= cap,   sum s = budget

The first serves the swing that storage reaches worst, the second the volume of what it reaches. W is linear in s, so
the programs are written in shares of the budget, and only the caps over the budget are parameters.

Both criteria are concave: with a gradient g_i = <Z, W_i> at s*, no sizes do better than value(s*) + max_s g (s - s*),
a fractional knapsack. This bound is worked out apart from the solver; an answer that misses it is not given.
"""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model.case import Storage
from stabctl.smallsignal import Mode

from .gramians import DECAY, SWINGS, Gramians, gramians
from .sensitivity import Candidate

Criterion = Literal["min-eigenvalue", "log-det"]
MISS = 1e-3  # largest gap to the bound, relative (of a logarithm: absolute)
NOTHING = 1e-6  # share of the budget that is none
TIGHT = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-10)


@dataclass(frozen=True, repr=False, eq=False)
class Allocation:
    """Megawatts at every candidate, and what each is worth there."""

    case: str
    criterion: Criterion
    budget_mw: float
    candidates: tuple[Candidate, ...]
    sizes: np.ndarray  # (candidates) MW
    caps: np.ndarray  # (candidates) MW
    value: float  # lambda_min or log det of W(s)
    bound: float  # that no sizes exceed
    worth: np.ndarray  # (candidates)   gain of the criterion per MW more, at these sizes
    alone: np.ndarray  # (candidates)   trace of W_i, of 1 MW by itself
    modes: tuple[Mode, ...]
    decay: float  # 1/s

    @property
    def ranking(self) -> tuple[int, ...]:
        """Rows of the candidates, the largest first; those with nothing by their worth."""
        return tuple(int(i) for i in np.lexsort((-self.worth, -self.sizes)))

    def storage(self, **options: Any) -> tuple[Storage, ...]:
        """The devices, for `Case.with_storage`; options as fields of `Storage`."""
        return tuple(
            Storage(c.machine, c.bus, float(s), **options)
            for c, s in zip(self.candidates, self.sizes, strict=True)
            if s > 0
        )

    def __str__(self) -> str:
        head = [
            f"{self.case}: {self.budget_mw:g} MW by {self.criterion}, {self.value:.4g} (at most {self.bound:.4g})",
            *(f"  swing {m}" for m in self.modes),
            "device          MW        cap   worth/MW   alone/MW",
        ]
        rows = [
            f"{self.candidates[i]!s:8} {self.sizes[i]:9.2f} {self.caps[i]:10.4g} {self.worth[i]:10.3g} "
            f"{self.alone[i]:10.3g}"
            for i in self.ranking
        ]
        return "\n".join(head + rows)

    __repr__ = __str__


class Program:
    """One criterion over the shares x of the budget: sum x = 1, 0 <= x <= limit. Built once; `limit` is a parameter.

    Written in coordinates in which the Gramian of an even fleet is the unit matrix: its eigenvalues, ten orders of
    magnitude apart and more where few sites reach many swings, are then alike.
    """

    def __init__(self, W: np.ndarray, criterion: Criterion) -> None:
        """Write the program for Gramians W (candidates, n, n)."""
        import cvxpy as cp

        count, n, _ = W.shape
        self.even = np.linalg.inv(np.linalg.cholesky(W.mean(axis=0)))
        white = (self.even @ W @ self.even.T).reshape(count, -1)
        self.share, self.limit = cp.Variable(count), cp.Parameter(count, nonneg=True)
        whole = cp.reshape(white.T @ self.share, (n, n), order="C")
        law = [cp.sum(self.share) == 1, self.share >= 0, self.share <= self.limit]
        self.least = None
        if criterion == "min-eigenvalue":
            level, unit = cp.Variable(), self.even @ self.even.T
            self.least = whole >> level * (unit / np.linalg.norm(unit, 2))
            law, aim = [self.least, *law], level
        else:
            aim = cp.log_det(whole)
        self.problem = cp.Problem(cp.Maximize(aim), law)
        if not self.problem.is_dcp(dpp=True):
            raise AssertionError("the program must be convex with its parameters (DPP)")

    def solve(self, limit: np.ndarray) -> np.ndarray | None:
        """The shares (candidates), None where the solver found none."""
        import cvxpy as cp

        self.limit.value = limit
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate answer shows in its bound
            try:
                self.problem.solve(solver=cp.CLARABEL, **TIGHT)
            except cp.SolverError:
                return None
        if self.share.value is None or not np.isfinite(self.share.value).all():
            return None
        share = np.clip(self.share.value, 0, limit)
        return np.where(share < NOTHING, 0, share)

    def slope(self, whole: np.ndarray) -> np.ndarray:
        """Z (n, n) with <Z, W_i> the gradient at W(s): inv(W), or the multiplier of W(s) >= lambda_min, of trace 1."""
        if self.least is None:
            return np.linalg.inv(whole)
        values, vectors = np.linalg.eigh((self.least.dual_value + self.least.dual_value.T) / 2)
        turned = self.even.T @ vectors
        Z = turned * np.maximum(values, 0) @ turned.T
        return Z / np.trace(Z)


def by_gramian(
    point: OperatingPoint,
    candidates: Iterable[tuple[int, int]] | None = None,
    budget_mw: float = 100.0,
    caps_mw: float | Sequence[float] | Mapping[tuple[int, int], float] = np.inf,
    criterion: Criterion = "min-eigenvalue",
    modes: int | Sequence[float] = SWINGS,
    decay: float = DECAY,
) -> Allocation:
    """The budget (MW) shared out among the candidates; arguments as in `gramians`, caps (MW) for all or for each.

    Raises `StudyError` as there, and for a budget that is not positive or more than the caps hold, for caps below 0,
    and where the program has no accurate solution.
    """
    return allocate(gramians(point, candidates, modes, decay), budget_mw, caps_mw, criterion)


def allocate(
    g: Gramians,
    budget_mw: float,
    caps_mw: float | Sequence[float] | Mapping[tuple[int, int], float] = np.inf,
    criterion: Criterion = "min-eigenvalue",
) -> Allocation:
    """The same from Gramians at hand."""
    if criterion not in get_args(Criterion):
        raise StudyError(f"{criterion!r} is no criterion of siting; known are {', '.join(get_args(Criterion))}.")
    if not 0 < budget_mw < np.inf:
        raise StudyError(f"The budget of {budget_mw:g} MW is not allowed; it must be more than 0.")
    caps = _caps(g, caps_mw)
    if not budget_mw <= caps.sum():
        raise StudyError(
            f"The budget of {budget_mw:g} MW does not fit: the caps of the {len(caps)} candidates hold "
            f"{caps.sum():g} MW; raise the caps, add candidates, or lower the budget."
        )
    try:
        program = Program(g.W, criterion)
        share = program.solve(np.minimum(caps / budget_mw, 1))
    except np.linalg.LinAlgError:
        share = None
    if share is None or abs(share.sum() - 1) > MISS:
        raise StudyError(_unsolved(g, criterion))
    sizes = budget_mw * share
    whole = g.of(sizes)
    least, n = float(np.linalg.eigvalsh(whole)[0]), len(whole)
    if least <= 0:
        raise StudyError(_unsolved(g, criterion))
    worth = np.tensordot(g.W, program.slope(whole), 2)
    best = _knapsack(worth, caps, budget_mw)
    if criterion == "log-det":
        value, miss = float(np.linalg.slogdet(whole)[1]), best - n  # <inv(W), W> = n
    else:
        value, miss = least, best - least
    if not miss <= MISS * (1.0 if criterion == "log-det" else least):
        raise StudyError(_unsolved(g, criterion))
    parts = (g.candidates, sizes, caps, value, value + max(miss, 0.0), worth, g.alone, g.modes, g.decay)
    return Allocation(g.case, criterion, float(budget_mw), *parts)


def _caps(g: Gramians, given: float | Sequence[float] | Mapping[tuple[int, int], float]) -> np.ndarray:
    """Caps (candidates) in MW."""
    if isinstance(given, Mapping):
        for c in g.candidates:
            if c not in given:
                raise StudyError(f"The candidate {c} has no cap; give one in MW for every candidate.")
        given = [given[c] for c in g.candidates]
    caps = np.asarray(given, float)
    if caps.ndim and caps.shape != (len(g.candidates),):
        count = len(g.candidates)
        raise StudyError(f"There are {caps.size} caps for {count} candidates; give one for all or for each.")
    caps = np.broadcast_to(caps, len(g.candidates)).copy()
    for c, cap in zip(g.candidates, caps, strict=True):
        if not cap >= 0:
            raise StudyError(f"The cap of {cap:g} MW of candidate {c} is not allowed; it must be 0 or more.")
    return caps


def _knapsack(worth: np.ndarray, caps: np.ndarray, budget: float) -> float:
    """The most that worth @ s reaches over sum s = budget, 0 <= s <= caps: the best first."""
    first = np.argsort(-worth)
    filled = np.minimum(np.cumsum(caps[first]), budget)
    return float(worth[first] @ np.diff(filled, prepend=0))


def _unsolved(g: Gramians, criterion: Criterion) -> str:
    return (
        f"The {criterion} program of {g.case} has no accurate solution: the candidates that may hold storage hardly "
        f"reach some of the {len(g.modes)} swings; take fewer swings or more candidates."
    )

"""The convex programs of the allocation, with cvxpy and Clarabel."""

import warnings
from typing import Literal

import numpy as np

Objective = Literal["min-eigenvalue", "log-det"]
NOTHING = 1e-6  # share of the budget that counts as zero
TIGHT = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-10)


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

"""Search: quadratic programs in a trust region, with working sets of scenarios.

Every step linearizes the rows near the worst and solves (Clarabel)

    max t - rho s - d'Hd / 2   over |d| <= radius,   rows: value + slope d >= t, limits: value + slope d >= -s,

with bounds and G (p + d) <= g; H estimates the curvature of the rows that decide (damped BFGS on their Lagrangian). A
step is taken if the exact merit rises. Steps see the scenarios near the worst; every few steps and at the end all are
checked, and those that are worse join. Sources: F. Curtis, M. Overton, A Sequential Quadratic Programming Algorithm for
Nonconvex, Nonsmooth Constrained Optimization, SIAM J. Optim. 22, 2012; J. Nocedal, S. Wright, Numerical Optimization,
2006, section 18.3 (damped BFGS).
"""

import base64
import json
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from .problem import PENALTY, Merit, Problem, Rows, Trial

NEAREST, MODES = (0.015, 0.06), 6  # damping ratio above the worst up to which a mode is a row; most of a scenario
FIRST, SMALLEST, LARGEST = 0.3, 2e-3, 1.0  # radius: relative changes of the parameters
BUNDLED = 0.06  # radius below which a step that fails leaves its rows
AGAIN = 0.02  # least radius after a check
DECIDES = 1e-4  # weight of a row, relative to the largest, from which it counts in the curvature
STEEPEST = 10.0  # first curvature at most
RESTARTS, NEARBY = 4, 0.02  # at most, and their distance from the best
LITTLE = 0.01  # radius of the test of stationarity
WITHIN = 0.02  # damping ratio above the worst, up to which a scenario is in the working set
FEWEST, MOST = 8, 14  # scenarios that join: the worst of all and the worst without a floor, and near ones at most
LEAVE = 0.1  # damping ratio above the worst, from which one that joined leaves
EVERY, DEEP = 5, 10  # steps between checks of all scenarios, and of the peaks of all plants
RISE = 1e-5  # of the merit, by which a step must raise it
JOIN = 8  # plants at most, whose sensitivity is watched, that join in a check


class Search:
    """A search from one start.

    Parameters
    ----------
    problem
        The problem.
    p
        Start.
    curved
        Whether the curvature H is estimated; without it, H = 0, steps are linear programs.
    tell
        Called after each step with the level.
    """

    def __init__(
        self, problem: Problem, p: np.ndarray, curved: bool = True, tell: Callable[[float], None] | None = None
    ) -> None:
        self.problem, self.curved, self.tell = problem, curved, tell
        self.now = problem.at(np.clip(p, problem.low, problem.high))
        self.plants = sorted({one.plant for one in problem.scenarios}) if problem.peaks else []
        self.which: list[int] = []  # scenarios, and plants whose sensitivity is watched, that steps see
        self.joined: set[int] = set()
        self.watched: list[int] = []
        self.H = np.zeros((len(p),) * 2)
        self.steps, self.restarts, self.radius = 0, 0, FIRST
        self.best = self.now, Merit(-np.inf, 0.0)  # looked at in all plants

    def run(self, steps: int) -> "Search":
        """Raise the merit in so many steps more at most, until the goal is reached with all limits."""
        merit, last, since, goal = self.check(deep=not self.steps), self.steps + steps, 0, self.problem.goal
        while self.steps < last and not merit.reaches(goal) and self.restarts <= RESTARTS:
            rows = self.now.rows(self.which, self.watched, float(np.clip(self.radius / 2, *NEAREST)), MODES)
            while self.radius > SMALLEST:
                d, weights = self.program(rows, self.radius, merit.level)
                new = self.problem.at(self.now.p + d)
                found = new.merit(self.which, self.watched, merit.value + RISE)
                if found.value > merit.value + RISE:
                    break
                if self.radius < BUNDLED:
                    rows = rows.joined(new.rows(self.which, self.watched, NEAREST[0], MODES), d)
                self.radius /= 3 if self.radius > BUNDLED else 2
            stuck = self.radius <= SMALLEST
            if not stuck:
                if self.curved:
                    self.bend(rows, weights, new)
                self.now, merit, self.radius = new, found, min(1.5 * self.radius, LARGEST)
                self.steps, since = self.steps + 1, since + 1
                if self.tell:
                    self.tell(merit.level)
            if stuck or since >= EVERY or merit.reaches(goal):
                deep = stuck or merit.reaches(goal) or self.steps % DEEP == 0
                before, merit, since = merit, self.check(deep), 0
                if stuck and merit.value > before.value - RISE:
                    merit = self.restart()
                self.radius = max(self.radius, AGAIN)
        self.check(deep=True)
        return self

    @property
    def state(self) -> str:
        """Everything that the next round needs, as text."""
        trial, merit = self.best
        found = {name: getattr(self, name) for name in ("which", "watched", "steps", "restarts", "radius", "curved")}
        H = base64.b64encode(self.H.tobytes()).decode()
        now, best = self.now.p.tolist(), trial.p.tolist()
        return json.dumps(found | {"joined": sorted(self.joined), "now": now, "best": best, "merit": merit, "H": H})

    @classmethod
    def resumed(cls, problem: Problem, state: str, tell: Callable[[float], None] | None = None) -> "Search":
        """The search with a state."""
        found = json.loads(state)
        search = cls(problem, np.array(found.pop("now")), found.pop("curved"), tell)
        search.best = problem.at(np.array(found.pop("best"))), Merit(*found.pop("merit"))
        search.H = np.frombuffer(base64.b64decode(found.pop("H"))).reshape(search.H.shape)
        search.joined = set(found.pop("joined"))
        vars(search).update(found)
        return search

    def restart(self) -> Merit:
        """Begin again near the best, without the curvature: at a kink, steps end before the point is stationary."""
        rng, p = np.random.default_rng(self.restarts), self.best[0].p
        self.restarts += 1
        near = p + NEARBY * rng.standard_normal(len(p))
        room = self.problem.g - self.problem.G @ near
        self.now = self.problem.at(np.clip(near if (room >= 0).all() else p, self.problem.low, self.problem.high))
        self.H = np.zeros_like(self.H)
        self.radius = FIRST / 3
        return self.check(deep=False)

    def check(self, deep: bool) -> Merit:
        """The merit over all scenarios, and if `deep` over all plants; those that decide are the working set."""
        every, now = range(len(self.problem.scenarios)), self.now
        plants = self.plants if deep else self.watched
        margin = {k: now.margin(k) for k in plants}
        level = np.array([now.level(k) for k in every])
        soft = np.array([one.floor is None for one in self.problem.scenarios])
        least = level[soft].min(initial=np.inf)
        gap = np.where(soft, level - least, level)
        known = level[[k for k in self.which if soft[k]]].min(initial=np.inf) if self.which else least
        worse = {k for k in every if k not in self.which and gap[k] < (known - least if soft[k] else 0) - RISE}
        self.joined = {k for k in self.joined | worse if gap[k] < LEAVE}
        near = np.argsort(gap)[: np.clip((gap < WITHIN).sum(), FEWEST, MOST)]
        worst = np.argsort(np.where(soft, gap, np.inf))[: min(FEWEST, soft.sum())]
        self.which = sorted({*near.tolist(), *worst.tolist(), *self.joined}, key=lambda k: (gap[k], k))
        over = [k for k in sorted(margin, key=margin.__getitem__) if margin[k] < 0 and k not in self.watched]
        self.watched += over[:JOIN]
        merit = now.merit(every, plants)
        if deep and merit.value >= self.best[1].value:
            self.best = now, merit
        return merit

    def program(self, rows: Rows, radius: float, level: float) -> tuple[np.ndarray, np.ndarray]:
        """The step d (parameters), and the weights (rows) of the rows in it."""
        problem, p = self.problem, self.now.p
        n = len(p)
        value, slope, hard = np.array(rows.value), np.array(rows.slope).reshape(-1, n), np.array(rows.hard, bool)
        m = len(value)
        A = [np.hstack([-slope, np.where(hard, 0, 1)[:, None], np.where(hard, -1, 0)[:, None]])]
        b = [value]
        if len(problem.G):
            A.append(np.hstack([problem.G, np.zeros((len(problem.G), 2))]))
            b.append(np.maximum(problem.g - problem.G @ p, 0))
        eye = np.eye(n + 2)
        A += [eye[:n], -eye[:n], -eye[n + 1 :], eye[n : n + 1]]
        b += [
            np.minimum(problem.high - p, radius),
            np.minimum(p - problem.low, radius),
            np.zeros(1),
            np.array([min(max(level, 0) + 1.0, problem.goal)]),
        ]
        q = np.r_[np.zeros(n), -1.0, PENALTY]
        P = np.zeros((n + 2, n + 2))
        P[:n, :n] = self.H
        x, z = quadratic_program(P, q, np.vstack(A), np.concatenate(b))
        d = np.clip(x[:n], -b[-3], b[-4])
        return d, z[:m]

    def bend(self, rows: Rows, weights: np.ndarray, new: Trial) -> None:
        """Update H by the change of the gradient of the rows that decided (damped BFGS)."""
        active = [i for i, w in enumerate(weights) if w > DECIDES * weights.max() and rows.where[i].key]
        keys = {rows.where[i].key[0] for i in active}
        after = new.rows([k for k in keys if k >= 0], [-1 - k for k in keys if k < 0], np.inf, 3 * MODES)
        d, y = new.p - self.now.p, np.zeros(len(new.p))
        for i in active:
            own = rows.where[i]
            same = [j for j, one in enumerate(after.where) if one.key == own.key]
            if same:
                j = min(same, key=lambda j: abs(after.where[j].at - own.at))
                y -= weights[i] * (after.slope[j] - rows.slope[i])
        curvature = float(y @ d)
        if not self.H.any():
            self.H = np.eye(len(d)) * min(float(y @ y) / curvature, STEEPEST) if curvature > 0 else self.H
            return
        self.H = bent(self.H, d, y)

    def promise(self) -> float:
        """Rise of the best merit that a linear program still promises within 1 % of every parameter."""
        self.now = self.best[0]
        self.check(deep=False)
        rows = self.now.rows(self.which, self.watched, NEAREST[1], MODES)
        merit, self.H = self.now.merit(self.which, self.watched), np.zeros_like(self.H)
        d, _ = self.program(rows, LITTLE, merit.level)
        slope, hard = np.array(rows.slope).reshape(-1, len(d)), np.array(rows.hard, bool)
        value = np.array(rows.value) + slope @ d
        level = min(float(value[~hard].min()), self.problem.goal)
        return Merit(level, float(value[hard].min(initial=0.0))).value - merit.value


def bent(H: np.ndarray, d: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The curvature H after a step d that changed the gradient by y: damped, d H d falls to a fifth at most."""
    Hd, curvature = H @ d, float(y @ d)
    dHd = float(d @ Hd)
    if curvature < 0.2 * dHd:
        share = 0.8 * dHd / (dHd - curvature)
        y = share * y + (1 - share) * Hd
        curvature = float(y @ d)
    return H - np.outer(Hd, Hd) / dHd + np.outer(y, y) / curvature


def quadratic_program(P: np.ndarray, q: np.ndarray, A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """min x'Px / 2 + q'x subject to A x <= b, by Clarabel: x and the multipliers."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.NonnegativeConeT(len(b))]
    solver = clarabel.DefaultSolver(sp.triu(sp.csc_matrix(P), format="csc"), q, sp.csc_matrix(A), b, cones, settings)
    found = solver.solve()
    return np.array(found.x), np.array(found.z)

"""What is tuned for: rows that shall be large, with their derivatives by all parameters.

    eigenvalue    ds = w^H dA v,  dA = B N dK (1 - D K)^-1 C             (w, v left and right vectors, w^H v = 1)
    sensitivity   S = 1 + out (jw - A)^-1 B;   dS = (e + Y B) dK (C X + D e),  X = (jw - A)^-1 B e,  Y = out (jw - A)^-1

The damping ratio of every mode above 0.1 Hz counts, also those of exciters and controllers. Down to a third of that,
less and less is asked, smoothly, and slower modes must only decay. Sources: P. Kundur, Power System Stability and
Control, 1994, section 12.2.4; P. Seiler, A. Packard, P. Gahinet, An Introduction to Disk Margins, IEEE Control Systems
40, 2020.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import zgetrf, zgetrs

from stabctl.controllers.realization import Matrices

from .blocks import Laws, noise_size
from .plants import STABLE, Loop, Plant

LOW = 0.1  # Hz   from which the damping ratio counts in full
EASE = 0.2  # by which less is asked at a frequency e times lower
WEIGHT = 0.2  # of the logarithm of a peak: comparable with a damping ratio
LOWEST, HIGHEST, FREQUENCIES = 0.02, 30.0, 80  # Hz   of sensitivities
ROUNDS = 4  # of refinement of a peak, each to a quarter of the distance between frequencies
NEAR = 0.75  # of the bound, from which a peak is a row
PENALTY = 3.0  # of limits that are missed
LOWER = 0.02  # weight of the logarithm of a gain that is lowered; so small that limits, with their penalty, weigh more
KEPT = 2e-4  # by which the limits of the search, which are tighter than those asked for, may be missed at the end
SLACK = 1e-4  # by which they may be missed where a search ends early
FEW = 8  # modes, up to which inverse iteration takes less time than all vectors
UNSTABLE = -0.5  # what an unstable plant counts as in the limits of sensitivity


class Scenario(NamedTuple):
    """A plant with factors of the gains, and what is asked there.

    Attributes
    ----------
    plant
        Row of the plant.
    factors
        Factors (controllers) of their gains.
    floor
        Damping ratio that is a limit; None: it is maximized.
    name
        What it is called in results.
    """

    plant: int
    factors: np.ndarray
    floor: float | None
    name: str


class Peak(NamedTuple):
    """A bound of max |S(jw) - shift|: of each loop alone, or of the largest singular value of all together."""

    bound: float
    shift: float = 0.0
    together: bool = False


class Active(NamedTuple):
    """Where a row comes from: a scenario and its eigenvalue, a plant, an input and the frequency of a peak, or a gain.

    The row of a gain that is lowered has no key: it is linear. Nor has the row of noise, which is nearly so.
    """

    name: str
    at: complex
    key: tuple[int, ...]


@dataclass
class Rows:
    """Values (rows) and derivatives (rows, parameters), those that are limits, and where they come from."""

    value: list[float] = field(default_factory=list)
    slope: list[np.ndarray] = field(default_factory=list)
    hard: list[bool] = field(default_factory=list)
    where: list[Active] = field(default_factory=list)

    def joined(self, other: "Rows", d: np.ndarray) -> "Rows":
        """These and those of a trial at a distance d, as they would be here by their derivatives."""
        back = [v - float(g @ d) for v, g in zip(other.value, other.slope, strict=True)]
        return Rows(self.value + back, self.slope + other.slope, self.hard + other.hard, self.where + other.where)


class Merit(NamedTuple):
    """The least value that is maximized, and by how much limits are missed (0 or negative)."""

    level: float
    missed: float

    @property
    def value(self) -> float:
        """What a search raises."""
        return self.level + PENALTY * self.missed

    def missing(self, margin: float) -> "Merit":
        """The merit with one more limit, which is kept by a margin."""
        return Merit(self.level, min(self.missed, margin))

    def reaches(self, goal: float) -> bool:
        """Whether the goal is reached, and all limits are kept."""
        return self.level >= goal and self.missed >= -SLACK


def spare(s: np.ndarray) -> np.ndarray:
    """Damping ratios of eigenvalues, with ease below 0.1 Hz; of the slowest their decay, inf if they are real."""
    hz, size = np.abs(s.imag) / (2 * np.pi), np.maximum(np.abs(s), 1e-12)
    eased = -s.real / size + EASE * np.log(LOW / np.clip(hz, 1e-9, LOW))
    slow = np.where(s.real <= STABLE, np.inf, -s.real)
    return np.where(hz < LOW / 3, slow, eased)


def spare_slope(s: np.ndarray, ds: np.ndarray) -> np.ndarray:
    """Derivatives (modes, parameters) of `spare`."""
    hz, size = np.abs(s.imag)[:, None] / (2 * np.pi), np.abs(s)[:, None]
    s = s[:, None]
    ratio = -(ds.real - s.real / size * (s.conj() * ds).real / size) / size
    with np.errstate(divide="ignore", invalid="ignore"):
        eased = ratio - np.where(hz < LOW, EASE * ds.imag / s.imag, 0)
    return np.where(hz < LOW / 3, -ds.real, eased)


@dataclass(frozen=True, eq=False)
class Problem:
    """Parameters p: logarithms of those of the controllers, then of those of the case; low <= p <= high, G p <= g.

    Attributes
    ----------
    laws, plants, scenarios
        The controllers, the plants, and the scenarios over them.
    low, high, G, g
        Bounds.
    peaks
        Bounds of sensitivity.
    shares
        W and w, if the gains are lowered: W p - w are their logarithms, relative to their bounds, and the largest is
        lowered. Every scenario has a floor then.
    goal
        Damping ratio that is enough; more does not raise the merit.
    noise
        Largest standard deviation of the output of some controllers, by number, with noise of 1 in every input.
    """

    laws: Laws
    plants: Sequence[Plant]
    scenarios: Sequence[Scenario]
    low: np.ndarray
    high: np.ndarray
    G: np.ndarray
    g: np.ndarray
    peaks: Sequence[Peak] = ()
    shares: tuple[np.ndarray, np.ndarray] | None = None
    goal: float = np.inf
    noise: Mapping[int, float] = field(default_factory=dict)

    def at(self, p: np.ndarray) -> "Trial":
        """All loops at parameters p."""
        return Trial(self, p)


class Trial:
    """The loops of a problem at parameters p, each closed when it is first asked for."""

    def __init__(self, problem: Problem, p: np.ndarray) -> None:
        self.problem, self.p = problem, p
        split = problem.laws.size
        self.logs, self.of_case = p[:split], p[split:]
        self._blocks = problem.laws.blocks(self.logs)
        self._plants: dict[int, Matrices] = {}
        self._loops: dict[tuple[int, bytes], Loop] = {}
        self._varied: dict[int, list[Matrices]] = {}
        self._margins: dict[int, float] = {}

    def loop(self, k: int, factors: np.ndarray | None = None) -> Loop:
        """A plant closed with factors of the gains, or with the gains themselves."""
        laws = self.problem.laws
        factors = np.ones(len(laws.placed)) if factors is None else factors
        key = k, factors.tobytes()
        if key not in self._loops:
            if k not in self._plants:
                self._plants[k] = self.problem.plants[k].at(self.of_case)
            self._loops[key] = Loop(self._plants[k], laws.matrix(self._blocks, factors))
        return self._loops[key]

    # Merit.

    def level(self, k: int) -> float:
        """Least spare damping of a scenario, beyond the floor if there is one."""
        one = self.problem.scenarios[k]
        return float(spare(self.loop(one.plant, one.factors).eigenvalues).min()) - (one.floor or 0.0)

    def merit(self, which: Sequence[int], watched: Iterable[int], least: float = -np.inf) -> Merit:
        """The merit over scenarios, worst first, and peaks of watched plants; incomplete once it is below `least`."""
        found = Merit(float(np.r_[self.spared, self.problem.goal].min()), 0.0)
        found = found.missing(min(self.quiet[0], default=0.0))
        for k in which:
            level, soft = self.level(k), self.problem.scenarios[k].floor is None
            found = Merit(min(level, found.level), found.missed) if soft else found.missing(level)
            if found.value < least:
                return found
        for k in watched:
            found = found.missing(self.margin(k))
        return found

    @property
    def spared(self) -> np.ndarray:
        """LOWER log (bound / gain) of the gains that are lowered; empty if the damping is raised."""
        if self.problem.shares is None:
            return np.zeros(0)
        W, w = self.problem.shares
        return LOWER * (w - W @ self.p)

    @cached_property
    def quiet(self) -> tuple[list[float], list[np.ndarray]]:
        """WEIGHT log (bound / noise) of the controllers whose noise is bounded, and their derivatives."""
        laws, values, every = self.problem.laws, [], []
        for k, bound in self.problem.noise.items():
            size, slope = noise_size(laws.placed[k].structure, laws.parts(self.logs)[k])
            whole = np.zeros(len(self.p))
            whole[laws.at[k] : laws.at[k + 1]] = -WEIGHT * slope
            values.append(WEIGHT * float(np.log(bound / size)))
            every.append(whole)
        return values, every

    def margin(self, k: int) -> float:
        """WEIGHT log (bound / peak) of a plant, at worst over the bounds; inf without bounds."""
        if k not in self._margins:
            loop, peaks = self.loop(k), self.problem.peaks
            if peaks and not loop.stable:
                self._margins[k] = UNSTABLE
            else:
                each = (np.log(peak.bound / highest(loop, peak)[0]) for peak in peaks)
                self._margins[k] = WEIGHT * float(min(each, default=np.inf))
        return self._margins[k]

    # Rows.

    def rows(self, which: Sequence[int], watched: Iterable[int], near: float, most: int) -> Rows:
        """The rows near the worst: at most `most` modes of each scenario, and peaks of the watched plants."""
        scenarios, rows = self.problem.scenarios, Rows()
        values = [spare(self.loop(scenarios[k].plant, scenarios[k].factors).eigenvalues) for k in which]
        soft = (v.min() for k, v in zip(which, values, strict=True) if scenarios[k].floor is None)
        level = min(soft, default=0.0)
        for k, value in zip(which, values, strict=True):
            one = scenarios[k]
            loop, floor = self.loop(one.plant, one.factors), one.floor or 0.0
            s, below = loop.eigenvalues, near + (level if one.floor is None else floor)
            chosen = np.flatnonzero((value < below) & (s.imag >= 0))
            chosen = chosen[np.argsort(value[chosen])][:most]
            if len(chosen):
                left, right = vectors(loop, s[chosen])
                ds = self._slopes(one.plant, loop, (left, right, *loop.outer(left, right)), one.factors)
                rows.value += (value[chosen] - floor).tolist()
                rows.slope += list(spare_slope(s[chosen], ds))
                rows.hard += [one.floor is not None] * len(chosen)
                rows.where += [Active(one.name, complex(x), (k,)) for x in s[chosen]]
        for k in watched:
            self._peak_rows(k, rows)
        rows.value += self.quiet[0]
        rows.slope += self.quiet[1]
        rows.hard += [True] * len(self.quiet[0])
        rows.where += [Active("noise", 0j, ())] * len(self.quiet[0])
        if self.problem.shares is not None:
            W = self.problem.shares[0]
            rows.value += self.spared.tolist()
            rows.slope += list(-LOWER * W)
            rows.hard += [False] * len(W)
            rows.where += [Active("gain", 0j, ())] * len(W)
        return rows

    def _peak_rows(self, k: int, rows: Rows) -> None:
        """Rows of the peaks near the bounds, of a plant that is stable."""
        loop = self.loop(k)
        if not loop.stable:
            return
        ones, nu = np.ones(len(self.problem.laws.placed)), loop.nu
        for index, peak in enumerate(self.problem.peaks):
            for size, w, i in summits(loop, peak, NEAR * peak.bound):
                whole = loop.sensitivity(np.array([w]))[0] - peak.shift * np.eye(nu)
                U, _, V = np.linalg.svd(whole) if peak.together else (np.eye(nu), None, np.eye(nu))
                left, right = U[:, i].conj(), V[i].conj()
                left = left * (abs(left @ whole @ right) / (left @ whole @ right))
                lu, swapped, _ = zgetrf(1j * w * np.eye(len(loop.A)) - loop.A)
                X = zgetrs(lu, swapped, loop.B[:, :nu] @ right)[0][:, None]
                Y = zgetrs(lu, swapped, left @ loop.out[:nu] + 0j, trans=1)[0][None]
                l, r = loop.outer(Y, X)
                l, r = l + left @ loop.N[:nu], r + (loop.D[:, :nu] @ right)[:, None]
                dS = self._slopes(k, loop, (Y, X, l, r), ones, right)[0]
                rows.value.append(WEIGHT * float(np.log(peak.bound / size)))
                rows.slope.append(-WEIGHT * dS.real / size)
                rows.hard.append(True)
                rows.where.append(Active(self.problem.plants[k].name, 1j * w, (-1 - k, index, i)))

    @cached_property
    def _law_slopes(self) -> list[np.ndarray]:
        return self.problem.laws.slopes(self.logs)

    def _slopes(
        self,
        k: int,
        loop: Loop,
        around: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
        factors: np.ndarray,
        e: np.ndarray | None = None,
    ) -> np.ndarray:
        """Derivatives (vectors, parameters) from the vectors of x (rows, columns), of z (rows) and of y (columns)."""
        left, right, l, r = around
        own = self.problem.laws.gradient(l, r, self._law_slopes, factors)
        if not len(self.of_case):
            return own
        n, nu, ny = loop.n, loop.nu, self.problem.laws.ny
        u, y = (loop.K @ r)[:nu], (l @ loop.K)[:, :ny]
        if e is not None:
            u = u + e[:, None]
        left, right = left[:, :n].T, right[:n]
        changes = [
            (left * (d.A @ right + d.B @ u)).sum(axis=0) + (y.T * (d.C @ right + d.D @ u)).sum(axis=0)
            for d in self._plant_slopes(k)
        ]
        return np.hstack([own, np.array(changes).T])

    def _plant_slopes(self, k: int) -> list[Matrices]:
        if k not in self._varied:
            self._varied[k] = self.problem.plants[k].slopes(self.of_case)
        return self._varied[k]


def vectors(loop: Loop, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Left w^H (modes, n) and right (n, modes) vectors of eigenvalues, w^H v = 1; of a few by inverse iteration."""
    if len(s) > FEW or "modal" in vars(loop):
        own = loop.modal.some(np.abs(loop.modal.values - s[:, None]).argmin(axis=1))
        return own.left.conj().T, own.right
    A = loop.A
    n, left, right = len(A), [], []
    start = np.cos(1.7 * np.arange(n)) + 0.5 + 0j
    for x in s:
        M = A.astype(complex)
        M.flat[:: n + 1] -= x + 1e-9 * (1 + abs(x))
        lu, swapped, _ = zgetrf(M, overwrite_a=True)
        v = w = start
        for _ in range(2):
            v, w = zgetrs(lu, swapped, v)[0], zgetrs(lu, swapped, w, trans=1)[0]
            v, w = v / np.linalg.norm(v), w / np.linalg.norm(w)
        left.append(w / (w @ v))
        right.append(v)
    return np.array(left), np.array(right).T


def frequencies(loop: Loop) -> np.ndarray:
    """Frequencies (rad/s) among which peaks are sought: a grid, and the resonances of the loop."""
    resonances = np.abs(loop.eigenvalues.imag)
    w = 2 * np.pi * np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
    return np.unique(np.r_[w, resonances[(resonances > w[0]) & (resonances < w[-1])]])


def _sizes(loop: Loop, peak: Peak, w: np.ndarray) -> np.ndarray:
    """|S - shift| (frequencies, loops), or the largest singular value (frequencies, 1)."""
    if peak.together:
        S = loop.sensitivity(w) - peak.shift * np.eye(loop.nu)
        return np.linalg.norm(S, 2, axis=(1, 2))[:, None]
    return np.abs(loop.alone(w) - peak.shift)


def summits(loop: Loop, peak: Peak, above: float) -> list[tuple[float, float, int]]:
    """Size, frequency (rad/s) and loop of the local maxima above a size."""
    w = frequencies(loop)
    return _refined(loop, peak, w, _sizes(loop, peak, w), above)


def highest(loop: Loop, peak: Peak) -> tuple[float, float, int]:
    """The highest summit: size, frequency (rad/s), loop."""
    w = frequencies(loop)
    size = _sizes(loop, peak, w)
    k, i = np.unravel_index(size.argmax(), size.shape)
    edge = float(size[k, i]), float(w[k]), int(i)
    return max(_refined(loop, peak, w, size, 0.95 * edge[0]), default=edge)


def _refined(loop: Loop, peak: Peak, w: np.ndarray, size: np.ndarray, above: float) -> list[tuple[float, float, int]]:
    """Local maxima of sizes (frequencies, loops) on a grid, each looked for on finer and finer grids around it."""
    inner = (size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:]) & (size[1:-1] > above)
    found = []
    for k, i in zip(*np.nonzero(inner), strict=True):
        low, high = w[k], w[k + 2]
        for _ in range(ROUNDS):
            tried = np.linspace(low, high, 9)
            at = _sizes(loop, peak, tried)[:, i]
            best = int(np.clip(at.argmax(), 1, 7))
            low, high = tried[best - 1], tried[best + 1]
        found.append((float(at.max()), float(tried[at.argmax()]), int(i)))
    return found

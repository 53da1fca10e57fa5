"""The parts of a tuning problem: controllers, parameters of the case, their plants, and the scenarios."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.controllers.realization import Matrices
from stabctl.smallsignal.eigen import eigen

from .blocks import Laws, Placed, Variable, drawn
from .case_values import Device, Shared
from .devices import Tunable
from .networks import Network
from .plants import STABLE, Plant, plant
from .problem import Peak, Problem, Scenario, spare

UNMOVED = 1e-9  # of an unstable mode: how far it is seen and moved, below which nothing stabilizes it
MORE = 5e-4  # damping ratio in the search beyond what is asked for, so that it is reached
JITTER = 0.05  # of the first start: equal stages are a saddle
INSIDE = 1e-3  # how much tighter limits are in the search than asked, relative, so that they are kept


@dataclass(frozen=True)
class Asked:
    """What the tuning shall reach, checked.

    Attributes
    ----------
    damping
        Damping ratio from which the gains are lowered; None: as much as possible.
    gains
        Factors of all gains, beside 1, with which the damping counts too.
    doubled
        Damping ratio with doubled gains; None: not asked.
    peaks
        Bounds of sensitivity.
    one_out
        Whether each controller out of service counts too, in the intact networks.
    reserve
        Share of its limits that three standard deviations of noise leave every controller; None: not asked.
    """

    damping: float | None
    gains: tuple[float, ...]
    doubled: float | None
    peaks: tuple[Peak, ...]
    one_out: bool
    reserve: float | None = None


@dataclass(frozen=True)
class Parts:
    """Networks, the controllers and the parameters of the case, and the plants that they make."""

    networks: tuple[Network, ...]
    tunables: tuple[Tunable, ...]
    of_case: tuple[Shared, ...]
    laws: Laws
    plants: tuple[Plant, ...]
    owner: tuple[int, ...]  # network of each plant

    @classmethod
    def of(cls, networks: Sequence[Network], devices: Sequence[Device]) -> "Parts":
        """The plants of all networks."""
        first = networks[0]
        with_own = replace(first.point.case, devices=first.devices)
        tunables = [t for one in devices for t in one.tunables(with_own)]
        drives = [t.output for t in tunables]
        tunables = [replace(t, shared=drives.count(t.output) > 1) for t in tunables]
        of_case = [pair for one in devices for pair in one.of_case(first.point.case)]
        if not tunables and not of_case:
            raise StudyError("There is no parameter to tune; give st.design.stabilizers() or another device.")
        drives = list(dict.fromkeys(drives))
        reads = list(dict.fromkeys((name, t.delays) for t in tunables for name in t.inputs))
        placed = [
            Placed(t.structure, [reads.index((name, t.delays)) for name in t.inputs], drives.index(t.output))
            for t in tunables
        ]
        plants, owner = [], []
        for k, network in enumerate(networks):
            for j in range(max((len(t.delays) for t in tunables), default=1)):
                delays = [late[min(j, len(late) - 1)] for _, late in reads]
                plants.append(_plant(network, j, of_case, (drives, [name for name, _ in reads], delays)))
                owner.append(k)
        laws = Laws(placed, len(drives), len(reads))
        return cls(tuple(networks), tuple(tunables), tuple(of_case), laws, tuple(plants), tuple(owner))

    @property
    def variables(self) -> list[Variable]:
        """All parameters that are tuned, those of the controllers first."""
        return [v for t in self.tunables for v in t.structure.variables] + [v for _, v in self.of_case]

    def movable(self, damping: float | None) -> tuple["Parts", list[tuple[str, str]]]:
        """The same without plants with an unstable mode that no controller sees and moves, which are named.

        Such a mode that is stable, but has less than the damping wanted, is an error.
        """
        if self.of_case:
            return self, []
        kept, out = [], []
        for k, one in enumerate(self.plants):
            m = one.matrices
            modes = eigen(m.A, np.zeros((len(m.A), 0)))
            moved = np.abs(modes.left.conj().T @ m.B).max(axis=1) * np.abs(m.C @ modes.right).max(axis=0)
            unmoved = modes.values[moved < UNMOVED * np.abs(modes.values)]
            fixed = unmoved[unmoved.real > STABLE]
            if len(fixed):
                s = fixed[0]
                hz = f"at {abs(s.imag) / (2 * np.pi):.3f} Hz" if s.imag else f"of {s.real:.3g} 1/s"
                out.append((one.name, f"no controller moves its unstable mode {hz}"))
                continue
            kept.append(k)
            if damping is not None and spare(unmoved).min(initial=np.inf) < damping:
                s = unmoved[spare(unmoved).argmin()]
                raise StudyError(
                    f"damping = {damping:g} cannot be reached: no controller moves the mode at "
                    f"{abs(s.imag) / (2 * np.pi):.3f} Hz of {one.name}, whose damping ratio is "
                    f"{-s.real / abs(s):z.4f}; ask for less, or give other devices."
                )
        if not kept:
            raise StudyError(f"No controller stabilizes any network: {out[0][0]}: {out[0][1]}; give other devices.")
        plants, owner = tuple(self.plants[k] for k in kept), tuple(self.owner[k] for k in kept)
        return replace(self, plants=plants, owner=owner), out

    def problem(self, asked: Asked, *, lowered: bool = False) -> Problem:
        """What is asked of the plants; with `lowered`, the damping is a limit, and the gains are lowered."""
        lower = asked.damping + MORE if lowered and asked.damping is not None else None
        n = len(self.tunables)
        one = np.ones(n)
        factors = [(one, "")] + [(k * one, f" with gains x {k:g}") for k in asked.gains]
        scenarios = []
        for k, plant_ in enumerate(self.plants):
            every = list(factors)
            if asked.one_out and self.networks[self.owner[k]].intact:
                every += [(one - np.eye(n)[i], f" without {t.name}") for i, t in enumerate(self.tunables)]
            scenarios += [Scenario(k, f, lower, f"{plant_.name}{text}") for f, text in every]
            if asked.doubled is not None and n:
                scenarios.append(Scenario(k, 2 * one, asked.doubled + INSIDE, f"{plant_.name} with doubled gains"))
        low, high = (np.log([getattr(v, end) for v in self.variables]) for end in ("low", "high"))
        bounded = [i for i, t in enumerate(self.tunables) if np.isfinite(t.fast)]
        G, g = np.zeros((len(bounded), len(low))), np.log([self.tunables[i].fast for i in bounded])
        for row, i in enumerate(bounded):
            G[row, self.laws.at[i] : self.laws.at[i + 1]] = self.tunables[i].structure.fast
        for row, i in enumerate(bounded):
            least = G[row] @ np.where(G[row] > 0, low, high)
            if least > g[row]:
                raise StudyError(
                    f"{self.tunables[i].name}: the gain at high frequencies is at least {np.exp(least):.4g} within the "
                    f"bounds, above fast = {self.tunables[i].fast:g}; give a larger one, or other bounds."
                )
        peaks = [one._replace(bound=one.bound * (1 - INSIDE)) for one in asked.peaks if n]
        noise = {} if asked.reserve is None else self._loudest(asked.reserve)
        K = self.laws.at[:-1]
        shares = None if lower is None else (np.vstack([np.eye(len(low))[K], G]), np.r_[high[K], g])
        goal = np.inf if asked.damping is None or lower is not None else asked.damping + MORE
        return Problem(self.laws, self.plants, scenarios, low, high, G, g, peaks, shares, goal, noise)

    def _loudest(self, reserve: float) -> dict[int, float]:
        """Bounds of the noise, by number, of the controllers that read some."""
        noisy = {i: t for i, t in enumerate(self.tunables) if t.noise}
        if not noisy:
            raise StudyError(f"reserve = {reserve:g} needs the noise of a signal; give stabilizers(noise=1e-4).")
        for t in noisy.values():
            if not np.isfinite(t.limits).any():
                raise StudyError(f"{t.name}: reserve = {reserve:g} needs limits of its output; give limits=0.1.")
            if t.reserve(t.quietest) < reserve:
                raise StudyError(
                    f"{t.name}: even with the smallest gains within the bounds, its noise leaves "
                    f"{max(t.reserve(t.quietest), 0):.2g} of its limits, less than reserve = {reserve:g}; ask for "
                    "less, or give other bounds."
                )
        return {i: t.loudest(reserve) * (1 - INSIDE) for i, t in noisy.items()}

    def reserves(self, logs: np.ndarray) -> list[tuple[str, float]]:
        """Share of the limits of each controller that three standard deviations of its noise leave."""
        each = zip(self.tunables, self.laws.parts(logs), strict=True)
        return [(t.name, t.reserve(v)) for t, v in each if t.noise and np.isfinite(t.limits).any()]

    def starts(self, problem: Problem, number: int, seed: int) -> Iterator[np.ndarray]:
        """The first start is plain, the others are random; all within the bounds."""
        rest = np.log([v.start for _, v in self.of_case])
        for k in range(number):
            rng = np.random.default_rng([seed, k])
            if k == 0:
                own = [np.log([v.start for v in t.structure.variables]) for t in self.tunables]
                own = [one + JITTER * rng.standard_normal(len(one)) for one in own]
            else:
                own = [drawn(t.structure, rng) for t in self.tunables]
            yield self.feasible(problem, np.concatenate([*own, rest]))

    def feasible(self, problem: Problem, p: np.ndarray) -> np.ndarray:
        """The nearest parameters within the bounds: gains, then leads, are lowered."""
        p = np.clip(p, problem.low, problem.high)
        for row, limit in zip(problem.G, problem.g, strict=True):
            for k in np.flatnonzero(row > 0):
                p[k] = max(problem.low[k], p[k] - max(row @ p - limit, 0))
            for k in np.flatnonzero(row < 0):
                p[k] = min(problem.high[k], p[k] + max(row @ p - limit, 0))
        return p


def _plant(network: Network, j: int, of_case: Sequence[Shared], signals: tuple[Any, Any, Any]) -> Plant:
    """The plant of a network; with parameters of the case, also as a function of these."""
    name = network.name if j == 0 else f"{network.name} with delay {j + 1}"
    matrices = plant(network.point, *signals)
    if not of_case:
        return Plant(name, matrices)

    def varied(logs: np.ndarray) -> Matrices:
        return plant(network.tuned(of_case, logs), *signals)

    return Plant(name, matrices, varied)

"""The allocation of a budget of megawatts by the Gramians of the electromechanical modes: two convex programs.

    maximize  lambda_min(W(s))   or   log det W(s),   W(s) = sum s_i W_i,   0 <= s <= cap,   sum s = budget

The first improves the mode that storage controls worst, the second the volume that storage can reach. W is linear in s,
so the programs are written in shares of the budget, and only the caps over the budget are parameters.

Both objectives are concave: with a gradient g_i = <Z, W_i> at s*, no sizes do better than value(s*) + max_s g (s - s*),
a fractional knapsack problem. This bound does not depend on the solver; a solution that misses it is rejected.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from stabctl._util.tabular import Tabular
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model.case import Storage
from stabctl.smallsignal import Mode

from .allocation_program import AllocationProgram, Objective
from .gramians import DECAY, MODES, Gramians, gramians
from .sensitivity import Candidate

if TYPE_CHECKING:
    import pandas as pd

Caps = float | Sequence[float] | Mapping[tuple[int, int], float]
GAP = 1e-3  # largest gap to the bound, relative (of a logarithm: absolute)


@dataclass(frozen=True, repr=False, eq=False)
class Allocation(Tabular):
    """Megawatts at every candidate, and the gain of the objective per megawatt."""

    case: str
    objective: Objective
    budget_mw: float
    candidates: tuple[Candidate, ...]
    sizes: np.ndarray  # (candidates) MW
    caps: np.ndarray  # (candidates) MW
    value: float  # lambda_min or log det of W(s)
    bound: float  # upper bound of the value for any sizes
    gain: np.ndarray  # (candidates)   gain of the objective per MW, at these sizes
    alone: np.ndarray  # (candidates)   trace of W_i, of 1 MW alone
    modes: tuple[Mode, ...]
    decay: float  # 1/s

    @property
    def ranking(self) -> tuple[int, ...]:
        """Rows of the candidates, the largest first; those without storage by their gain."""
        return tuple(int(i) for i in np.lexsort((-self.gain, -self.sizes)))

    def storage(self, **options: Any) -> tuple[Storage, ...]:
        """The devices, for `simulate(storage=...)`; options are fields of `Storage`."""
        return tuple(
            Storage(c.machine, c.bus, float(s), **options)
            for c, s in zip(self.candidates, self.sizes, strict=True)
            if s > 0
        )

    @property
    def df(self) -> "pd.DataFrame":
        """The candidates, a row each, the largest first."""
        import pandas as pd

        table = pd.DataFrame(self.candidates, columns=Candidate._fields)
        table = table.assign(mw=self.sizes, cap_mw=self.caps, gain_per_mw=self.gain, alone_per_mw=self.alone)
        return table.iloc[list(self.ranking)].reset_index(drop=True)

    def __str__(self) -> str:
        head = [
            f"{self.case}: {self.budget_mw:g} MW by {self.objective}, {self.value:.4g} (at most {self.bound:.4g})",
            *(f"  mode {m}" for m in self.modes),
            "device          MW        cap    gain/MW   alone/MW",
        ]
        rows = [
            f"{self.candidates[i]!s:8} {self.sizes[i]:9.2f} {self.caps[i]:10.4g} {self.gain[i]:10.3g} "
            f"{self.alone[i]:10.3g}"
            for i in self.ranking
        ]
        return "\n".join(head + rows)


def by_gramian(
    point: OperatingPoint,
    candidates: Iterable[tuple[int, int]] | None = None,
    budget_mw: float = 100.0,
    caps_mw: Caps = np.inf,
    *,
    objective: Objective = "min-eigenvalue",
    modes: int | Sequence[float] = MODES,
    decay: float = DECAY,
) -> Allocation:
    """Allocate a budget among the candidates by their modal controllability.

    Parameters
    ----------
    point, candidates, modes, decay
        As in `gramians`.
    budget_mw, caps_mw, objective
        As in `allocate`.
    """
    return allocate(gramians(point, candidates, modes, decay), budget_mw, caps_mw, objective)


def allocate(
    g: Gramians, budget_mw: float, caps_mw: Caps = np.inf, objective: Objective = "min-eigenvalue"
) -> Allocation:
    """Allocate a budget among the candidates of some Gramians.

    Parameters
    ----------
    g : Gramians
        The Gramians.
    budget_mw : float, MW
        Sum of the sizes.
    caps_mw : float, sequence or mapping, MW
        Largest size of all candidates, or of each, in order or by (machine, bus).
    objective : {"min-eigenvalue", "log-det"}
        What is maximized.

    Raises
    ------
    StudyError
        For a budget that is not positive or exceeds the caps, for negative caps, and if the program has no accurate
        solution.
    """
    if objective not in get_args(Objective):
        raise StudyError(f"{objective!r} is not an objective; choose one of {', '.join(get_args(Objective))}.")
    if not 0 < budget_mw < np.inf:
        raise StudyError(f"The budget of {budget_mw:g} MW is not allowed; it must be more than 0.")
    caps = _caps(g, caps_mw)
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
    parts = (g.candidates, sizes, caps, value, value + max(gap, 0.0), gain, g.alone, g.modes, g.decay)
    return Allocation(g.case, objective, float(budget_mw), *parts)


def _caps(g: Gramians, given: Caps) -> np.ndarray:
    """Caps (candidates) in MW."""
    if isinstance(given, Mapping):
        for c in g.candidates:
            if c not in given:
                raise StudyError(f"The candidate {c} has no cap; give one in MW for every candidate.")
        given = [given[c] for c in g.candidates]
    caps = np.asarray(given, float)
    if caps.ndim and caps.shape != (len(g.candidates),):
        count = len(g.candidates)
        raise StudyError(f"There are {caps.size} caps for {count} candidates; give one for all or one for each.")
    caps = np.broadcast_to(caps, len(g.candidates)).copy()
    for c, cap in zip(g.candidates, caps, strict=True):
        if not cap >= 0:
            raise StudyError(f"The cap of {cap:g} MW for candidate {c} is not allowed; it must be 0 or more.")
    return caps


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

"""The search for a storage law: a coarse grid, then one parameter after the other.

The grid of angle gains, slopes and groups is measured on a coarse grid of clearing times. From the best laws on, every
parameter is moved to its next larger and smaller value, on the fine grid, as long as that improves the score; then to
all its other values, which may lead on. The finalists are measured as a clearing time is, with a scan for shorter
unstable and longer stable faults. Nothing is random, so the answer does not depend on the number of threads.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from stabctl.clearing.search import Search
from stabctl.controllers import Law, StorageLaw
from stabctl.simulation.contingency import Contingency

from .law_bench import Bench
from .law_limits import LawLimits

GRID = {"angle_gain": (0.0, 0.5, 1.0), "slope": (0.0, 0.05, 0.2)}
AXES: Mapping[str, tuple[float, ...]] = {
    "angle_gain": (0.0, 0.25, 0.5, 1.0, 2.0),
    "slope": (0.0, 0.02, 0.05, 0.1, 0.2, 0.4),
    "deadband": (0.02, 0.05, 0.1, 0.2),
    "min_voltage": (0.5, 0.6, 0.7, 0.75, 0.8),
    "max_acceleration": (0.0, 4.0, 2.0, 1.0),
    "arm_at": (0.0, 0.05, 0.1, 0.2),
}
STARTS = 2  # laws of the grid that are refined
FINALISTS = 3
FAR = 10  # values on each side that are tried when no next one helps: all


class LawSearch:
    """Search for the law with the best score in the training contingencies.

    Parameters
    ----------
    bench : Bench
    contingencies : sequence of Contingency
        Those of the training.
    reference : Law
        The law that clearing times are compared with.
    limits : LawLimits
    used : callable
        The law as it is used, behind its rate and delay.
    """

    def __init__(
        self,
        bench: Bench,
        contingencies: Sequence[Contingency],
        reference: Law,
        limits: LawLimits,
        used: Callable[[StorageLaw], Law],
    ) -> None:
        self.bench, self.contingencies, self.reference = bench, contingencies, reference
        self.limits, self.used = limits, used
        self.tried: dict[StorageLaw, None] = {}

    def best(self, start: StorageLaw, groups: Sequence[tuple[Any, ...]]) -> list[StorageLaw]:
        """The finalists, best first.

        Parameters
        ----------
        start
            A law with the parameters that are not on the grid.
        groups
            Groups of machines that may act as one: none, or those found.
        """
        axes = {name: self._allowed(name, values) for name, values in AXES.items()} | {"groups": tuple(groups)}
        grid = [
            replace(start, groups=g, **dict(zip(GRID, values, strict=True)))
            for g in groups
            for values in product(*GRID.values())
        ]
        ranked = self._ranked(grid, self.bench.coarse)
        refined = [law for start in ranked[:STARTS] for law in self._refined(start, axes)]
        finalists = self._ranked(list(dict.fromkeys(refined)), self.bench.fine)[:FINALISTS]
        return self._ranked(finalists, self.bench.search)

    def _allowed(self, name: str, values: tuple[float, ...]) -> tuple[float, ...]:
        """The values of a parameter within the limits, which are among them."""
        least = {"deadband": self.limits.deadband, "min_voltage": self.limits.min_voltage}.get(name)
        return values if least is None else tuple(sorted({least, *(v for v in values if v > least)}))

    def _refined(self, law: StorageLaw, axes: Mapping[str, tuple[Any, ...]]) -> list[StorageLaw]:
        """The laws on the way to one that no other value of a single parameter improves, last first."""
        way, reach = [law], 1
        while reach:
            near = [law, *(n for name, values in axes.items() for n in _neighbors(law, name, values, reach))]
            law = self._ranked(near, self.bench.fine)[0]
            if law != way[0]:
                way.insert(0, law)
                reach = 1
            else:
                reach = FAR if reach == 1 else 0
        return way

    def _ranked(self, laws: Sequence[StorageLaw], search: Search) -> list[StorageLaw]:
        """Laws by their score, best first; of equal ones, the earlier."""
        self.tried |= dict.fromkeys(laws)
        used = [self.reference, *(self.used(law) for law in laws)]
        found = self.bench.measured([(law, c) for law in used for c in self.contingencies], search)
        n = len(self.contingencies)
        reference, *others = [found[k : k + n] for k in range(0, len(found), n)]
        scores = [self.limits.score(of_one, reference) for of_one in others]
        return [laws[k] for k in sorted(range(len(laws)), key=lambda k: -scores[k])]


def _neighbors(law: StorageLaw, name: str, values: Sequence[Any], reach: int) -> list[StorageLaw]:
    """The law with the next values of a parameter, so many on each side; a deadband raises the arming level to it."""
    at = values.index(getattr(law, name))
    found = []
    for value in values[max(at - reach, 0) : at + reach + 1]:
        deadband, arm_at = (value if name == key else getattr(law, key) for key in ("deadband", "arm_at"))
        if name == "deadband" and arm_at:
            arm_at = max(arm_at, deadband)
        if value != values[at] and (arm_at == 0 or arm_at >= deadband):
            found.append(replace(law, **{name: value, "deadband": deadband, "arm_at": arm_at}))
    return found

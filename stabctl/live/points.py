"""The operating points of a case that the pages use: solved when they are first needed, the last ones kept."""

from functools import lru_cache
from threading import RLock

from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.case import Case

from .state import State

KEPT = 24


class Points:
    """Operating points of a case by load level, with and without storage devices."""

    def __init__(self, case: Case) -> None:
        self.case, self._lock = case, RLock()
        self._bare = lru_cache(KEPT)(self._solve)
        self._equipped = lru_cache(KEPT)(self._equip)

    def bare(self, state: State) -> OperatingPoint:
        """The case as it is, at the load level."""
        with self._lock:
            return self._bare(state.level)

    def of(self, state: State) -> OperatingPoint:
        """With the storage devices of the state; without any, `bare`."""
        if not state.stored:
            return self.bare(state)
        with self._lock:
            point = self._equipped(state.level)
        base = {m.machine: m.base for m in self.case.machines}
        share = state.percent / 100
        return point.resized(state.megawatts.get(s.machine, share * base[s.machine]) for s in point.case.storage)

    def _solve(self, level: float) -> OperatingPoint:
        return operating_point.solve(self.case if level == 100 else self.case.with_load_level(level / 100))

    def _equip(self, level: float) -> OperatingPoint:
        bare = self._bare(level)
        return operating_point.solve(bare.case.with_storage("1%mva"), bare.flow)

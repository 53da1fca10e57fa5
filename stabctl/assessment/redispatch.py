"""The smallest shift of active power from the machines that lose synchronism to the others that is enough.

The idea is that of preventive control with the single-machine-equivalent method: the power of the critical machines is
what accelerates them during the fault, and the others produce what they give up (Pavella, Ernst, Ruiz-Vega, "Transient
Stability of Power Systems: A Unified Approach to Assessment and Control", 2000). There the shift is extrapolated from
margins; here it is found by bisection on simulations, which need no margin.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import EquilibriumError, PowerFlowError, StudyError
from stabctl._util.units import cycles
from stabctl._util.wording import enumerated
from stabctl.clearing.trial import Search, Trial
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.trajectory import Trajectory

STEP = 0.01  # of the power of the critical machines, of which a shift is a multiple


class Shift(NamedTuple):
    """A dispatch with power shifted from the critical machines to others."""

    point: OperatingPoint
    values: dict[str, float]  # MW   of every machine that changes, by its path in the case
    mw: float
    words: str


def redispatch(
    point: OperatingPoint,
    lost: Sequence[Contingency],
    search: Search,
    *,
    control: Control = None,
    tried: Sequence[OperatingPoint] = (),
) -> Shift:
    """The smallest shift with which a system survives contingencies, in steps of 1 % of the power of the group.

    The critical machines give up power in proportion to what they produce. The others of their island take it in
    proportion to what is left of their rating, if they produce power themselves.

    Parameters
    ----------
    point : OperatingPoint
        The system.
    lost : sequence of Contingency
        Contingencies with the clearing times that are to be survived, the worst first.
    search : Search
        Grid, observation and criterion by which a run is judged.
    control : Control
        As in `simulate`.
    tried : sequence of OperatingPoint
        Dispatches that were not enough: a machine that is critical with one of them takes no power.

    Returns
    -------
    Shift

    Raises
    ------
    StudyError
        If no machine loses synchronism, there are no others with power to spare, or no shift is enough.
    """
    hz, grid = point.case.frequency_hz, search.resolution_cycles
    wanted = [(one, round(cycles(one.clear or 0.0, hz) / grid)) for one in lost]

    def ahead(there: OperatingPoint) -> list[np.ndarray]:
        """Which rotors are ahead when synchronism is lost, in each of the contingencies."""
        return [_ahead(Trial(there, one, control, search).simulate(k, record="rotors")) for one, k in wanted]

    sides = ahead(point)
    later = [side for other in tried for side in ahead(other)]
    room = _Room.of(point, np.logical_or.reduce(sides), np.logical_or.reduce([*sides, *later]))

    def survives(steps: int) -> bool:
        new = room.shift(steps * STEP)
        return new is not None and all(Trial(new.point, one, control, search).attempt(k).stable for one, k in wanted)

    low, high, last = 0, 1, int(room.most / STEP + 1e-9)
    if last and not room.shift(last * STEP):
        last = _first(0, last, lambda steps: room.shift(steps * STEP) is None) - 1
    while high <= last and not survives(high):
        low, high = high, max(min(2 * high, last), high + 1)
    best = room.shift(_first(low, high, survives) * STEP) if high <= last else None
    if best is None:
        most = last * STEP * room.power.sum()
        raise StudyError(
            f"Less power at {enumerated('machine', room.group)} is not enough, up to {most:.4g} MW, beyond which they "
            "produce no power, the ratings of the others are exceeded, or there is no operating point."
        )
    return best


def _first(low: int, high: int, holds: Callable[[int], bool]) -> int:
    """The first number at which something holds that does not at `low`, but at `high`, by bisection."""
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


class _Room(NamedTuple):
    """Who gives up power, and who takes it."""

    point: OperatingPoint
    produced: np.ndarray  # (machines) MW
    give: np.ndarray  # (islands, machines)   each one's share of what is given up in its island
    take: np.ndarray  # (islands, machines)   and of what is taken
    power: np.ndarray  # (islands) MW   of the critical machines
    spare: np.ndarray  # (islands) MW   of the others

    @classmethod
    def of(cls, point: OperatingPoint, ahead: np.ndarray, barred: np.ndarray) -> "_Room":
        """Of the rotors that are ahead, and those that take no power, which they are among (rotor units)."""
        case, rotors = point.case, point.rotors.unit
        if not ahead.any():
            raise StudyError("No group of machines loses synchronism in them, so no power can be shifted from it.")
        produced = point.flow.S.real * case.base_mva
        spare = np.maximum([m.base for m in case.machines] - produced, 0.0)
        P, rest = np.maximum(produced[rotors], 0.0), np.where(produced[rotors] > 0, spare[rotors], 0.0)
        inside = np.array([point.rotor_island == k for k in np.unique(point.rotor_island[ahead])])
        give, take = np.zeros((2, len(inside), len(produced)))
        give[:, rotors], take[:, rotors] = inside * ahead * P, inside * ~barred * rest
        power, room = give.sum(axis=1), take.sum(axis=1)
        if not (power.all() and room.all()):
            group = [name for name, of in zip(point.rotor_names, ahead, strict=True) if of]
            raise StudyError(f"No other machine can take the power that {enumerated('machine', group)} would give up.")
        return cls(point, produced, give / power[:, None], take / room[:, None], power, room)

    @property
    def most(self) -> float:
        """Largest share of their power that they can give up."""
        return float(min(1.0, *(self.spare / self.power)))

    @property
    def group(self) -> list[int | str]:
        """The critical machines."""
        return self._named(self.give.sum(axis=0) > 0)

    def _named(self, which: np.ndarray) -> list[int | str]:
        return [m.called for m, of in zip(self.point.case.machines, which, strict=True) if of]

    def shift(self, share: float) -> Shift | None:
        """The system in which the critical machines give up a share of their power; None without an equilibrium."""
        given = share * self.power
        now = self.produced + given @ (self.take - self.give)
        case, total = self.point.case, float(given.sum())
        fewer, more = (each.sum(axis=0) > 0 for each in (self.give, self.take))
        rows = zip(case.machines, now.tolist(), fewer | more, strict=True)
        values = {f"machines.{m.machine}.p": round(mw, 6) for m, mw, of in rows if of}
        less, to = (enumerated("machine", self._named(which)) for which in (fewer, more))
        words = f"{total:.4g} MW less at {less}; {total:.4g} MW more at {to}"
        try:
            return Shift(operating_point(case.set(values)), values, total, words)
        except (PowerFlowError, EquilibriumError):
            return None


def _ahead(run: Trajectory) -> np.ndarray:
    """Which rotors are ahead (rotor units) when synchronism is lost: the group that is lost, or else the others."""
    names, lost = run.point.rotor_names, run.unstable_machines
    side = np.array([name in lost for name in names], bool)
    if not side.any():
        return side
    others = ~side & (run.point.rotor_island == run.point.rotor_island[side.argmax()])
    moved = run.arrays.angle[-1] - run.arrays.angle[0]
    return others if others.any() and moved[others].mean() > moved[side].mean() else side

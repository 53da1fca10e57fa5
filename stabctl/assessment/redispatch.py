"""The smallest shift of active power from the machines that lose synchronism to the others that is enough.

The idea is that of preventive control with the single-machine-equivalent method: the power of the critical machines is
what accelerates them during the fault, and the others produce what they give up (Pavella, Ernst, Ruiz-Vega, "Transient
Stability of Power Systems: A Unified Approach to Assessment and Control", 2000). There the shift is extrapolated from
margins; here it is found by bisection on simulations, which need no margin.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
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

TINY = 1e-6  # MW   less is no change
STEP = 0.01  # of the power of the critical machines, of which a shift is a multiple


class Shift(NamedTuple):
    """A dispatch with power shifted from the critical machines to others."""

    point: OperatingPoint
    values: dict[str, float]  # MW   of every machine that is not scheduled at it, by its path in the case
    mw: float  # that the machines which give up none produce more; the losses change, too
    words: str
    unsolved: tuple[str, ...] = ()  # labels of contingencies that no shift was found for


class _Lost(NamedTuple):
    """A contingency that is to be survived."""

    contingency: Contingency
    cleared: int  # point of the grid
    stable: bool  # already as it is, but maybe not with another dispatch
    ahead: np.ndarray  # (rotor units) which are ahead when synchronism is lost


def redispatch(
    point: OperatingPoint,
    lost: Sequence[Contingency],
    search: Search,
    *,
    control: Control = None,
    tried: Sequence[OperatingPoint] = (),
) -> Shift:
    """The smallest shift with which a system survives contingencies, in steps of 1 % of the power of each group.

    The machines that run ahead in a contingency are a group, and so are those of several that have machines in common.
    The members of a group give up power in proportion to what they produce. The others of their island take it in
    proportion to what is left of their rating, if they produce power themselves. First all groups give up the same
    share, the smallest that is enough; then each one as little as is enough with the others as they are.

    Parameters
    ----------
    point : OperatingPoint
        The system.
    lost : sequence of Contingency
        Contingencies with the clearing times that are to be survived, the worst first. Those for which no shift is
        enough are left out, and named.
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

    def simulated(there: OperatingPoint, one: Contingency, k: int) -> _Lost:
        run = Trial(there, one, control, search).simulate(k, record="rotors")
        return _Lost(one, k, run.outcome.stable, _ahead(run))

    def survived(shift: Shift | None, one: _Lost) -> bool:
        return shift is not None and Trial(shift.point, one.contingency, control, search).attempt(one.cleared).stable

    every = [simulated(point, *one) for one in wanted]
    later = [simulated(other, *one).ahead for other in tried for one in wanted]
    if not any(one.ahead.any() for one in every):
        times = f"{lost[0].label}: {wanted[0][1] * grid:g} cycles"
        raise StudyError(f"With these clearing times ({times}) no machines lose synchronism, so none gives up power.")
    left = [one for one in every if one.stable or _can_shift(point, one.ahead)]
    if all(one.stable for one in left):
        first = next(one.ahead for one in every if one.ahead.any())
        raise StudyError(f"No other machine can take the power that {_called(point, first)} would give up.")
    while not all(one.stable for one in left):
        room = _Room.of(point, [one.ahead for one in left if not one.stable], later)
        steps = _smallest(room, lambda shift, left=left: all(survived(shift, one) for one in left))  # type: ignore[misc]
        found = room.shift(steps) if steps else None
        if found:
            kept = [one.contingency for one in left]
            return found._replace(unsolved=tuple(one.label for one in lost if one not in kept))
        most, who = room.shift([room.last] * len(room.power)), enumerated("machine", room.group)
        said = f"No other machine can take the power that {who} would give up."
        if most and room.last:
            said = (
                f"Less power at {who} is not enough, up to {most.mw:.4g} MW more at others, beyond which no "
                "power is left there, the ratings of the others are exceeded, or there is no operating point."
            )
        gone = [k for k, one in enumerate(left) if not survived(most, one)]
        unstable = [k for k in gone if not left[k].stable]
        shifts = [room.shift([n] * len(room.power)) for n in _tried(room.last)[:-1]] if unstable else []
        hopeless = [k for k in unstable if not any(survived(shift, left[k]) for shift in shifts)]
        left = [one for k, one in enumerate(left) if k not in (hopeless or unstable or gone)]
    raise StudyError(said)


def _smallest(room: "_Room", enough: Callable[[Shift | None], bool]) -> list[int] | None:
    """The steps of every group: the fewest that are enough for all alike, then for each; None if none are."""
    groups, tried = len(room.power), _tried(room.last)
    low, high = next((ends for ends in pairwise([0, *tried]) if enough(room.shift([ends[1]] * groups))), (0, 0))
    if not high:
        return None
    steps = [_first(low, high, lambda n: enough(room.shift([n] * groups)))] * groups
    for g in range(groups if groups > 1 else 0):

        def alone(n: int, g: int = g) -> bool:
            return enough(room.shift([*steps[:g], n, *steps[g + 1 :]]))

        steps[g] = _first(-1, steps[g], alone)
    return steps


def _tried(last: int) -> list[int]:
    """The steps that are tried before bisection: doubled each time, up to the last."""
    return [*(2**k for k in range(last.bit_length()) if 2**k < last), *[last] * bool(last)]


def _first(low: int, high: int, holds: Callable[[int], bool]) -> int:
    """The first number at which something holds that does not at `low`, but at `high`, by bisection."""
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def _can_shift(point: OperatingPoint, ahead: np.ndarray) -> bool:
    """Whether others can take a step of the power of the machines that are ahead."""
    room = _Room.of(point, [ahead], []) if ahead.any() else None
    return room is not None and bool((room.spare >= STEP * room.power).all() and room.power.all())


def _called(point: OperatingPoint, rotors: np.ndarray) -> str:
    """The machines of some rotors."""
    return enumerated("machine", [name for name, of in zip(point.rotor_names, rotors, strict=True) if of])


@dataclass(frozen=True, eq=False)
class _Room:
    """Who gives up power, and who takes it."""

    point: OperatingPoint
    produced: np.ndarray  # (machines) MW
    give: np.ndarray  # (groups, machines)   each one's share of what is given up
    take: np.ndarray  # (groups, machines)   and of what is taken
    power: np.ndarray  # (groups) MW   of the critical machines
    spare: np.ndarray  # (groups) MW   of those that take power

    @classmethod
    def of(cls, point: OperatingPoint, ahead: Sequence[np.ndarray], later: Sequence[np.ndarray]) -> "_Room":
        """Of the rotors that are ahead in each contingency, and those that are so in another dispatch (rotor units)."""
        case, rotors = point.case, point.rotors.unit
        produced = point.flow.S.real * case.base_mva
        spare = np.maximum([m.base for m in case.machines] - produced, 0.0)
        P, rest = np.maximum(produced[rotors], 0.0), np.where(produced[rotors] > 0, spare[rotors], 0.0)
        groups, barred = np.array(_joined(ahead)), np.logical_or.reduce([*ahead, *later])
        inside = point.rotor_island == point.rotor_island[groups.argmax(axis=1)][:, None]
        give, take = np.zeros((2, len(groups), len(produced)))
        give[:, rotors], take[:, rotors] = groups * P, inside * ~barred * rest
        power, room = give.sum(axis=1), take.sum(axis=1)
        give, take = give / np.maximum(power, TINY)[:, None], take / np.maximum(room, TINY)[:, None]
        return cls(point, produced, give, take, power, room)

    @cached_property
    def last(self) -> int:
        """The most steps that all groups can give up; 0 if there are none."""
        groups, most = len(self.power), round(1 / STEP)
        if not self.spare.all():
            return 0
        if self.shift([most] * groups):
            return most
        return _first(0, most, lambda n: self.shift([n] * groups) is None) - 1

    @property
    def group(self) -> list[int | str]:
        """The critical machines."""
        return self._named(self.give.sum(axis=0) > 0)

    def _named(self, which: np.ndarray) -> list[int | str]:
        return [m.called for m, of in zip(self.point.case.machines, which, strict=True) if of]

    def shift(self, steps: Sequence[int]) -> Shift | None:
        """The system in which every group gives up so many steps of its power; None if that is not possible."""
        given, case = STEP * np.array(steps) * self.power, self.point.case
        P, rated = self.produced, np.array([m.base for m in case.machines])
        least, most = np.where(P < 0, -np.inf, 0.0), np.where(rated < P, np.inf, rated)  # that are kept until now
        try:
            wanted = self._values(P + given @ (self.take - self.give))
            now = case.set(wanted).power_flow().S.real * case.base_mva  # at the swing bus with what the losses change
            if ((now < least - TINY) | (now > most + TINY)).any():
                return None
            values = self._values(now)
            point = operating_point(case.set(values))
        except (PowerFlowError, EquilibriumError):
            return None
        change, groups = now - P, self.give[given > 0] > 0
        others = ~groups.any(axis=0) & (np.abs(change) > TINY)
        more = float(change[others].sum())
        parts = [(-change[group].sum(), "less", group) for group in groups] + [(more, "more", others)]
        words = "; ".join(f"{mw:.4g} MW {way} at {enumerated('machine', self._named(of))}" for mw, way, of in parts)
        return Shift(point, values, more, words)

    def _values(self, power: np.ndarray) -> dict[str, float]:
        """The power (machines, MW) of those that are not scheduled at it, by their path in the case."""
        rows = zip(self.point.case.machines, power.tolist(), strict=True)
        return {f"machines.{m.called}.p": round(mw, 6) for m, mw in rows if abs(mw - m.p) > TINY}


def _joined(sides: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Groups of rotors: those of contingencies that have any in common are one."""
    groups: list[np.ndarray] = []
    for side in sides:
        near = [group for group in groups if (group & side).any()]
        groups = [group for group in groups if not (group & side).any()]
        groups.append(np.logical_or.reduce([side, *near]))
    return groups


def _ahead(run: Trajectory) -> np.ndarray:
    """Which rotors are ahead (rotor units) when synchronism is lost: the group that is lost, or else the others."""
    names, lost = run.point.rotor_names, run.unstable_machines
    side = np.array([name in lost for name in names], bool)
    if not side.any():
        return side
    others = ~side & (run.point.rotor_island == run.point.rotor_island[side.argmax()])
    moved = run.arrays.angle[-1] - run.arrays.angle[0]
    return others if others.any() and moved[others].mean() > moved[side].mean() else side

"""How a run keeps criteria: spells beyond a level, recovery, separation of rotors, swings.

A value at its limit is allowed, and so is a time at its limit. Between two recorded instants a value is linear.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.units import radians, seconds
from stabctl._util.wording import counted
from stabctl.simulation.swings import LEAST, SPAN
from stabctl.simulation.trajectory import Trajectory

from .criteria import Angle, Criteria, Frequency, Swings, Voltage, criteria

if TYPE_CHECKING:
    import pandas as pd

SLACK = 1e-9  # s   of a time that is rounding


class Violation(NamedTuple):
    """A rule that a run does not keep."""

    rule: str
    where: str  # bus 7, machine 2
    from_s: float  # s   from when on it was not allowed
    extreme: float  # the value farthest beyond the limit, in `unit`, which may be at another instant
    unit: str
    limit: str

    @property
    def label(self) -> str:
        """Rule and place."""
        return f"{self.rule}: {self.where}"

    def __str__(self) -> str:
        since = f"not allowed from {self.from_s:.3f} s on"
        return f"{self.label}, {self.extreme:.4g} {self.unit} at worst, {since}; {self.limit}."


@dataclass(frozen=True, repr=False)
class Judged(Tabular):
    """How a run keeps criteria.

    Attributes
    ----------
    title : str
        Of the criteria.
    violations : tuple of Violation
        By rule and place.
    undecided : tuple of str
        What the run is too short for, one sentence each.
    unstable : str
        How the run ended, if it is unstable; such a run keeps no criteria.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Contingency("7", clear="6cyc"), until="5s")
    >>> print(run.judge("wecc-tpl-001"))
    WECC TPL-001-WECC-CRT-3.2: kept.
    """

    title: str
    violations: tuple[Violation, ...]
    undecided: tuple[str, ...]
    unstable: str = ""

    @property
    def kept(self) -> bool:
        """Whether the run is stable and there is no violation; what is undecided does not count."""
        return not (self.violations or self.unstable)

    @property
    def df(self) -> "pd.DataFrame":
        """A row for every violation."""
        import pandas as pd

        return pd.DataFrame(self.violations, columns=Violation._fields)

    def __str__(self) -> str:
        number = counted(len(self.violations), "violation")
        said = "kept" if self.kept else f"not kept, the run is unstable; {number}" if self.unstable else number
        return "\n".join([f"{self.title}: {said}.", *map(str, self.violations[:10]), *self.undecided[:5]])


def judge(run: Trajectory, by: "Criteria | str | Path") -> Judged:
    """Judge a run by criteria.

    Parameters
    ----------
    run
        The run, with its rows recorded.
    by : Criteria, str or Path
        The criteria, the name of packaged ones, or a TOML file.

    Returns
    -------
    Judged

    Raises
    ------
    StudyError
        If the run has no rows, or the criteria are those of another rated frequency or cannot be read.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Contingency("7", clear="6cyc"), until="5s")
    >>> run.judge("nerc-prc-024").kept
    True
    """
    rules, case = criteria(by), run.point.case
    if len(run.time) < 2:
        raise StudyError("The run has no rows to judge: they were not recorded; leave out record=False.")
    rules.check(case)
    found: list[Violation] = []
    undecided: list[str] = []
    seen = _Seen(run)
    for rule in rules.rules:
        for one in seen.of(rule):
            (found if isinstance(one, Violation) else undecided).append(one)  # type: ignore[arg-type]
    end = run.outcome
    return Judged(rules.title, tuple(found), tuple(undecided), "" if end.stable else end.message)


class _Seen:
    """A run as the rules see it: instants, which rows hold their values until an event, faults and clearing."""

    def __init__(self, run: Trajectory) -> None:
        self.run, self.time, self.hz = run, run.time, run.point.case.frequency_hz
        changes = run.happened.changes[1:]
        rows = np.searchsorted(self.time, [c.at - 1e-9 for c in changes])
        self.held = np.zeros(len(self.time), bool)
        self.held[[row - 1 for row in rows if 0 < row < len(self.time)]] = True
        periods = [(next(g).at, on) for on, g in groupby(changes, key=lambda change: bool(change.switching.faulted))]
        ends = [*(min(at, self.time[-1]) for at, _ in periods[1:]), self.time[-1]]
        faults = [(at, end) for (at, on), end in zip(periods, ends, strict=False) if on]
        self.faults = faults or [(changes[0].at,) * 2 if changes else (0.0, 0.0)]  # s   each until it is cleared
        self.cleared = self.faults[-1][1]

    def of(self, rule: Any) -> "Iterator[Violation | str]":
        """Violations of a rule, and what the run is too short for."""
        if isinstance(rule, Voltage):
            yield from self._voltage(rule)
        elif isinstance(rule, Frequency):
            yield from self._frequency(rule)
        elif isinstance(rule, Angle):
            yield from self._angle(rule)
        else:
            yield from self._swings(rule)

    def _voltage(self, rule: Voltage) -> "Iterator[Violation | str]":
        case, size = self.run.point.case, np.where(self.run.energized, self.run.values("voltage"), np.nan)
        before = np.abs(self.run.point.V)
        wanted = {
            "loads": {x.bus for x in case.loads if x.kind == "load"},
            "machines": {m.storage_bus or m.bus for m in case.machines},
        }
        level, sign = _side(rule)
        for k, b in enumerate(case.buses):
            if not rule.concerns(b) or (rule.buses != "all" and b.bus not in wanted[rule.buses]):
                continue
            base = float(before[k]) if rule.of == "before" else 1.0
            unit = "of its initial value" if rule.of == "before" else "pu"
            told = f"{'below' if sign > 0 else 'above'} {level:g} {unit}"
            place = Place(f"bus {b.bus}", size[:, k], sign, level * base, "pu", told, self.held)
            if rule.recover is not None:
                yield from self._recovered(rule, place)
            else:
                start = self._since(rule, size[:, k] - (rule.recovered or 0.0) * base)
                yield from self._spells(rule, place, start)

    def _since(self, rule: Voltage, above: np.ndarray) -> float:
        """The instant from which a rule holds; infinite before the recovery."""
        if rule.since == "start":
            return 0.0
        if rule.since == "clearing":
            return self.cleared
        return min(
            (max(a, self.cleared) for a, b in spells(self.time, above, self.held) if b > self.cleared), default=np.inf
        )

    def _recovered(self, rule: Voltage, place: "Place") -> "Iterator[Violation | str]":
        """Whether a level is reached within a time from each fault."""
        allowed, end = seconds(rule.recover or "0s", self.hz), self.time[-1]
        below = spells(self.time, place.excess, place.held)
        limit = f"it must recover within {rule.recover} of the fault, {place.told}"
        for fault, cleared in self.faults:
            until = max((b for a, b in below if a <= cleared + SLACK and b > fault), default=fault)
            if until - fault > allowed + SLACK:
                late = fault + allowed
                later = [np.interp(late, self.time, place.values), *place.values[self.time >= late]]
                yield Violation(rule.name, place.name, late, float(np.nanmin(later)), place.unit, limit)
                return
            if fault < until >= end - SLACK:
                yield f"{rule.name}: {place.name} has not recovered when the run ends at {end:.3f} s; simulate longer."

    def _frequency(self, rule: Frequency) -> "Iterator[Violation | str]":
        speeds = self.run.values("speed") * self.hz
        level, sign = _side(rule)
        told = f"{'below' if sign > 0 else 'above'} {level:g} Hz"
        case, point = self.run.point.case, self.run.point
        for k, (name, unit) in enumerate(zip(point.rotor_names, point.rotors.unit, strict=True)):
            if not rule.concerns(case.buses[case.row_of_bus[case.machines[unit].bus]]):
                continue
            yield from self._spells(rule, Place(f"machine {name}", speeds[:, k], sign, level, "Hz", told), 0.0)

    def _spells(self, rule: Voltage | Frequency, place: "Place", start: float) -> "Iterator[Violation | str]":
        """Whether the times beyond a level are too long."""
        allowed, total, end = seconds(rule.longest, self.hz), 0.0, self.time[-1]
        limit = f"not longer than {rule.longest}{' in total' if rule.total else ''} {place.told}"
        for a, b in spells(self.time, place.excess, place.held):
            a = max(a, start)
            if b <= a:
                continue
            before, total = (total, total + b - a) if rule.total else (0.0, b - a)
            if total > allowed + SLACK:
                beyond = place.values[(self.time >= start - SLACK) & (place.excess > 0)]
                value = place.sign * float(np.min(place.sign * beyond, initial=place.sign * place.level))
                yield Violation(rule.name, place.name, a + allowed - before, value, place.unit, limit)
                return
            if b >= end - SLACK and allowed > 0:
                yield f"{rule.name}: {place.name} is {place.told} when the run ends at {end:.3f} s; simulate longer."

    def _angle(self, rule: Angle) -> "Iterator[Violation | str]":
        angle, island, names = self.run.angle_from_coi_deg, self.run.rotor_island, self.run.point.rotor_names
        most, told = float(np.rad2deg(radians(rule.separation))), set[tuple[int, int]]()
        for one in np.unique(island[island >= 0]):
            high, low = (np.where(island == one, angle, beyond) for beyond in (-np.inf, np.inf))
            if (beyond := np.flatnonzero(high.max(axis=1) - low.min(axis=1) > most)).size:
                i, j = int(high[beyond[0]].argmax()), int(low[beyond[0]].argmin())
                if (i, j) in told:  # in an island that was another before
                    continue
                told.add((i, j))
                together = (island[:, i] == island[:, j]) & (island[:, i] >= 0)
                apart = np.where(together, angle[:, i] - angle[:, j], np.nan)
                since = next((a for a, _ in spells(self.time, apart - most)), float(self.time[beyond[0]]))
                where, limit = f"machines {names[i]} and {names[j]}", f"not more than {most:g} degrees apart"
                yield Violation(rule.name, where, since, float(np.nanmax(apart)), "degrees", limit)

    def _swings(self, rule: Swings) -> "Iterator[Violation | str]":
        end, last = self.run.outcome, self.run.outcome.swings
        short = end.time_s - self.run.happened.changes[-1].at < (SPAN if last else LEAST) - SLACK
        doubtful = last is None or (rule.must == "decay" and not last.decaying)
        if last and (last.growing or (doubtful and not short)):
            machine, size = (last.widest, last.largest) if last.growing else (last.machine, last.last)
            since, limit = end.time_s - last.half_s, f"swings must {rule.must}"
            yield Violation(rule.name, f"machine {machine}", since, float(np.rad2deg(size)), "degrees", limit)
        elif doubtful and end.stable:
            when = f"{SPAN:g} s after the last event, but the run ends at {end.time_s:.3f} s; simulate longer"
            where = "only where machines swing against each other, and with a criterion whose decay is above 0"
            yield f"{rule.name}: swings are judged {when if short else where}."


def _side(rule: Voltage | Frequency) -> tuple[float, float]:
    """The level of a rule, and 1 if values must not be below it, -1 if not above."""
    if rule.below is not None:
        return rule.below, 1.0
    assert rule.above is not None
    return rule.above, -1.0


class Place(NamedTuple):
    """A signal of a bus or machine and its level."""

    name: str
    values: np.ndarray
    sign: float  # 1: not below the level, -1: not above
    level: float
    unit: str
    told: str
    held: np.ndarray | bool = False  # rows whose value is that until an event, at which it jumps

    @property
    def excess(self) -> np.ndarray:
        """How far it is beyond its level, positive if so."""
        return self.sign * (self.level - self.values)


def spells(time: np.ndarray, excess: np.ndarray, held: np.ndarray | bool = False) -> list[tuple[float, float]]:
    """The intervals in which a signal is positive: linear between instants, or held until the next one, an event.

    It is held, too, until it is NaN.
    """
    y, last = np.nan_to_num(excess, nan=-1.0), held | np.isnan(np.append(excess[1:], 0.0))
    found: list[tuple[float, float]] = []
    for k in np.flatnonzero((y[:-1] > 0) | (y[1:] > 0)):
        a, b, u, v = time[k], time[k + 1], y[k], (y[k] if last[k] else y[k + 1])
        begin = a if u > 0 else a + (b - a) * u / (u - v) if v > 0 else b
        end = b if v > 0 else a + (b - a) * u / (u - v) if u > 0 else a
        if end <= begin:
            continue
        if found and begin - found[-1][1] <= 1e-12:
            found[-1] = found[-1][0], float(end)
        else:
            found.append((float(begin), float(end)))
    return found

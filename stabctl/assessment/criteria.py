"""Criteria of performance: how far and for how long voltages, frequencies and angles of a run may leave their ranges.

Criteria are data, packaged ones or those of a TOML file. A violation says where, when, by how much, and of which limit.
A value at its limit is allowed, and so is a time at its limit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from stabctl._util import toml_file
from stabctl._util.errors import StudyError, shown
from stabctl._util.tabular import Tabular
from stabctl._util.units import quantity, seconds
from stabctl._util.wording import counted, near
from stabctl.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    import pandas as pd

SLACK = 1e-9  # s   of a time that is rounding


class _Rule(BaseModel):
    """What all rules have."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    name: str = Field(description='what the rule is called, such as "WR1.4"')


class Voltage(_Rule):
    """A [[voltage]] rule: no longer below (or above) a level than a time."""

    below: float | None = Field(None, gt=0, le=2, description="a voltage in pu, above 0")
    above: float | None = Field(None, gt=0, le=2, description="a voltage in pu, above 0")
    of: Literal["nominal", "before"] = Field(
        "nominal", description='"nominal", or "before": the voltage before the fault'
    )
    longest: str = Field("0s", description='a time such as "2s" or "30cyc"')
    total: bool = Field(False, description="true, if the times below are added up, or false")
    since: Literal["start", "clearing", "recovery"] = Field(
        "start", description='"start", "clearing", or "recovery": the first time above `recovered` after clearing'
    )
    recovered: float | None = Field(None, gt=0, le=2, description="a voltage in pu, above 0")
    recover: str | None = Field(None, description='the time from the fault within which the level is reached, "20s"')
    buses: Literal["all", "loads", "machines"] = Field("all", description='"all", "loads" or "machines"')


class Frequency(_Rule):
    """A [[frequency]] rule: the speed of no machine longer below (or above) a frequency than a time."""

    below: float | None = Field(None, gt=0, description="a frequency in Hz")
    above: float | None = Field(None, gt=0, description="a frequency in Hz")
    longest: str = Field("0s", description='a time such as "2s"')
    total: bool = Field(False, description="true, if the times below are added up, or false")


class Angle(_Rule):
    """An [[angle]] rule: rotors of an island no farther apart."""

    separation: str = Field(description='an angle such as "120deg"')


class Swings(_Rule):
    """A [[swings]] rule: the last swings of the run decay, or at least do not grow."""

    must: Literal["decay", "not grow"] = Field(description='"decay" or "not grow"')


MODELS: dict[str, Any] = {"voltage": Voltage, "frequency": Frequency, "angle": Angle, "swings": Swings}


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    title: str = Field(description="a text")
    source: str = Field("", description="a text")
    unverified: str = Field("", description="a text")
    frequency_hz: float | None = Field(None, gt=0, description="the rated frequency for which the rules hold")
    voltage: list[Any] = Field([], description="[[voltage]] rules")
    frequency: list[Any] = Field([], description="[[frequency]] rules")
    angle: list[Any] = Field([], description="[[angle]] rules")
    swings: list[Any] = Field([], description="[[swings]] rules")


@dataclass(frozen=True)
class Criteria:
    """Rules for the runs of a system.

    Attributes
    ----------
    title, source, unverified
        What they are, where they are from, and what of them could not be verified.
    rules
        The rules.
    frequency_hz
        Rated frequency of the systems for which they hold; None: any.

    Examples
    --------
    >>> len(st.criteria("wecc-tpl-001").rules)
    4
    """

    title: str
    source: str
    unverified: str
    rules: tuple[Voltage | Frequency | Angle | Swings, ...]
    frequency_hz: float | None = None


class Violation(NamedTuple):
    """A rule that a run does not keep."""

    rule: str
    where: str  # bus 7, machine 2
    at_s: float  # s   when the limit was passed
    value: float  # the extreme value, in `unit`
    unit: str
    limit: str

    def __str__(self) -> str:
        return f"{self.rule}: {self.where}, {self.value:.4g} {self.unit} at {self.at_s:.3f} s; {self.limit}."


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


def packaged() -> tuple[str, ...]:
    """Names of the packaged criteria."""
    folder = resources.files("stabctl") / "assessment" / "rules"
    return tuple(sorted(one.name.removesuffix(".toml") for one in folder.iterdir() if one.name.endswith(".toml")))


def criteria(name: Criteria | str | Path) -> Criteria:
    """Read criteria.

    Parameters
    ----------
    name : Criteria, str or Path
        Criteria, which are returned, packaged ones (wecc-tpl-001, nerc-prc-024, entso-e), or a TOML file.

    Returns
    -------
    Criteria

    Raises
    ------
    StudyError
        If there is no such file, or for the first mistake in it, with its place.

    Examples
    --------
    >>> st.criteria("nerc-prc-024").rules[0].name
    'PRC-024-3, above 1.200 pu'
    """
    if isinstance(name, Criteria):
        return name
    if str(name) in packaged():
        path = Path(str(resources.files("stabctl") / "assessment" / "rules" / f"{name}.toml"))
    elif Path(name).suffix.lower() == ".toml":
        path = Path(name)
    else:
        others = near(str(name), packaged(), "there are")
        raise StudyError(f"There are no criteria {shown(str(name))}; {others} Or give a TOML file.")
    found = toml_file.validated(_File, toml_file.read(path, "criteria file"), str(path))
    rules: list[Any] = []
    for kind, model in MODELS.items():
        for k, row in enumerate(getattr(found, kind), start=1):
            where = f"{path}, {kind} rule {k}"
            rules.append(_checked(toml_file.validated(model, row, where), where))
    if not rules:
        raise StudyError(f"{path} has no rules; write [[voltage]], [[frequency]], [[angle]] or [[swings]].")
    return Criteria(found.title, found.source, found.unverified, tuple(rules), found.frequency_hz)


def _checked(rule: Any, where: str) -> Any:
    """A rule whose limits make sense."""
    if isinstance(rule, Voltage | Frequency) and (rule.below is None) == (rule.above is None):
        raise StudyError(f"{where}: give either below or above.")
    if isinstance(rule, Voltage) and (rule.since == "recovery") != (rule.recovered is not None):
        raise StudyError(f'{where}: since = "recovery" and recovered belong together.')
    if isinstance(rule, Voltage) and rule.recover is not None and rule.below is None:
        raise StudyError(f"{where}: recover needs below, the level to be reached.")
    try:
        for text in (getattr(rule, "longest", None), getattr(rule, "recover", None)):
            seconds(text or "0s", 60.0)
        apart = quantity(rule.separation, "rad") if isinstance(rule, Angle) else 1.0
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None
    if not apart > 0:
        raise StudyError(f"{where}: the separation {rule.separation!r} is not above 0.")
    return rule


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
    if rules.frequency_hz not in (None, case.frequency_hz):
        raise StudyError(
            f"{rules.title} is for {rules.frequency_hz:g} Hz, but {case.name} has {case.frequency_hz:g} Hz."
        )
    found: list[Violation] = []
    undecided: list[str] = []
    seen = _Seen(run)
    for rule in rules.rules:
        for one in seen.of(rule):
            (found if isinstance(one, Violation) else undecided).append(one)  # type: ignore[arg-type]
    end = run.outcome
    return Judged(rules.title, tuple(found), tuple(undecided), "" if end.stable else end.message)


class _Seen:
    """A run as the rules see it: instants, which rows hold their values until an event, fault and clearing."""

    def __init__(self, run: Trajectory) -> None:
        self.run, self.time, self.hz = run, run.time, run.point.case.frequency_hz
        changes = run.happened.changes[1:]
        rows = np.searchsorted(self.time, [c.at - 1e-9 for c in changes])
        self.held = np.zeros(len(self.time), bool)
        self.held[[row - 1 for row in rows if 0 < row < len(self.time)]] = True
        faulted = [c.at for c in changes if c.switching.faulted]
        self.fault = faulted[0] if faulted else (changes[0].at if changes else 0.0)
        after = [c.at for c in changes if not c.switching.faulted and c.at >= self.fault]
        self.cleared = next(
            (at for at in after if not any(f > at for f in faulted)), self.time[-1] if faulted else self.fault
        )

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
        case, size = self.run.point.case, self.run.values("voltage")
        wanted = {"loads": {x.bus for x in case.loads}, "machines": {m.storage_bus or m.bus for m in case.machines}}
        level, sign = _side(rule)
        for k, b in enumerate(case.buses):
            if rule.buses != "all" and b.bus not in wanted[rule.buses]:
                continue
            base = float(size[0, k]) if rule.of == "before" else 1.0
            unit = "of its initial value" if rule.of == "before" else "pu"
            told = f"{'below' if sign > 0 else 'above'} {level:g} {unit}"
            place = Place(f"bus {b.bus}", size[:, k], sign, level * base, "pu", told)
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
        """Whether a level is reached within a time from the fault."""
        allowed, end = seconds(rule.recover or "0s", self.hz), self.time[-1]
        low = [
            (a, b)
            for a, b in spells(self.time, place.excess, self.held)
            if b > self.cleared + SLACK and a <= self.cleared + SLACK
        ]
        until = low[0][1] if low else self.cleared
        limit = f"it must recover within {rule.recover} of the fault, {place.told}"
        if until - self.fault > allowed + SLACK:
            yield Violation(
                rule.name,
                place.name,
                self.fault + allowed,
                float(place.values[self.time >= self.cleared].min()),
                place.unit,
                limit,
            )
        elif low and until >= end - SLACK:
            yield f"{rule.name}: {place.name} has not recovered when the run ends at {end:.3f} s; simulate longer."

    def _frequency(self, rule: Frequency) -> "Iterator[Violation | str]":
        speeds = self.run.values("speed") * self.hz
        level, sign = _side(rule)
        told = f"{'below' if sign > 0 else 'above'} {level:g} Hz"
        for k, name in enumerate(self.run.point.rotor_names):
            yield from self._spells(rule, Place(f"machine {name}", speeds[:, k], sign, level, "Hz", told), 0.0)

    def _spells(self, rule: Voltage | Frequency, place: "Place", start: float) -> "Iterator[Violation | str]":
        """Whether the times beyond a level are too long."""
        allowed, total, end = seconds(rule.longest, self.hz), 0.0, self.time[-1]
        limit = f"not longer than {rule.longest}{' in total' if rule.total else ''} {place.told}"
        for a, b in spells(self.time, place.excess, self.held):
            a = max(a, start)
            if b <= a:
                continue
            before, total = (total, total + b - a) if rule.total else (0.0, b - a)
            if total > allowed + SLACK:
                inside = (self.time >= a - SLACK) & (self.time <= b + SLACK)
                beyond = place.sign * place.values[inside]
                value = place.sign * float(np.nanmin(beyond)) if inside.any() else place.level
                yield Violation(rule.name, place.name, a + allowed - before, value, place.unit, limit)
                return
            if b >= end - SLACK and allowed > 0:
                yield f"{rule.name}: {place.name} is {place.told} when the run ends at {end:.3f} s; simulate longer."

    def _angle(self, rule: Angle) -> "Iterator[Violation | str]":
        angle, island = self.run.angle_from_coi_deg, self.run.happened.island[self.run.point.rotors.unit]
        most = float(np.rad2deg(quantity(rule.separation, "rad")))
        for one in np.unique(island[island >= 0]):
            inside = angle[:, island == one]
            apart = np.nanmax(inside, axis=1) - np.nanmin(inside, axis=1)
            if (beyond := np.flatnonzero(apart > most)).size:
                names = [n for n, i in zip(self.run.point.rotor_names, island, strict=True) if i == one]
                row = beyond[0]
                pair = names[int(np.nanargmax(inside[row]))], names[int(np.nanargmin(inside[row]))]
                where, limit = f"machines {pair[0]} and {pair[1]}", f"not more than {most:g} degrees apart"
                yield Violation(rule.name, where, float(self.time[row]), float(apart.max()), "degrees", limit)

    def _swings(self, rule: Swings) -> "Iterator[Violation | str]":
        last = self.run.outcome.swings
        if last is None:
            yield f"{rule.name}: swings are not judged: the run ends too early, or unstable."
        elif last.growing or (rule.must == "decay" and not (last.decaying or last.settled)):
            at, value = self.run.outcome.time_s, float(np.rad2deg(last.largest))
            yield Violation(rule.name, f"machine {last.machine}", at, value, "degrees", f"swings must {rule.must}")


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

    @property
    def excess(self) -> np.ndarray:
        """How far it is beyond its level, positive if so."""
        return self.sign * (self.level - self.values)


def spells(time: np.ndarray, excess: np.ndarray, held: np.ndarray) -> list[tuple[float, float]]:
    """The intervals in which a signal is positive: linear between instants, or held until the next one, an event."""
    y = np.nan_to_num(excess, nan=-1.0)
    found: list[tuple[float, float]] = []
    for k in np.flatnonzero((y[:-1] > 0) | (y[1:] > 0)):
        a, b, u, v = time[k], time[k + 1], y[k], (y[k] if held[k] else y[k + 1])
        begin = a if u > 0 else a + (b - a) * u / (u - v) if v > 0 else b
        end = b if v > 0 else a + (b - a) * u / (u - v) if u > 0 else a
        if end <= begin:
            continue
        if found and begin - found[-1][1] <= 1e-12:
            found[-1] = found[-1][0], float(end)
        else:
            found.append((float(begin), float(end)))
    return found

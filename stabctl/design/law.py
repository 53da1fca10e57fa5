"""Design of a storage law: the best member of the family `StorageLaw` for a list of contingencies.

A part of the contingencies, drawn over the whole range of their clearing times, tunes the law. A grid of angle gains,
slopes and groups is measured first, on a coarse grid of clearing times. From the best laws on, every parameter is moved
to its next larger and smaller value, on the fine grid, as long as that improves the score; then to all its other
values, which may lead on. The finalists are measured as a clearing time is, with a scan for shorter unstable faults.
The answer is the best finalist without a stable limit cycle by describing functions, or the best of all if each has
one. The search draws nothing at random, so its answer does not depend on the number of threads.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import islice, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.validation import checks_arguments
from stabctl.clearing import Screen
from stabctl.clearing.critical_time import LONGEST
from stabctl.clearing.trial import Search, Trial
from stabctl.controllers import BangBang, Law, SampledLaw, StorageLaw
from stabctl.controllers.timing import duration
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.jobs import Runner
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.smallsignal.areas import Areas
from stabctl.smallsignal.limit_cycles import limit_cycles

from .critical_machines import Group, critical_machines, disjoint, slow_areas
from .law_measurement import LAW, Bench, Measured
from .law_result import Judged, LawDesign, LawLimits

COUNT = 20  # contingencies taken from a screen
DEADBAND = 0.05  # Hz   where the search begins
ARMED = 0.1  # Hz   where the search begins, so that a new angle does not keep the devices acting
RETURNED = 4  # time constants of the return of energy within the time allowed
GRID = {"angle_gain": (0.0, 0.5, 1.0), "slope": (0.0, 0.05, 0.2)}  # values measured first, in all combinations
AXES: Mapping[str, tuple[float, ...]] = {  # values of every parameter, next ones side by side
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
AT_REST = {"arm_at": 0.0, "return_time": 0.0, "max_acceleration": 0.0}  # the law as if always armed


@checks_arguments
def law(
    base: Case | OperatingPoint,
    contingencies: Iterable[Contingency | str] | Contingency | Screen,
    *,
    storage: "Fleet | None" = None,
    limits: LawLimits | None = None,
    rate: int | None = None,
    delay: str | float = 0.0,
    training: float = 0.5,
    seed: int = 1,
    resolution: str | float = "0.125cyc",
    limit: str | float = "60cyc",
    observe: str | float = "10s",
    longest: str | float = LONGEST,
    scan: str | float = "auto",
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    workers: int | None = None,
    store: str | Path | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> LawDesign:
    """Design the control law of storage devices for the longest clearing times.

    The group of machines that each contingency drives out of synchronism is found, and the parameters of a `StorageLaw`
    are tuned with a part of the contingencies. Clearing times without a law, with the paper's law `BangBang()` and with
    the designed law are measured in all of them.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system with its storage; a case is initialized first.
    contingencies : iterable of Contingency or str, Contingency, or Screen
        Faults; their own clearing times are ignored. Of a screen, the 20 most critical, spread over the machines that
        lose synchronism.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    limits : LawLimits, optional
        Limits on energy, switching, frequency and voltage.
    rate, delay
        Frames per second and delay of the laws; by default they act at every step, without delay.
    training : float
        Share of the contingencies that the law is tuned with; of a single one, all.
    seed : int
        Seed of their choice.
    resolution, limit, observe, longest, scan, step, criterion
        As in `clearing_time`.
    workers : int, optional
        Threads; by default one per core.
    store : str or Path, optional
        Folder that keeps every measurement, in law.db; called again, the design continues from there.
    scheduler : str, optional
        Scheduler of a Dask cluster instead of threads: "tcp://host:8786".
    progress : callable, optional
        Called after every clearing time with their number.

    Returns
    -------
    LawDesign

    Raises
    ------
    StudyError
        If there is no storage or no contingency, or the case lacks something named.

    Examples
    --------
    >>> limits = st.design.LawLimits(return_within=0)
    >>> options = {"resolution": "2cyc", "scan": 0, "observe": "2s"}
    >>> found = st.design.law(st.load("two_area"), "7-8@0.4", storage="50MW", limits=limits, **options)
    >>> [(one.none.reach, one.reference.reach, one.designed.reach) for one in found.contingencies]
    [(20.0, 26.0, 34.0)]
    """
    began, limits = time.perf_counter(), LawLimits() if limits is None else limits
    if rate is None and duration("delay", delay):
        raise StudyError(f"delay = {shown(delay)} is that of a sampled law; give a rate too: rate=60, for example.")
    point = operating_point(base, storage)
    search = Search.of(
        point.case,
        resolution=resolution,
        limit=limit,
        observe=observe,
        step=step,
        criterion=criterion,
        scan=scan,
        longest=longest,
    )
    faults = checked_contingencies(point, contingencies)
    with Runner(LAW, store=store, workers=workers, scheduler=scheduler) as runner:
        bench = Bench(point, search, runner, within_s=limits.return_within, progress=progress)
        found = _designed(bench, faults, limits, Use(rate, delay), training=training, seed=seed)
    return replace(found, wall_s=time.perf_counter() - began)


def checked_contingencies(point: OperatingPoint, given: Any) -> tuple[Contingency, ...]:
    """The contingencies, checked."""
    if not point.case.storage:
        raise StudyError(f"{point.case.name} has no storage devices to control; give storage='50MW', for example.")
    if isinstance(given, Screen):
        given = spread(given, COUNT)
    several = [given] if isinstance(given, Contingency | str) else given
    if not isinstance(several, Iterable):
        raise StudyError(f"{shown(given)} is not a list of contingencies; give [Contingency('16', trip='16-21'), ...].")
    found = [Contingency(c) if isinstance(c, str) else c for c in several]
    if not found:
        raise StudyError("There is no contingency to design the law for; give at least one.")
    for c in found:
        if not isinstance(c, Contingency) or c.fault is None:
            raise StudyError(f"{shown(c)} is not a contingency with a fault; give Contingency('16', trip='16-21').")
    return tuple(dict.fromkeys(c.placed(point.case) for c in found))


def spread(found: Screen, count: int) -> tuple[Contingency, ...]:
    """The most critical contingencies of a screen that have a clearing time, in turn for each machine that is lost."""
    queues: dict[Any, list[Contingency]] = {}
    for pair in found.pairs:
        if pair.cycles:
            queues.setdefault(pair.machine, []).append(pair.contingency)
    rounds = (
        queue[k]
        for k in range(max(map(len, queues.values()), default=0))
        for queue in queues.values()
        if k < len(queue)
    )
    return tuple(islice(rounds, count))


class Use(NamedTuple):
    """How laws are used."""

    rate: int | None
    delay: str | float

    def of(self, law: Law) -> Law:
        """The law behind its rate and delay."""
        return law if self.rate is None else law.sampled(self.rate, self.delay)


def _designed(
    bench: Bench, faults: Sequence[Contingency], limits: LawLimits, use: Use, *, training: float, seed: int
) -> LawDesign:
    """The design; its computing time is added later."""
    point, reference = bench.point, use.of(BangBang())
    none = bench.measured([(None, c) for c in faults], bench.search)
    order = sorted(range(len(faults)), key=lambda k: none[k].reach)
    chosen = training_contingencies([faults[k] for k in order], training, seed)
    areas = slow_areas(point.modes())
    groups = [_leaving(bench, areas, c, m) for c, m in zip(faults, none, strict=True)]
    named = disjoint(g for k in order if faults[k] in chosen and (g := groups[k]))
    number = {m.called: m.machine for m in point.case.machines}  # a law is given names with a slash only
    together = tuple(tuple(m if "/" in str(m) else number[m] for m in group) for group in named)
    tuning = LawSearch(bench, chosen, reference, limits, use.of)
    finalists = [use.of(one) for one in tuning.best(_start(limits), [(), together] if together else [()])]
    best, silent = _quiet(point, finalists)
    pairs = bench.measured([(law, c) for c in faults for law in (reference, best)], bench.search)
    found = zip(faults, none, pairs[::2], pairs[1::2], groups, strict=True)
    rows = tuple(Judged(c, c in chosen, n, r, d, group) for c, n, r, d, group in found)
    kept = limits.kept([row.designed for row in rows if row.training])
    leaving = sum(m.status != "stable_at_limit" for m in none)  # simulations of `_leaving`
    work = len(tuning.tried), bench.simulations + leaving, 0.0
    return LawDesign(point.case.name, best, reference, rows, limits, kept, *work, silent)


def training_contingencies(faults: Sequence[Contingency], share: float, seed: int) -> tuple[Contingency, ...]:
    """The contingencies of the training, of faults in the order of their clearing times: a share of each part."""
    if not 0 < share <= 1:
        raise StudyError(f"training = {share:g} is not a share; give more than 0 and at most 1, such as 0.5.")
    count = max(1, round(share * len(faults)))
    draw = np.random.default_rng(seed)
    parts = np.array_split(np.arange(len(faults)), count)
    return tuple(faults[int(draw.choice(part))] for part in parts)


def _leaving(bench: Bench, areas: Areas, contingency: Contingency, idle: Measured) -> Group | None:
    """The group that leaves just beyond the clearing time with idle devices."""
    if idle.status == "stable_at_limit":
        return None
    above = bench.search.resolution_cycles if idle.status == "found" else 0.0
    return critical_machines(Trial(bench.point, contingency, None, bench.search), areas, idle.reach + above)


def _start(limits: LawLimits) -> StorageLaw:
    """Where the search begins."""
    returns = limits.return_within > 0
    return StorageLaw(
        deadband=max(DEADBAND, limits.deadband),
        min_voltage=limits.min_voltage,
        arm_at=max(ARMED, limits.deadband) if returns else 0.0,
        return_time=limits.return_within / RETURNED,
    )


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
    own = getattr(law, name)
    if own not in values:  # a level that a deadband has raised
        values = sorted([*values, own])
    at = values.index(own)
    found = []
    for value in values[max(at - reach, 0) : at + reach + 1]:
        deadband, arm_at = (value if name == key else getattr(law, key) for key in ("deadband", "arm_at"))
        if name == "deadband" and arm_at:
            arm_at = max(arm_at, deadband)
        if value != values[at] and (arm_at == 0 or arm_at >= deadband):
            found.append(replace(law, **{name: value, "deadband": deadband, "arm_at": arm_at}))
    return found


def _quiet(point: OperatingPoint, finalists: Sequence[Law]) -> tuple[Law, bool]:
    """The first law without a stable limit cycle, and whether there is one; if there is none, the first."""
    silent = next((one for one in finalists if no_stable_limit_cycle(point, one)), None)
    return silent or finalists[0], silent is not None


def no_stable_limit_cycle(point: OperatingPoint, law: Law) -> bool:
    """Whether no limit cycle of 0.1 to 10 Hz is stable with a `StorageLaw`, its rate and delay included."""
    if isinstance(law, SampledLaw) and isinstance(law.law, StorageLaw):
        law = replace(law, law=replace(law.law, **AT_REST))
    elif isinstance(law, StorageLaw):
        law = replace(law, **AT_REST)
    return not any(cycle.stable for cycle in limit_cycles(point, law).cycles)

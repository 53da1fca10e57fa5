"""Design of a storage law: the best member of the family `StorageLaw` for a system and a list of contingencies."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from stabctl.clearing import Screen
from stabctl.clearing.critical_time import LONGEST
from stabctl.clearing.search import Search
from stabctl.clearing.trial import Trial
from stabctl.controllers import BangBang, Law, StorageLaw
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.jobs import Runner
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.smallsignal.areas import Areas

from .critical_machines import Group, critical_machines, disjoint, slow_areas
from .law_bench import Bench
from .law_contingencies import faults as checked
from .law_contingencies import training as share_of
from .law_jobs import LAW, Measured
from .law_limits import LawLimits
from .law_result import Judged, LawDesign
from .law_search import LawSearch
from .limit_cycle_check import no_stable_limit_cycle

DEADBAND = 0.05  # Hz   where the search begins
ARMED = 0.1  # Hz   where the search begins, so that a new angle does not keep the devices acting
RETURNED = 4  # time constants of the return of energy within the time allowed


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
    storage : str, mapping, or iterable of Storage, optional
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
    """
    began, limits = time.perf_counter(), LawLimits() if limits is None else limits
    if not isinstance(limits, LawLimits):
        raise StudyError(f"limits = {shown(limits)} are not limits of a law; give LawLimits(...).")
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
    faults = checked(point, contingencies)
    with Runner(LAW, store=store, workers=workers, scheduler=scheduler) as runner:
        bench = Bench(point, search, runner, within_s=limits.return_within, progress=progress)
        found = _designed(bench, faults, limits, Use(rate, delay), training=training, seed=seed)
    return replace(found, wall_s=time.perf_counter() - began)


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
    chosen = share_of([faults[k] for k in order], training, seed)
    areas = slow_areas(point.modes())
    groups = [_leaving(bench, areas, c, m) for c, m in zip(faults, none, strict=True)]
    together = _numbers(point, disjoint(g for k in order if faults[k] in chosen and (g := groups[k])))
    tuning = LawSearch(bench, chosen, reference, limits, use.of)
    finalists = [use.of(one) for one in tuning.best(_start(limits), [(), together] if together else [()])]
    best, silent = _quiet(point, finalists)
    pairs = bench.measured([(law, c) for c in faults for law in (reference, best)], bench.search)
    found = zip(faults, none, pairs[::2], pairs[1::2], groups, strict=True)
    rows = tuple(Judged(c, c in chosen, n, r, d, group) for c, n, r, d, group in found)
    kept = limits.kept([row.designed for row in rows if row.training])
    work = len(tuning.tried), bench.simulations, 0.0
    return LawDesign(point.case.name, best, reference, rows, limits, kept, *work, silent)


def _quiet(point: OperatingPoint, finalists: Sequence[Law]) -> tuple[Law, bool]:
    """The first law without a stable limit cycle, and whether there is one; if there is none, the first."""
    silent = next((one for one in finalists if no_stable_limit_cycle(point, one)), None)
    return silent or finalists[0], silent is not None


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


def _numbers(point: OperatingPoint, groups: Sequence[tuple[int | str, ...]]) -> tuple[tuple[int, ...], ...]:
    """Groups as numbers of machines."""
    return tuple(tuple(sorted(point.case.machine(m).machine for m in group)) for group in groups)

"""A stability study: is a system secure, what limits it, and by how much?

Power flow, modes, a screen of faults and the worst of them, with the margin of each to a clearing time that protection
guarantees and of the damping to a wanted value. Every number is that of the single study.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from stabctl._util.errors import LinearizationError, StudyError
from stabctl._util.units import cycles, quantity
from stabctl._util.validation import checks_arguments
from stabctl.clearing import ClearingTime, Screen, Severity
from stabctl.clearing.screen import carried_out, plan
from stabctl.clearing.screen_result import Lines
from stabctl.clearing.trial import observed
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.io.contingencies import monitored as monitored_by
from stabctl.judgment import Criteria
from stabctl.judgment import criteria as named
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.model.short_circuit import installed, short_circuit_ratio
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control, idle
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.setup import setup
from stabctl.smallsignal.analysis import modes

from .prices import Prices
from .prices import prices as priced
from .remedies import Asked, applicable, kinds, remedy
from .result import BAND, NORMAL, Settings, Study, Wanted, cleared

EVERY = 20.0  # s   between two partial studies during the screen
AT_FIRST = 2.0, 3.0, 5.0  # s   between the first ones
SCREENED = 0.95  # share of the work that is done after the screen
WORST = 10  # faults simulated
LIMIT = 60.0  # cycles   longest clearing time tried, if none is given
ALONE = 0.2  # share of the work that is done before the remedies

Tell = Callable[[float, str], None]  # the share that is done, and the part under way


@checks_arguments
def study(
    base: Case | OperatingPoint,
    clear: str | float = "6cyc",
    *,
    damping: str | float = 0.05,
    voltages: tuple[float, float] = NORMAL,
    monitored: str | Path | None = None,
    subsystems: str | Path | None = None,
    faults: str | Iterable[Contingency | str] = "lines, buses",
    worst: int = WORST,
    storage: "Fleet | None" = None,
    control: Control = None,
    criterion: Criterion = DEFAULT,
    criteria: Criteria | str | Path | None = None,
    remedies: str = "all",
    prices: Prices | str | Path | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    scheduler: str | None = None,
    progress: Callable[[float, str], None] | None = None,
    each: Callable[[Study], None] | None = None,
    **search: Any,
) -> Study:
    """Study the stability of a system: power flow, modes, a screen of faults, and the worst of them simulated.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    clear : str or float
        Clearing time that protection guarantees: "6cyc", "100ms", or seconds. Default "6cyc".
    damping : str or float
        Damping ratio that every oscillation of 0.1 to 3 Hz must have: 0.05 or "5%". Default 0.05.
    voltages : tuple of float, pu
        Range of the voltages in normal operation.
    monitored : str or Path, optional
        MON file of PSS/E, whose voltage ranges replace it at the buses that it names.
    subsystems : str or Path, optional
        SUB file of PSS/E with the subsystems that the MON file names.
    faults
        As in `screen`: "lines", "buses", both (the default), categories such as "P1, P4@15cyc", or contingencies. A
        contingency with a clearing time of its own is compared with that.
    worst : int
        Number of contingencies that are simulated with this clearing time, those with the smallest margins. Default 10.
    storage, control, criterion
        As in `simulate`; the modes are those without the control.
    criteria : Criteria, str or Path, optional
        Criteria of performance that a run must keep to count as stable: "wecc-tpl-001", "nerc-prc-024", "entso-e", or a
        file.
    remedies : str
        What might help if the system is not secure, each verified by the same study: "stabilizers", "storage",
        "redispatch", several of them, "all" (the default), or "none". They take several times as long as the rest.
    prices : Prices, str or Path, optional
        Prices of which the costs of the remedies are made, or a TOML file with them.
    workers, store, scheduler
        As in `screen`: with a store, an interrupted study goes on.
    progress : callable, optional
        Called with the share that is done, and the name of the part under way.
    each : callable, optional
        Called with the study as far as it is done: after every part, before the screen with the contingencies that look
        worst, and during the screen, which then begins with them, after 2, 5 and 10 s and every 20 s.
    **search
        Further arguments of `screen`: resolution, limit (60 cycles, or `clear` if that is longer), observe, longest,
        scan, step.

    Returns
    -------
    Study

    Raises
    ------
    StudyError
        If an argument is not possible, or the power flow, the initialization or a part other than the modes has no
        result.

    Examples
    --------
    >>> print(st.study(st.load("two_area"), clear="6cyc", faults="lines", worst=1))
    two_area: 4 contingencies survived with a clearing time of 6 cycles, none lost; the smallest margin is 3 cycles.
    All oscillations of 0.1 to 3 Hz have a damping ratio of at least 0.05; the least damped: ...
    """
    began, point = time.perf_counter(), operating_point(base, storage)
    case = point.case
    ranges = None if monitored is None else monitored_by(monitored, case, subsystems)
    wanted = Wanted(cycles(clear, case.frequency_hz), quantity(damping, "-"), voltages, ranges)
    for possible, what in (
        (
            0 < wanted.cycles < 1e6,
            f"clear = {wanted.cycles:g} cycles is not possible; give a time above 0 and below 1e6cyc",
        ),
        (0 <= wanted.damping < 1, f"damping = {wanted.damping:g} is no damping ratio; give one from 0 to 1"),
        (voltages[0] < voltages[1], f"voltages = {voltages} is no range; give the lower one first"),
        (worst >= 0, f"worst = {worst} runs are not possible; give at least 0"),
    ):
        if not possible:
            raise StudyError(f"{what}.")
    if prices is not None and not kinds(remedies):
        raise StudyError("Prices are those of remedies; leave out remedies, or the prices.")
    longest = cycles(search.setdefault("limit", f"{max(LIMIT, wanted.cycles)}cyc"), case.frequency_hz)
    if longest < wanted.cycles:
        raise StudyError(
            f"limit = {longest:g} cycles, the longest clearing time tried, is shorter than the clearing time that "
            f"protection guarantees, clear = {wanted.cycles:g} cycles; give at least that."
        )
    asked, costs, rules = kinds(remedies), priced(prices), None if criteria is None else named(criteria)
    running = {"workers": workers, "store": store, "scheduler": scheduler}
    work = _Work(worst, {**search, "criterion": criterion}, running)
    if isinstance(faults, Iterator):
        faults = tuple(faults)  # they are needed again for the remedies
    found = Study(point, wanted, case.check(), powerflow.solve(case), Settings(faults, control, rules))

    def done(now: Study) -> Study:
        now = replace(now, wall_s=time.perf_counter() - began)
        if each:
            each(now)
        return now

    tell, share, whole = progress or _nobody, ALONE if asked else 1.0, found
    for part in work.parts(found, lambda done, part: tell(share * done, part), each):
        whole = done(part)
    chosen = applicable(whole, asked)
    whole = replace(whole, how=whole.how._replace(remedies=chosen))
    for k, kind in enumerate(chosen):
        tell(share + (1 - share) * k / len(chosen), kind)
        one = remedy(kind, Asked(whole, costs, partial(work.again, found), running))
        whole = done(replace(whole, remedies=tuple(sorted((*whole.remedies, one), key=lambda one: one.order))))
    return whole


def _nobody(share: float, part: str) -> None:
    """Nobody is told."""


class _Work(NamedTuple):
    """How the parts of a study are computed."""

    worst: int
    search: Mapping[str, Any]  # arguments of `screen`
    running: Mapping[str, Any]  # workers, store and scheduler

    def parts(self, now: Study, tell: Tell, each: Callable[[Study], None] | None = None) -> Iterator[Study]:
        """The study after every part. Raises `StudyError` before the first one if its screen is not possible."""
        point, case, how = now.point, now.point.case, now.how
        planned = plan(case, faults=how.faults, control=how.control, criteria=how.criteria, **self.search)
        yield now
        tell(0.0, "modes")
        try:
            now = replace(now, modes=modes(point, BAND, damping=now.wanted.dampings))
        except LinearizationError as error:
            now = replace(now, no_modes=str(error))
        yield now
        if installed(case):
            yield (now := replace(now, ratios=short_circuit_ratio(case)))
        partly = Partly(now, each) if each else None
        done = carried_out(
            point,
            planned,
            progress=lambda done, total: tell(SCREENED * done / total, "faults"),
            each=partly,
            ranking=partly.begin if partly else None,
            **self.running,
        )
        for m in (now := replace(now, screen=done)).margins:
            if m.found.status == "stable_at_limit" and not m.secure:
                raise StudyError(
                    f"The screen ends at limit = {m.found.reach_cycles:g} cycles, but {m.found.contingency.label} "
                    f"is cleared after {m.required:g} cycles; give a limit of at least that."
                )
        yield now
        search = done.search
        system = setup(point, how.control, step=search.step, criterion=search.criterion)
        runs = (observed(system, *cleared(m, case), search, late=True)[0] for m in now.margins[: self.worst])
        yield replace(now, worst=tuple(replace(run, idle=idle(case, how.control)) for run in runs))

    def again(self, study: Study, point: OperatingPoint, control: Control) -> Study:
        """The same study of a changed system."""
        how = study.how._replace(control=control)
        changed = Study(point, study.wanted, study.unusual, powerflow.solve(point.case), how)
        *_, last = self.parts(changed, _nobody)
        return last


class Partly:
    """Tells of a study during its screen, with the contingencies that are done."""

    def __init__(self, study: Study, each: Callable[[Study], None]) -> None:
        self.study, self.each = study, each
        self.pairs: list[ClearingTime] = []
        self.pauses = iter(AT_FIRST)

    def begin(self, ranking: Sequence[Severity]) -> None:
        """The screen begins; these contingencies look worst."""
        self.study = replace(self.study, ranking=tuple(ranking))
        self._tell(self.study)

    def __call__(self, pairs: Iterable[ClearingTime]) -> None:
        """These contingencies are done, too."""
        self.pairs += pairs
        number = len(self.study.ranking)
        if time.monotonic() < self.due or len(self.pairs) == number:
            return
        case, search = self.study.point.case, self.pairs[0].search
        done = tuple(sorted(self.pairs, key=lambda pair: pair.reach_cycles))
        runs = sum(len(p.runs) for p in done)
        so_far = Screen(case.name, done, Lines((), (), ()), search, case.frequency_hz, number, runs, 0.0)
        self._tell(replace(self.study, screen=so_far))

    def _tell(self, study: Study) -> None:
        self.each(study)
        self.due = time.monotonic() + next(self.pauses, EVERY)

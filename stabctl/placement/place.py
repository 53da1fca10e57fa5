"""Where storage belongs and how large it must be: from contingencies and costs to a fleet with its evidence.

With a tolerance, any one device alone may be a little smaller or larger. Survival is not monotone in the size of one
device. Every scenario is therefore simulated with every device smaller and larger; those that are lost become scenarios
of the search.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np

from stabctl._util import units
from stabctl._util.errors import StudyError, shown
from stabctl._util.validation import checks_arguments
from stabctl._util.wording import counted
from stabctl.clearing import Screen, Search
from stabctl.controllers import BangBang, Controller, Law
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import EstimatorName
from stabctl.jobs import Runner
from stabctl.model import fleet, powerflow
from stabctl.model.tables import Storage
from stabctl.simulation.control import Control, Sampled, acting, with_law
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.swings import SPAN

from . import _cutting_planes, _initial_fleets, evidence
from ._cutting_planes import CuttingPlanes, Master
from ._simulated import FLEET, CriticalTime
from .contingencies import LONGER, Bases, Contingencies, Scenario, operating_points, scaled, scenarios
from .contingencies import contingencies as as_contingencies
from .evidence import critical_times, energies, table
from .sensitivity import sensitivity
from .site_options import SiteOptions, Sites
from .site_options import sites as as_sites
from .siting import CandidateSite, Costs, Infeasible, Site, Siting, Survived
from .siting_rows import label
from .trials import Trials

if TYPE_CHECKING:
    from stabctl.judgment import Criteria

UNIFORM = 0.05  # of machine MVA   the uniform fleet that is scaled
LESS = 0.97  # of the fleet, at which a binding contingency is lost
USUAL = 0.1  # tolerance of a size in the evidence of every fleet, if none is given
BY_SCREEN = (
    f"The required clearing times were chosen by default: {100 * (LONGER - 1):.0f} % longer than the critical "
    "ones of a screen without storage."
)
LIMIT = "60cyc"  # longest clearing time tried for the evidence


@checks_arguments
def place(
    base: Bases,
    contingencies: Contingencies,
    *,
    cap: str = "30%mva",
    costs: Costs = Costs(),  # noqa: B008
    sites: int | None = None,
    candidates: SiteOptions | None = None,
    outages: bool = False,
    tolerance: str | float | None = None,
    control: Control = None,
    device: Mapping[str, Any] | None = None,
    observe: str | float = "5s",
    longest: str | float = 0.0,
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    criteria: "Criteria | str | Path | None" = None,
    validate: EstimatorName | Mapping[str, Sampled] | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Siting:
    """Search for the cheapest storage fleet that survives every contingency in nonlinear simulation.

    Parameters
    ----------
    base : Case, OperatingPoint, or several of them
        The system, or several of its operating points: a list, or a mapping of names to cases. The fleet survives every
        contingency at each of them. The storage that the cases have already is kept, and costs nothing.
    contingencies : iterable of Contingency, Screen, str or Path
        The contingencies with the clearing times to be survived: a list, a screen (its most critical ones, with 20 %
        longer clearing times), or a TOML file. Contingencies without a fault, such as the trip of a machine, are
        survived if the system stays stable.
    cap : str
        Largest size of a device: "50MW", "30%mva", "100%dispatch" (of the first operating point).
    costs : Costs
        Cost of a MW, a site and a MWh; by default only the MW counts.
    sites : int, optional
        Largest number of devices.
    candidates : str, Path, or iterable of SiteOption, (machine, bus) or bus, optional
        Where devices may be installed: a CSV table of sites, records, or places; by default every machine's storage
        bus. A device without a machine follows the nearest one: that at the bus, or else the one that a MW absorbed
        there decelerates most.
    outages : bool
        Whether the fleet must survive everything also without each one of the devices, new or existing.
    tolerance : str or float, optional
        Share of its size by which any one new device may be smaller or larger: "10%" or 0.1. The fleet must survive
        everything also with each device so much smaller, and so much larger, than planned, the others as planned. By
        default the evidence shows what 10 % change, and nothing is required.
    control : control law, Controller, or list of them, optional
        The control law of all devices, `BangBang()` by default, and controllers, which act in every simulation. If
        controllers give orders to the storage devices, there is no law unless one is given.
    device : mapping, optional
        Other properties of the new devices: fields of `Storage`, such as {"lag": 0.05}.
    observe : str or float
        Observation window after the last event: "5s", or seconds.
    longest : str or float
        Longest time simulated after the last event, while the swings do not decay, as in `clearing_time`: "20s"; by
        default never more than `observe`.
    step, criterion
        As in `simulate`.
    criteria
        As in `clearing_time`: criteria of performance that every simulation must keep.
    validate : str or mapping, optional
        Other controllers to simulate the fleet with: the name of an estimator ("kalman"), or controllers by name.
    workers : int, optional
        Threads, one per core by default.
    store : str or Path, optional
        Folder that keeps every simulation, in place.db; called again, the study continues from there.
    scheduler : str, optional
        Scheduler of a Dask cluster instead of threads: "tcp://host:8786".
    progress : callable, optional
        Called with the number of simulations and the lowest cost so far.

    Returns
    -------
    Siting

    Raises
    ------
    StudyError
        If an argument is invalid, no fleet survives any contingency, or no fleet with so few sites or
        within the tolerance is found.

    Examples
    --------
    >>> wanted = [st.Contingency("29", clear="4.7cyc", trip="26-29")]
    >>> found = st.place(st.load("ieee39").classical(), wanted, candidates=[(9, 29), (8, 25)], observe="3s")
    >>> found.df[["bus", "machine", "mw"]].round(1)
       bus  machine    mw
    0   29        9  45.7
    """
    began = time.perf_counter()
    cases = operating_points(base)
    case = next(iter(cases.values()))
    _check(costs, sites)
    acts = acting_in(control)
    others = other_controllers(validate, acts)
    search = Search.of(
        case, resolution="0.125cyc", limit=LIMIT, observe=observe, step=step, criterion=criterion, longest=longest,
        keeping=criteria,
    )  # fmt: skip
    decaying = any(getattr(rule, "must", "") == "decay" for rule in (search.criteria.rules if search.criteria else ()))
    if decaying and max(search.observed_s, search.longest_s) < SPAN:
        raise StudyError(
            f"Swings that must decay are judged {SPAN:g} s after the last event; observe that long at least."
        )
    wanted = as_contingencies(case, contingencies, acts)
    flow = powerflow.solve(case)
    possible = as_sites(operating_point.solve(case, flow), candidates, cap, costs, flow)
    most = possible.cap
    largest = np.where(possible.module > 0, most, _cutting_planes.down(most, _cutting_planes.decimals(most)))
    places = case.with_storage(_devices(possible, largest), **device or {}).storage
    points = [operating_point.solve(fleet.extended(one, (*one.storage, *places))) for one in cases.values()]
    every = scenarios(wanted, len(points), len(case.storage) + len(places) if outages else None)
    targets = BY_SCREEN if isinstance(contingencies, Screen) else ""
    study = _Study(
        began, points, tuple(cases), every, targets, possible, largest, costs, sites, share(tolerance), acts, search
    )
    with Runner(FLEET, store=store, workers=workers, scheduler=scheduler) as runner:
        return _siting(study, _searched(study, runner, progress), others)


class _Study(NamedTuple):
    """What is asked."""

    began: float  # s   instant, of `time.perf_counter`
    points: list[OperatingPoint]  # with a device at every candidate
    names: tuple[str, ...]  # of the points
    scenarios: tuple[Scenario, ...]
    targets: str  # how the clearing times were chosen, if not by the user
    possible: Sites
    largest: np.ndarray  # (candidates) MW
    costs: Costs
    sites: int | None  # at most
    tolerance: float | None  # of the size of any one device
    acts: list[Law | Controller]
    search: Search


class _Found(NamedTuple):
    """What the search found."""

    planes: CuttingPlanes  # with the best fleet
    trials: Trials  # of the scenarios that are asked for; those of `planes` have more, within the tolerance
    best: np.ndarray  # (candidates) MW
    energy: np.ndarray  # (candidates) MWh
    even: np.ndarray | None  # the smallest uniform fleet
    linear: np.ndarray | None  # the cheapest linear allocation, scaled
    infeasible: dict[Scenario, Infeasible]


def _searched(study: _Study, runner: Runner, progress: Callable[[int, float], None] | None) -> _Found:
    """The cheapest fleet found: initial fleets, cutting planes, and again with what is lost within the tolerance."""
    planes: CuttingPlanes | None = None

    def tell(runs: int) -> None:
        if progress:
            progress(runs, planes.cost if planes else np.inf)

    points, possible, largest = study.points, study.possible, study.largest
    trials = Trials(
        points, study.scenarios, largest, study.acts,
        names=study.names, search=study.search, runner=runner, progress=tell,
    )  # fmt: skip
    uniform = UNIFORM * possible.mva
    trials, boundary, infeasible = _initial_fleets.feasible(trials, uniform)
    tried, prices = trials.fleet(uniform), possible.prices
    hours = np.zeros(len(uniform))
    if prices.mwh.any():
        hours = energies(trials, tried) / np.where(tried > 0, tried, np.inf)
    master = Master(largest, prices.per_mw(hours), prices.site, study.sites, module=possible.module)
    J = tuple(sensitivity(point, possible.candidates).J for point in points)
    planes = CuttingPlanes(trials, master, J, prices, hours)
    even = _initial_fleets.uniform_fleet(planes, uniform, boundary)
    linear = _initial_fleets.linear_fleet(planes, uniform)
    for start in (even, linear):
        if start is not None and (whole := planes.buildable(start)) is not None:
            planes.accept(whole)
    _initial_fleets.single_fleets(planes)
    _initial_fleets.relaxed_fleets(planes)
    planes.run()
    if study.tolerance is not None:
        hold(planes, study.tolerance)
    if planes.best is None or planes.energy is None:
        raise StudyError(_none_found(trials, study.sites))
    return _Found(planes, trials, planes.best, planes.energy, even, linear, infeasible)


def _siting(study: _Study, found: _Found, others: Mapping[str, Sampled]) -> Siting:
    """The result with its evidence, which is simulated here."""
    planes, best, even, case = found.planes, found.best, found.even, study.points[0].case
    trials = found.trials.of(best).alone()
    times = critical_times(trials, best)
    rows = table(trials, best, times, others, study.tolerance or USUAL)
    survived = _survived(trials, best, times)
    devices, uses = evidence.devices(trials, best), evidence.used(trials, best)
    places, price = study.possible.candidates, study.possible.prices.of_a_mw
    order, built = [int(i) for i in np.argsort(-best) if best[i] > 0], []
    for i in order:
        s = devices[i]
        site = Site(s.bus, case.called[s.machine], s.rating, float(found.energy[i]), s.mva or s.rating)
        built.append(site if (use := uses[i]) is None else site._replace(**use._asdict()))
    return Siting(
        case=case.name,
        sites=tuple(built),
        devices=tuple(devices[i] for i in order),
        costs=study.costs,
        cost=planes.cost,
        cuts_cost=planes.bound,
        cuts_mw=planes.bound / price if planes.bound is not None and price else None,
        uniform_mw=None if even is None else float(even.sum()),
        uniform_percent=None if even is None else float(100 * (even / study.possible.mva).max()),
        linear_mw=None if found.linear is None else float(found.linear.sum()),
        contingencies=survived,
        infeasible=tuple(found.infeasible[one] for one in trials.among(found.infeasible).of(best).scenarios),
        evidence=rows,
        history=tuple(planes.history),
        observed_s=study.search.observed_s,
        criteria=study.search.criteria.title if study.search.criteria else "",
        simulations=trials.simulations,
        wall_s=time.perf_counter() - study.began,
        candidates=tuple(
            CandidateSite(
                c.bus, case.called[c.machine], float(study.largest[i]), None if even is None else float(even[i])
            )
            for i, c in enumerate(places)
        ),
        title=case.title,
        existing=case.storage[: len(case.storage) - len(places)],
        controllers=tuple(str(c) for c in study.acts if isinstance(c, Controller)),
        law=next((str(law) for law in study.acts if isinstance(law, Law)), ""),
        targets=study.targets,
        tolerance=study.tolerance,
    )


def _check(costs: Costs, sites: int | None) -> None:
    if not all(isinstance(value, int | float) for value in costs):
        raise StudyError(f"costs = {shown(costs)} are not costs; give Costs(mw=1.0, site=20.0), for example.")
    for name, value in costs._asdict().items():
        if not 0 <= value < np.inf:
            unit = {"mw": "MW", "mwh": "MWh"}.get(name, name)
            raise StudyError(f"The cost of {value:g} per {unit} is not allowed; it must be finite and at least 0.")
    if sites is not None and (isinstance(sites, bool) or not isinstance(sites, int) or sites < 1):
        raise StudyError(f"sites = {shown(sites)} is not allowed; it must be a whole number of at least 1.")


def share(tolerance: str | float | None) -> float | None:
    """A tolerance of sizes as a share: "10%" or 0.1; None for none. Raises `StudyError`."""
    if tolerance is None:
        return None
    value = units.quantity(tolerance, "-")
    if not 0 < value < 1:
        raise StudyError(f"The tolerance {shown(tolerance)} is not allowed; give a share of a size, such as 10%.")
    return value


def acting_in(control: Control) -> list[Law | Controller]:
    """What acts in every simulation: a law, unless controllers give the orders, and the controllers."""
    parts = acting(control)
    if parts.pilots:
        raise StudyError("A fleet is sized with true speeds; give the estimator as validate='kalman', for example.")
    return with_law([*([parts.law] if parts.law else []), *parts.controllers], BangBang())


def other_controllers(
    validate: EstimatorName | Mapping[str, Sampled] | None, acts: Sequence[Law | Controller]
) -> Mapping[str, Sampled]:
    """Other controllers by name."""
    if validate is None or isinstance(validate, Mapping):
        return validate or {}
    if validate not in get_args(EstimatorName):
        raise StudyError(f"validate = {validate!r} is not an estimator; choose {', '.join(get_args(EstimatorName))}.")
    return {validate: EstimatorControl(acts, validate)}


def _devices(possible: Sites, largest: np.ndarray) -> list[Storage]:
    """A device of the largest size at every candidate."""
    return [Storage(c.machine, c.bus, float(mw)) for c, mw in zip(possible.candidates, largest, strict=True)]


def hold(planes: CuttingPlanes, tolerance: float) -> None:
    """Search again with what the best fleet does not survive within the tolerance, until nothing is left.

    Each search adds at least one of finitely many scenarios. Raises `StudyError` if one finds no fleet.
    """
    given, best = planes.trials, planes.best
    while planes.best is not None and (missing := lost(given, planes.best, tolerance)).scenarios:
        best, left = planes.best, missing
        planes.require(missing.scenarios)
        planes.run()
    if best is not None and planes.best is None:
        raise StudyError(
            f"No fleet within the caps was found that survives every contingency also with any one site "
            f"{100 * tolerance:g} % smaller or larger. The last one, {best.sum():.1f} MW, loses {_named(left, 0)}. "
            "Raise the caps or the number of sites, shorten the clearing times, or reduce the tolerance."
        )


def lost(trials: Trials, mw: np.ndarray, tolerance: float) -> Trials:
    """The scenarios with any one device of a fleet (candidates, MW) smaller or larger that it does not survive."""
    built = [len(trials.existing) + int(i) for i in np.flatnonzero(mw)]
    multiples = 1 - tolerance, 1 + tolerance
    every = trials.among(one for row in built for a in multiples for one in scaled(trials.scenarios, row, a))
    return every.only(every.lost(mw))


def _named(trials: Trials, k: int) -> str:
    """Scenario k with the device that has another size."""
    one = trials.scenarios[k]
    row, multiple = one.scaled or (0, 1.0)
    size = f"{trials.site(row - len(trials.existing))} x{multiple:g}"
    return f"{label(one.contingency, *trials.named(k))} with {size}"


def _none_found(trials: Trials, sites: int | None) -> str:
    few = f" with at most {counted(sites, 'site')}" if sites is not None else ""
    return (
        f"No fleet{few} within the caps was found that survives all {len(trials.scenarios)} contingencies of "
        f"{trials.point.case.name}; raise the caps or the number of sites, or shorten the clearing times."
    )


def _survived(trials: Trials, best: np.ndarray, times: list[CriticalTime]) -> tuple[Survived, ...]:
    """A row for every scenario."""
    less = trials.lost(LESS * best)
    return tuple(
        Survived(
            one, trials.target(k), c.cycles, c.machine, c.stable, k in less, *trials.named(k), c.growing, c.longest
        )
        for k, (one, c) in enumerate(zip(trials.contingencies, times, strict=True))
    )

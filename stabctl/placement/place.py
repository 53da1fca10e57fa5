"""Where storage belongs and how large it must be: from contingencies and costs to a fleet with its evidence."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, get_args

import numpy as np

from stabctl._util.wording import counted
from stabctl.clearing import Screen, Search
from stabctl.controllers import BangBang, Law
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import EstimatorName
from stabctl.model import fleet, powerflow
from stabctl.model.case import Case, Storage, as_case
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.sampled import Sampled

from . import initial_fleets
from .contingencies import LONGER, Contingencies
from .contingencies import contingencies as as_contingencies
from .cutting_planes import CuttingPlanes, decimals
from .evidence import critical_times, energies, table
from .master import Master
from .prices import Prices
from .sensitivity import Candidate, sensitivity
from .sensitivity import checked as checked_candidates
from .siting import CandidateSite, Costs, Site, Siting, Survived
from .trials import Trials

UNIFORM = 0.05  # of machine MVA   the uniform fleet that is scaled
LARGEST = 1e6  # MW
LESS = 0.97  # of the fleet, at which a binding contingency is lost
BY_SCREEN = (
    f"The required clearing times were chosen by default: {100 * (LONGER - 1):.0f} % longer than the critical "
    "ones of a screen without storage."
)
LIMIT = "60cyc"  # longest clearing time tried for the evidence


def place(
    base: Case | OperatingPoint,
    contingencies: Contingencies,
    *,
    cap: str = "30%mva",
    costs: Costs = Costs(),  # noqa: B008
    sites: int | None = None,
    candidates: Iterable[tuple[int, int]] | None = None,
    control: Law | None = None,
    device: Mapping[str, Any] | None = None,
    observe: str | float = "5s",
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    validate: EstimatorName | Mapping[str, Sampled] | None = None,
    workers: int | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Siting:
    """Find the cheapest storage fleet that survives every contingency in nonlinear simulation.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; its own storage is ignored.
    contingencies : iterable of Contingency, Screen, str or Path
        The contingencies with the clearing times to be survived: a list, a screen (its most critical ones, with 20 %
        longer clearing times), or a TOML file.
    cap : str
        Largest size of a device: "50MW", "30%mva", "100%dispatch".
    costs : Costs
        Cost of a MW, a site and a MWh; by default only the MW counts.
    sites : int, optional
        Largest number of devices.
    candidates : iterable of (machine, bus), optional
        Where devices may be installed; by default at every machine's storage bus.
    control : control law, optional
        Control law of the devices, `BangBang()` by default.
    device : mapping, optional
        Other properties of the devices: fields of `Storage`, such as {"lag": 0.05}.
    observe : str or float
        Observation window after clearing: "5s", or seconds.
    step, criterion
        As in `simulate`.
    validate : str or mapping, optional
        Other controllers to simulate the fleet with: the name of an estimator ("kalman"), or controllers by name.
    workers : int, optional
        Threads, one per core by default.
    progress : callable, optional
        Called with the number of simulations and the lowest cost so far.

    Returns
    -------
    Siting

    Raises
    ------
    StudyError
        If an argument is invalid, no fleet survives any contingency, or no fleet with so few sites is found.
    """
    began = time.perf_counter()
    case = as_case(base)
    _check(costs, sites)
    law = control or BangBang()
    controls = _controls(validate, law)
    search = Search.of(case, resolution="0.125cyc", limit=LIMIT, observe=observe, step=step, criterion=criterion)
    flow = powerflow.solve(case)
    found = checked_candidates(case, candidates)
    mva = np.array([case.machine(c.machine).base for c in found])
    largest = _caps(case, cap, found, flow)
    devices = [Storage(c.machine, c.bus, float(mw)) for c, mw in zip(found, largest, strict=True)]
    point = operating_point.solve(case.with_storage(devices, **(device or {})), flow)

    planes: CuttingPlanes | None = None

    def tell(runs: int) -> None:
        if progress:
            progress(runs, planes.cost if planes else np.inf)

    wanted = as_contingencies(case, contingencies)
    trials = Trials(point, wanted, largest, law, search=search, workers=workers, progress=tell)
    uniform = UNIFORM * mva
    trials, boundary, infeasible = initial_fleets.feasible(trials, uniform)
    prices = Prices(*(np.full(len(found), float(cost)) for cost in (costs.mw, costs.mwh, costs.site)))
    tried = trials.fleet(uniform)
    hours = energies(trials, tried) / np.where(tried > 0, tried, np.inf) if costs.mwh else np.zeros(len(found))
    master = Master(largest, prices.per_mw(hours), prices.site, sites)
    planes = CuttingPlanes(trials, master, sensitivity(point, found).J, prices, hours)
    even = initial_fleets.uniform_fleet(planes, uniform, boundary)
    linear = initial_fleets.linear_fleet(planes, uniform)
    for start in (even, linear):
        if start is not None:
            planes.accept(start)
    planes.run()
    if planes.best is None:
        raise StudyError(_none_found(trials, sites))
    best = planes.best
    times = critical_times(trials, best)
    rows = table(trials, best, times, controls)
    lost_with_less = trials.lost(LESS * best)
    assert planes.energy is not None
    survived = tuple(
        Survived(one, trials.target(k), c.cycles, c.machine, c.stable, k in lost_with_less)
        for k, (one, c) in enumerate(zip(trials.contingencies, times, strict=True))
    )
    order = [int(i) for i in np.argsort(-best) if best[i] > 0]
    return Siting(
        case=case.name,
        sites=tuple(Site(found[i].bus, found[i].machine, float(best[i]), float(planes.energy[i])) for i in order),
        costs=costs,
        cost=planes.cost,
        lower_bound=planes.bound,
        uniform_mw=None if even is None else float(even.sum()),
        uniform_percent=None if even is None else float(100 * (even / mva).max()),
        linear_mw=None if linear is None else float(linear.sum()),
        contingencies=survived,
        infeasible=infeasible,
        evidence=rows,
        history=tuple(planes.history),
        observed_s=search.observed_s,
        simulations=trials.simulations,
        wall_s=time.perf_counter() - began,
        candidates=tuple(
            CandidateSite(c.bus, c.machine, float(largest[i]), None if even is None else float(even[i]))
            for i, c in enumerate(found)
        ),
        title=case.title,
        targets=BY_SCREEN if isinstance(contingencies, Screen) else "",
    )


def _check(costs: Costs, sites: int | None) -> None:
    for name, value in costs._asdict().items():
        if not 0 <= value < np.inf:
            unit = {"mw": "MW", "mwh": "MWh"}.get(name, name)
            raise StudyError(f"The cost of {value:g} per {unit} is not allowed; it must be finite and at least 0.")
    if costs.mw + costs.mwh == 0:
        raise StudyError("The costs per MW and per MWh are both 0; make one of them positive.")
    if sites is not None and sites < 1:
        raise StudyError(f"sites = {sites} is not allowed; it must be at least 1.")


def _controls(validate: EstimatorName | Mapping[str, Sampled] | None, law: Law) -> Mapping[str, Sampled]:
    """Other controllers by name."""
    if validate is None or isinstance(validate, Mapping):
        return validate or {}
    if validate not in get_args(EstimatorName):
        raise StudyError(f"validate = {validate!r} is not an estimator; choose {', '.join(get_args(EstimatorName))}.")
    return {validate: EstimatorControl(law, validate, engine="batched")}


def _caps(case: Case, cap: str, found: Sequence[Candidate], flow: powerflow.PowerFlow) -> np.ndarray:
    """Largest sizes (candidates, MW)."""
    out = np.array([fleet.megawatts(case, case.machine(c.machine), cap, flow) for c in found])
    if not (out > 0).any():
        raise StudyError(f"The cap of {cap} is not allowed; give a size above 0.")
    if out.max() > LARGEST:
        raise StudyError(f"The cap of {cap} is not realistic; give at most {LARGEST:g} MW.")
    return np.floor(out * 10 ** decimals(out) + 1e-6) / 10 ** decimals(out)


def _none_found(trials: Trials, sites: int | None) -> str:
    few = f" with at most {counted(sites, 'site')}" if sites is not None else ""
    return (
        f"No fleet{few} within the caps was found that survives all {len(trials.contingencies)} contingencies of "
        f"{trials.point.case.name}; raise the caps or the number of sites, or shorten the clearing times."
    )

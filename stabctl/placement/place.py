"""Where storage belongs and how large: the whole study, from contingencies and costs to a fleet with its proof."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from stabctl._util.wording import counted
from stabctl.clearing import Search as ClearingSearch
from stabctl.controllers import Law
from stabctl.dynamics import operating_point
from stabctl.errors import StudyError
from stabctl.model import fleet, powerflow
from stabctl.model.case import Case, Storage
from stabctl.simulation.criterion import DEFAULT, Criterion
from stabctl.simulation.sampled import Sampled

from . import initial_fleets
from .contingency import Contingency, checked
from .evidence import energies, proof, table
from .master import Master
from .program import Search
from .sensitivity import Candidate, sensitivity
from .sensitivity import checked as checked_candidates
from .siting import Costs, Place, Site, Siting, Survived
from .trials import Trials

UNIFORM = 0.05  # of machine MVA   the uniform fleet that is scaled
LARGEST = 1e6  # MW
LESS = 0.97  # of the fleet, at which a binding contingency is lost


def place(
    case: Case,
    contingencies: Iterable[Contingency],
    cap: str = "30%mva",
    costs: Costs = Costs(),  # noqa: B008
    sites: int | None = None,
    candidates: Iterable[tuple[int, int]] | None = None,
    law: Law | None = None,
    observed_s: float = 5.0,
    step: float | None = None,
    criterion: Criterion = DEFAULT,
    others: Mapping[str, Sampled] | None = None,
    workers: int | None = None,
    progress: Callable[[int, float], None] | None = None,
    **options: Any,
) -> Siting:
    """The cheapest fleet found that survives every contingency that some fleet survives, with its evidence.

    Args: case (its own storage is left out); what must be survived; largest size of a device (50MW, 30%mva); costs; at
    most so many sites; candidates (machine, bus), by default every machine's storage bus; storage law (bang-bang);
    time watched after clearing (s); step (s); when a run ends; other controllers to put the fleet under, by name;
    threads; what is told simulations and best cost so far; options as fields of `Storage`. Raises `StudyError` for
    impossible arguments, where nothing is curable, and where no fleet of so few sites is found.
    """
    began = time.perf_counter()
    _check(costs, sites, observed_s)
    flow = powerflow.solve(case)
    found = checked_candidates(case, candidates)
    mva = np.array([case.machine(c.machine).base for c in found])
    largest = _caps(case, cap, found, flow)
    devices = (Storage(c.machine, c.bus, float(mw), **options) for c, mw in zip(found, largest, strict=True))
    point = operating_point.solve(case.with_storage(devices), flow)

    search: Search | None = None

    def tell(runs: int) -> None:
        if progress:
            progress(runs, search.cost if search else np.inf)

    trials = Trials(point, checked(contingencies, case), largest, law, observed_s, step, criterion, workers, tell)
    uniform = UNIFORM * mva
    trials, cures, incurable = initial_fleets.curable(trials, uniform)
    price = np.full(len(found), float(costs.mw))
    if costs.mwh:
        tried = trials.fleet(uniform)
        price += costs.mwh * energies(trials, uniform) / np.where(tried > 0, tried, np.inf)
    master = Master(largest, price, np.full(len(found), costs.site), sites)
    search = Search(trials, master, sensitivity(point, found).J)
    even = initial_fleets.uniform_fleet(search, uniform, cures)
    shared = initial_fleets.linear_fleet(search, uniform)
    for start in (even, shared):
        if start is not None:
            search.accept(start)
    search.run()
    if search.best is None:
        raise StudyError(_none_found(search, sites))
    best = search.best
    proved = proof(trials, best)
    rows = table(trials, best, proved, others or {})
    lost_with_less = trials.lost(LESS * best)
    energy = energies(trials, best)
    hz = case.frequency_hz
    survived = tuple(
        Survived(one, one.clear * hz, c.cycles, c.machine, c.stable, k in lost_with_less)
        for k, (one, c) in enumerate(zip(trials.contingencies, proved, strict=True))
    )
    order = [int(i) for i in np.argsort(-best) if best[i] > 0]
    return Siting(
        case=case.name,
        sites=tuple(Site(found[i].bus, found[i].machine, float(best[i]), float(energy[i])) for i in order),
        costs=costs,
        cost=search.cost,
        lower_bound=search.bound,
        uniform_mw=None if even is None else float(even.sum()),
        uniform_percent=None if even is None else float(100 * (even / mva).max()),
        linear_mw=None if shared is None else float(shared.sum()),
        contingencies=survived,
        incurable=incurable,
        evidence=rows,
        history=tuple(search.history),
        observed_s=observed_s,
        simulations=trials.simulations,
        wall_s=time.perf_counter() - began,
        places=tuple(
            Place(c.bus, c.machine, float(largest[i]), None if even is None else float(even[i]))
            for i, c in enumerate(found)
        ),
        title=case.title,
    )


def _check(costs: Costs, sites: int | None, observed_s: float) -> None:
    ClearingSearch(observed_s=observed_s)
    for name, value in costs._asdict().items():
        if not 0 <= value < np.inf:
            raise StudyError(f"The cost of {value:g} per {name} is not allowed; it must be at least 0 and finite.")
    if costs.mw + costs.mwh == 0:
        raise StudyError("Neither a MW nor a MWh costs anything; give one of them a cost above 0.")
    if sites is not None and sites < 1:
        raise StudyError(f"At most {sites} sites leave no room for storage; give at least 1.")


def _caps(case: Case, cap: str, found: Sequence[Candidate], flow: powerflow.PowerFlow) -> np.ndarray:
    """Largest sizes (candidates, MW)."""
    out = np.array([fleet.megawatts(case, case.machine(c.machine), cap, flow) for c in found])
    if not (out > 0).any():
        raise StudyError(f"The cap of {cap} leaves no room for storage; give a size above 0.")
    if out.max() > LARGEST:
        raise StudyError(f"The cap of {cap} is beyond any storage; give at most {LARGEST:g} MW.")
    return out


def _none_found(search: Search, sites: int | None) -> str:
    trials = search.trials
    few = f" of at most {counted(sites, 'site')}" if sites is not None else ""
    return (
        f"No fleet{few} within the caps was found that survives all {len(trials.contingencies)} contingencies of "
        f"{trials.point.case.name}; raise the caps or the number of sites, or ask for less."
    )

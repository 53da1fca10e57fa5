"""Where storage belongs and how large: the whole study, from contingencies and costs to a fleet with its proof."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from stabctl import equilibrium, powerflow
from stabctl.case import Case, Storage
from stabctl.controllers import Law
from stabctl.errors import StudyError
from stabctl.quantity import NOT_NEGATIVE
from stabctl.simulate.sampled import Sampled
from stabctl.simulate.stepper import DEFAULT, Rules
from stabctl.units import size

from .allocation import by_gramian
from .contingency import Contingency, checked
from .evidence import critical_cycles, energies, evidence
from .master import Master
from .programme import Search
from .scaling import critical_scaling, least, reach
from .sensitivity import Candidate, sensitivity
from .sensitivity import checked as checked_candidates
from .siting import Evidence, Incurable, Site, Siting, Survived
from .trials import Trials

UNIFORM = 0.05  # of machine MVA   the uniform fleet that is scaled
BUDGET = 0.5  # of the uniform fleet, for the linear stage to share out
MARGINS = (1.0, 1.02, 1.03, 1.05, 1.1)  # of the sizes, tried until half the step and twice the time change nothing
LESS = 0.97  # of the fleet, at which a binding contingency is lost


class Costs(NamedTuple):
    """What storage costs, in any one currency."""

    mw: float = 1.0  # per MW
    site: float = 0.0  # per site
    mwh: float = 0.0  # per MWh, by what a MW of each candidate takes in with the uniform fleet


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
    rules: Rules = DEFAULT,
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
    _check(costs, sites)
    flow = powerflow.solve(case)
    found = checked_candidates(case, candidates)
    mva = np.array([case.machine(c.machine).base for c in found])
    largest = _caps(case, cap, mva, found, flow)
    devices = (Storage(c.machine, c.bus, float(mw), **options) for c, mw in zip(found, largest, strict=True))
    point = equilibrium.solve(case.with_storage(devices), flow)

    def tell(_runs: int = 0) -> None:
        if progress:
            progress(trials.simulations, search.cost if search else np.inf)

    search = None
    trials = Trials(point, checked(contingencies, case), largest, law, observed_s, step, rules, workers, tell)
    uniform = UNIFORM * mva
    trials, cures, incurable = _curable(trials, uniform)
    J = sensitivity(point, found).J
    price = np.full(len(found), costs.mw)
    if costs.mwh:
        price += costs.mwh * energies(trials, uniform) / trials.fleet(uniform)
    search = Search(trials, Master(largest, price, np.full(len(found), costs.site), sites), J)
    even, shared = _seeded(search, uniform, cures)
    search.run()
    if search.best is None:
        raise StudyError(_none_found(search, sites))
    best = search.best
    rows = _evidence(search, even, others or {})
    lost_with_less = trials.lost(LESS * best) if best.any() else []
    proof = trials.each(lambda k: critical_cycles(trials, best, k))
    hz = case.frequency_hz
    survived = tuple(
        Survived(one, one.clear * hz, cycles, machine, stable, k in lost_with_less)
        for k, (one, (cycles, stable, machine)) in enumerate(zip(trials.contingencies, proof, strict=True))
    )
    energy = energies(trials, best)
    order = [int(i) for i in np.argsort(-best) if best[i] > 0]
    return Siting(
        case.name,
        tuple(Site(found[i].bus, found[i].machine, float(best[i]), float(energy[i])) for i in order),
        search.cost,
        search.bound,
        None if even is None else float(trials.fleet(even).sum()),
        None if even is None else float(100 * (even / mva).max()),
        None if shared is None else float(trials.fleet(shared).sum()),
        survived,
        incurable,
        rows,
        tuple(search.history),
        observed_s,
        trials.simulations,
        time.perf_counter() - began,
    )


def _check(costs: Costs, sites: int | None) -> None:
    for name, value in costs._asdict().items():
        if value not in NOT_NEGATIVE or not np.isfinite(value):
            raise StudyError(f"The cost of {value:g} per {name} is not allowed; it must be a finite number of at least 0.")
    if costs.mw + costs.mwh == 0:
        raise StudyError("Neither a MW nor a MWh costs anything; give one of them a cost above 0.")
    if sites is not None and sites < 1:
        raise StudyError(f"At most {sites} sites leave no room for storage; give at least 1.")


def _caps(case: Case, cap: str, mva: np.ndarray, found: Sequence[Candidate], flow: powerflow.Flow) -> np.ndarray:
    """Largest sizes (candidates, MW)."""
    value, unit = size(cap)
    if unit == "%dispatch":
        rows = [case.machines.index(case.machine(c.machine)) for c in found]
        out = value / 100 * np.maximum(flow.S[rows].real, 0.0) * case.base_mva
    else:
        out = value / 100 * mva if unit == "%mva" else np.full(len(mva), value)
    if not (out > 0).any():
        raise StudyError(f"The cap of {cap} leaves no room for storage; give a size above 0.")
    return out


def _curable(trials: Trials, uniform: np.ndarray) -> tuple[Trials, list[tuple[np.ndarray, float]], tuple[Incurable, ...]]:
    """The trials without what no fleet survives; for the others a fleet and its critical scaling; what is left out.

    Tried are the uniform fleet and each candidate alone, from small to the caps.
    """
    alone = [np.where(np.arange(len(uniform)) == i, trials.cap / 4, 0.0) for i in range(len(uniform))]

    def cure(k: int) -> tuple[np.ndarray, float] | None:
        for mw in (uniform, *alone):
            most = reach(trials, mw)
            a = critical_scaling(lambda a: trials.survives(a * mw, k), most) if most else None
            if a is not None:
                return mw, a
        return None

    cures = trials.each(cure)
    kept = [k for k, cured in enumerate(cures) if cured is not None]
    hz, incurable = trials.point.case.frequency_hz, []
    for k in (k for k, cured in enumerate(cures) if cured is None):
        one = trials.contingencies[k]
        without = critical_cycles(trials, np.zeros_like(uniform), k)[0]
        incurable.append(Incurable(one, one.clear * hz, without, trials.fleets(k)))
    if not kept:
        raise StudyError(f"No contingency is survived by any fleet within the caps: {'; '.join(map(str, incurable))}")
    return trials.only(kept), [cures[k] for k in kept], tuple(incurable)


def _seeded(
    search: Search, uniform: np.ndarray, cures: Sequence[tuple[np.ndarray, float]]
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Cuts and fleets to begin with: the smallest uniform fleet, and the linear stage's, that survive everything."""
    trials = search.trials
    for k, (mw, a) in enumerate(cures):
        if a:
            search.cut(a * mw, k)
    if not any(a for _, a in cures):
        search.accept(np.zeros_like(uniform))
        return np.zeros_like(uniform), np.zeros_like(uniform)
    scaled = least(trials, max(a for _, a in cures) * uniform) if all(mw is uniform for mw, _ in cures) else None
    even = None if scaled is None else scaled.scaling * max(a for _, a in cures) * uniform
    if even is not None:
        search.accept(even)
    return even, _by_linear_stage(search, float(trials.fleet(uniform).sum()) * BUDGET)


def _by_linear_stage(search: Search, budget: float) -> np.ndarray | None:
    """The allocation of the linear stage, scaled until it survives everything; cuts where it does."""
    trials = search.trials
    found = [(s.machine, s.bus) for s in trials.point.case.storage]
    try:
        mw = by_gramian(trials.point, found, budget, trials.cap, "log-det").sizes
    except StudyError:
        return None
    scaled = least(trials, mw)
    search.cut_near(mw, scaled)
    if scaled is None:
        return None
    search.accept(scaled.scaling * mw)
    return scaled.scaling * mw


def _none_found(search: Search, sites: int | None) -> str:
    few = f" of at most {sites} site{'s' * (sites > 1)}" if sites is not None else ""
    return (
        f"No fleet{few} within the caps was found that survives all {len(search.trials.contingencies)} contingencies of "
        f"{search.trials.point.case.name}; raise the caps or the number of sites, or ask for less."
    )


def _evidence(search: Search, even: np.ndarray | None, others: Mapping[str, Sampled]) -> tuple[Evidence, ...]:
    """The fleet, smaller, without each site, more finely simulated, and under other controllers."""
    trials, best = search.trials, search.best
    rows = [evidence(trials, "x1", best), evidence(trials, "x0.9", 0.9 * best)]
    for i in (int(i) for i in np.argsort(-best) if best[i] > 0):
        rest = best.copy()
        rest[i] = 0.0
        rows.append(evidence(trials, f"without {trials.point.case.storage[i].bus}", rest))
    finer = trials.refined()
    for margin in MARGINS:
        if not finer.lost(margin * best):
            rows.append(evidence(finer, f"x{margin:g}, half the step, twice as long", margin * best))
            break
    rows += [evidence(trials, name, best, control) for name, control in others.items()]
    return tuple(rows)

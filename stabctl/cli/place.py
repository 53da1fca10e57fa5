"""stabctl place: siting and sizing of storage."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from . import groups, options, shared
from .parameters import Option

if TYPE_CHECKING:
    from stabctl.model.case import Case
    from stabctl.placement.siting import Evidence, Siting
    from stabctl.simulation.contingency import Contingency

File = Annotated[
    Path | None,
    Option(
        "--contingencies",
        help="FILE.toml with [[contingency]] fault, trip, clear (default: the packaged file, or a screen).",
    ),
]
Sites = Annotated[int | None, Option("--sites", help="Maximum number of sites.")]
Cap = Annotated[str, Option("--cap", help="Maximum size of a device: 30%mva, 100%dispatch or 500MW.")]
Candidates = Annotated[
    Path | None,
    Option(
        "--candidates",
        help="FILE.csv with the buses where devices may be built: bus, machine, cap_mw, module_mw, cost_per_mw, "
        "cost_per_mwh, cost_per_site (default: every machine's storage bus).",
    ),
]
Also = Annotated[list[str] | None, Option("--also", help="Another operating point: a case. Repeatable.")]
Levels = Annotated[
    list[float] | None,
    Option(
        "--load-level",
        help="Operating point with all loads and the dispatch multiplied by this factor: 0.9. Repeatable.",
    ),
]
Outages = Annotated[bool, Option("--outages", help="Also survive the outage of any one storage device.")]
Tolerance = Annotated[
    float | None,
    Option(
        "--tolerance",
        metavar="SHARE",
        parser=options.in_unit("-"),
        help="Also survive with any one device this much smaller or larger: 10%.",
    ),
]
Existing = Annotated[
    str | None, Option("--storage-at", help="Existing devices, instead of those of the case: 14=50MW,13@33=20MW.")
]
CostMw = Annotated[float, Option("--cost-mw", help="Cost per MW.")]
CostSite = Annotated[float, Option("--cost-site", help="Cost per site.")]
CostMwh = Annotated[float, Option("--cost-mwh", help="Cost per MWh.")]
Validate = Annotated[
    Literal["frequency", "kinematic", "kalman"] | None,
    Option("--validate", help="Also simulate the fleet with estimated speeds."),
]


def place(
    *,
    contingencies: File = None,
    also: Also = None,
    load_level: Levels = None,
    outages: Outages = False,
    tolerance: Tolerance = None,
    storage_at: Existing = None,
    candidates: Candidates = None,
    sites: Sites = None,
    cap: Cap = "30%mva",
    cost_mw: CostMw = 1.0,
    cost_site: CostSite = 0.0,
    cost_mwh: CostMwh = 0.0,
    observe: options.Observe = "5s",
    longest: options.Longest = "0s",
    step: options.Step = None,
    characteristic: options.Characteristic = "power",
    lag: options.Lag = "0s",
    storage_model: options.StorageModel = "ideal",
    storage_energy: options.StorageEnergy = 0.0,
    storage_mva: options.Mva = None,
    converter: options.Converter = "",
    law: groups.LawOptions,
    controller: options.Controllers = None,
    stability: groups.StabilityOptions,
    validate: Validate = None,
    seed: options.Seed = 1,
    workers: options.Workers = None,
    store: options.Store = None,
    scheduler: options.Scheduler = None,
    by: options.Criteria = None,
    report: options.Report = None,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> int:
    """Search for the cheapest storage fleet that survives every contingency in simulation."""
    from stabctl._util.errors import StudyError
    from stabctl.estimation.estimator_control import EstimatorControl
    from stabctl.placement.place import place
    from stabctl.placement.siting import Costs

    if seed != 1 and not validate:
        raise StudyError("--seed is that of the estimator of --validate; give that too.")
    shared.folder(report)
    criteria = shared.criteria(by)
    chosen_law, own = law.chosen(True, None, shared.controllers(controller))
    acts: list[Any] = [*([chosen_law] if chosen_law else []), *own]
    estimated: dict[str, Any] = {}
    loaded = case.load()
    points = _operating_points([loaded, *(case._replace(case=name).load() for name in also or ())], load_level)
    if storage_at is not None:
        points = {name: point.with_storage(storage_at) for name, point in points.items()}
    chosen, source = _contingencies(loaded, case.case, contingencies, case.classical, store=store, scheduler=scheduler)
    if validate:
        estimated[validate] = EstimatorControl(acts, validate, seed=seed)
    with shared.progress("siting", None) as tell:
        found = place(
            points,
            chosen,
            cap=cap,
            candidates=candidates,
            outages=outages,
            tolerance=tolerance,
            costs=Costs(cost_mw, cost_site, cost_mwh),
            sites=sites,
            control=acts,
            device={
                "characteristic": characteristic,
                "lag": shared.lag(lag, loaded),
                **groups.connection(storage_model, storage_energy, storage_mva, converter),
            },
            observe=observe,
            longest=longest,
            step=step,
            criterion=stability.criterion(loaded),
            criteria=criteria,
            validate=estimated or None,
            workers=workers,
            store=store,
            scheduler=scheduler,
            progress=lambda runs, cost: tell(None, f"{runs} simulations, {_so_far(cost)}"),
        )
    if as_json:
        shared.print_json(_record(found) | {"contingencies_from": source})
    else:
        shared.console().print(str(found))
        if not found.targets:
            chosen_by = "come from" if contingencies else "were chosen by default: they are those of"
            shared.console().print(f"The contingencies and their clearing times {chosen_by} {source}.")
    shared.written([found.report(report, base=next(iter(points.values())))] if report else [], as_json)
    return 1 if found.infeasible else 0


def _operating_points(cases: "list[Case]", levels: list[float] | None) -> "dict[str, Case]":
    """Each case at each load level, by name."""
    from stabctl.placement.contingencies import operating_points

    named = operating_points(cases)
    if not levels:
        return named
    several = len(named) > 1
    return {
        f"{name + ', ' if several else ''}load {100 * level:g} %": case.with_load_level(level)
        for name, case in named.items()
        for level in levels
    }


def _contingencies(
    case: "Case", name: str, file: Path | None, classical: bool, **where: Any
) -> "tuple[tuple[Contingency, ...], str]":
    """The contingencies of the file, the packaged ones, or the most critical ones of a screen, and their source."""
    from stabctl.clearing import screen
    from stabctl.placement.contingencies import contingencies, packaged

    if file:
        return contingencies(case, file), f"the file {file}"
    if not Path(name).is_dir() and (file := packaged(name, classical)):
        return contingencies(case, file), f"the packaged file {file.name}"
    with shared.progress("screening", 1.0) as tell:
        found = screen(case, progress=lambda done, of: tell(done / of), **where)
    return contingencies(case, found), "a screen, with clearing times 20 % longer than without storage"


def _record(found: "Siting") -> dict[str, Any]:
    return {
        "case": found.case,
        "sites": [s._asdict() for s in found.sites],
        "total_mw": found.total_mw,
        "total_mwh": found.total_mwh,
        "total_mva": found.total_mva,
        "uniform_mw": found.uniform_mw,
        "uniform_percent": found.uniform_percent,
        "linear_mw": found.linear_mw,
        "cost": found.cost,
        "cuts_cost": found.cuts_cost,
        "cuts_mw": found.cuts_mw,
        "contingencies": [
            _asked(c)
            | {"critical_cycles": c.critical_cycles, "machine": c.machine, "stable": c.stable, "binding": c.binding}
            for c in found.contingencies
        ],
        "lost": [_asked(c) | {"alone_cycles": c.alone_cycles, "fleets_tried": c.tried} for c in found.infeasible],
        "existing": [s._asdict() for s in found.existing],
        "controllers": list(found.controllers),
        "law": found.law,
        "evidence": [_evidence(row) for row in found.evidence],
        "tolerance": found.tolerance,
        "history": [h._asdict() for h in found.history],
        "observed_s": found.observed_s,
        "criteria": found.criteria,
        "simulations": found.simulations,
        "wall_s": found.wall_s,
    }


def _so_far(cost: float) -> str:
    return f"lowest cost {cost:.4g}" if cost < math.inf else "no fleet yet"


def _asked(c: Any) -> dict[str, Any]:
    """A contingency and the clearing time asked for."""
    fault, trip = c.contingency.fault, list(map(str, c.contingency.trip))
    what = {"fault": fault and str(fault), "trip": trip, "operating_point": c.operating_point}
    return what | {"out": c.out, "target_cycles": c.target_cycles}


def _evidence(row: "Evidence") -> dict[str, Any]:
    record = row._asdict()
    refined = record.pop("refined")
    return {"fleet": row.fleet, **record, "finer": refined}

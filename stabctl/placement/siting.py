"""The result of a siting study: a storage fleet, its cost, the evidence, and all of it in sentences."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from stabctl._util.tabular import Tabular, machine_column
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.controllers import BangBang
from stabctl.model.tables import Storage

from .siting_rows import CandidateSite, Costs, Evidence, Infeasible, Iteration, Site, Survived

if TYPE_CHECKING:
    import pandas as pd

SLACK = 1e-6  # largest violation of a cut that is rounding


@dataclass(frozen=True, repr=False)
class Siting(Tabular):
    """The cheapest storage fleet found that survives every contingency in nonlinear simulation.

    Attributes
    ----------
    case, title : str
        Name and title of the case.
    sites : tuple of Site
        The devices, largest first.
    devices : tuple of Storage
        The same as they were simulated.
    costs : Costs
        What was minimized.
    cost : float
        Cost of the fleet.
    cuts_cost : float or None
        Lowest cost that the cutting planes allow, no bound; None if the solver failed.
    cuts_mw : float or None, MW
        The same in MW, if a MW costs the same everywhere and nothing else has a cost.
    uniform_mw, uniform_percent : float or None, MW and percent of the machine's MVA at every candidate site
        Smallest uniform fleet that survives everything, no device above its cap; None if there is none.
    linear_mw : float or None, MW
        Allocation by linear analysis, scaled until it survives everything.
    contingencies, infeasible : tuple
        Contingencies that the fleet survives, and those that no fleet tried survives.
    evidence : tuple of Evidence
        Variants of the fleet.
    history : tuple of Iteration
        Iterations of the search.
    observed_s : float, s
        Observation window after the last event.
    simulations : int
        Number of simulations.
    wall_s : float, s
        Computing time.
    candidates : tuple of CandidateSite
        Sites at which storage could be built.
    existing : tuple of Storage
        Devices of the case, which are kept.
    controllers : tuple of str
        Controllers in every simulation.
    law : str
        Law of the devices; empty if controllers drive them.
    targets : str
        Source of the required clearing times, as a sentence; empty if they were given.
    tolerance : float or None
        Share by which any one device alone may be smaller or larger, if that was required.
    criteria : str
        Title of the criteria that every run keeps; empty if there are none.

    Examples
    --------
    >>> wanted = st.Contingency("7-8@0.4", clear="22cyc")
    >>> found = st.place(st.load("two_area"), wanted, candidates=[(1, 5)], observe="2s")
    >>> round(found.cost), [(site.bus, round(site.mw)) for site in found.sites]
    (47, [(5, 47)])
    """

    case: str
    sites: tuple[Site, ...]
    costs: Costs
    cost: float
    cuts_cost: float | None
    uniform_mw: float | None
    uniform_percent: float | None
    linear_mw: float | None
    contingencies: tuple[Survived, ...]
    infeasible: tuple[Infeasible, ...]
    evidence: tuple[Evidence, ...]
    history: tuple[Iteration, ...]
    observed_s: float
    simulations: int
    wall_s: float
    candidates: tuple[CandidateSite, ...] = ()
    title: str = ""
    existing: tuple[Storage, ...] = ()
    controllers: tuple[str, ...] = ()
    law: str = ""
    targets: str = ""
    tolerance: float | None = None
    criteria: str = ""
    cuts_mw: float | None = None
    devices: tuple[Storage, ...] = ()

    plot = verb("stabctl.view.figures.siting:plot")
    report = verb("stabctl.view.pages.siting_page:write")

    @property
    def total_mw(self) -> float:
        """Megawatts of the fleet."""
        return sum(s.mw for s in self.sites)

    @property
    def total_mva(self) -> float:
        """Megavolt-amperes of the fleet."""
        return sum(s.mva or s.mw for s in self.sites)

    @property
    def converters(self) -> tuple[Site, ...]:
        """The sites with converters."""
        return tuple(s for s in self.sites if s.limit is not None)

    @property
    def total_mwh(self) -> float:
        """Megawatt-hours of the fleet."""
        return sum(s.mwh for s in self.sites)

    @property
    def percent_of_uniform(self) -> float | None:
        """The fleet's megawatts in percent of the uniform fleet's."""
        return 100 * self.total_mw / self.uniform_mw if self.uniform_mw else None

    @property
    def gap(self) -> float | None:
        """Distance of the cost from `cuts_cost`, relative to the cost; None without that."""
        if self.cuts_cost is None:
            return None
        return 1 - self.cuts_cost / self.cost if self.cost else 0.0

    @property
    def smaller(self) -> tuple[Evidence, ...]:
        """Fleets with less storage that survive everything too; none if a tolerance was required."""
        asked = self.sites and self.tolerance is None
        return tuple(row for row in self.evidence if asked and row.smaller and not row.lost)

    def storage(self, **options: Any) -> tuple[Storage, ...]:
        """The devices, for `simulate(storage=...)`, with the properties that they were sized with.

        Parameters
        ----------
        **options
            Other values of fields of `Storage`, such as lag.

        Returns
        -------
        tuple of Storage

        Examples
        --------
        >>> wanted = st.Contingency("7-8@0.4", clear="22cyc")
        >>> found = st.place(st.load("two_area"), wanted, candidates=[(1, 5)], observe="2s")
        >>> [device.lag for device in found.storage(lag=0.05)]
        [0.05]
        """
        return tuple(device._replace(**options) for device in self.devices)

    @property
    def df(self) -> "pd.DataFrame":
        """The devices of the fleet, a row each, with their caps; of converters also the current that sets their MVA.

        `lost_if_smaller` and `lost_if_larger` count the scenarios that are lost with another size at this site alone.
        """
        import pandas as pd

        caps = {(c.bus, c.machine): c.cap_mw for c in self.candidates}
        rows = [(*s, caps.get((s.bus, s.machine)), *self._lost_at(s)) for s in self.sites]
        table = pd.DataFrame(rows, columns=[*Site._fields, "cap_mw", "lost_if_smaller", "lost_if_larger"])
        return table if self.converters else table.drop(columns=["current", "limit", "voltage", "worst"])

    @property
    def clearing_times(self) -> "pd.DataFrame":
        """The contingencies, a row each: target, critical clearing time and margin with the fleet (cycles).

        A fault that is survived up to the longest clearing time tried has no critical time. Those that no fleet
        survives are the last rows, without times and not stable.
        """
        import pandas as pd

        rows: list[tuple[object, ...]] = [
            (c.label, c.target_cycles, c.critical_cycles, c.margin_cycles, c.stable, c.binding, c.machine)
            for c in self.contingencies
        ]
        rows += [(lost.label, lost.target_cycles, None, None, False, False, None) for lost in self.infeasible]
        columns = ["contingency", "target_cycles", "critical_cycles", "margin_cycles", "stable", "binding", "machine"]
        numbers = dict.fromkeys(("target_cycles", "critical_cycles", "margin_cycles"), float)
        return machine_column(pd.DataFrame(rows, columns=columns).astype(numbers))

    def _lost_at(self, site: Site) -> list[int | None]:
        """Scenarios lost with a smaller and with a larger size at a site."""
        rows = [row for row in self.evidence if row.site == f"{site.machine}@{site.bus}"]
        return [next((row.lost for row in rows if (row.scale < 1) == less), None) for less in (True, False)]

    def remarks(self) -> tuple[str, ...]:
        """The result in sentences."""
        return remarks(self)

    def reservations(self) -> tuple[str, ...]:
        """What the fleet does not survive, what the solver missed, and which smaller fleets are sufficient."""
        return reservations(self)

    def __str__(self) -> str:
        lines = [self.remarks()[0], *sites(self)]
        rows: list[tuple[Survived | Infeasible, str, str]] = [
            *((c, c.critical or "-", "  binding" * c.binding) for c in self.contingencies),
            *((lost, "lost", "  with every fleet tried") for lost in self.infeasible),
        ]
        width = max(26, *(len(row.label) for row, *_ in rows))
        lines.append(f"{'contingency':{width}s}  target  critical, cycles")
        for row, critical, more in rows:
            target = "-" if row.target_cycles is None else f"{row.target_cycles:.3f}"
            lines.append(f"{row.label:{width}s} {target:>7s} {critical:>9s}{more}")
        return "\n".join([*lines, *self.remarks()[1:]])

    def _head(self) -> str:
        return "\n".join(self.remarks())


def sites(siting: Siting) -> Iterator[str]:
    """The rows of the table of sites, with MVA where there are converters."""
    rated = bool(siting.converters) or any(s.mva not in (0.0, s.mw) for s in siting.sites)
    heads = "      MVA " if rated else "", "  MVA set by" if siting.converters else ""
    yield f"   bus machine        MW {heads[0]}      kWh{heads[1]}"
    for s in siting.sites:
        mva = f"{s.mva or s.mw:9.2f} " if rated else ""
        yield f"{s.bus:6d} {s.machine!s:>7s} {s.size:>9s} {mva}{1e3 * s.mwh:9.1f}{'  ' if s.set_by else ''}{s.set_by}"


def remarks(siting: Siting) -> tuple[str, ...]:
    """The fleet, what it is compared with, and what is left open."""
    survived = counted(len(siting.contingencies), "contingency")
    rows: list[Survived | Infeasible] = [*siting.contingencies, *siting.infeasible]
    if any(row.operating_point or row.out for row in rows):
        survived = counted(len(siting.contingencies), "scenario")
    if siting.infeasible:
        survived += f" of {len(siting.contingencies) + len(siting.infeasible)}"
    kept = f" and judged by {siting.criteria}" if siting.criteria else ""
    first = (
        f"{siting.case}: {counted(len(siting.sites), 'site')} with {siting.total_mw:.1f} MW and "
        f"{1e3 * siting.total_mwh:.0f} kWh survive {survived}, each observed {siting.observed_s:g} s after "
        f"the last event{kept} ({counted(siting.simulations, 'simulation')} in {siting.wall_s:.1f} s)."
    )
    if siting.infeasible:
        left_out = "; ".join(one.label for one in siting.infeasible)
        first += f" No fleet within the caps was found that survives {left_out}."
    targets = (siting.targets,) if siting.targets else ()
    return (
        first,
        *targets,
        *_converters(siting),
        *_acting(siting),
        *_comparisons(siting),
        *_cuts(siting),
        *reservations(siting),
    )


def _converters(siting: Siting) -> Iterator[str]:
    """The MVA of the converters, and how far the contingencies use them."""
    found = siting.converters
    if not found:
        return
    limited, rest = [s for s in found if s.limited], [s for s in found if not s.limited]
    share = siting.total_mva / siting.total_mw
    yield f"The converters have {siting.total_mva:.1f} MVA in all, {100 * share:.0f} % of the MW."
    if limited:
        voltages = sorted(s.voltage or 0.0 for s in limited)
        given = sorted(100 * (s.limit or 0.0) * (s.voltage or 0.0) * (s.mva or s.mw) / s.mw for s in limited)
        yield (
            f"The current limit is reached at {len(limited)} of {counted(len(found), 'site')}, down to voltages of "
            f"{_range(voltages, '.2f')} pu, at which it allows {_range(given, '.0f')} % of the MW."
        )
    if rest:
        free = min(1 - (s.current or 0.0) / (s.limit or 1.0) for s in rest)
        others = "The others have" if limited else "All have"
        yield f"{others} at least {100 * free:.2g} % of the current to spare in every contingency."


def _range(values: list[float], form: str) -> str:
    """The least and the largest of ascending values, or the only one."""
    ends = list(dict.fromkeys(f"{x:{form}}" for x in (values[0], values[-1])))
    return " to ".join(ends)


def _acting(siting: Siting) -> Iterator[str]:
    """What acts beside the fleet, and its law."""
    if siting.existing:
        total = sum(s.rating for s in siting.existing)
        yield f"{counted(len(siting.existing), 'existing device')} with {total:.1f} MW in all are kept."
    if siting.law and siting.law != str(BangBang()):
        yield f"The devices follow the law {siting.law}."
    if siting.controllers:
        yield f"In every simulation act {'; '.join(siting.controllers)}."


def _comparisons(siting: Siting) -> Iterator[str]:
    """The uniform fleet and the allocation by linear analysis."""
    if siting.uniform_mw == 0:
        yield f"The system survives {_every(siting)} even without {'further ' * bool(siting.existing)}storage."
    elif siting.uniform_mw:
        yield (
            f"A uniform fleet would need at least {siting.uniform_mw:.1f} MW ({siting.uniform_percent:.2f} % of the "
            "machine's MVA at every candidate site, up to its cap); this fleet needs "
            f"{siting.percent_of_uniform:.0f} % of that."
        )
    else:
        yield "No uniform fleet within the caps is sufficient."
    if siting.linear_mw:
        yield f"The allocation by linear analysis needs {siting.linear_mw:.1f} MW."
    elif siting.linear_mw is None:
        yield "No multiple of the allocation by linear analysis within the caps is sufficient."
    if siting.tolerance is not None and (siting.uniform_mw or siting.linear_mw):
        yield "The uniform fleet and the linear allocation are sized without the tolerance."


def _cuts(siting: Siting) -> Iterator[str]:
    if not siting.cost:
        return
    if siting.cuts_cost is None or siting.gap is None:
        yield f"Cost {siting.cost:.5g}; what the cuts allow is unknown, because the solver failed."
        return
    yield (
        f"Cost {siting.cost:.5g}; the cuts allow {siting.cuts_cost:.5g} ({100 * siting.gap:.1f} % less). That is no "
        "lower bound, because the set of surviving fleets need not be convex."
    )


def reservations(siting: Siting) -> tuple[str, ...]:
    """What the fleet does not survive, what the solver missed, and which smaller fleets are sufficient."""
    said = [*(f"Not survived: {one}" for one in siting.infeasible), *_solver(siting)]
    rows = siting.evidence
    longer = any(row.lost for row in rows if row.longer)  # otherwise simulations that are refined too say enough
    for row in rows:
        if row.refined or row.control or (row.longer and longer):
            what = row.setting or f"the control '{row.control}'"
            fleet = "this fleet" if row.scale == 1 else f"this fleet, enlarged to {row.scale:.4g} times its MW,"
            fleet = fleet if siting.sites else f"the system without {'further ' * bool(siting.existing)}storage"
            lost = _lost(siting, row)
            advice = "; use a longer observation window" if row.setting else ""
            found = f"does not survive {lost}{advice}" if lost else f"survives {_every(siting)}"
            said.append(f"With {what}, {fleet} {found}.")
    if growing := [c.label for c in siting.contingencies if c.growing]:
        said.append(
            f"The swings after {', '.join(growing)} grow within the {siting.observed_s:g} s observed; with a longer "
            "observation window, stability may be lost."
        )
    said += _other_sizes(siting)
    also = f"survives {_every(siting)} too, so a smaller fleet is possible"
    said += [f"The fleet {row.fleet} {also}." for row in siting.smaller]
    return tuple(said)


def _solver(siting: Siting) -> Iterator[str]:
    """Programs that the solver did not solve accurately, could not solve, or solved with violated cuts."""
    count = counted(len(siting.history), "iteration")
    for i, row in enumerate(siting.history, start=1):
        if row.failed:
            yield (
                f"The solver failed in iteration {i} ({row.status}); the search ended there, and the fleet is the best "
                "one found until then."
            )
    inaccurate = sum(row.status == "optimal_inaccurate" for row in siting.history)
    if inaccurate:
        yield (
            f"In {inaccurate} of {count} the solver did not reach its tolerances (optimal_inaccurate); each fleet was "
            "simulated nevertheless, but what the cuts allow may be inaccurate."
        )
    slack = [row.slack for row in siting.history if row.slack > SLACK]
    if slack:
        yield (
            f"In {len(slack)} of {count} no fleet within the caps, sites and trust region satisfied every cut (largest "
            f"violation {100 * max(slack):.3g} % of the contribution of one device)."
        )


def _other_sizes(siting: Siting) -> Iterator[str]:
    """What the fleet does not survive if one device alone is smaller or larger."""
    rows = [row for row in siting.evidence if row.site]
    if rows and not any(row.lost for row in rows):
        changed = 100 * abs(rows[0].scale - 1)
        yield f"The fleet survives {_every(siting)} also if any one site has {changed:g} % less or more."
        return
    for less in (False, True):
        tried = [row for row in rows if (row.scale < 1) == less]
        if lost := [row for row in tried if row.lost]:
            changed, count = 100 * abs(lost[0].scale - 1), counted(len(tried), "site")
            named = "; ".join(f"{row.site} loses {_lost(siting, row)}" for row in lost)
            yield (
                f"With {changed:g} % {'less' if less else 'more'} at one site alone, the fleet is not sufficient for "
                f"{len(lost)} of {count}: {named}."
            )


def _every(siting: Siting) -> str:
    """What a fleet is simulated against."""
    return f"every {'other ' * bool(siting.infeasible)}contingency"


def _lost(siting: Siting, row: Evidence) -> str:
    """The scenarios that a variant of the fleet does not survive."""
    return ", ".join(c.label for c, ok in zip(siting.contingencies, row.stable, strict=True) if not ok)

"""The result of a siting study: a storage fleet, its cost, and the evidence that it survives every contingency."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from stabctl._util.tabular import Tabular, machine_column
from stabctl._util.verbs import verb
from stabctl.model.case import Storage

from . import siting_text
from .siting_rows import CandidateSite, Costs, Evidence, Infeasible, Iteration, Site, Survived

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Siting(Tabular):
    """The cheapest storage fleet found that survives every contingency in nonlinear simulation.

    Attributes
    ----------
    case, title : str
        Name and title of the case.
    sites : tuple of Site
        The devices, largest first.
    costs : Costs
        What was minimized.
    cost : float
        Cost of the fleet.
    lower_bound : float or None
        Lower bound of the cost, estimated from the cutting planes; None if the solver failed.
    uniform_mw, uniform_percent : float or None, MW and percent of machine MVA
        Smallest uniform fleet that survives everything; None if there is none within the caps.
    linear_mw : float or None, MW
        Allocation by linear analysis, scaled until it survives everything.
    contingencies, infeasible : tuple
        Contingencies that the fleet survives, and those that no fleet tried survives.
    evidence : tuple of Evidence
        Variants of the fleet.
    history : tuple of Iteration
        Iterations of the search.
    observed_s : float, s
        Observation window after clearing.
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
    """

    case: str
    sites: tuple[Site, ...]
    costs: Costs
    cost: float
    lower_bound: float | None
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

    plot = verb("stabctl.plotting.siting:plot")
    report = verb("stabctl.report.siting_page:write")

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
    def lower_bound_mw(self) -> float | None:
        """The estimated lower bound in MW, if only megawatts have a cost."""
        priced = self.costs.site or self.costs.mwh
        return None if priced or self.lower_bound is None else self.lower_bound / self.costs.mw

    @property
    def percent_of_uniform(self) -> float | None:
        """The fleet's megawatts in percent of the uniform fleet's."""
        return 100 * self.total_mw / self.uniform_mw if self.uniform_mw else None

    @property
    def gap(self) -> float | None:
        """Distance of the cost from the estimated bound, relative to the cost; None without a bound."""
        if self.lower_bound is None:
            return None
        return 1 - self.lower_bound / self.cost if self.cost else 0.0

    @property
    def smaller(self) -> tuple[Evidence, ...]:
        """Fleets with less storage that survive everything too; none if a tolerance was required."""
        asked = self.sites and self.tolerance is None
        return tuple(row for row in self.evidence if asked and row.smaller and not row.lost)

    def storage(self, **options: Any) -> tuple[Storage, ...]:
        """The devices, for `simulate(storage=...)`.

        Parameters
        ----------
        **options
            Fields of `Storage`, such as lag.

        Returns
        -------
        tuple of Storage
        """
        return tuple(
            Storage(s.machine, s.bus, s.mw, **{"mva": 0.0 if s.mva == s.mw else s.mva, **options}) for s in self.sites
        )

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
        """The contingencies, a row each: target, critical clearing time and margin with the fleet (cycles)."""
        import pandas as pd

        rows = [
            (c.label, c.target_cycles, c.critical_cycles, c.margin_cycles, c.stable, c.binding, c.machine)
            for c in self.contingencies
        ]
        columns = ["contingency", "target_cycles", "critical_cycles", "margin_cycles", "stable", "binding", "machine"]
        numbers = dict.fromkeys(("target_cycles", "critical_cycles", "margin_cycles"), float)
        return machine_column(pd.DataFrame(rows, columns=columns).astype(numbers))

    def _lost_at(self, site: Site) -> list[int | None]:
        """Scenarios lost with a smaller and with a larger size at a site."""
        rows = [row for row in self.evidence if row.site == f"{site.machine}@{site.bus}"]
        return [next((row.lost for row in rows if (row.scale < 1) == less), None) for less in (True, False)]

    def remarks(self) -> tuple[str, ...]:
        """The result in sentences."""
        return siting_text.remarks(self)

    def reservations(self) -> tuple[str, ...]:
        """What the fleet does not survive, what the solver missed, and which smaller fleets are sufficient."""
        return siting_text.reservations(self)

    def __str__(self) -> str:
        lines = [self.remarks()[0], *siting_text.sites(self)]
        width = max([26, *(len(c.label) for c in self.contingencies)])
        lines.append(f"{'contingency':{width}s}  target  critical, cycles")
        for c in self.contingencies:
            target = "-" if c.target_cycles is None else f"{c.target_cycles:.3f}"
            found = "none" if c.critical_cycles is None else f"{c.critical_cycles:.3f}"
            found = "-" if c.target_cycles is None else found
            binding = "  binding" if c.binding else ""
            lines.append(f"{c.label:{width}s} {target:>7s} {found:>9s}{binding}")
        return "\n".join([*lines, *self.remarks()[1:]])

    def _head(self) -> str:
        return "\n".join(self.remarks())

"""The result of a siting study: a storage fleet, its cost, and the evidence that it survives every contingency."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from stabctl._util.tabular import Tabular, machine_column
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.model.case import Storage

from .siting_rows import REFINED, CandidateSite, Costs, Evidence, Infeasible, Iteration, Site, Survived

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Siting(Tabular):
    """The cheapest storage fleet found that survives every contingency in nonlinear simulation."""

    case: str
    sites: tuple[Site, ...]  # largest first
    costs: Costs
    cost: float  # of the fleet
    lower_bound: float  # cost, estimated from the cutting planes
    uniform_mw: float | None  # smallest uniform fleet, by machine MVA, that survives everything; None within the caps
    uniform_percent: float | None  # of machine MVA
    linear_mw: float | None  # the allocation by linear analysis, scaled until it survives everything
    contingencies: tuple[Survived, ...]
    infeasible: tuple[Infeasible, ...]
    evidence: tuple[Evidence, ...]
    history: tuple[Iteration, ...]
    observed_s: float  # s   observation window after clearing
    simulations: int
    wall_s: float
    candidates: tuple[CandidateSite, ...] = ()
    title: str = ""  # of the case
    targets: str = ""  # where the clearing times to be survived come from, as a sentence; empty if they were given

    plot = verb("stabctl.plotting.siting:plot")
    report = verb("stabctl.report.siting_page:write")

    @property
    def total_mw(self) -> float:
        """Megawatts of the fleet."""
        return sum(s.mw for s in self.sites)

    @property
    def total_mwh(self) -> float:
        """Megawatt-hours of the fleet."""
        return sum(s.mwh for s in self.sites)

    @property
    def lower_bound_mw(self) -> float | None:
        """The estimated lower bound in MW, if only megawatts have a cost."""
        return None if self.costs.site or self.costs.mwh else self.lower_bound / self.costs.mw

    @property
    def percent_of_uniform(self) -> float | None:
        """The fleet's megawatts in percent of the uniform fleet's."""
        return 100 * self.total_mw / self.uniform_mw if self.uniform_mw else None

    @property
    def gap(self) -> float:
        """Distance of the cost from the estimated bound, relative to the cost."""
        return 1 - self.lower_bound / self.cost if self.cost else 0.0

    @property
    def smaller(self) -> tuple[Evidence, ...]:
        """Fleets with less storage that survive everything too."""
        return tuple(row for row in self.evidence if self.sites and row.smaller and not row.lost)

    def storage(self, **options: Any) -> tuple[Storage, ...]:
        """The devices, for `simulate(storage=...)`; options are fields of `Storage`."""
        return tuple(Storage(s.machine, s.bus, s.mw, **options) for s in self.sites)

    @property
    def df(self) -> "pd.DataFrame":
        """The devices of the fleet, a row each, with their caps."""
        import pandas as pd

        caps = {(c.bus, c.machine): c.cap_mw for c in self.candidates}
        rows = [(*s, caps.get((s.bus, s.machine))) for s in self.sites]
        return pd.DataFrame(rows, columns=[*Site._fields, "cap_mw"])

    @property
    def clearing_times(self) -> "pd.DataFrame":
        """The contingencies, a row each: target, critical clearing time and margin with the fleet (cycles)."""
        import pandas as pd

        rows = [
            (c.contingency.label, c.target_cycles, c.critical_cycles, c.margin_cycles, c.stable, c.binding, c.machine)
            for c in self.contingencies
        ]
        columns = ["contingency", "target_cycles", "critical_cycles", "margin_cycles", "stable", "binding", "machine"]
        return machine_column(pd.DataFrame(rows, columns=columns).astype({"critical_cycles": float}))

    def remarks(self) -> tuple[str, ...]:
        """The result in sentences."""
        survived = counted(len(self.contingencies), "contingency")
        if self.infeasible:
            survived += f" of {len(self.contingencies) + len(self.infeasible)}"
        said = [
            f"{self.case}: {counted(len(self.sites), 'site')} with {self.total_mw:.1f} MW and "
            f"{1e3 * self.total_mwh:.0f} kWh survive {survived}, each observed {self.observed_s:g} s after clearing "
            f"({counted(self.simulations, 'simulation')} in {self.wall_s:.1f} s)."
        ]
        if self.infeasible:
            left_out = "; ".join(one.contingency.label for one in self.infeasible)
            said[0] += f" No fleet within the caps was found that survives {left_out}."
        if self.uniform_mw == 0:
            said.append("The system survives every contingency even without storage.")
        elif self.uniform_mw:
            said.append(
                f"A uniform fleet would need at least {self.uniform_mw:.1f} MW ({self.uniform_percent:.2f} % of every "
                f"machine's MVA); this fleet needs {self.percent_of_uniform:.0f} % of that."
            )
        else:
            said.append("No uniform fleet within the caps is sufficient.")
        if self.linear_mw:
            said.append(f"The allocation by linear analysis needs {self.linear_mw:.1f} MW.")
        elif self.linear_mw is None:
            said.append("No multiple of the allocation by linear analysis within the caps is sufficient.")
        if self.cost:
            said.append(
                f"Cost {self.cost:.4g}, estimated lower bound {self.lower_bound:.4g} ({100 * self.gap:.1f} % lower). "
                "The bound is an estimate, because the set of surviving fleets need not be convex."
            )
        if self.targets:
            said.insert(1, self.targets)
        return (*said, *self.reservations())

    def reservations(self) -> tuple[str, ...]:
        """What the fleet does not survive, also in refined simulations, and which smaller fleets are sufficient."""
        said = [f"Not survived: {one}" for one in self.infeasible]
        for row in self.evidence:
            if row.refined:
                fleet = f"{row.scale:g} times this fleet" if self.sites else "the system without storage"
                lost = [c.contingency.label for c, ok in zip(self.contingencies, row.stable, strict=True) if not ok]
                said.append(
                    f"With {REFINED}, {fleet} does not survive {'; '.join(lost)}; use a longer observation window."
                    if lost
                    else f"With {REFINED}, {fleet} survives every contingency."
                )
        also = "survives every contingency too, so a smaller fleet is possible"
        said += [f"The fleet {row.fleet} {also}." for row in self.smaller]
        return tuple(said)

    def __str__(self) -> str:
        lines = [self.remarks()[0], "   bus machine        MW       kWh"]
        lines += [f"{s.bus:6d} {s.machine:7d} {s.mw:9.2f} {1e3 * s.mwh:9.1f}" for s in self.sites]
        lines.append("contingency                 target  critical, cycles")
        for c in self.contingencies:
            found = "none" if c.critical_cycles is None else f"{c.critical_cycles:.3f}"
            binding = "  binding" if c.binding else ""
            lines.append(f"{c.contingency.label:26s} {c.target_cycles:7.3f} {found:>9s}{binding}")
        return "\n".join([*lines, *self.remarks()[1:]])

    def _head(self) -> str:
        return "\n".join(self.remarks())

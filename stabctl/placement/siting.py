"""The answer of the siting program: a fleet, what it costs, and the proof that it does what was asked."""

from dataclasses import dataclass
from typing import NamedTuple

from stabctl._util.wording import counted

from .contingency import Contingency

FINER = "half the step, twice as long"


class Costs(NamedTuple):
    """What storage costs, in any one currency."""

    mw: float = 1.0  # per MW
    site: float = 0.0  # per site
    mwh: float = 0.0  # per MWh, by what a MW of each candidate takes in with the uniform fleet


class Site(NamedTuple):
    """A storage device that was chosen."""

    bus: int
    machine: int
    mw: float
    mwh: float  # energy it took or gave in the hardest run, and so has to hold


class Place(NamedTuple):
    """A candidate, and what the uniform fleet has there."""

    bus: int
    machine: int
    cap_mw: float
    uniform_mw: float | None  # None: no uniform fleet survives everything


class Survived(NamedTuple):
    """A contingency and how far the fleet carries it."""

    contingency: Contingency
    target_cycles: float
    critical_cycles: float | None  # with the fleet, on a grid that holds the target; None: unstable at any
    machine: int | None  # goes first just beyond
    stable: bool  # simulated at the target
    binding: bool  # lost with 3 % less of the fleet

    @property
    def margin_cycles(self) -> float:
        """Cycles from the target to the critical clearing time."""
        return (self.critical_cycles or 0.0) - self.target_cycles


class Incurable(NamedTuple):
    """A contingency that no fleet tried survives."""

    contingency: Contingency
    target_cycles: float
    alone_cycles: float | None  # critical clearing time without storage
    tried: int  # fleets

    def __str__(self) -> str:
        without = "at no clearing time" if self.alone_cycles is None else f"up to {self.alone_cycles:.2f} cycles"
        return (
            f"{self.contingency.name} at {self.target_cycles:.2f} cycles: none of {self.tried} fleets within the caps "
            f"survives it (without storage it is survived {without})."
        )


class Evidence(NamedTuple):
    """A fleet near the one chosen, or another simulation or control of it, put to every contingency."""

    mw: float
    critical_cycles: tuple[float | None, ...]
    stable: tuple[bool, ...]  # at the targets
    scale: float = 1.0  # of all sizes
    without: str | None = None  # the device (machine@bus) that is left out
    finer: bool = False  # simulated at half the step, watched twice as long
    control: str | None = None  # another than the law itself

    @property
    def fleet(self) -> str:
        """What it is, in words."""
        if self.without:
            return f"without {self.without}"
        said = [self.control] if self.control else [FINER] if self.finer else []
        return ", ".join(said if self.control and self.scale == 1 else [f"x{self.scale:g}", *said])

    @property
    def less(self) -> bool:
        """Is there less of it than of the fleet that was chosen?"""
        return self.scale < 1 or self.without is not None

    @property
    def lost(self) -> int:
        """Contingencies that are lost."""
        return self.stable.count(False)


class Round(NamedTuple):
    """A round of the program; costs in those of a MW, as given."""

    planned: float  # cost of the master's answer
    reached: float  # of the same, scaled until it survives; inf where it cannot be
    best: float  # of the best fleet so far
    sites: int  # of the best fleet


@dataclass(frozen=True)
class Siting:
    """The smallest (cheapest) fleet found that survives every contingency in the nonlinear simulation."""

    case: str
    sites: tuple[Site, ...]  # largest first
    costs: Costs
    cost: float  # of the fleet
    lower_bound: float  # cost; estimated: what the cuts allow
    uniform_mw: float | None  # smallest uniform fleet, by machine MVA, that survives all; None: none within the caps
    uniform_percent: float | None  # of machine MVA
    linear_mw: float | None  # the linear stage's allocation, scaled until it survives all
    contingencies: tuple[Survived, ...]
    incurable: tuple[Incurable, ...]
    evidence: tuple[Evidence, ...]
    history: tuple[Round, ...]
    observed_s: float  # s   watched after clearing
    simulations: int
    wall_s: float
    places: tuple[Place, ...] = ()  # every candidate
    title: str = ""  # of the case

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
        """The estimated lower bound in MW, where nothing but a MW costs anything."""
        return None if self.costs.site or self.costs.mwh else self.lower_bound / self.costs.mw

    @property
    def percent_of_uniform(self) -> float | None:
        """The fleet's megawatts in percent of the uniform fleet's."""
        return 100 * self.total_mw / self.uniform_mw if self.uniform_mw else None

    @property
    def gap(self) -> float:
        """How far the cost is above the estimated bound, relative to the cost."""
        return 1 - self.lower_bound / self.cost if self.cost else 0.0

    @property
    def spared(self) -> tuple[Evidence, ...]:
        """Fleets of less that survive everything all the same."""
        return tuple(r for r in self.evidence if self.sites and r.less and not r.lost)

    def remarks(self) -> tuple[str, ...]:
        """What was found, in sentences."""
        said = [
            f"{self.case}: {self.total_mw:.1f} MW and {1e3 * self.total_mwh:.0f} kWh at "
            f"{counted(len(self.sites), 'site')} survive {counted(len(self.contingencies), 'contingency')}, each "
            f"watched {self.observed_s:g} s after clearing ({counted(self.simulations, 'simulation')} in "
            f"{self.wall_s:.1f} s)."
        ]
        if self.uniform_mw == 0:
            said.append("Everything is survived without storage.")
        elif self.uniform_mw:
            said.append(
                f"A uniform fleet that does the same has {self.uniform_mw:.1f} MW ({self.uniform_percent:.2f} % of "
                f"every machine's MVA): this one has {self.percent_of_uniform:.0f} % of it."
            )
        else:
            said.append("No uniform fleet within the caps does the same.")
        if self.linear_mw:
            said.append(f"What the linear stage shares out does the same with {self.linear_mw:.1f} MW.")
        elif self.linear_mw is None:
            said.append("What the linear stage shares out does not do the same at any scale within the caps.")
        if self.cost:
            said.append(
                f"Cost {self.cost:.4g}, estimated lower bound {self.lower_bound:.4g} ({100 * self.gap:.1f} % below; an "
                "estimate, since the fleets that survive need not form a convex set)."
            )
        return (*said, *self.reservations())

    def reservations(self) -> tuple[str, ...]:
        """What is not cured, what finer runs lose, and where less would do, in sentences."""
        said = [f"Left out: {one}" for one in self.incurable]
        for row in self.evidence:
            if row.finer:
                lost = [c.contingency.name for c, ok in zip(self.contingencies, row.stable, strict=True) if not ok]
                these = f"x{row.scale:g} of these sizes" if self.sites else "the system without storage"
                said.append(
                    f"At half the step, watched twice as long, {these} survives everything."
                    if not lost
                    else f"At half the step, watched twice as long, even {these} is lost to "
                    f"{'; '.join(lost)}: watch longer (--observe)."
                )
        said += [f"The fleet {row.fleet} survives everything too: it is not a least one." for row in self.spared]
        return tuple(said)

    def __str__(self) -> str:
        lines = [self.remarks()[0], "   bus machine        MW       kWh"]
        lines += [f"{s.bus:6d} {s.machine:7d} {s.mw:9.2f} {1e3 * s.mwh:9.1f}" for s in self.sites]
        lines.append("contingency                 target  critical, cycles")
        for c in self.contingencies:
            found = "none" if c.critical_cycles is None else f"{c.critical_cycles:.3f}"
            lines.append(
                f"{c.contingency.name:26s} {c.target_cycles:7.3f} {found:>9s}" + ("  binding" if c.binding else "")
            )
        return "\n".join([*lines, *self.remarks()[1:]])

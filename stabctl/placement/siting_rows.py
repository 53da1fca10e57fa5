"""The parts of a siting result: costs, sites, contingencies, evidence, iterations."""

from typing import NamedTuple

from stabctl.simulation.contingency import Contingency

SAME = 1e-3  # relative difference of currents that count as equal
LONGER = "twice the observation window"
REFINED = f"half the time step and {LONGER}"


class Costs(NamedTuple):
    """What storage costs, in any one currency, where a site has no costs of its own.

    Parameters
    ----------
    mw, site, mwh : float
        Cost of a MW, of a site, and of a MWh.

    Examples
    --------
    >>> wanted, costs = st.Contingency("7-8@0.4", clear="22cyc"), st.Costs(mw=1.0, site=20.0)
    >>> found = st.place(st.load("two_area"), wanted, candidates=[(1, 5)], costs=costs, observe="2s")
    >>> round(found.cost - found.total_mw)
    20
    """

    mw: float = 1.0  # per MW
    site: float = 0.0  # per site
    mwh: float = 0.0  # per MWh


class Site(NamedTuple):
    """A chosen storage device."""

    bus: int
    machine: int | str  # name or number
    mw: float
    mwh: float  # energy it absorbs or injects in the worst contingency: the required capacity
    mva: float = 0.0  # 0: as many as MW
    current: float | None = None  # pu on the MVA of its converter, the largest in any contingency; None: ideal device
    limit: float | None = None  # pu   of the current
    voltage: float | None = None  # pu   of the bus with that current, the lowest if several
    worst: str = ""  # the contingency in which that current flows

    @property
    def limited(self) -> bool:
        """Whether the current of its converter reaches the limit."""
        return self.current is not None and self.limit is not None and self.current >= (1 - SAME) * self.limit

    @property
    def set_by(self) -> str:
        """What sets the MVA: the current limit at a low voltage, or the power rating; empty for an ideal device."""
        if self.current is None:
            return ""
        if self.limited:
            return f"current limit of {self.limit:g} pu at {self.voltage:.2f} pu"
        return f"power rating; current {self.current:.2f} of {self.limit:g} pu"

    @property
    def size(self) -> str:
        """Megawatts with two decimals, or more in systems of a few MW."""
        return f"{self.mw:.2f}" if round(self.mw, 2) == self.mw else f"{self.mw:g}"


class CandidateSite(NamedTuple):
    """A site where a storage device was allowed."""

    bus: int
    machine: int | str
    cap_mw: float
    uniform_mw: float | None  # of the uniform fleet; None if no uniform fleet survives everything


def label(contingency: Contingency, operating_point: str, out: str) -> str:
    """A scenario in words: `16 trip 16-21, load 90 %, without 9@29`."""
    return ", ".join(filter(None, (contingency.label, operating_point, f"without {out}" if out else "")))


class Survived(NamedTuple):
    """A scenario and its critical clearing time with the fleet."""

    contingency: Contingency
    target_cycles: float | None  # None: without a fault
    critical_cycles: float | None  # on a grid that contains the target; None: no fault, or there is none
    machine: int | str | None  # loses synchronism first just beyond the critical time
    stable: bool  # in the simulation at the target
    binding: bool  # unstable with 3 % less storage
    operating_point: str = ""  # if there are several
    out: str = ""  # the device out of service: machine@bus, or "existing machine@bus"
    growing: bool = False  # the swings grow in the simulation at the target
    longest_cycles: float | None = None  # of the faults tried, if that is stable and there is no critical time

    @property
    def label(self) -> str:
        """The contingency, and the operating point and the device out of service if there are any."""
        return label(self.contingency, self.operating_point, self.out)

    @property
    def margin_cycles(self) -> float | None:
        """Critical clearing time minus target, cycles; None if there is none."""
        if self.target_cycles is None or self.critical_cycles is None:
            return None
        return self.critical_cycles - self.target_cycles

    @property
    def critical(self) -> str:
        """The critical clearing time in cycles; empty without a fault."""
        if self.target_cycles is None:
            return ""
        if self.longest_cycles is not None:
            return f"{self.longest_cycles:.4g} or more"
        return "none" if self.critical_cycles is None else f"{self.critical_cycles:.3f}"


class Infeasible(NamedTuple):
    """A scenario that no fleet tried survives."""

    contingency: Contingency
    target_cycles: float | None  # None: without a fault
    alone_cycles: float | None  # critical clearing time without the fleet, existing devices in service
    tried: int  # fleets
    operating_point: str = ""  # if there are several
    out: str = ""  # the device out of service: machine@bus, or "existing machine@bus"
    existing: bool = False  # there are existing devices

    @property
    def label(self) -> str:
        """The contingency, and the operating point and the device out of service if there are any."""
        return label(self.contingency, self.operating_point, self.out)

    def __str__(self) -> str:
        none = f"none of the {self.tried} fleets tried within the caps survives it"
        if self.target_cycles is None:
            return f"{self.label}: {none}."
        alone = (
            "it is unstable at any clearing time"
            if self.alone_cycles is None
            else f"its critical clearing time is {self.alone_cycles:.2f} cycles"
        )
        without = f"without {'further ' * self.existing}storage"
        return f"{self.label} at {self.target_cycles:.2f} cycles: {none} ({without} {alone})."


class Evidence(NamedTuple):
    """The fleet, or a variant of it, simulated against every contingency."""

    mw: float
    critical_cycles: tuple[float | None, ...]  # empty: simulated at the targets only
    stable: tuple[bool, ...]  # at the targets
    scale: float = 1.0  # of all sizes, or of the one of `site`
    without: str | None = None  # the device (machine@bus) that is removed
    site: str | None = None  # the only device (machine@bus) that `scale` changes
    longer: bool = False  # simulated with twice the observation window
    refined: bool = False  # simulated with half the time step and twice the observation window
    control: str | None = None  # another controller

    @property
    def fleet(self) -> str:
        """The variant in words."""
        if self.without:
            return f"without {self.without}"
        if self.site:
            return f"{self.site} x{self.scale:.4g}"
        also = list(filter(None, [self.control or self.setting]))
        return ", ".join(also if self.control and self.scale == 1 else [f"x{self.scale:.4g}", *also])

    @property
    def setting(self) -> str:
        """How it was simulated, if not as in the search."""
        return REFINED if self.refined else LONGER * self.longer

    @property
    def smaller(self) -> bool:
        """Whether it has less storage than the fleet."""
        return self.scale < 1 or self.without is not None

    @property
    def lost(self) -> int:
        """Number of contingencies that it does not survive."""
        return self.stable.count(False)


class Iteration(NamedTuple):
    """An iteration of the siting program; costs in the given currency."""

    planned: float  # cost of the plan of the master program
    reached: float  # of the plan scaled until it survives everything; inf if no multiple does
    best: float  # of the best fleet so far
    sites: int  # of the best fleet
    status: str = "optimal"  # of the solver; "optimal_inaccurate", or why it failed
    slack: float = 0.0  # largest violation of a cut by the plan, relative to the largest contribution of one device

    @property
    def failed(self) -> bool:
        """Whether the solver found no plan."""
        return not self.status.startswith("optimal")

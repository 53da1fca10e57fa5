"""The result of a search for the optimal schedule: the orders, the run that verifies them, and the iterations."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl.clearing.result import ClearingTime, watched
from stabctl.clearing.search import Search
from stabctl.clearing.trial import Run
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.schedule import Schedule
from stabctl.simulation.trajectory import Trajectory

from .order_program import Bounds
from .schedule_search import Iteration

if TYPE_CHECKING:
    import pandas as pd

FULL = 0.99  # of a limit counts as all of it
ENDS = {
    "converged": "no step of the convex program improves it",
    "iterations": "stopped at the allowed number of convex programs",
    "limit": "stopped at the search limit",
}


@dataclass(frozen=True, repr=False)
class Optimum(Tabular):
    """A schedule of storage orders for the longest fault found that a system survives: a local optimum.

    Attributes
    ----------
    case, contingency
        The system and the fault.
    cycles, seconds
        The longest fault that is survived with a schedule.
    start
        The clearing time with the law alone.
    schedule
        The orders, and the law that takes over after them.
    run
        The simulated run of the schedule.
    proof
        How the search of clearing times judges it.
    before
        Frames of the schedule before clearing.
    iterations
        The convex programs.
    ended
        "converged", "iterations" or "limit".
    search
        The grid of clearing times and the criterion.
    bounds
        Limits of the orders.
    simulations, wall_s
        Number of simulations, and computing time (s).
    """

    case: str
    contingency: Contingency
    cycles: float
    seconds: float
    start: ClearingTime
    schedule: Schedule
    run: Trajectory
    proof: Run
    before: int
    iterations: tuple[Iteration, ...]
    ended: str
    search: Search
    bounds: Bounds
    simulations: int
    wall_s: float

    plot = verb("stabctl.plotting.optimum:plot")

    @property
    def time(self) -> np.ndarray:
        """Instants of the frames (frames), s after clearing."""
        return (np.arange(len(self.schedule.orders)) - self.before) / self.schedule.rate

    @property
    def cleared(self) -> float:
        """Instant of clearing in the run, s."""
        return self.schedule.start + self.before / self.schedule.rate

    @property
    def fault(self) -> Contingency:
        """The fault with its clearing time, at the instant for which the schedule was made; without other events."""
        return replace(self.contingency, at=self.cleared - self.seconds, clear=self.seconds, events=())

    @property
    def df(self) -> "pd.DataFrame":
        """The schedule: a row per frame, its time after clearing, and the power absorbed by every device, MW."""
        import pandas as pd

        power = self.schedule.orders * self.bounds.rating
        columns = {f"absorbed_mw:{name}": power[:, j] for j, name in enumerate(self.run.devices())}
        return pd.DataFrame({"time_s": self.time} | columns)

    @property
    def energy_kwh(self) -> np.ndarray:
        """Range of the energy of every device over the schedule (devices), kWh."""
        inside = self.run.time <= self.cleared + self.time[-1] + 1 / self.schedule.rate + 1e-9
        return 1e3 * np.ptp(self.run.arrays.energy[inside], axis=0)

    @property
    def peak(self) -> tuple[int | str, float, float]:
        """The rotor that swings most against the center of inertia, its angle (rad), and when (s after clearing)."""
        moves = np.abs(self.run.arrays.swing)
        row, rotor = np.unravel_index(int(moves.argmax()), moves.shape)
        return self.run.point.rotor_names[rotor], float(moves[row, rotor]), float(self.run.time[row] - self.cleared)

    @property
    def binding(self) -> tuple[str, ...]:
        """The limits that hold back the devices until the largest swing, as phrases."""
        until = self.cleared + self.peak[2]
        acting = (self.run.time >= self.schedule.start - 1e-9) & (self.run.time < until - 1e-9)
        faulted = self.run.time < self.cleared - 1e-9
        order = np.abs(self.run.arrays.order)
        out = []
        if (full := float((order[acting] >= FULL).mean())) > 0.01:
            out.append(f"the power ratings ({100 * full:.0f} % of the time of the devices until the largest swing)")
        bus = [self.run.point.net.place[s.bus] for s in self.run.point.case.storage]
        low = np.abs(self.run.arrays.V[:, bus]) < self.schedule.min_voltage
        for when, part in (("during the fault", acting & faulted), ("after clearing", acting & ~faulted)):
            if part.any() and (idle := float(low[part].mean())) > 0.01:
                out.append(f"low voltage {when} ({100 * idle:.0f} % of the time of the devices)")
        level = self.bounds.energy(self.schedule.orders, self.schedule.rate)
        if ((level >= FULL * self.bounds.full) | (level <= FULL * self.bounds.empty)).any():
            out.append("the energy of the devices")
        return tuple(out)

    def __str__(self) -> str:
        c, p = self.contingency, self.peak
        what = f"{self.case}, fault {c.fault}" + (f", trip {', '.join(c.trip)}" if c.trip else "")
        seen = watched(self.search, self.proof.observed_s)
        gate = self.schedule.min_voltage
        idle = f", idle below {gate:g} pu" if gate else ""
        made = f"{len(self.iterations)} convex programs, {self.simulations} simulations"
        used, takes_over = self.energy_kwh, self.time[-1] + 1 / self.schedule.rate
        return (
            f"{what}: {self.cycles:g} cycles ({self.seconds:.4f} s) with the best schedule found, "
            f"{self.start.cycles:g} with the law alone{idle}. This is a local optimum: {ENDS[self.ended]} ({made}); "
            f"a better schedule far from it may exist. Verified by simulation, observed {seen} after clearing; the law "
            f"takes over {takes_over:.3g} s after clearing. Machine {p[0]} has the largest swing, "
            f"{np.rad2deg(p[1]):.0f} degrees against the center of inertia, {p[2]:.2f} s after clearing. Energy used: "
            f"{used.sum():.3g} kWh in total, {used.max():.3g} kWh by one device. Active limits: "
            f"{'; '.join(self.binding) or 'none'}."
        )

    __repr__ = __str__

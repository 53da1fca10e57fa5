"""The critical machines of a fault: a group that loses synchronism together, whose storage should act as one.

The fault is cleared slightly too late. The machine that loses synchronism first, and those on its side of the widest
gap between the rotor angles, are unstable. If it loses synchronism alone, the fault may still have accelerated another
one that just remained in synchronism, so the other machines of its coherent area are candidates, too. A candidate
belongs to the group if at clearing it moves, relative to the center of inertia, in the direction of the first machine,
and at least half as fast.

Coherent areas are those of the slow modes (J. H. Chow, ed., Time-Scale Modeling of Dynamic Networks, 1982, ch. 5).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stabctl.clearing.critical_time import critical
from stabctl.clearing.trial import Trial
from stabctl.model import naming
from stabctl.smallsignal.areas import Areas, areas
from stabctl.smallsignal.modes import Modes

SHARE = 0.5  # of the speed of the first machine, at clearing
PER_AREA = 3  # machines per coherent area, on average


@dataclass(frozen=True)
class Group:
    """Machines that lose synchronism together.

    Attributes
    ----------
    machines
        The group, names or numbers.
    first
        The machine that loses synchronism first.
    unstable
        Machines that had lost synchronism when the run ended.
    area
        The coherent area of the first machine.
    cycles
        Clearing time of the run, just beyond the critical one.
    """

    machines: tuple[int | str, ...]
    first: int | str
    unstable: tuple[int | str, ...]
    area: tuple[int | str, ...]
    cycles: float

    @property
    def coherent(self) -> bool:
        """Whether the group is in one coherent area."""
        return set(self.machines) <= set(self.area)

    def __str__(self) -> str:
        others = [m for m in self.machines if m != self.first]
        if not others:
            return f"machine {self.first} loses synchronism alone"
        within = "one coherent area" if self.coherent else "several coherent areas"
        return f"machine {self.first} loses synchronism with {', '.join(map(str, others))} ({within})"


def slow_areas(modes: Modes) -> Areas:
    """The coherent areas that groups are checked against: about a third as many as machines."""
    point = modes.linear.point
    count, islands = len(point.case.machines) // PER_AREA, point.members.shape[1]
    return areas(modes, min(max(islands + 1, count), len(modes.swings()) + islands))


def critical_machines(trial: Trial, coherent: Areas, cycles: float | None = None) -> Group | None:
    """The group of machines that lose synchronism together after a contingency.

    Parameters
    ----------
    trial : Trial
        The contingency and the control law.
    coherent : Areas
        Coherent areas of the system.
    cycles : float, optional
        Lowest unstable clearing time, searched if it is not given.

    Returns
    -------
    Group or None
        None if no fault of the search makes a machine lose synchronism.
    """
    cycles = critical(trial).lowest_unstable if cycles is None else cycles
    if cycles is None:
        return None
    k = round(cycles / trial.search.resolution_cycles)
    run = trial.simulate(k, record=True)
    first, names = run.outcome.machine, run.point.rotor_names
    if first not in names:
        return None
    at = min(int(np.searchsorted(run.time, trial.cleared(k) - 1e-9)), len(run.time) - 1)
    w = run.point.from_center(run.arrays.speed[at] - run.arrays.speed[0], run.point.inertia)
    lead = w[names.index(first)]
    area = coherent.groups[coherent.of(first)]
    candidates = {first, *run.unstable_machines, *area}
    group = (m for m in candidates if m == first or w[names.index(m)] * np.sign(lead) >= SHARE * abs(lead))
    return Group(
        tuple(sorted(group, key=naming.order)), first, run.unstable_machines, area, k * trial.search.resolution_cycles
    )


def disjoint(found: Iterable[Group]) -> tuple[tuple[int | str, ...], ...]:
    """Groups of several machines without a common one, of several contingencies: those found first are kept."""
    kept: list[tuple[int | str, ...]] = []
    for group in found:
        if len(group.machines) > 1 and not {m for g in kept for m in g} & set(group.machines):
            kept.append(group.machines)
    return tuple(kept)

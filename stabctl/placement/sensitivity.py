"""The immediate effect on every machine of a megawatt absorbed at a bus, before any state has changed.

With the states held the currents still balance, 0 = gv dv + gu dP (as in `smallsignal.descriptor`), and the speed of
machine j changes at the rate dw' = fv dv. Its air-gap power rises by J dP, J = -2 H dw'/dP = 2 H fv inv(gv) gu.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl._util.errors import StudyError
from stabctl.dynamics import signals
from stabctl.dynamics.inputs import draw
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS
from stabctl.model import naming, network
from stabctl.model.case import Case
from stabctl.model.network import UNSWITCHED, Switching

TOLERANCE = 1e-10  # pu   largest current mismatch of a bus
LIMIT = 30  # Newton steps


class Candidate(NamedTuple):
    """A possible storage device: the machine it would belong to, and its bus."""

    machine: int
    bus: int

    def __str__(self) -> str:
        return f"{self.machine}@{self.bus}"


@dataclass(frozen=True, repr=False, eq=False)
class Sensitivity:
    """Change of the machines' air-gap powers per megawatt absorbed at each candidate's bus, states held."""

    case: str
    machines: tuple[int, ...]
    candidates: tuple[Candidate, ...]
    J: np.ndarray  # (machines, candidates)   MW per MW
    inertia: np.ndarray  # (machines) s   on the system base
    island: np.ndarray  # (machines)   island number
    base_mva: float

    @property
    def in_coi(self) -> np.ndarray:
        """The part of J that moves a machine relative to its island's COI, J_j - H_j/sum H sum J (MW per MW)."""
        same = self.island[:, None] == self.island
        share = self.inertia[:, None] * same / (same @ self.inertia)[:, None]
        return self.J - share @ self.J

    @property
    def acceleration(self) -> np.ndarray:
        """Acceleration of every machine relative to the COI (machines, candidates), pu/s per MW."""
        return -self.in_coi / (2 * self.inertia[:, None] * self.base_mva)

    @property
    def own(self) -> np.ndarray:
        """J of every candidate's own machine (candidates)."""
        rows = [self.machines.index(c.machine) for c in self.candidates]
        return self.J[rows, np.arange(len(rows))]

    def __str__(self) -> str:
        lines = [f"{self.case}: air-gap power of the machines per MW absorbed"]
        lines.append("device     own   all machines   largest share")
        for c, own, column in zip(self.candidates, self.own, self.J.T, strict=True):
            most = int(column.argmax())
            lines.append(f"{c!s:8} {own:5.3f} {column.sum():14.3f}   {self.machines[most]} ({column[most]:.3f})")
        return "\n".join(lines)

    __repr__ = __str__


def all_candidates(case: Case) -> tuple[Candidate, ...]:
    """A candidate at every machine's storage bus."""
    return tuple(Candidate(m.machine, m.storage_bus) for m in case.machines)


def checked(case: Case, candidates: Iterable[tuple[int | str, int]] | None) -> tuple[Candidate, ...]:
    """The candidates (machine, bus), by default `all_candidates`; raises StudyError if the case has no such place."""
    if candidates is None:
        return all_candidates(case)
    found = tuple(Candidate(case.machine(machine).machine, int(bus)) for machine, bus in candidates)
    if not found:
        raise StudyError(f"There is no candidate for storage in {case.name}; give at least one machine and its bus.")
    buses = {b.bus for b in case.buses}
    for c in found:
        if c.bus not in buses:
            raise StudyError(
                f"There is no bus {c.bus} in {case.name} for the storage of machine {case.called[c.machine]}."
            )
        if found.count(c) > 1:
            raise StudyError(f"The candidate {naming.device(case, *c)} is listed twice; remove one of them.")
    return found


def sensitivity(
    point: OperatingPoint, candidates: Iterable[tuple[int | str, int]] | None = None, switching: Switching = UNSWITCHED
) -> Sensitivity:
    """Sensitivities at an operating point, or just after its network has been switched, with all states held.

    Parameters
    ----------
    point : OperatingPoint
        The system.
    candidates : iterable of (machine, bus), optional
        Possible devices; by default one at every machine's storage bus. A bus without a machine in its island has no
        effect.
    switching : Switching
        Open lines and switched shunts.

    Raises
    ------
    StudyError
        For impossible candidates, for a fault, a tripped machine or a load step, and if the switched network has no
        voltage solution.
    """
    case, found = point.case, checked(point.case, candidates)
    if switching.faulted or switching.tripped or switching.loads:
        raise StudyError(
            f"The sensitivities of {case.name} need a network with all its machines and loads and without a fault; "
            "remove faults, tripped machines and load steps from the switching."
        )
    where = network.islands(point.net, switching)
    served = np.isin(where, where[point.net.machine_bus])
    V, fv, gv = _settled(point, switching, served)
    gu = np.zeros((2 * len(V), len(found)))
    for k, c in enumerate(found):
        (signal,) = signals.chosen(case, [f"storage:{c.bus}"], INPUTS)
        drawn = draw(point, signal)
        if served[drawn.bus]:
            gu[2 * drawn.bus : 2 * drawn.bus + 2, k] = np.array([drawn.current_of(complex(V[drawn.bus]))]).view(float)
    rotors = point.rotors.real
    J = 2 * rotors.inertia[:, None] * (fv @ splu(gv).solve(gu))
    numbers = tuple(case.machines[i].machine for i in rotors.unit)
    island = where[point.system.unit_bus[rotors.unit]]
    return Sensitivity(case.name, numbers, found, J, rotors.inertia, island, case.base_mva)


def _settled(
    point: OperatingPoint, switching: Switching, served: np.ndarray
) -> tuple[np.ndarray, sp.csc_matrix, sp.csc_matrix]:
    """Voltages of the switched network, and the slopes there: of the machines' w' and of the currents."""
    s, places = point.s.copy(), point.layout.voltages
    v, Y = s[places], point.real_admittance(switching)
    live = sp.diags(np.repeat(served, 2).astype(float), format="csc")
    for _ in range(LIMIT):
        d = point.equations.at(s)
        gv = sp.csc_matrix(live @ (d.of_currents[:, places] - Y) - (sp.identity(len(v)) - live))
        miss = live @ (d.currents.view(float) - Y @ v)
        if np.abs(miss).max() < TOLERANCE:
            return v.view(complex), sp.csc_matrix(d.of_rates[point.rotors.real.speed][:, places]), gv
        try:
            v -= splu(gv).solve(miss)
        except RuntimeError:
            break
        if not np.isfinite(v).all():
            break
    raise StudyError(
        f"The network of {point.case.name} has no voltage solution just after this switching, with the machines at "
        "their operating point; choose another switching, or an operating point with less load."
    )

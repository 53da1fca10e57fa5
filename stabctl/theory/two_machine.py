"""The two-machine equivalent (15)-(28): one machine and the center of inertia of the others (Table 2).

Its relative angle delta = delta1 - deltaCOI moves like one machine on an infinite bus with H = H1 HCOI/(H1 + HCOI).
A device at machine 1 acts on that machine alone: of its P_C the share M/M1 = HCOI/(H1 + HCOI) acts on delta.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from stabctl._util.guard import guard
from stabctl.schema import POSITIVE

from .equal_area import CriticalClearing, EqualArea, critical_clearing, equal_area
from .minimum_time import MinimumTimeProblem
from .omib import FREQUENCY, INERTIA, OMIB, POWER, REACTANCE, VOLTAGE, during_fault


@dataclass(frozen=True)
class Equivalent:
    """Two machines that exchange Pm1; all per-unit values are on `base`.

    Raises StudyError if a value is out of range or Pm1 has no equilibrium.
    """

    H1: Annotated[float, "s", "inertia constant of machine 1", INERTIA] = 1.0
    HCOI: Annotated[float, "s", "inertia constant of all others", INERTIA] = 6.0
    V1: Annotated[float, "pu", "voltage of machine 1", VOLTAGE] = 1.0
    VCOI: Annotated[float, "pu", "voltage of the others", VOLTAGE] = 1.0
    X: Annotated[float, "pu", "reactance between the two voltages", REACTANCE] = 1.0
    Pm1: Annotated[float, "pu", "mechanical power of machine 1, PmCOI = -Pm1", POWER] = 0.5
    base: Annotated[float, "MVA", "base of the per-unit values", POSITIVE] = 100.0
    Xpost: Annotated[float | None, "pu", "reactance after clearing, X if omitted", REACTANCE] = None
    fb: Annotated[float, "Hz", "base frequency", FREQUENCY] = 60.0

    def __post_init__(self) -> None:
        guard(self)
        _ = self.omib

    @property
    def share(self) -> float:
        """Share of P_C that acts on the relative angle, M/M1."""
        return self.HCOI / (self.H1 + self.HCOI)

    @property
    def M1(self) -> float:
        """Inertia coefficient of machine 1 (28), s^2/rad."""
        return 2 * self.H1 / (2 * math.pi * self.fb)

    @property
    def omib(self) -> OMIB:
        """The relative motion (21)-(23) as one machine on an infinite bus."""
        return OMIB(self.H1 * self.share, self.Pm1, self.X, self.VCOI, self.V1, self.Xpost, None, self.fb)

    def minimum_time_problem(self, cycles: float, Pc_min: float = -0.5, Pc_max: float = 0.5) -> MinimumTimeProblem:
        """The control problem (29)-(31) after a bolted fault at machine 1.

        Parameters
        ----------
        cycles : float
            Duration of the fault.
        Pc_min, Pc_max : float, pu
            Limits of the absorbed power.

        Raises
        ------
        StudyError
            If the duration or the limits are not possible.
        """
        m = self.omib
        x1, x2 = during_fault(m, m.seconds(cycles))
        return MinimumTimeProblem(x1, x2, m.M, self.M1, self.Pm1, m.Pmax_post, Pc_min, Pc_max)

    def critical(self, Pc: float = 0.0) -> CriticalClearing:
        """Critical clearing with P_C = `Pc` (pu) absorbed at machine 1 after clearing (Figure 9b)."""
        return critical_clearing(self.omib, self.share * Pc)

    def equal_area(self, cycles: float, Pc: float = 0.0) -> EqualArea:
        """The areas (25), (26) of a bolted fault of so many cycles (Figure 9). Raises StudyError as `equal_area`."""
        m = self.omib
        return equal_area(m, during_fault(m, m.seconds(cycles))[0], self.share * Pc)

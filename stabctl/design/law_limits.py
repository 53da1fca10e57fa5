"""Limits of a storage law, and its score: clearing times gained, less penalties for exceeded limits."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from stabctl._util.guard import guard
from stabctl.schema import NOT_NEGATIVE, POSITIVE

from .law_jobs import Measured

SLACK = 1e-9  # excess that is rounding
MEAN = 0.1  # weight of the mean gain beside the median, which has many ties on a grid
SHORT = 4.0  # cycles lost for a cycle below the reference law, in one contingency
EXCEEDED = 20.0  # cycles lost in a contingency that exceeds a limit, and as much again for a limit exceeded twice
LEFT = 0.05  # share of the energy that may be missing in the end
EFFORT = 0.02  # cycles lost for as much energy as the reference law uses


@dataclass(frozen=True)
class LawLimits:
    """Limits of a storage law, in each of its contingencies, cleared at the critical time.

    Parameters
    ----------
    energy : float, kWh, optional
        Energy of all devices together: the range of each.
    switchings : int
        Sign changes of an order within a swing.
    coi : float, Hz, optional
        Deviation of the speed of the center of inertia.
    voltage : float, pu
        Lowest voltage of a bus at the end.
    min_voltage : float, pu
        Voltage at a device down to which it is able to act.
    deadband : float, Hz
        Smallest deadband, above the noise of the speeds.
    return_within : float, s
        Time after which the devices have their energy back, within 5 % of what they used; 0: no return.
    """

    energy: Annotated[float | None, "kWh", "energy of all devices", POSITIVE] = None
    switchings: Annotated[int, "-", "sign changes of an order within a swing", NOT_NEGATIVE] = 2
    coi: Annotated[float | None, "Hz", "deviation of the speed of the center of inertia", POSITIVE] = None
    voltage: Annotated[float, "pu", "lowest voltage at the end", NOT_NEGATIVE] = 0.0
    min_voltage: Annotated[float, "pu", "voltage down to which a device is able to act", NOT_NEGATIVE] = 0.5
    deadband: Annotated[float, "Hz", "smallest deadband", NOT_NEGATIVE] = 0.02
    return_within: Annotated[float, "s", "time after which the energy is back", NOT_NEGATIVE] = 120.0

    def __post_init__(self) -> None:
        guard(self)

    def exceeded(self, found: Measured) -> float:
        """By how much a law exceeds the limits in one contingency.

        Parameters
        ----------
        found : Measured
            What was measured with the law.

        Returns
        -------
        float
            Sum of the excesses, each relative to its limit; 0 if all limits are kept.
        """
        use, after = found.duty, found.later
        over = [
            found.energy_kwh / self.energy - 1 if self.energy else 0.0,
            (use.switchings - self.switchings) / max(self.switchings, 1),
            use.coi_hz / self.coi - 1 if self.coi else 0.0,
            1 - use.voltage / self.voltage if self.voltage else 0.0,
            after.left_kwh / (LEFT * after.energy_kwh) - 1 if after and after.energy_kwh else 0.0,
            0.0 if after is None or after.stable else 1.0,
        ]
        return float(sum(x for x in over if x > SLACK))

    def kept(self, found: Sequence[Measured]) -> bool:
        """Whether a law keeps the limits in all contingencies.

        Parameters
        ----------
        found : sequence of Measured
            What was measured with the law, one entry per contingency.

        Returns
        -------
        bool
        """
        return not any(map(self.exceeded, found))

    def score(self, found: Sequence[Measured], reference: Sequence[Measured]) -> float:
        """Score of a law, compared with the reference law in the same contingencies.

        Parameters
        ----------
        found, reference : sequence of Measured
            What was measured with the law and with the reference law, one entry per contingency.

        Returns
        -------
        float, cycles
            Median gain plus a tenth of the mean gain, less the penalties for shorter clearing times, exceeded limits
            and energy.
        """
        gain = np.array([m.reach - r.reach for m, r in zip(found, reference, strict=True)])
        energy = sum(r.energy_kwh for r in reference)
        used = sum(m.energy_kwh for m in found) / energy if energy else 0.0
        over = sum(1 + excess for m in found if (excess := self.exceeded(m)))
        lost = SHORT * float(np.maximum(-gain, 0).sum()) + EXCEEDED * over + EFFORT * used
        return float(np.median(gain)) + MEAN * float(gain.mean()) - lost

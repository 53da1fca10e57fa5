"""Phasor measurement units: what they report of a machine's terminals, with noise, latency and losses.

Errors follow IEEE/IEC 60255-118-1: a total vector error (TVE) of 1 % is allowed. A reported phasor is

    V (1 + m) exp(j (a + c)),   m, a white and normal, c a constant offset of the PMU's clock,

and its frequency and ROCOF are those of the voltage angle between two frames, with white errors.
"""

from dataclasses import KW_ONLY, dataclass
from math import ceil, hypot
from typing import Annotated, Any, Literal

from annotated_types import Ge, Interval

from stabctl._util.guard import guard
from stabctl.errors import StudyError
from stabctl.units import quantity

from .bad_pmu import BadPmu

RATES = (10, 12, 15, 20, 24, 25, 30, 40, 50, 60, 100, 120, 200, 240)  # 1/s
HALF_WINDOW = {"none": 0, "P": 1, "M": 3}  # cycles   half the length of the class's filter
NOISE = Interval(ge=0, le=10)


@dataclass(frozen=True)
class Pmu:
    """A PMU at every machine. Quantities may be text with a unit, such as latency="100ms".

    Parameters
    ----------
    rate : int
        Reports per second, one of `RATES`.
    angle, magnitude : float, rad and relative
        Standard deviations of a phasor's angle and magnitude.
    frequency, rocof : float, Hz and Hz/s
        Standard deviations of the frequency and of its rate of change.
    clock : float, s
        Standard deviation of the constant offset of a PMU's clock.
    latency : float, s
        Latency of remote reports; a machine's own report has none.
    loss, burst : float
        Fraction of the reports that never arrive, and mean length (frames) of a run of lost reports.
    outage : (time, time), optional
        From, to: every report is lost.
    missing : tuple of int
        Numbers of the machines without a PMU; their phasors are computed from those of the others.
    bad : tuple of BadPmu
        PMUs that report wrong phasors.
    filter_class : {"none", "P", "M"}
        Class of the PMU's filter: none, or centered windows of 2 and 6 cycles.

    Raises
    ------
    StudyError
        For a rate that is not in the standard, and for values out of range.
    """

    rate: Annotated[int, "-", "reports per second"] = 60
    _: KW_ONLY
    angle: Annotated[float, "rad", "noise of the phasor angles", NOISE] = 2e-3
    magnitude: Annotated[float, "-", "relative noise of the phasor magnitudes", NOISE] = 2e-3
    frequency: Annotated[float, "Hz", "noise of the frequency", NOISE] = 5e-3
    rocof: Annotated[float, "Hz/s", "noise of the rate of change of frequency", Interval(ge=0, le=1e3)] = 0.1
    clock: Annotated[float, "s", "offset of the clocks", Interval(ge=0, le=1)] = 1e-6
    latency: Annotated[float, "s", "latency of remote reports", NOISE] = 0.05
    loss: Annotated[float, "-", "fraction of the reports that are lost", Interval(ge=0, lt=1)] = 0.02
    burst: Annotated[float, "-", "mean length of a run of lost reports, frames", Ge(1)] = 1.0
    outage: tuple[str | float, str | float] | None = None
    missing: tuple[int, ...] = ()
    bad: tuple[BadPmu, ...] = ()
    filter_class: Annotated[Literal["none", "P", "M"], "-", "class of the PMU's filter"] = "none"

    @classmethod
    def noisy(cls, rate: int, noise_mrad: float, latency_ms: float, loss: float) -> "Pmu":
        """PMUs with one noise level for angles and magnitudes of the phasors.

        Parameters
        ----------
        rate : int, 1/s
            Reports per second.
        noise_mrad : float, mrad and per mille
            Standard deviation of the angles, and the same number in per mille for the magnitudes.
        latency_ms : float, ms
            Latency of remote reports.
        loss : float
            Fraction of the reports that are lost.

        Returns
        -------
        Pmu

        Raises
        ------
        StudyError
            For a value out of range.
        """
        return cls(rate, angle=1e-3 * noise_mrad, magnitude=1e-3 * noise_mrad, latency=1e-3 * latency_ms, loss=loss)

    @classmethod
    def exact(cls, rate: int = 60, **options: Any) -> "Pmu":
        """PMUs without noise, latency or losses.

        Parameters
        ----------
        rate : int, 1/s
            Reports per second.
        **options
            Other fields of `Pmu`.

        Returns
        -------
        Pmu
        """
        none: dict[str, Any]
        none = dict.fromkeys(("angle", "magnitude", "frequency", "rocof", "clock", "latency", "loss"), 0.0)
        return cls(rate, **(none | options))

    def __post_init__(self) -> None:
        guard(self)
        if self.rate not in RATES:
            rates = ", ".join(map(str, RATES))
            raise StudyError(f"A PMU rate of {self.rate} per second is not possible; choose one of {rates}.")
        if self.loss > self.burst / (1 + self.burst):
            raise StudyError(
                f"A loss of {self.loss:g} with a burst length of {self.burst:g} is not possible; it must be at most "
                f"burst/(1 + burst) = {self.burst / (1 + self.burst):g}."
            )
        if self.outage is not None:
            object.__setattr__(self, "outage", tuple(quantity(time, "s", bare=False) for time in self.outage))

    def own_frames(self, hz: float) -> int:
        """Age of a machine's own report: the group delay of the PMU's filter.

        Parameters
        ----------
        hz : float, Hz
            Rated frequency of the system.

        Returns
        -------
        int, frames
        """
        return round(HALF_WINDOW[self.filter_class] * self.rate / hz)

    def remote_frames(self, hz: float) -> int:
        """Age of the newest report of another machine: group delay and latency.

        Parameters
        ----------
        hz : float, Hz
            Rated frequency of the system.

        Returns
        -------
        int, frames
        """
        return self.own_frames(hz) + ceil(self.latency * self.rate - 1e-9)

    @property
    def tve(self) -> float:
        """Root mean square of the total vector error |V' - V|/|V|."""
        return hypot(self.angle, self.magnitude)

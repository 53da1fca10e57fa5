"""Phasor measurement units: their data, and what they report with noise, latency, losses and faults.

Errors follow IEEE/IEC 60255-118-1: a total vector error (TVE) of 1 % is allowed. A reported phasor is

    V (1 + m) exp(j (a + c)),   m, a white and normal, c a constant offset of the PMU's clock,

and its frequency and ROCOF are those of the voltage angle between two frames, with white errors.

A bad PMU reports wrong phasors: it is frozen, or has a drifting clock, or a jump or a ramp of the angle. An error of
the clock turns voltage and current alike, so that the power stays right.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from math import ceil, hypot, pi
from numbers import Integral
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import quantity
from stabctl._util.validation import checks_arguments, guard

RATES = (10, 12, 15, 20, 24, 25, 30, 40, 50, 60, 100, 120, 200, 240)  # 1/s
HALF_WINDOW = {"none": 0, "P": 1, "M": 3}  # cycles   half the length of the class's filter
NOISE = Interval(ge=0, le=10)
TURN = Interval(ge=-pi, le=pi)


@dataclass(frozen=True)
class BadPmu:
    """What is wrong with the PMU of a machine from an instant on. Quantities may be text, as jump="5deg", drift="10us".

    Parameters
    ----------
    machine : int or str
        Number or name of the machine.
    at : float, s
        Instant from which it is wrong.
    frozen : bool
        It repeats its last report before `at`.
    drift : float, s
        Error of its clock that is added in every second.
    jump : float, rad
        Angle by which its phasors are turned.
    ramp : float, rad
        Angle by which they are turned further in every second, as by a spoofed time signal.
    until : float, s
        Instant from which it is right again.

    Raises
    ------
    StudyError
        For a value out of range.

    Examples
    --------
    >>> pmu = st.Pmu(bad=(st.BadPmu(3, "0.5s", jump="5deg"),))
    >>> control = st.EstimatorControl(pmu=pmu, check_pmus=True)
    >>> found = st.load("two_area").estimate(st.Contingency("7", clear="6cyc"), "2s", storage="50MW", control=control)
    >>> [(alarm.machine, alarm.time_s) for alarm in found.alarms]
    [(3, 0.5)]
    """

    machine: int | str
    at: Annotated[float, "s", "instant from which a PMU is bad", Interval(ge=0, le=1e6)]
    _: KW_ONLY
    frozen: bool = False
    drift: Annotated[float, "s", "error of a clock per second", Interval(ge=-1, le=1)] = 0.0
    jump: Annotated[float, "rad", "jump of the angles of a PMU", TURN] = 0.0
    ramp: Annotated[float, "rad", "turn of the angles of a PMU per second", TURN] = 0.0
    until: Annotated[float, "s", "instant from which a PMU is right again", Interval(ge=0, le=1e6)] = 1e6

    def __post_init__(self) -> None:
        guard(self)
        if self.until <= self.at:
            raise StudyError(f"A PMU that is bad from {self.at:g} s until {self.until:g} s never is; give a later end.")
        if not (self.frozen or self.drift or self.jump or self.ramp):
            raise StudyError(
                f"Nothing is wrong with the PMU of machine {self.machine}; give frozen=True or jump='5deg'."
            )


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
        Fraction of the reports that never arrive, and mean length (frames) of a run of lost reports; with a length of
        1, each is lost independently of the others.
    outage : (time, time), optional
        From, to (s): every report is lost.
    missing : tuple of int or str
        Numbers or names of the machines without a PMU; their phasors are computed from those of the others.
    bad : tuple of BadPmu
        PMUs that report wrong phasors.
    filter_class : {"none", "P", "M"}
        Class of the PMU's filter: none, or centered windows of 2 and 6 cycles, rounded to whole frames.

    Raises
    ------
    StudyError
        For a rate that is not one of `RATES`, and for values out of range.

    Examples
    --------
    >>> pmu = st.Pmu(rate=30, latency="100ms", loss=0.05, missing=(2,))
    >>> round(pmu.tve, 5)
    0.00283
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
    missing: tuple[int | str, ...] = ()
    bad: tuple[BadPmu, ...] = ()
    filter_class: Annotated[Literal["none", "P", "M"], "-", "class of the PMU's filter"] = "none"

    @classmethod
    @checks_arguments
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

        Examples
        --------
        >>> st.Pmu.noisy(60, noise_mrad=5, latency_ms=100, loss=0.02).angle
        0.005
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

        Examples
        --------
        >>> st.Pmu.exact(latency="100ms").latency
        0.1
        """
        none: dict[str, Any]
        none = dict.fromkeys(("angle", "magnitude", "frequency", "rocof", "clock", "latency", "loss"), 0.0)
        return cls(rate, **(none | options))

    def __post_init__(self) -> None:
        if isinstance(self.rate, float) and float(self.rate).is_integer():
            object.__setattr__(self, "rate", int(self.rate))
        guard(self)
        for name, kind, example in (
            ("missing", Integral | str, "(3,)"),
            ("bad", BadPmu, "BadPmu(3, '0.5s', frozen=True)"),
        ):
            given = getattr(self, name)
            several = (given,) if isinstance(given, kind) else given
            if not isinstance(several, tuple | list) or not all(isinstance(one, kind) for one in several):
                raise StudyError(f"{name} = {shown(given)} is not allowed; give {name}={example}.")
            object.__setattr__(self, name, tuple(several))
        if self.rate not in RATES:
            rates = ", ".join(map(str, RATES))
            raise StudyError(f"A PMU rate of {self.rate} per second is not possible; choose one of {rates}.")
        if self.burst > 1 and self.loss > self.burst / (1 + self.burst):
            raise StudyError(
                f"A loss of {self.loss:g} with a burst length of {self.burst:g} is not possible; it must be at most "
                f"burst/(1 + burst) = {self.burst / (1 + self.burst):g}."
            )
        if self.outage is not None:
            if not isinstance(self.outage, tuple | list) or len(self.outage) != 2:
                raise StudyError(f"outage = {shown(self.outage)} is not allowed; give (from, to): ('0.6s', '0.8s').")
            begin, end = (quantity(time, "s", bare=False) for time in self.outage)
            if not begin < end:
                raise StudyError(f"An outage from {begin:g} to {end:g} s is not possible; give the earlier time first.")
            object.__setattr__(self, "outage", (begin, end))

    @checks_arguments
    def own_frames(self, hz: float) -> int:
        """Age of a machine's own report: the group delay of the PMU's filter.

        Parameters
        ----------
        hz : float, Hz
            Rated frequency of the system.

        Returns
        -------
        int, frames

        Raises
        ------
        StudyError
            If the window of the filter has no other frame than that in its middle.

        Examples
        --------
        >>> st.Pmu(filter_class="M").own_frames(60)
        3
        """
        cycles = HALF_WINDOW[self.filter_class]
        if cycles and not (half := round(cycles * self.rate / hz)):
            raise StudyError(
                f"{self.rate} reports per second are too few for the filter of class {self.filter_class}, a window of "
                f"{2 * cycles} cycles; give more than {hz / (2 * cycles):g}, or no filter."
            )
        return half if cycles else 0

    def remote_frames(self, hz: float) -> int:
        """Age of the newest report of another machine: group delay and latency.

        Parameters
        ----------
        hz : float, Hz
            Rated frequency of the system.

        Returns
        -------
        int, frames

        Examples
        --------
        >>> st.Pmu(latency="100ms").remote_frames(60)
        6
        """
        return self.own_frames(hz) + ceil(self.latency * self.rate - 1e-9)

    @property
    def tve(self) -> float:
        """Root mean square of the total vector error |V' - V|/|V| that the noise alone makes."""
        return hypot(self.angle, self.magnitude)


class Frame(NamedTuple):
    """One report of every PMU, arrays (seeds, machines); `slip` is the truth, for the ideal estimator only."""

    V: np.ndarray  # pu   terminal voltage
    I: np.ndarray  # pu   current out of the machine, system base
    frequency: np.ndarray  # pu   deviation from nominal
    rocof: np.ndarray  # pu/s
    received: np.ndarray  # bool
    slip: np.ndarray  # pu
    parts: "Parts | None" = None
    since: np.ndarray | None = None  # (seeds, 1)   frames since the network was switched; None: never


class Parts(NamedTuple):
    """Phasors that are not reports of the machine itself, but computed from those of others."""

    computed: np.ndarray  # (seeds, machines) bool
    V: np.ndarray  # (seeds, machines, reports) pu   what each report contributes to the voltage
    I: np.ndarray  # (seeds, machines, reports) pu


class Instrument:
    """The PMUs of all machines in operation, one row per seed; the same seed always gives the same errors.

    `report` takes the true phasors (seeds, machines) of an instant. With a filter class the report belongs to the
    instant `own_frames` ago.
    """

    def __init__(
        self, pmu: Pmu, seeds: Sequence[int] | Sequence[list[int]], machines: int, frequency_hz: float
    ) -> None:
        self.pmu, self.hz, self.shape = pmu, frequency_hz, (len(seeds), machines)
        self._random = [np.random.default_rng(seed) for seed in seeds]
        offset = np.array([r.standard_normal(machines) for r in self._random])
        self._clock = np.exp(2j * pi * frequency_hz * pmu.clock * offset)
        self._lost = np.zeros(self.shape, bool)
        half = pmu.own_frames(frequency_hz)
        self._length = 2 * half + 1
        self._recent: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=self._length)
        self._weights = window(half)
        self._angle: np.ndarray | None = None
        self._frequency: np.ndarray | None = None

    def report(self, time: float, V: np.ndarray, I: np.ndarray, slip: np.ndarray) -> Frame:
        """The frame at `time` (s) of true voltages and currents (pu)."""
        p, m = self.pmu, self.shape[1]
        V, I = self._filtered(V, I)
        frequency, rocof = self._rates(V)
        draws = np.array([r.standard_normal((6, m)) for r in self._random]).transpose(1, 0, 2)
        chance = np.array([r.random(m) for r in self._random])
        noise = p.magnitude * draws[:2] + 1j * p.angle * draws[2:4]
        ends = chance < 1 / p.burst
        begins = chance < p.loss / (p.burst * (1 - p.loss)) if p.loss else np.zeros(self.shape, bool)
        self._lost = np.where(self._lost, ~ends, begins) if p.burst > 1 else chance < p.loss
        out = p.outage is not None and float(p.outage[0]) - 1e-9 <= time < float(p.outage[1]) - 1e-9
        return Frame(
            V * (1 + noise[0].real) * np.exp(1j * noise[0].imag) * self._clock,
            I * (1 + noise[1].real) * np.exp(1j * noise[1].imag) * self._clock,
            frequency + p.frequency / self.hz * draws[4],
            rocof + p.rocof / self.hz * draws[5],
            ~self._lost & (not out),
            slip,
        )

    def _filtered(self, V: np.ndarray, I: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._recent.append((V, I))
        while len(self._recent) < self._length:
            self._recent.append((V, I))
        if len(self._weights) == 1:
            return V, I
        voltages, currents = zip(*self._recent, strict=True)
        return np.tensordot(self._weights, voltages, 1), np.tensordot(self._weights, currents, 1)

    def _rates(self, V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angle = np.angle(V)
        before = angle if self._angle is None else self._angle
        turn = np.angle(np.exp(1j * (angle - before)))
        frequency = turn * self.pmu.rate / (2 * pi * self.hz)
        earlier = frequency if self._frequency is None else self._frequency
        self._angle, self._frequency = angle, frequency
        return frequency, (frequency - earlier) * self.pmu.rate


def window(half: int) -> np.ndarray:
    """Triangular weights over 2 half + 1 frames."""
    weights = np.bartlett(2 * half + 3)[1:-1]
    return weights / weights.sum()


class BadReports:
    """Makes the reports of bad PMUs wrong; `rows` are the rows of their machines.

    What turns the phasors between two frames is in the frequency, and in the ROCOF what changes that.
    """

    def __init__(self, pmu: Pmu, rows: Sequence[int], frequency_hz: float) -> None:
        self._bad, self._wb = tuple(zip(pmu.bad, rows, strict=True)), 2 * pi * frequency_hz
        self._rate = pmu.rate
        self._last: dict[int, tuple[np.ndarray, ...]] = {}
        self._before: dict[int, tuple[float, float]] = {}  # rad and pu   turn and error of the frequency a frame ago

    def __call__(self, at: float, frame: Frame) -> Frame:
        """The frame at an instant (s), as it is reported."""
        if not self._bad:
            return frame
        V, I, frequency, rocof = told = [part.copy() for part in (frame.V, frame.I, frame.frequency, frame.rocof)]
        for k, (bad, row) in enumerate(self._bad):
            since = at - bad.at
            wrong = since >= -1e-9 and at <= bad.until - 1e-9
            if since < -1e-9:
                self._last[k] = tuple(part[:, row].copy() for part in told)
            if wrong and bad.frozen and k in self._last:
                for part, last in zip(told, self._last[k], strict=True):
                    part[:, row] = last
            turn = (bad.jump + (bad.ramp + self._wb * bad.drift) * since) if wrong else 0.0
            before, error = self._before.get(k, (turn, 0.0))
            faster = (turn - before) * self._rate / self._wb
            self._before[k] = turn, faster
            V[:, row], I[:, row] = V[:, row] * np.exp(1j * turn), I[:, row] * np.exp(1j * turn)
            frequency[:, row] += faster
            rocof[:, row] += (faster - error) * self._rate
        return frame._replace(V=V, I=I, frequency=frequency, rocof=rocof)

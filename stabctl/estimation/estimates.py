"""Estimated speeds and the commands that follow from them, compared with the true ones."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.units import seconds
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.controllers import BangBang
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.simulation.trajectory import Trajectory

from ._bad_data import Alarm
from .pmu import Frame

if TYPE_CHECKING:
    import pandas as pd

    from .estimator_control import EstimatorControl

SETTLED = 0.05  # s   time after the last event from which the estimates are evaluated
LARGEST_SHIFT = 100  # ms


class Accuracy(NamedTuple):
    """Accuracy of the estimated speed deviations, and of the commands that follow from them."""

    rmse_mhz: float  # mHz   root mean square error
    p99_mhz: float  # mHz   99th percentile of the absolute error
    delay_ms: float  # ms    shift that best aligns estimate and truth, positive if the estimate is late; NaN: unknown
    wrong_command_share: float  # -     share of machine-frames in which the bang-bang command is not the true one
    opposite_command_share: float  # -     share of those in which absorbing and injecting are swapped
    cpu_ms_per_frame: float  # ms    of the estimator and the controller, all machines of one seed

    def __str__(self) -> str:
        return (
            f"error {self.rmse_mhz:.1f} mHz rms ({self.p99_mhz:.1f} mHz at the 99th percentile), delay "
            f"{self.delay}, {100 * self.wrong_command_share:.2f} % wrong and "
            f"{100 * self.opposite_command_share:.2f} % opposite commands"
        )

    @property
    def delay(self) -> str:
        """The delay in words: "3.4 ms", or "unknown" where no shift of up to 100 ms is best."""
        return "unknown" if np.isnan(self.delay_ms) else f"{self.delay_ms:.1f} ms"


@dataclass(frozen=True, repr=False, eq=False)
class Estimates(Tabular):
    """True and estimated speeds of a simulation, for each seed of noise and losses.

    Arrays have the shape (frames, seeds, machines) unless stated otherwise.

    Attributes
    ----------
    point : OperatingPoint
        Where the simulations start.
    control : EstimatorControl
        The estimator and what it drives.
    seeds : tuple of int
        Seeds of noise and losses.
    time : ndarray (frames), s
        Instants of the frames.
    slip, estimated, slip_sigma : ndarray, pu
        True and estimated deviation of the speed from nominal, and the standard deviation of the estimate; with late or
        lost reports, what is known of the instant of the frame.
    deviation, deviation_estimated, sigma : ndarray, pu
        True and estimated speed relative to the COI of the other machines, and its reported standard deviation.
    acceleration : ndarray, pu/s
        Rate of the estimated deviation.
    usable : ndarray of bool
        Whether the storage of the machine may act.
    on : ndarray of bool
        Whether the machine is connected, in a simulation that is still running.
    nis, nees : ndarray
        Normalized innovation squared, and normalized error squared of angle and speed; NaN without a filter.
    orders : ndarray (frames, seeds, devices)
        Orders to the storage devices, in ratings.
    wall_s : ndarray (frames), s
        Computing time of estimator and controller for all seeds.
    runs : tuple of Trajectory
        The simulation of each seed.
    cleared_s : float, s
        Instant of the last event.
    alarms : tuple of Alarm
        PMUs found to be bad, or consistent again.
    frames : tuple of Frame
        The reports, beginning with a second in steady state before the run.

    Examples
    --------
    >>> base = st.load("two_area").classical().initialize(storage="50MW")
    >>> found = base.estimate(st.Contingency("7", clear="8cyc", trip="7-8"), "3s")
    >>> found.deviation.shape, found.runs[0].outcome.stable
    ((180, 1, 4), True)
    """

    point: OperatingPoint
    control: "EstimatorControl"
    seeds: tuple[int, ...]
    time: np.ndarray
    slip: np.ndarray
    estimated: np.ndarray
    slip_sigma: np.ndarray
    deviation: np.ndarray
    deviation_estimated: np.ndarray
    acceleration: np.ndarray
    sigma: np.ndarray
    usable: np.ndarray
    on: np.ndarray
    nis: np.ndarray
    nees: np.ndarray
    orders: np.ndarray
    wall_s: np.ndarray
    runs: tuple[Trajectory, ...] = ()
    cleared_s: float = 0.0
    alarms: tuple[Alarm, ...] = ()
    frames: tuple[Frame, ...] = ()

    plot = verb("stabctl.view.figures.estimates:plot")
    report = verb("stabctl.view.pages.pattern:report")
    fit = verb("stabctl.estimation.fit:fit")

    @property
    def deadband(self) -> float:
        """Deadband (pu) of the bang-bang law; its default value if another law acts."""
        law = self.control.law if isinstance(self.control.law, BangBang) else BangBang()
        return law.deadband / self.point.case.frequency_hz

    @property
    def true_commands(self) -> np.ndarray:
        """Bang-bang commands from the true deviations: absorb 1, inject -1, idle 0."""
        return np.sign(self.deviation) * (np.abs(self.deviation) > self.deadband)

    @property
    def estimated_commands(self) -> np.ndarray:
        """Bang-bang commands from the estimated deviations; 0 where these are not usable."""
        return np.sign(self.deviation_estimated) * (np.abs(self.deviation_estimated) > self.deadband) * self.usable

    def count_commands(self, before: str | float = np.inf) -> int:
        """Number of machine-frames with a bang-bang command from the estimates.

        Parameters
        ----------
        before : str or float, s
            Count frames before this instant.

        Returns
        -------
        int

        Examples
        --------
        >>> base = st.load("two_area").classical().initialize(storage="50MW")
        >>> base.estimate(st.Contingency("7", clear="8cyc"), "2s").count_commands(before=1.1)
        11
        """
        end = before if before == np.inf else seconds(before, self.point.case.frequency_hz)
        return int(np.count_nonzero(self.estimated_commands[self.time < end - 1e-9]))

    @property
    def judged_from_s(self) -> float:
        """Instant (s) from which `accuracy` is taken: 50 ms after the last event, such as the clearing of the fault."""
        return self.cleared_s + SETTLED

    @property
    def accuracy(self) -> Accuracy:
        """Accuracy from `judged_from_s` to the end.

        Raises `StudyError` if the run ends before, and as `accuracy_between`.
        """
        since, end = self.judged_from_s, self.time[-1] if len(self.time) else 0.0
        if len(self.time) and end < since - 1e-9:
            case, last = self.point.case, self.cleared_s
            raise StudyError(
                f"The estimates of {case.name} end at {end:.3f} s, but they are judged after the last event, at "
                f"{last:g} s ({last * case.frequency_hz:.6g} cycles); clear the fault earlier or add storage."
            )
        return self.accuracy_between(since, end)

    def accuracy_between(self, since: str | float, until: str | float) -> Accuracy:
        """Accuracy of the estimates in a part of the run.

        Parameters
        ----------
        since, until : str or float, s
            Beginning and end of this part: 1.2 or "1.2s".

        Returns
        -------
        Accuracy

        Raises
        ------
        StudyError
            If one of them is not a time, they are not in order, or no machine was in synchronism between them.

        Examples
        --------
        >>> base = st.load("two_area").classical().initialize(storage="50MW")
        >>> found = base.estimate(st.Contingency("7", clear="8cyc"), "2s")
        >>> round(found.accuracy_between(1.2, 2.0).rmse_mhz, 1)
        3.1
        """
        begin, end = (seconds(one, self.point.case.frequency_hz) for one in (since, until))
        if begin > end:
            raise StudyError(f"There is nothing between {begin:g} and {end:g} s; give the earlier time first.")
        rows = (self.time >= begin - 1e-9) & (self.time <= end + 1e-9)
        if not rows.any():
            raise StudyError(
                f"There is no frame between {begin:g} and {end:g} s; the estimates are from {self.time[0]:g} to "
                f"{self.time[-1]:g} s."
            )
        on = self.on[rows]
        if not on.any():
            raise StudyError(
                f"No machine of {self.point.case.name} is in synchronism between {begin:g} and {end:g} s; clear the "
                "fault earlier or add storage."
            )
        error = (self.deviation_estimated - self.deviation)[rows][on] * 1e3 * self.point.case.frequency_hz
        true, estimated = self.true_commands[rows][on], self.estimated_commands[rows][on]
        return Accuracy(
            float(np.sqrt(np.mean(error**2))),
            float(np.percentile(np.abs(error), 99)),
            self._delay(rows, on),
            float(np.mean(true != estimated)),
            float(np.mean(true * estimated < 0)),
            float(1e3 * np.median(self.wall_s) / len(self.seeds)),
        )

    def _delay(self, rows: np.ndarray, on: np.ndarray) -> float:
        """Time shift (ms, to a tenth) of the true speeds with the least square error, linear between frames; or NaN."""
        at, shifts = self.time[rows], np.arange(-LARGEST_SHIFT, LARGEST_SHIFT + 1)
        estimated, truth = self.deviation_estimated[rows][on], self.deviation
        cost = []
        for shift in shifts:
            place = np.interp(at - 1e-3 * shift, self.time, np.arange(len(self.time)))
            low = np.minimum(place.astype(int), len(self.time) - 2)
            part = (place - low)[:, None, None]
            shifted = (1 - part) * truth[low] + part * truth[low + 1]
            cost.append(np.sum((estimated - shifted[on]) ** 2))
        k = int(np.argmin(cost))
        if not 0 < k < len(shifts) - 1:
            return np.nan
        a, b, c = cost[k - 1 : k + 2]
        bend = a - 2 * b + c
        return round(float(shifts[k] + (0.5 * (a - c) / bend if bend > 0 else 0.0)), 1) + 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the numbers must know, a sentence each: bad PMUs, and a run without any usable speed."""
        idle = ", so that all storage idled" if self.point.case.storage and self.control.law else ""
        none = f"No speed was usable in the whole run{idle}; give more PMUs, or better ones."
        return *map(str, self.alarms), *(() if self.usable.any() else (none,))

    @property
    def df(self) -> "pd.DataFrame":
        """A row per frame, seed and machine: deviations and their standard deviation (mHz), commands, usable, on."""
        import pandas as pd

        machines = [m.called for m in self.point.case.machines]
        index = pd.MultiIndex.from_product([self.time, self.seeds, machines], names=["time_s", "seed", "machine"])
        mhz = 1e3 * self.point.case.frequency_hz
        columns = {
            "deviation_mhz": mhz * self.deviation,
            "estimated_mhz": mhz * self.deviation_estimated,
            "sigma_mhz": mhz * self.sigma,
            "true_command": self.true_commands,
            "estimated_command": self.estimated_commands,
            "usable": self.usable,
            "on": self.on,
        }
        return pd.DataFrame({name: column.ravel() for name, column in columns.items()}, index=index).reset_index()

    def __str__(self) -> str:
        return (
            f"{self.point.case.name}, {self.control.estimator} estimator: {len(self.time)} frames at "
            f"{self.control.rate} per second, {counted(len(self.seeds), 'seed')}"
            + "".join(f"\n{line}" for line in self.notes)
        )

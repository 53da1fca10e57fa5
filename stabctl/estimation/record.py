"""What an estimator knew and ordered, beside the truth, and how good it was."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl._util.wording import counted
from stabctl.controllers import BangBang
from stabctl.dynamics.operating_point import Point
from stabctl.errors import StudyError
from stabctl.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from .loop import Driven

SETTLED = 0.05  # s   after clearing, from when on the estimates are judged
FURTHEST = 100  # ms   largest shift that is tried


class Score(NamedTuple):
    """How good the estimated speed deviations were, and the orders that follow from them."""

    rmse_mhz: float  # mHz   root mean square error
    p99_mhz: float  # mHz   99th percentile of the size of the error
    delay_ms: float  # ms    shift that best aligns estimate and truth, positive where the estimate is late
    wrong_command_share: float  # -     of machine-frames whose bang-bang order is not the true one
    opposite_command_share: float  # -     of those where absorb and inject are swapped
    cpu_ms_per_frame: float  # ms    of the estimator and the controller, all machines of one seed


@dataclass(frozen=True, repr=False, eq=False)
class Record:
    """Arrays (frames, seeds, machines) unless told otherwise; `sigma` as the filter has it."""

    point: Point
    driven: "Driven"
    seeds: tuple[int, ...]
    time: np.ndarray  # (frames) s
    slip: np.ndarray  # pu   true speed deviation from nominal
    estimated: np.ndarray  # pu
    slip_sigma: np.ndarray  # pu
    deviation: np.ndarray  # pu   true own speed less the COI speed of the rest
    deviation_estimated: np.ndarray  # pu
    sigma: np.ndarray  # pu
    usable: np.ndarray  # bool   the storage may act
    on: np.ndarray  # bool   the machine runs, in a run that goes on
    nis: np.ndarray  # -
    nees: np.ndarray  # -    of angle and speed, NaN where there is no filter
    orders: np.ndarray  # (frames, seeds, devices)
    wall_s: np.ndarray  # (frames) s   of the estimator and the controller, all seeds
    runs: tuple[Trajectory, ...] = ()

    @property
    def deadband(self) -> float:
        """Speed deviation (pu) without action of the bang-bang law: the default one where another law acts."""
        law = self.driven.law if isinstance(self.driven.law, BangBang) else BangBang()
        return law.deadband / self.point.case.frequency_hz

    @property
    def wanted(self) -> np.ndarray:
        """Bang-bang orders (frames, seeds, machines) by the true deviations: absorb 1, inject -1, idle 0."""
        return np.sign(self.deviation) * (np.abs(self.deviation) > self.deadband)

    @property
    def given(self) -> np.ndarray:
        """The same by the estimated deviations."""
        return np.sign(self.deviation_estimated) * (np.abs(self.deviation_estimated) > self.deadband)

    def commands(self, before: float = np.inf) -> int:
        """Machine-frames before an instant (s) with a bang-bang order by the estimates."""
        return int(np.count_nonzero(self.given[self.time < before - 1e-9]))

    def score(self, since: float, until: float) -> Score:
        """Judge from `since` to `until` (s). `StudyError` where no running machine was seen in between."""
        rows = (self.time >= since - 1e-9) & (self.time <= until + 1e-9)
        counted = self.on[rows]
        if not counted.any():
            raise StudyError(
                f"No frame lies between {since:g} and {until:g} s with {self.point.case.name} in synchronism; "
                "clear the fault earlier or give more storage."
            )
        error = (self.deviation_estimated - self.deviation)[rows][counted] * 1e3 * self.point.case.frequency_hz
        wanted, given = self.wanted[rows][counted], self.given[rows][counted]
        return Score(
            float(np.sqrt(np.mean(error**2))),
            float(np.percentile(np.abs(error), 99)),
            self._delay(rows, counted),
            float(np.mean(wanted != given)),
            float(np.mean(wanted * given < 0)),
            float(1e3 * np.median(self.wall_s) / len(self.seeds)),
        )

    def after(self, clearing: float, until: float) -> Score:
        """Judge from `SETTLED` after the clearing of the fault (s) on."""
        return self.score(clearing + SETTLED, until)

    def _delay(self, rows: np.ndarray, counted: np.ndarray) -> float:
        """The shift (ms) of the truth, linear between frames, with the least square error; to a tenth."""
        at, shifts = self.time[rows], np.arange(-FURTHEST, FURTHEST + 1)
        seen, truth = self.deviation_estimated[rows][counted], self.deviation
        cost = []
        for shift in shifts:
            place = np.interp(at - 1e-3 * shift, self.time, np.arange(len(self.time)))
            low = np.minimum(place.astype(int), len(self.time) - 2)
            part = (place - low)[:, None, None]
            moved = (1 - part) * truth[low] + part * truth[low + 1]
            cost.append(np.sum((seen - moved[counted]) ** 2))
        k = int(np.argmin(cost))
        if 0 < k < len(shifts) - 1:
            a, b, c = cost[k - 1 : k + 2]
            bend = a - 2 * b + c
            return round(float(shifts[k] + (0.5 * (a - c) / bend if bend > 0 else 0.0)), 1) + 0.0
        return float(shifts[k])

    def __str__(self) -> str:
        return (
            f"{self.point.case.name}, {self.driven.kind} estimator: {len(self.time)} frames at {self.driven.rate} per "
            f"second, {counted(len(self.seeds), 'seed')}"
        )

    __repr__ = __str__

"""What is kept of a run: rows of signals, all or some of them, and the last angles, by which its swings are judged.

If every signal is recorded, also the extremes of speeds and voltages, of every step and not only of the rows kept.
"""

from collections import deque
from typing import Literal

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint

from ._places import Net, Places

Recorded = bool | Literal["rotors"]
BUFFER = 256e6  # bytes   of the rows that one call of the compiled loop may fill
AT_ONCE = 1200  # steps of one call; Ctrl-C and progress are handled in between


class Extremes:
    """The least and greatest speed of every rotor while it is on, and the lowest voltage of every bus after the faults.

    After the rotors, those of the angles without weight among them, while they turn an island. NaN of one that never
    did, and of a bus that has had no voltage since.
    """

    def __init__(self, point: OperatingPoint) -> None:
        self._voltages = point.layout.voltages
        self._speed = np.r_[point.rotors.speed, point.system.unweighted.column("frequency")]
        self.slowest = np.full(len(self._speed), np.nan)  # pu
        self.fastest = self.slowest.copy()  # pu
        self.lowest = np.full(point.layout.buses, np.nan)  # pu
        self.cleared = False  # whether there was a fault

    def enter(self, net: Net, places: Places) -> None:
        """Go on with the network after an event."""
        self._on = np.r_[net.island[places.unit] >= 0, places.other_weight > 0]
        self._alive, self._faulted = net.alive, net.faulted
        if net.faulted:
            self.cleared, self.lowest[:] = True, np.nan

    def add(self, rows: np.ndarray) -> None:
        """Take rows of all signals on this network."""
        speed = rows[:, self._speed]
        np.fmin(self.slowest, speed.min(axis=0), out=self.slowest, where=self._on)
        np.fmax(self.fastest, speed.max(axis=0), out=self.fastest, where=self._on)
        if not self._faulted:
            parts = rows[:, self._voltages] ** 2
            size = np.sqrt((parts[:, ::2] + parts[:, 1::2]).min(axis=0))
            np.fmin(self.lowest, size, out=self.lowest, where=self._alive)


class Recording:
    """The record of a run while it grows.

    Parameters
    ----------
    point : OperatingPoint
        Where the run starts.
    what : bool or "rotors"
        Keep all signals, none, or only those up to the angles and speeds of the rotors.
    signals : int
        Number of all signals.
    every : float, s
        Least time between two rows; 0 keeps every step. There is also a row after every event, and a last one.
    span : float, s
        Length of the time whose angles are kept.
    """

    def __init__(self, point: OperatingPoint, what: Recorded, signals: int, *, every: float, span: float) -> None:
        self._rotors, self._every, self._span, self.recording = point.rotors.angle, every, span, bool(what)
        last = int(np.r_[point.rotors.angle, point.rotors.speed].max(initial=-1))
        self.width = signals if what is True else last + 1  # of a row
        self.at_once = int(min(AT_ONCE, max(1, BUFFER // (8 * max(self.width, 1)))))
        self.extremes = Extremes(point) if what is True else None
        self._next = -np.inf
        self._times: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        self._instants: deque[np.ndarray] = deque()
        self._angles: deque[np.ndarray] = deque()

    def per_step(self, step: float) -> float:
        """Signals recorded per time step (s)."""
        return self.width * min(1.0, step / self._every if self._every else 1.0) if self.recording else 0.0

    def event(self) -> None:
        """Keep the next row."""
        self._next = -np.inf

    def enter(self, net: Net, places: Places) -> None:
        """Go on with the network after an event."""
        self.event()
        if self.extremes:
            self.extremes.enter(net, places)

    def add(self, times: np.ndarray, rows: np.ndarray) -> None:
        """Take the rows (times, width) at consecutive instants (s)."""
        if not len(times):
            return
        self._instants.append(times)
        self._angles.append(rows[:, self._rotors])
        while len(self._instants) > 1 and self._instants[1][0] < times[-1] - self._span:
            self._instants.popleft()
            self._angles.popleft()
        if not self.recording:
            return
        if self.extremes:
            self.extremes.add(rows)
        if self._every:
            kept = self._due(times)
            times, rows = times[kept], rows[kept]
        self._times.append(times)
        self._rows.append(rows)

    def kept(self, width: int) -> tuple[np.ndarray, np.ndarray]:
        """Instants (rows), s, and rows; without a record none, of this width."""
        if not self._times:
            return np.empty(0), np.empty((0, width))
        return np.concatenate(self._times), np.concatenate(self._rows)

    def angles(self, begin: float, middle: float) -> tuple[np.ndarray, int]:
        """Angles (instants, rotor units) since `begin` (s), rad, and the row of the instant `middle` (s)."""
        times, angles = np.concatenate(self._instants), np.concatenate(self._angles)
        first, half = np.searchsorted(times, (begin - 1e-9, middle - 1e-9))
        return angles[first:], int(half - first)

    def _due(self, times: np.ndarray) -> list[int]:
        """Rows that are at least the interval after the one before."""
        kept, i = list[int](), -1
        while (i := max(i + 1, int(np.searchsorted(times, self._next - 1e-9)))) < len(times):
            kept.append(i)
            self._next = float(times[i]) + self._every
        return kept

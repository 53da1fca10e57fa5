"""When a controller acts: while its gate of signals and time is open, and with which delay after a frame."""

import math
from dataclasses import dataclass
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import TIME, quantity

FASTEST = 10_000  # frames per second
SHORTEST, LONGEST = 1e-6, 60.0  # s   the shortest time other than 0, and the longest delay
MOST = 2000  # frames of a delay
ROUNDED = 5e-3  # of a frame, as 16.67ms at 60/s


@dataclass(frozen=True)
class Gate:
    """A controller acts only while its gate is open; otherwise its outputs are 0 and its states are at rest.

    Parameters
    ----------
    signal : str, optional
        The signal that opens the gate, such as "voltage:7" or "rocof:7" (Hz/s); its value, not its deviation.
    low, high : float
        The gate is open while the signal is within these bounds.
    magnitude : bool
        Compare the magnitude of the signal.
    start, end : float, s
        The gate is open only from `start` to `end`.

    Examples
    --------
    >>> gate = st.Gate("voltage:7", low=0.8)
    >>> pod = st.Controller("deviation:1", "order:1@5", [], [], [], [[100.0]], gate=gate)
    >>> st.load("two_area").clearing_time("7-8@0.4", storage="1=50MW", control=pod, resolution="1cyc").cycles
    20.0
    """

    signal: str | None = None
    low: float = -math.inf
    high: float = math.inf
    magnitude: bool = False
    start: float = -math.inf
    end: float = math.inf

    @property
    def timed(self) -> bool:
        """Whether it opens or closes at a given instant."""
        return self.start > -math.inf or self.end < math.inf

    def __post_init__(self) -> None:
        if self.signal is not None and (not isinstance(self.signal, str) or not self.signal.strip()):
            raise StudyError(
                f"gate: signal = {shown(self.signal)} does not name a signal; give one, such as 'voltage:7'."
            )
        if not isinstance(self.magnitude, bool):
            raise StudyError(f"gate: magnitude = {shown(self.magnitude)} is not allowed; give true or false.")
        for key in ("low", "high", "start", "end"):
            value: Any = getattr(self, key)
            if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
                raise StudyError(f"gate: {key} = {shown(value)} is not a number.")
        if not self.low < self.high or not self.start < self.end:
            raise StudyError("gate: the gate is never open; give low < high and start < end.")
        if self.signal is not None and self.low == -math.inf and self.high == math.inf:
            raise StudyError(f"gate: the gate of {self.signal} is always open; give low or high.")
        if self.signal is None and (self.low > -math.inf or self.high < math.inf or self.magnitude):
            raise StudyError("gate: low, high and magnitude are those of a signal; give one, such as 'voltage:7'.")


def duration(key: str, value: Any) -> float:
    """A time in seconds, from a number or text with a unit. Raises `StudyError` if it is not one."""
    found = quantity(value, "s", bare=False) if isinstance(value, str) else value
    if isinstance(found, bool) or not isinstance(found, int | float) or not 0 <= found < math.inf:
        raise StudyError(f"{key} = {shown(value)} is not a time; give {TIME.examples}.")
    if key == "delay" and found > LONGEST:
        raise StudyError(f"delay = {shown(value)} is too long; give at most {LONGEST:g} s.")
    if 0 < found < SHORTEST:
        raise StudyError(f"{key} = {shown(value)} is too short; give at least 1us.")
    return float(found)


def checked_frames(name: str, rate: Any, delay: float) -> int:
    """Frames in a delay (s). Raises `StudyError` if the rate is not allowed, or it is not a whole number of frames."""
    if isinstance(rate, bool) or not isinstance(rate, int) or not 1 <= rate <= FASTEST:
        raise StudyError(
            f"{name}: the rate of {shown(rate)} frames per second is not allowed; give a whole number from 1 to "
            f"{FASTEST}."
        )
    if delay * rate > MOST:
        raise StudyError(f"{name}: a delay of {delay:g} s is {delay * rate:.0f} frames; give at most {MOST}.")
    if abs(delay * rate - round(delay * rate)) > ROUNDED:
        below = math.floor(delay * rate)
        raise StudyError(
            f"{name}: a delay of {1e3 * delay:g} ms is not a whole number of frames at {rate}/s; give "
            f"{1e3 * below / rate:.4g} or {1e3 * (below + 1) / rate:.4g} ms."
        )
    return round(delay * rate)

"""When a controller acts: while a signal is within bounds, and within a window of time."""

import math
from dataclasses import dataclass
from typing import Any

from stabctl.errors import StudyError, shown


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
    """

    signal: str | None = None
    low: float = -math.inf
    high: float = math.inf
    magnitude: bool = False
    start: float = -math.inf
    end: float = math.inf

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

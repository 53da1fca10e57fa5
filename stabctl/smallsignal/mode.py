"""One mode: its eigenvalue, the states that participate, its shape."""

from dataclasses import dataclass

import numpy as np

from stabctl._util.verbs import verb


@dataclass(frozen=True)
class Share:
    """Participation of a state in a mode."""

    state: str
    share: float  # |p| over the sum of all |p|


@dataclass(frozen=True)
class Part:
    """A machine in a mode shape: its speed relative to the largest."""

    machine: int | str
    magnitude: float
    angle_deg: float


@dataclass(frozen=True, repr=False)
class Mode:
    """One eigenvalue of the system."""

    eigenvalue: complex  # 1/s
    electromechanical: bool
    label: str
    participation: tuple[Share, ...]  # the ten largest
    shape: tuple[Part, ...]

    plot = verb("stabctl.plotting.mode_shape:plot")

    @property
    def frequency_hz(self) -> float:
        """Frequency of the oscillation, |Im| / 2 pi."""
        return abs(self.eigenvalue.imag) / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio -Re / |eigenvalue|; 1 for a zero eigenvalue."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size if size else 1.0

    def __str__(self) -> str:
        s, ratio = self.eigenvalue, round(self.damping_ratio, 4) + 0.0
        return f"{s.real:.4f} {s.imag:+.4f}j 1/s: {self.frequency_hz:.3f} Hz, damping {ratio:.4f}; {self.label}"

    __repr__ = __str__

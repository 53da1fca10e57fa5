"""The damping ratio required of the modes."""

from dataclasses import dataclass

import numpy as np

from stabctl.errors import StudyError, shown

SLOW, FAST = 0.1, 3.0  # Hz   band of the modes that a design improves
NEAR = 0.1  # Hz   within which a mode is taken for the same before and after
SLACK = 0.002  # loss of damping ratio allowed to a mode that is not meant
GROWING = 1e-6  # 1/s   real part of an eigenvalue from which it counts as growing


@dataclass(frozen=True)
class Requirement:
    """A damping ratio that the modes of 0.1 to 3 Hz shall reach; no other mode may grow.

    Attributes
    ----------
    damping
        The damping ratio.
    floors
        Frequency (Hz) and damping ratio of the modes that need not reach it, but must not fall.
    """

    damping: float
    floors: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        given = self.damping
        if isinstance(given, bool) or not isinstance(given, int | float) or not 0 <= given < 1:
            raise StudyError(
                f"damping = {shown(given)} is not a damping ratio; give a number of at least 0 and below 1."
            )

    def spare(self, s: np.ndarray) -> np.ndarray:
        """What the damping ratio of every eigenvalue s (1/s) has beyond what it must reach; inf if nothing is asked."""
        hz, ratio = np.abs(s.imag) / (2 * np.pi), ratios(s)
        inside = (s.imag != 0) & (hz >= SLOW) & (hz <= FAST)
        asked = np.full(len(s), self.damping)
        for f, value in self.floors:
            near = np.abs(hz - f) < NEAR
            asked[near] = np.minimum(asked[near], value - SLACK)
        outside = np.where(s.real > GROWING, ratio - self.damping, np.where(s.imag == 0, np.inf, ratio))
        return np.where(inside, ratio - asked, outside)

    def sparing(self, s: np.ndarray, hz: float) -> "Requirement":
        """The same for one mode alone, that nearest to a frequency; others of s below it must stay where they are."""
        at, ratio = np.abs(s.imag) / (2 * np.pi), ratios(s)
        inside = np.flatnonzero((s.imag > 0) & (at >= SLOW) & (at <= FAST))
        meant = min(inside, key=lambda k: abs(at[k] - hz), default=-1)
        others = [k for k in inside if k != meant and ratio[k] < self.damping]
        return Requirement(self.damping, tuple((float(at[k]), float(ratio[k])) for k in others))


def ratios(s: np.ndarray) -> np.ndarray:
    """Damping ratios -Re / |s| of eigenvalues; 1 for zero."""
    size = np.abs(s)
    return np.divide(-s.real, size, out=np.ones(len(s)), where=size > 0)


def least_ratio(s: np.ndarray) -> float:
    """Smallest damping ratio of the eigenvalues s (1/s) of 0.1 to 3 Hz; 1 if there is none."""
    hz = np.abs(s.imag) / (2 * np.pi)
    return float(min(ratios(s[(hz >= SLOW) & (hz <= FAST)]), default=1.0))

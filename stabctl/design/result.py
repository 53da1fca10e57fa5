"""The result of a design: the controllers, and the modes without and with them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util import files
from stabctl._util.wording import counted
from stabctl.controllers.controller import Controller
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes

if TYPE_CHECKING:
    import pandas as pd

SLOW, FAST = 0.1, 3.0  # Hz   band of the modes that a design improves
NEAR = 0.1  # Hz   within which a mode is taken for the same before and after
SLACK = 0.002  # loss of damping ratio allowed to a mode that is not meant


@dataclass(frozen=True, repr=False)
class Design:
    """Designed controllers.

    Attributes
    ----------
    controllers
        The controllers.
    before, after
        Modes of each operating point without and with them.
    reached
        Whether the damping asked for was reached.
    """

    controllers: tuple[Controller, ...]
    before: tuple[Modes, ...]
    after: tuple[Modes, ...]
    reached: bool

    @property
    def controller(self) -> Controller:
        """The first controller."""
        return self.controllers[0]

    @property
    def worst_before(self) -> float:
        """Smallest damping ratio of 0.1 to 3 Hz without the controllers."""
        return min(least(m)[0] for m in self.before)

    @property
    def worst_after(self) -> float:
        """Smallest damping ratio of 0.1 to 3 Hz with the controllers."""
        return min(least(m)[0] for m in self.after)

    @property
    def df(self) -> "pd.DataFrame":
        """The modes of 0.1 to 3 Hz of every operating point, without and with the controllers."""
        import pandas as pd

        rows = []
        for what, several in (("before", self.before), ("after", self.after)):
            for modes in several:
                for k in modes.within(SLOW, FAST):
                    ratio, hz = modes.damping_ratio[k], modes.frequency_hz[k]
                    rows.append((what, modes.linear.point.case.name, hz, ratio, modes.label(k)))
        return pd.DataFrame(rows, columns=["controllers", "case", "frequency_hz", "damping_ratio", "mode"])

    def save(self, path: str | Path) -> tuple[Path, ...]:
        """Write the controllers to TOML files: k.toml, or k-1.toml, k-2.toml ... if there are several."""
        path = files.path_of(path)
        if len(self.controllers) == 1:
            return (self.controller.save(path),)
        named = (path.with_name(f"{path.stem}-{k + 1}{path.suffix}") for k in range(len(self.controllers)))
        return tuple(c.save(where) for c, where in zip(self.controllers, named, strict=True))

    def __str__(self) -> str:
        several = f" at {len(self.before)} operating points" if len(self.before) > 1 else ""
        text = f"{counted(len(self.controllers), 'controller')}: smallest damping ratio of {SLOW:g} to {FAST:g} Hz"
        found = f"{self.worst_before:.4f} without, {self.worst_after:.4f} with{several}"
        return f"{text}: {found}." if self.reached else f"{text}: {found}; the damping asked for is not reached."

    __repr__ = __str__


def operating_points(base: Any, storage: "Fleet | None" = None) -> list[OperatingPoint]:
    """The operating points of one case or point, or of several."""
    return [operating_point(one, storage) for one in (base if isinstance(base, list | tuple) else [base])]


def least(modes: Modes) -> tuple[float, int]:
    """Smallest damping ratio in the band, and its mode; 1 if there is none. Growing modes of any frequency count."""
    oscillating = modes.within(SLOW, FAST)
    growing = np.flatnonzero(modes.eigenvalues.real > 1e-6).tolist()
    chosen = [*oscillating, *growing]
    return min(((float(modes.damping_ratio[k]), k) for k in chosen), default=(1.0, -1))


def tuned(
    points: Sequence[OperatingPoint],
    make: Callable[[float], Sequence[Controller]],
    damping: float,
    gains: np.ndarray,
    *,
    hz: float | None = None,
) -> Design:
    """The controllers with the smallest gain that reaches a damping at all points, or with the best worst damping.

    Parameters
    ----------
    points
        Operating points.
    make
        The controllers with a gain.
    damping
        Damping ratio to reach.
    gains
        Gains that are tried, in ascending order.
    hz
        Frequency of the mode that is meant; others that were below the damping must only stay where they were. By
        default all modes are meant.
    """
    before = tuple(closed_loop(point).modes() for point in points)
    floors = [_floors(modes, damping, hz) for modes in before]

    def after(gain: float) -> tuple[Modes, ...]:
        return tuple(closed_loop(point, *make(gain)).modes() for point in points)

    def spare(gain: float) -> float:
        return min(_spare(m, damping, f) for m, f in zip(after(gain), floors, strict=True))

    best, low = (min(_spare(m, damping, f) for m, f in zip(before, floors, strict=True)), 0.0), 0.0
    for gain in map(float, gains):
        found = spare(gain)
        best = max(best, (found, gain))
        if found >= 0:
            high = gain
            for _ in range(6):
                middle = (low + high) / 2
                low, high = (low, middle) if spare(middle) >= 0 else (middle, high)
            best = spare(high), high
            break
        if found < best[0] - 0.1:
            break
        low = gain
    return Design(tuple(make(best[1])), before, after(best[1]), best[0] >= 0)


def _floors(modes: Modes, damping: float, hz: float | None) -> list[tuple[float, float]]:
    """Frequency and damping ratio of the modes that need not reach the damping."""
    if hz is None:
        return []
    meant = min(modes.within(SLOW, FAST), key=lambda k: abs(modes.frequency_hz[k] - hz), default=-1)
    others = [k for k in modes.within(SLOW, FAST) if k != meant and modes.damping_ratio[k] < damping]
    return [(float(modes.frequency_hz[k]), float(modes.damping_ratio[k])) for k in others]


def _spare(modes: Modes, damping: float, floors: Sequence[tuple[float, float]]) -> float:
    """Least distance of a damping ratio from what it must reach."""
    spare = 1.0
    for k in {*modes.within(SLOW, FAST), *np.flatnonzero(modes.eigenvalues.real > 1e-6).tolist()}:
        hz = modes.frequency_hz[k]
        near = [ratio - SLACK for f, ratio in floors if abs(f - hz) < NEAR]
        spare = min(spare, float(modes.damping_ratio[k]) - min([damping, *near]))
    return spare

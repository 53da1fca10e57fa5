"""The result of a design: the controllers, the modes without and with them, and the damping required."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Interval
from scipy.optimize import linear_sum_assignment

from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl._util.validation import guard
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes

from .outages import Outages

if TYPE_CHECKING:
    import pandas as pd

SLOW, FAST = 0.1, 3.0  # Hz   band of the modes that a design improves
SLACK = 0.002  # loss of damping ratio allowed to a mode that is not meant: any damper moves the others a little
GROWING = 1e-6  # 1/s   real part of an eigenvalue from which it counts as growing
HZ = np.geomspace(0.01, 1000.0, 1001)  # frequencies at which the largest gain is sought
ENOUGH = "The required damping is reached without the controllers, so they have almost no effect; require more damping."


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
        Whether the required damping was reached.
    short
        Damping ratio that is missing, at the worst operating point and gain, to the mode that is farthest below what it
        must have; this need not be the least damped one.
    remarks
        What else a user must know, as sentences.
    replaced
        Modes of each operating point with the stabilizers of the case that the controllers replace; empty if none.

    Examples
    --------
    >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    >>> found = st.design.pod(base, "deviation:3", "order:3@11", damping=0.05)
    >>> print(found)
    1 controller: smallest damping ratio of 0.1 to 3 Hz: -0.0087 without, 0.0500 with.
    >>> found.reached, found.controller
    (True, pod: deviation:3 -> order:3@11 (2 states, continuous))
    """

    controllers: tuple[Controller, ...]
    before: tuple[Modes, ...]
    after: tuple[Modes, ...]
    reached: bool
    short: float = 0.0
    remarks: tuple[str, ...] = ()
    replaced: tuple[Modes, ...] = ()

    plot = verb("stabctl.view.figures.design:plot_design")
    report = verb("stabctl.view.pages.design_page:write")

    @classmethod
    def of(
        cls, points: Sequence[OperatingPoint], controllers: Sequence[Controller], *, short: float, needed: bool = True
    ) -> "Design":
        """The design with the modes of all operating points without and with its controllers.

        Parameters
        ----------
        points, controllers
            Operating points and controllers.
        short
            Damping ratio that is missing; negative if there is more than required.
        needed
            Whether the required damping is missing without the controllers.

        Returns
        -------
        Design

        Examples
        --------
        >>> base = st.load("two_area_thyristor").initialize(storage="50MW")
        >>> pod = st.Controller("deviation:1", "order:1@5", [], [], [], [[500.0]])
        >>> print(st.design.Design.of([base], [pod], short=0.0))
        1 controller: smallest damping ratio of 0.1 to 3 Hz: -0.0087 without, 0.0755 with.
        """
        before = tuple(closed_loop(point).modes() for point in points)
        after = tuple(closed_loop(point, *controllers).modes() for point in points)
        return cls(tuple(controllers), before, after, short <= 0, max(short, 0.0), () if needed else (ENOUGH,))

    @property
    def base(self) -> OperatingPoint:
        """The first operating point, without the controllers: what they are simulated with."""
        return self.before[0].linear.point

    @property
    def given(self) -> OperatingPoint | None:
        """The first operating point with the stabilizers of the case that the controllers replace; None if none."""
        return self.replaced[0].linear.point if self.replaced else None

    @property
    def controller(self) -> Controller:
        """The first controller. Raises `StudyError` if there is none."""
        if not self.controllers:
            raise StudyError("There is no controller: the result is values of the case, which its `case` has.")
        return self.controllers[0]

    @property
    def worst_before(self) -> float:
        """Smallest damping ratio of 0.1 to 3 Hz without the controllers."""
        return min(least(m)[0] for m in self.before)

    @property
    def worst_replaced(self) -> float | None:
        """Smallest damping ratio of 0.1 to 3 Hz with the stabilizers of the case that they replace; None if none."""
        return min((least(m)[0] for m in self.replaced), default=None)

    @property
    def worst_after(self) -> float:
        """Smallest damping ratio of 0.1 to 3 Hz with the controllers."""
        return min(least(m)[0] for m in self.after)

    @property
    def largest_gains(self) -> dict[str, float]:
        """The largest gain at any frequency of every continuous controller of one signal, pu, by name."""
        single = (c for c in self.controllers if c.rate is None and c.law is None and c.D.shape == (1, 1))
        return {c.name: largest_gain(c) for c in single}

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

    @property
    def worst(self) -> "pd.DataFrame":
        """Smallest damping ratio of 0.1 to 3 Hz of every operating point without and with the controllers."""
        import pandas as pd

        rows = []
        for before, after in zip(self.before, self.after, strict=True):
            ratio, k = least(after)
            at = (float(after.frequency_hz[k]), after.label(k)) if k >= 0 else (np.nan, "")
            rows.append((before.linear.point.case.name, least(before)[0], ratio, *at))
        return pd.DataFrame(rows, columns=["case", "before", "after", "frequency_hz", "mode"])

    def save(self, path: str | Path) -> tuple[Path, ...]:
        """Write the controllers to TOML files.

        Parameters
        ----------
        path : str or Path
            File for one controller, "k.toml"; several are written to k-1.toml, k-2.toml ...

        Returns
        -------
        tuple of Path
            The files.

        Raises
        ------
        StudyError
            If a file cannot be written.

        Examples
        --------
        >>> base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
        >>> st.design.pod(base, "deviation:3", "order:3@11", damping=0.05).save("pod.toml")
        (PosixPath('pod.toml'),)
        """
        path = files.path_of(path)
        if len(self.controllers) == 1:
            return (self.controller.save(path),)
        named = (path.with_name(f"{path.stem}-{k + 1}{path.suffix}") for k in range(len(self.controllers)))
        return tuple(c.save(where) for c, where in zip(self.controllers, named, strict=True))

    def __str__(self) -> str:
        if not self.controllers:  # parameters of the case alone, of which the remarks tell
            missed = f"The required damping is not reached, short by up to {self.short:.4f}." if self.short else ""
            return "\n".join(filter(None, [*self.remarks, missed]))
        several = f" at {len(self.before)} operating points" if len(self.before) > 1 else ""
        text = f"{counted(len(self.controllers), 'controller')}: smallest damping ratio of {SLOW:g} to {FAST:g} Hz"
        found = f"{self.worst_before:z.4f} without, {self.worst_after:z.4f} with{several}"
        if not self.short:
            return "\n".join([f"{text}: {found}.", *self.remarks])
        (ratio, k), modes = min(((least(m), m) for m in self.after), key=lambda pair: pair[0][0])
        weakest = f"least damped: {ratio:z.4f} at {modes.frequency_hz[k]:.3f} Hz ({modes.label(k)})"
        missed = f"the required damping is not reached, a mode is short by up to {self.short:.4f}"
        return "\n".join([f"{text}: {found}; {missed}; {weakest}.", *self.remarks])

    __repr__ = __str__


def largest_gain(c: Controller) -> float:
    """The largest gain of a continuous controller of one signal at any frequency, output over input."""
    return float(np.abs(c.to_control()(2j * np.pi * HZ)).max())


def least(modes: Modes) -> tuple[float, int]:
    """Smallest damping ratio in the band, and its mode; 1 if there is none. Growing modes of any frequency count."""
    oscillating = modes.within(SLOW, FAST)
    growing = np.flatnonzero(modes.eigenvalues.real > GROWING).tolist()
    chosen = [*oscillating, *growing]
    return min(((float(modes.damping_ratio[k]), k) for k in chosen), default=(1.0, -1))


@dataclass(frozen=True)
class Requirement:
    """A damping ratio that the modes of 0.1 to 3 Hz shall reach; no other mode may grow.

    Attributes
    ----------
    damping
        The damping ratio.
    floors
        Eigenvalue (1/s) of every mode of 0.1 to 3 Hz as it is, and the damping ratio that it must have.
    """

    damping: Annotated[float, "-", "damping ratio", Interval(ge=0, lt=1)]
    floors: tuple[tuple[complex, float], ...] = ()

    def __post_init__(self) -> None:
        guard(self)

    def spare(self, s: np.ndarray) -> np.ndarray:
        """What the damping ratio of every eigenvalue s (1/s) has beyond what it must reach; inf if nothing is asked.

        Nothing is asked of the second of a pair. The modes of the floors are those whose eigenvalues moved least.
        """
        inside, ratio = _upper(s), ratios(s)
        asked = np.full(len(s), self.damping)
        if self.floors:
            before, least = np.array(self.floors).T
            floor, own = linear_sum_assignment(np.abs(before[:, None] - s[inside]))
            asked[np.flatnonzero(inside)[own]] = least[floor].real
        outside = np.where(s.real > GROWING, ratio - self.damping, np.where(s.imag == 0, np.inf, ratio))
        return np.where(inside, ratio - asked, np.where(s.imag < 0, np.inf, outside))

    def sparing(self, s: np.ndarray, hz: float) -> "Requirement":
        """The same for one mode alone, that nearest to a frequency; others of s below it may fall by SLACK."""
        inside = s[_upper(s)]
        ratio, edge = ratios(inside), -GROWING / np.abs(inside)
        least = np.where(ratio < edge, ratio - SLACK, np.maximum(ratio - SLACK, edge))
        least[np.abs(inside.imag - 2 * np.pi * hz).argsort()[:1]] = self.damping
        least = np.minimum(least, self.damping)
        return Requirement(self.damping, tuple(zip(inside.tolist(), least.tolist(), strict=True)))


def _upper(s: np.ndarray) -> np.ndarray:
    """Which eigenvalues (1/s) are modes of 0.1 to 3 Hz, one of each pair."""
    hz = s.imag / (2 * np.pi)
    return np.asarray((hz >= SLOW) & (hz <= FAST))


def ratios(s: np.ndarray) -> np.ndarray:
    """Damping ratios -Re / |s| of eigenvalues; 1 for zero."""
    size = np.abs(s)
    return np.divide(-s.real, size, out=np.ones(len(s)), where=size > 0)


def least_ratio(s: np.ndarray) -> float:
    """Smallest damping ratio of the eigenvalues s (1/s) of 0.1 to 3 Hz; 1 if there is none."""
    hz = np.abs(s.imag) / (2 * np.pi)
    return float(min(ratios(s[(hz >= SLOW) & (hz <= FAST)]), default=1.0))


def operating_points(base: Any, storage: "Fleet | None" = None) -> list[OperatingPoint]:
    """The operating points of one case or point, or of several."""
    several = base if isinstance(base, list | tuple | Outages) else [base]
    if not len(several):
        raise StudyError("There is no operating point to design for; give a case, or several operating points.")
    return [operating_point(one, storage) for one in several]

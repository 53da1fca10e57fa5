"""Choice of signal and input for damping a mode: pairs ranked by residue and availability."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.tabular import Tabular
from stabctl._util.units import hertz
from stabctl._util.verbs import verb
from stabctl._util.wording import near
from stabctl.controllers.timing import duration
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes

if TYPE_CHECKING:
    import pandas as pd

RANGES = {"order": 1.0, "vs": 0.1, "vref": 0.05, "pref": 0.05}  # what an output may give, in its unit; others 0.1
SIGNALS = "deviation, flow"  # that are ranked by default
DIGITS = 11  # of a score, so that signals that are the same by symmetry rank equal
SHOWN = 5  # pairs in the summary
UNSEEN = 1e-9  # residue of a mode that a feedback cannot move
ASIDE = 0.2  # of the frequency given, within which a mode is taken for the one that is meant


@dataclass(frozen=True, repr=False)
class Pairs(Tabular):
    """Pairs of a signal that is read and an input that is driven, for one mode.

    Attributes
    ----------
    case
        Name of the case.
    mode_hz, mode
        Frequency (Hz) and name of the mode.
    inputs, outputs
        Names of the signals that are read, and of the inputs that are driven.
    residues
        Residues (inputs, outputs), complex: change of the eigenvalue (1/s) per gain.
    weights
        Availability of every pair (inputs, outputs), with the delay.
    scores
        Score of every pair (inputs, outputs), 1/s.

    Examples
    --------
    >>> found = st.design.pairs(st.load("two_area_thyristor"), "flow, deviation", storage="3@11=50MW")
    >>> print(found.best, found.scores.max().round(6), round(found.mode_hz, 3))
    ('flow:7-8', 'order:3@11') 0.000541 0.608
    """

    case: str
    mode_hz: float
    mode: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    residues: np.ndarray
    weights: np.ndarray
    scores: np.ndarray

    plot = verb("stabctl.view.figures.design:plot_pairs")

    @property
    def best(self) -> tuple[str, str]:
        """The signal that is read and the input that is driven with the highest score; an error if none is above 0."""
        if not self.scores.max() > 0:
            raise StudyError(
                f"No pair has a score above 0 for the mode at {self.mode_hz:.3f} Hz: availability or delay leave no "
                "signal; give others, a shorter delay, or input and output."
            )
        i, j = np.unravel_index(int(self.scores.argmax()), self.scores.shape)
        return self.inputs[i], self.outputs[j]

    @property
    def df(self) -> "pd.DataFrame":
        """All pairs, the best first."""
        import pandas as pd

        rows = [
            (
                a,
                b,
                abs(self.residues[i, j]),
                np.rad2deg(np.angle(self.residues[i, j])),
                self.weights[i, j],
                self.scores[i, j],
            )
            for i, a in enumerate(self.inputs)
            for j, b in enumerate(self.outputs)
        ]
        columns = ["input", "output", "residue", "angle_deg", "availability", "score"]
        return pd.DataFrame(rows, columns=columns).sort_values(
            "score", ascending=False, ignore_index=True, kind="stable"
        )

    def __str__(self) -> str:
        first = self.df.head(SHOWN)
        names = ", ".join(f"{r.input} to {r.output} ({r.score:.3g})" for r in first.itertuples())
        what = f"{self.scores.size} pairs for the mode at {self.mode_hz:.3f} Hz ({self.mode}) of {self.case}"
        return f"{what}; best: {names}."

    __repr__ = __str__


def pairs(
    base: "Case | OperatingPoint",
    inputs: str | Sequence[str] = SIGNALS,
    outputs: str | Sequence[str] | None = None,
    *,
    mode: str | float | None = None,
    availability: Mapping[str, float] | None = None,
    delay: str | float | Mapping[str, str | float] = 0.0,
    ranges: Mapping[str, float] | None = None,
    storage: "Fleet | None" = None,
) -> Pairs:
    r"""Rank the pairs of a signal and an input for damping a mode.

    The score of a pair is

    $$ \frac{|R| \, r}{a} \, \alpha \cos \omega T $$

    with the residue $R$, the largest output $r$, the availability $\alpha$, the delay $T$, and $a$, the root of the sum
    of squares of the signal in all electromechanical modes (each with a largest speed of 1 pu). A signal that shows the
    mode alone, and an input that moves it far, score highest: the gain $r/a$ takes the
    whole range at a speed of 1 pu.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    inputs : str or sequence of str
        Signals that may be read.
    outputs : str or sequence of str, optional
        Inputs that may be driven; by default the orders of the storage devices, or the stabilizer inputs if the case
        has none.
    mode : str or float, Hz, optional
        Frequency of the mode; by default the least damped electromechanical one.
    availability : mapping of str to float, optional
        Share of the time that a signal, or all of a kind, is available: {"deviation:1": 0.99, "flow": 0.9}; also of an
        input that is driven. 1 for what is not named.
    delay : str, float, or mapping of str, s
        Time from measurement to output, for all signals or for some.
    ranges : mapping of str to float, optional
        What an input, or all of a kind, may be given, in its unit; by default 1 for orders, 0.1 for "vs", 0.05 for
        "vref" and "pref", and 0.1 for others.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    Pairs

    Raises
    ------
    StudyError
        If there is no such signal or mode, or no input to drive.

    Examples
    --------
    >>> case = st.load("two_area_thyristor")
    >>> st.design.pairs(case, storage="50MW", delay={"deviation": "100ms"}).best
    ('flow:7-8', 'order:3@11')
    """
    point = operating_point(base, storage)
    reads = chosen(point.case, inputs, OUTPUTS)
    drives = chosen(point.case, outputs or ("order" if point.case.storage else "vs"), INPUTS)
    if not reads or not drives:
        raise StudyError(f"{point.case.name} has no signal to read, or no input to drive; give inputs and outputs.")
    modes = closed_loop(point, inputs=drives, outputs=reads).modes()
    k = meant(modes, None if mode is None else hertz(mode))
    speed = np.abs(modes.speeds).max(axis=0)
    seen = modes.observability()
    residues = np.outer(seen[:, k], modes.controllability()[k])
    swings = modes.swings()
    size = np.sqrt((np.abs(seen[:, swings] / speed[swings]) ** 2).sum(axis=1))
    _known("availability", availability, (*reads, *drives))
    _known("ranges", ranges, drives)
    _known("delay", delay if isinstance(delay, Mapping) else None, reads)
    late = {name: duration("delay", value) for name, value in delay.items()} if isinstance(delay, Mapping) else {}
    each = 0.0 if isinstance(delay, Mapping) else duration("delay", delay)
    T = np.array([_of(late, s, each) for s in reads])
    weight = np.array([_of(availability, s, 1.0, most=1.0) for s in reads]) * np.maximum(
        np.cos(modes.eigenvalues[k].imag * T), 0.0
    )
    weights = np.outer(weight, [_of(availability, s, 1.0, most=1.0) for s in drives])
    reach = np.array([_of(ranges, s, RANGES.get(s.kind, 0.1)) for s in drives])
    scores = np.abs(residues) * weights * reach / np.maximum(size, UNSEEN)[:, None]
    scores = np.round(scores, DIGITS)
    at = float(modes.frequency_hz[k]), modes.label(k)
    return Pairs(
        point.case.name, *at, tuple(s.name for s in reads), tuple(s.name for s in drives), residues, weights, scores
    )


def _known(key: str, given: object, signals: Sequence[Signal]) -> None:
    """Raise `StudyError` unless values are given for some of these signals or their kinds."""
    if given is not None and not isinstance(given, Mapping):
        raise StudyError(f"{key} = {shown(given)} is not a dict of signals; give {{'flow': 0.9}}, for example.")
    known = list(dict.fromkeys([*(s.kind for s in signals), *(s.name for s in signals)]))
    for name in given or ():
        if name not in known:
            raise StudyError(f"{key} names {shown(name)}, which is not among the signals; {near(str(name), known)}")


def _of(given: Mapping[str, float] | None, signal: Signal, otherwise: float, most: float = 1e9) -> float:
    """A value given for a signal or its kind."""
    for key in (signal.name, signal.kind):
        if given and key in given:
            value = given[key]
            if not (isinstance(value, int | float) and 0 <= value <= most):
                raise StudyError(f"{key} = {shown(value)} is not allowed; give a number from 0 to {most:g}.")
            return float(value)
    return otherwise


def meant(modes: Modes, hz: float | None) -> int:
    """Index of the electromechanical mode nearest to a frequency, or of the least damped one."""
    swings = modes.swings()
    if not swings:
        raise StudyError(f"{modes.linear.name} has no electromechanical mode to damp.")
    if hz is None:
        return modes.least_damped()[-1]
    k = min(swings, key=lambda k: abs(modes.frequency_hz[k] - hz))
    if abs(modes.frequency_hz[k] - hz) > ASIDE * hz:
        known = ", ".join(f"{modes.frequency_hz[k]:.3f}" for k in swings)
        raise StudyError(f"{modes.linear.name} has no electromechanical mode near {hz:g} Hz; they are at {known} Hz.")
    return k

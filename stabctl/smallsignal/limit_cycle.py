"""Limit cycles as records: frequency, amplitudes, stability, and the Nyquist curves that show them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl._util.wording import counted

from .describing import Nonlinearity

if TYPE_CHECKING:
    import pandas as pd

MOST = 3  # signals named in the sentence


@dataclass(frozen=True)
class Component:
    """The fundamental of one signal in a limit cycle."""

    signal: str
    amplitude: float
    angle_deg: float
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.signal} {self.amplitude:.4g}{' ' if self.unit else ''}{self.unit}"


@dataclass(frozen=True)
class LimitCycle:
    """One limit cycle.

    Attributes
    ----------
    frequency_hz
        Frequency, Hz.
    stable
        Whether the system returns to it: a larger swing decays and a smaller one grows (Loeb's criterion), and no other
        mode of the loop with the gains N(A) grows.
    wanted
        What each output with a deadband, limits or relay is asked for, before they act; in the unit of the output.
    signals
        The signals asked for, or the inputs of these controllers; speeds and frequencies in mHz.
    third_harmonic
        Estimate of the third harmonic of what is wanted over its fundamental. The method takes it for zero.
    inverse
        -1/N(A) of the output with the largest amplitude, where the Nyquist curve meets it.
    """

    frequency_hz: float
    stable: bool
    wanted: tuple[Component, ...]
    signals: tuple[Component, ...]
    third_harmonic: float
    inverse: float

    def __getitem__(self, signal: str) -> Component:
        """The component of one signal, by name."""
        return {c.signal: c for c in (*self.wanted, *self.signals)}[signal]

    def __str__(self) -> str:
        shown = sorted(self.signals or self.wanted, key=lambda c: -c.amplitude)[:MOST]
        kind = "stable" if self.stable else "unstable"
        return f"{self.frequency_hz:.4f} Hz, {kind}, {', '.join(map(str, shown))}"


@dataclass(frozen=True)
class Nyquist:
    """The loop gain L(jw), sign of negative feedback, and what limits act on it: a cycle is where L = -1/N(A)."""

    name: str
    hz: np.ndarray
    gain: np.ndarray
    acts: Nonlinearity


@dataclass(frozen=True, repr=False)
class LimitCycles(Tabular):
    """The limit cycles of a closed loop, by frequency.

    Attributes
    ----------
    name : str
        Name of the case.
    band : pair of float, Hz
        Frequencies that were searched.
    cycles : tuple of LimitCycle
        The limit cycles.
    curves : tuple of Nyquist
        Loop gains of the figure: of the only output, or for each limit cycle of the output with the largest
        oscillation, with the others as gains.
    """

    name: str
    band: tuple[float, float]
    cycles: tuple[LimitCycle, ...]
    curves: tuple[Nyquist, ...]

    plot = verb("stabctl.plotting.limit_cycles:plot")

    @property
    def df(self) -> "pd.DataFrame":
        """One row per limit cycle; amplitudes by signal."""
        import pandas as pd

        rows = [
            {"frequency_hz": c.frequency_hz, "stable": c.stable, "third_harmonic": c.third_harmonic}
            | {f"{k.signal}{f' ({k.unit})' if k.unit else ''}": k.amplitude for k in (*c.wanted, *c.signals)}
            for c in self.cycles
        ]
        return pd.DataFrame(rows)

    def __len__(self) -> int:
        return len(self.cycles)

    def __str__(self) -> str:
        low, high = self.band
        found = counted(len(self), "limit cycle") if self.cycles else "no limit cycle"
        text = f"{self.name}: {found} from {low:g} to {high:g} Hz"
        return "\n".join([text + (":" if self.cycles else ""), *(f"  {c}" for c in self.cycles)])

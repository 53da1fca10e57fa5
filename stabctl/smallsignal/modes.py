"""Modes of a linear model: damping, participation factors, mode shapes, controllability and observability."""

from dataclasses import dataclass
from functools import cached_property
from html import escape
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.errors import StudyError, shown

from . import naming
from .descriptor import Descriptor
from .eigen import ZERO
from .mode import Mode, Part, Share
from .model import Linear, eliminated

if TYPE_CHECKING:
    import control
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Modes:
    """Eigenvalues with left and right eigenvectors, W^H V = I; by frequency, conjugate pairs next to each other."""

    linear: Linear
    eigenvalues: np.ndarray  # (modes) complex, 1/s
    right: np.ndarray  # (states, modes) V
    left: np.ndarray  # (states, modes) W
    band: tuple[float, float] | None = None  # Hz   of the table; None: all modes

    plot = verb("stabctl.plotting.modes:plot")

    def __len__(self) -> int:
        return len(self.eigenvalues)

    @property
    def frequency_hz(self) -> np.ndarray:
        """Frequencies |Im| / 2 pi (modes)."""
        return np.abs(self.eigenvalues.imag) / (2 * np.pi)

    @property
    def damping_ratio(self) -> np.ndarray:
        """Damping ratios -Re / |eigenvalue| (modes); 1 for a zero eigenvalue."""
        size = np.abs(self.eigenvalues)
        return np.divide(-self.eigenvalues.real, size, out=np.ones(len(self)), where=size > 0)

    @cached_property
    def participation(self) -> np.ndarray:
        """Participation factors p_ki = conj(w_ki) v_ki (states, modes), complex; each column sums to 1."""
        return self.left.conj() * self.right

    @cached_property
    def shares(self) -> np.ndarray:
        """Magnitudes of the participation factors (states, modes), each column scaled to a sum of 1."""
        size = np.abs(self.participation)
        return size / size.sum(axis=0)

    @cached_property
    def speeds(self) -> np.ndarray:
        """Speeds (rotor units, modes) in the right eigenvectors, pu.

        The speed of a virtual rotor that is not a state follows from its angle: wb speed = eigenvalue angle.
        """
        point = self.linear.point
        speeds = self.right[self.linear.angles()] * (self.eigenvalues / (2 * np.pi * point.case.frequency_hz))
        speeds[point.rotors.speed < point.layout.nx] = self.right[self.linear.speeds()]
        return speeds

    @cached_property
    def shapes(self) -> np.ndarray:
        """Mode shapes: speeds (rotor units, modes) relative to the largest of each mode; 0 if none moves."""
        speeds = self.speeds
        if not len(speeds):
            return speeds
        largest = np.take_along_axis(speeds, np.abs(speeds).argmax(axis=0)[None], axis=0)
        still = np.abs(largest[0]) < 1e-9 * np.abs(self.right).max(axis=0)
        return np.where(still, 0, speeds / np.where(still, 1, largest[0]))

    @cached_property
    def electromechanical(self) -> np.ndarray:
        """Which modes are electromechanical: machines, or converters with a virtual rotor, swing against each other."""
        rotor = np.r_[self.linear.angles(), self.linear.speeds()]
        return naming.swings(self.eigenvalues, self.shares, self.shapes, rotor, self.linear.point.inertia)

    def label(self, k: int) -> str:
        """Name of mode k: the machines and converters that swing against each other, or the dominant state."""
        linear, H = self.linear, self.linear.point.inertia
        if self.eigenvalues[k] == 0:
            return naming.zero(linear, self.right[:, k], self.left[:, k], k == 0)
        if self.electromechanical[k]:
            rotors, weight = linear.point.rotors, self.shares[linear.angles(), k]
            weight[rotors.speed < linear.point.layout.nx] = self.shares[linear.speeds(), k]
            return naming.against(self.shapes[:, k], weight, linear.point.rotor_names, rotors.virtual)
        return naming.leader(linear, self.shares[:, k], self.shapes[:, k], H, self.eigenvalues[k].imag != 0)

    def mode(self, k: int) -> Mode:
        """Mode k as a record; k is an index of `eigenvalues`, as returned by `swings()`."""
        count = len(self.eigenvalues)
        if not isinstance(k, Integral) or not -count <= k < count:
            raise StudyError(
                f"There is no mode {shown(k)}; give a number from 0 to {count - 1}, such as one of swings()."
            )
        first = np.argsort(-self.shares[:, k], kind="stable")[:10]
        shares = tuple(Share(self.linear.states[i], float(self.shares[i, k])) for i in first)
        parts = zip(self.linear.point.rotor_names, self.shapes[:, k], strict=True)
        shape = tuple(Part(name, float(abs(s)), float(np.angle(s, deg=True))) for name, s in parts)
        return Mode(complex(self.eigenvalues[k]), bool(self.electromechanical[k]), self.label(k), shares, shape)

    def swings(self) -> list[int]:
        """Indices of the electromechanical modes, one of each pair, the slowest first."""
        return [int(k) for k in np.flatnonzero(self.electromechanical) if self.eigenvalues[k].imag > 0]

    def within(self, low_hz: float, high_hz: float) -> list[int]:
        """Indices of the oscillatory modes in a band of frequencies, one of each pair."""
        if not 0 <= low_hz <= high_hz:
            raise StudyError(
                f"The band from {low_hz:g} to {high_hz:g} Hz is empty or negative; give the lower frequency first."
            )
        f = self.frequency_hz
        return [int(k) for k in np.flatnonzero((self.eigenvalues.imag > 0) & (f >= low_hz) & (f <= high_hz))]

    @property
    def stable(self) -> bool:
        """Whether no mode grows; zero eigenvalues and undamped oscillations do not."""
        return bool((self.eigenvalues.real <= ZERO).all())

    def controllability(self) -> np.ndarray:
        """Controllability W^H B (modes, inputs): how strongly an input excites a mode."""
        return self.left.conj().T @ self.linear.B

    def observability(self) -> np.ndarray:
        """Observability C V (outputs, modes): how strongly a mode appears in an output."""
        return self.linear.C @ self.right

    def residues(self, output: str | int = 0, input: str | int = 0) -> np.ndarray:
        """Residues (modes) of the transfer function from an input to an output (labels or indices).

        They are also the derivatives of the eigenvalues with respect to the gain k of the feedback u = k y, at k = 0.
        """
        i = naming.index(self.linear.outputs, output, "output")
        j = naming.index(self.linear.inputs, input, "input")
        return self.observability()[i] * self.controllability()[:, j]

    @property
    def df(self) -> "pd.DataFrame":
        """The modes of the band, or all of them, one of each pair; `swing` marks electromechanical modes."""
        import pandas as pd

        shown = np.flatnonzero(self.eigenvalues.imag >= 0) if self.band is None else self.within(*self.band)
        columns = {
            "frequency_hz": self.frequency_hz[shown],
            "damping_ratio": self.damping_ratio[shown],
            "real": self.eigenvalues.real[shown],
            "imag": self.eigenvalues.imag[shown],
            "swing": self.electromechanical[shown],
            "mode": [self.label(int(k)) for k in shown],
        }
        return pd.DataFrame(columns)

    def to_control(self) -> "control.StateSpace":
        """The linear model as a python-control system with the same labels."""
        return (eliminated(self.linear) if isinstance(self.linear, Descriptor) else self.linear).to_control()

    def __str__(self) -> str:
        worst = min(self.swings(), key=lambda k: self.damping_ratio[k], default=None)
        counts = counted(len(self), "eigenvalue"), counted(len(self.swings()), "electromechanical mode")
        text = f"{self.linear.point.case.name}: {', '.join(counts)}"
        if worst is not None:
            hz, ratio = self.frequency_hz[worst], round(self.damping_ratio[worst], 4) + 0.0
            text += f"; least damped: {hz:.3f} Hz, damping ratio {ratio:.4f} ({self.label(worst)})"
        return text + ("." if self.stable else f"; the operating point is unstable: {self._fastest_growing()}.")

    def _fastest_growing(self) -> str:
        """The eigenvalue with the largest real part, and its mode."""
        k = int(self.eigenvalues.real.argmax())
        s = self.eigenvalues[k]
        swing = f" +- {abs(s.imag):.4g}j" if s.imag else ""
        return f"eigenvalue {s.real:.4g}{swing} 1/s ({self.label(k)})"

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>{self.df.to_html(index=False, float_format='{:.4f}'.format)}"

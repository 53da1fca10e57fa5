"""Modes of a linear model: damping, participation factors, mode shapes, controllability and observability."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from stabctl import units
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from . import naming, selected
from .descriptor import Descriptor, descriptor
from .eigen import ZERO, Eigen, eigen
from .mode import Mode, Part, Share
from .model import Linear, eliminated

if TYPE_CHECKING:
    import control
    import pandas as pd

LARGE = 2000  # states beyond which only modes of a band are computed: all would take minutes
BAND = (0.1, 2.5)  # Hz   electromechanical modes
DAMPING = (-0.1, 0.3)  # damping ratios of a selection


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
    def shapes(self) -> np.ndarray:
        """Mode shapes: speeds (machines, modes) relative to the largest of each mode; 0 if no machine moves."""
        speeds = self.right[self.linear.speeds()]
        largest = np.take_along_axis(speeds, np.abs(speeds).argmax(axis=0)[None], axis=0)
        still = np.abs(largest[0]) < 1e-9 * np.abs(self.right).max(axis=0)
        return np.where(still, 0, speeds / np.where(still, 1, largest[0]))

    @cached_property
    def electromechanical(self) -> np.ndarray:
        """Which modes are electromechanical: machines swing against each other (modes)."""
        rotor = np.r_[self.linear.angles(), self.linear.speeds()]
        return naming.swings(self.eigenvalues, self.shares, self.shapes, rotor, self.linear.point.inertia)

    def label(self, k: int) -> str:
        """Name of mode k: the machines that swing against each other, or the dominant state."""
        linear, H = self.linear, self.linear.point.inertia
        if self.eigenvalues[k] == 0:
            return naming.zero(linear, self.right[:, k], self.left[:, k], k == 0)
        if self.electromechanical[k]:
            weight = self.shares[linear.speeds(), k]
            return naming.against(self.shapes[:, k], weight, [m.called for m in linear.point.case.machines])
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
        parts = zip(self.linear.point.case.machines, self.shapes[:, k], strict=True)
        shape = tuple(Part(m.called, float(abs(s)), float(np.angle(s, deg=True))) for m, s in parts)
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
        i, j = _place(self.linear.outputs, output, "output"), _place(self.linear.inputs, input, "input")
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
        return text + ("." if self.stable else "; the operating point is unstable.")

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>{self.df.to_html(index=False, float_format='{:.4f}'.format)}"


@dataclass(frozen=True, repr=False)
class Selected(Modes):
    """The modes in a band of frequencies and damping ratios, one of each pair."""

    linear: Descriptor  # type: ignore[assignment]  # sparse, in place of the dense model
    damping: tuple[float, float] = DAMPING

    def controllability(self) -> np.ndarray:
        """W^H B (modes, inputs), B = fu - fv inv(gv) gu."""
        d = self.linear
        return self.left.conj().T @ (d.fu.toarray() - d.fv @ splu(d.gv).solve(d.gu.toarray()))

    def observability(self) -> np.ndarray:
        """C V (outputs, modes), C = hx - hv inv(gv) gx."""
        d, factors = self.linear, splu(self.linear.gv)
        currents = d.gx @ self.right
        return d.hx @ self.right - d.hv @ (factors.solve(currents.real) + 1j * factors.solve(currents.imag))

    def __str__(self) -> str:
        (slow, fast), (low, high) = self.band or (0.0, np.inf), self.damping
        asked = f"{slow:g} to {fast:g} Hz with damping ratios from {low:g} to {high:g}"
        whole = super().__str__().partition(": ")[2].replace("eigenvalue", "mode", 1)
        return f"{self.linear.name}, {len(self.linear.states)} states, only modes from {asked}: {whole}"

    __repr__ = __str__


def modes(
    base: Case | OperatingPoint,
    band: str | Sequence[str | float] | None = None,
    *,
    storage: "Fleet | None" = None,
    damping: tuple[float, float] = DAMPING,
) -> Modes:
    """Compute the modes of a system at its operating point.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    band : str or pair, optional
        Frequencies of the modes in `df`: "0.1..2Hz", or two numbers in Hz. Up to 2000 states all modes are computed;
        above that, only those of the band (0.1 to 2.5 Hz by default).
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    damping : tuple of float
        Lowest and highest damping ratio, if only the modes of a band are computed.

    Returns
    -------
    Modes

    Raises
    ------
    LinearizationError
        If the point is not an equilibrium, or a device is exactly at a limit; names the state or the limit.
    StudyError
        If the band is not a band of frequencies.
    """
    chosen = None if band is None else units.band(band)
    d = descriptor(operating_point(base, storage))
    if len(d.rows) > LARGE:
        return analyze(d, chosen, damping)
    return replace(analyze(d), band=chosen)


def analyze(
    model: Linear | Descriptor,
    band: tuple[float, float] | None = None,
    damping: tuple[float, float] = DAMPING,
) -> Modes:
    """Compute the modes of a linear model or of a sparse descriptor.

    Parameters
    ----------
    model : Linear or Descriptor
        Of a linear model all modes are computed (LAPACK); of a descriptor those of a band (shift-invert Arnoldi).
    band : tuple of float, Hz, optional
        Lowest and highest frequency. A descriptor without a band is treated as a linear model up to `LARGE` states,
        and with the band `BAND` above that.
    damping : tuple of float
        Lowest and highest damping ratio of the modes in a band.

    Returns
    -------
    Modes

    Raises
    ------
    StudyError
        If no unit has a rotor, or the band or the damping ratios are not possible.
    """
    if not len(model.point.rotors.unit):
        raise StudyError(
            f"{model.point.case.name} has no synchronous machine, so its frequency is not defined; add one to compute "
            "modes."
        )
    if isinstance(model, Descriptor):
        if band is not None or len(model.rows) > LARGE:
            band = BAND if band is None else band
            return Selected(model, *_fixed(selected.band(model, *band, damping)), band, damping=damping)
        model = eliminated(model)
    elif band is not None:
        raise StudyError(
            "Computing only the modes of a band needs a sparse model; use stabctl.smallsignal.descriptor to linearize."
        )
    return Modes(model, *_fixed(eigen(model.A, model.angles())))


def _fixed(found: Eigen) -> Eigen:
    for part in found:
        part.setflags(write=False)
    return found


def _place(labels: tuple[str, ...], wanted: str | int, what: str) -> int:
    if isinstance(wanted, int) and 0 <= wanted < len(labels):
        return wanted
    if wanted not in labels:
        raise StudyError(f"{wanted!r} is not an {what} of the model; its {what}s are {', '.join(labels) or 'none'}.")
    return labels.index(wanted)

"""Modes of a linear model: damping, participation, shapes, residues, and the names of modes.

A mode is named by the machines that swing against each other, by why its eigenvalue is zero, by the control loop of
converters that takes part most ("PLL of REGC_C 5"), or by its dominant state.
"""

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING, Literal

import numpy as np

from stabctl import devices
from stabctl._util.errors import StudyError, shown
from stabctl._util.tabular import Tabular
from stabctl._util.units import hertz
from stabctl._util.verbs import verb
from stabctl._util.wording import counted, listed
from stabctl.dynamics.assembly import INFINITE
from stabctl.dynamics.newton import leading
from stabctl.dynamics.operating_point import OperatingPoint, loops
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen

from .descriptor import Descriptor
from .eigen import ZERO
from .model import Linear, eliminated

if TYPE_CHECKING:
    import control
    import pandas as pd


SWING = 1 / 3  # least participation of angles and speeds in a swing mode: n - 1 in every packaged case of n machines
ROUNDOFF = 1e-6  # deg
NAMED = 0.2  # participation, relative to the largest, from which a machine is named
TOGETHER = 0.7  # |sum H s| / sum H |s| above which the machines move together
STANDING = 1e-4 * INFINITE  # s   inertia of an infinite bus, whatever its MVA
MOST = 4  # largest number of machines named on each side
CONVERTER = 0.5  # participation of converters and their controls from which a mode is theirs
NAMED_LOOPS = 0.5  # participation, relative to the largest, from which a converter is named
LEAST = 1e-3  # participation that counts


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
    """One eigenvalue of the system.

    Attributes
    ----------
    eigenvalue, electromechanical, label, participation, shape
        The value (1/s), whether machines swing against each other, the name, the ten main states, and the mode shape.

    Examples
    --------
    >>> mode = st.load("two_area").modes().sensitivity("pss.K").mode
    >>> mode.label, round(mode.frequency_hz, 3), round(mode.damping_ratio, 3), mode.participation[0].state
    ('1, 2 against 3, 4', 0.611, 0.12, 'angle GENROU 3')
    """

    eigenvalue: complex  # 1/s
    electromechanical: bool
    label: str
    participation: tuple[Share, ...]  # the ten largest
    shape: tuple[Part, ...]

    plot = verb("stabctl.view.figures.modes:plot_mode_shape")

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
        s, hz = self.eigenvalue, self.frequency_hz
        return f"{s.real:z.4f} {s.imag:+.4f}j 1/s: {hz:.3f} Hz, damping {self.damping_ratio:z.4f}; {self.label}"

    __repr__ = __str__


@dataclass(frozen=True, repr=False)
class Modes(Tabular):
    """Eigenvalues with left and right eigenvectors, W^H V = I; by frequency, conjugate pairs next to each other.

    Attributes
    ----------
    linear, eigenvalues, right, left, band
        The model, the eigenvalues (1/s), V, W, and the frequencies (Hz) of the modes in `df`, or None for all.

    Examples
    --------
    >>> modes = st.load("two_area").modes()
    >>> modes.stable, modes.frequency_hz[modes.swings()].round(3), modes.damping_ratio[modes.swings()].round(3)
    (True, array([0.611, 1.263, 1.341]), array([0.12 , 0.362, 0.375]))
    """

    linear: Linear
    eigenvalues: np.ndarray  # (modes) complex, 1/s
    right: np.ndarray  # (states, modes) V
    left: np.ndarray  # (states, modes) W
    band: tuple[float, float] | None = None  # Hz   of the table; None: all modes

    plot = verb("stabctl.view.figures.modes:plot_modes")
    sensitivity = verb("stabctl.smallsignal.sensitivity:sensitivity")
    contributions = verb("stabctl.smallsignal.contributions:contributions")

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
    def references(self) -> int:
        """How many angle references there are, one per island: the first modes."""
        return self.linear.rotation().shape[1]

    @cached_property
    def participation(self) -> np.ndarray:
        """Participation factors p_ki = conj(w_ki) v_ki (states, modes), complex; each column sums to 1."""
        return self.left.conj() * self.right

    @cached_property
    def shares(self) -> np.ndarray:
        """Magnitudes of the participation factors (states, modes), scaled to a sum of 1; 0 where one is missing."""
        size = np.abs(self.participation)
        return size / np.maximum(size.sum(axis=0), np.finfo(float).tiny)

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
        return swings(self.eigenvalues, self.shares, self.shapes, rotor, self.linear.point)

    def label(self, k: int) -> str:
        """Name of mode k: the machines and converters that swing against each other, or the dominant state.

        Parameters
        ----------
        k : int
            Index of the mode among `eigenvalues`, as returned by `swings()`.

        Examples
        --------
        >>> modes = st.load("two_area").modes()
        >>> [modes.label(k) for k in modes.swings()]
        ['1, 2 against 3, 4', '1 against 2', '3 against 4']
        """
        linear, count = self.linear, len(self.eigenvalues)
        if not isinstance(k, Integral) or not -count <= k < count:
            raise StudyError(
                f"There is no mode {shown(k)}; give a number from 0 to {count - 1}, such as one of swings()."
            )
        if self.eigenvalues[k] == 0:
            return zero(linear, self.right[:, k], self.left[:, k], k if k < self.references else None)
        if self.electromechanical[k]:
            rotors, weight = linear.point.rotors, self.shares[linear.angles(), k]
            weight[rotors.speed < linear.point.layout.nx] = self.shares[linear.speeds(), k]
            return against(self.shapes[:, k], weight, linear.point.rotor_names, rotors.virtual)
        return leader(linear, self.shares[:, k], self.shapes[:, k], self.eigenvalues[k].imag != 0)

    def mode(self, k: int) -> Mode:
        """Mode k as a record.

        Parameters
        ----------
        k : int
            Index of the mode among `eigenvalues`, as returned by `swings()`.

        Examples
        --------
        >>> modes = st.load("two_area").modes()
        >>> print(modes.mode(modes.swings()[0]))
        -0.4634 +3.8417j 1/s: 0.611 Hz, damping 0.1198; 1, 2 against 3, 4
        """
        label = self.label(k)
        first = np.argsort(-self.shares[:, k].round(6), kind="stable")[:10]  # equal ones in their order
        shares = tuple(Share(self.linear.states[i], float(self.shares[i, k])) for i in first)
        angles = np.angle(self.shapes[:, k], deg=True)
        angles[angles <= ROUNDOFF - 180] = 180.0
        parts = zip(self.linear.point.rotor_names, np.abs(self.shapes[:, k]), angles, strict=True)
        shape = tuple(Part(name, float(size), float(angle)) for name, size, angle in parts)
        return Mode(complex(self.eigenvalues[k]), bool(self.electromechanical[k]), label, shares, shape)

    def swings(self) -> list[int]:
        """Indices of the electromechanical modes, one of each pair, the slowest first."""
        return [int(k) for k in np.flatnonzero(self.electromechanical) if self.eigenvalues[k].imag > 0]

    def least_damped(self) -> list[int]:
        """Indices of the least damped oscillatory mode and, last, of the electromechanical one, if it is another."""
        ratio, groups = self.damping_ratio.round(9), (np.flatnonzero(self.eigenvalues.imag > 0).tolist(), self.swings())
        slowest = (min(group, key=lambda k: (ratio[k], self.eigenvalues[k].imag)) for group in groups if group)
        return list(dict.fromkeys(slowest))  # of undamped modes, whose ratios are rounding errors, the slowest

    def within(self, low_hz: str | float, high_hz: str | float) -> list[int]:
        """Indices of the oscillatory modes in a band of frequencies, one of each pair.

        Parameters
        ----------
        low_hz, high_hz : str or float, Hz
            The band: 0.5 or "500mHz".

        Examples
        --------
        >>> modes = st.load("two_area").modes()
        >>> [modes.label(k) for k in modes.within(0.5, 1)]
        ['1, 2 against 3, 4']
        """
        low, high = hertz(low_hz), hertz(high_hz)
        if not 0 <= low <= high:
            raise StudyError(f"The band of {low:g} to {high:g} Hz is empty or negative; give the lower first.")
        inside = (self.eigenvalues.imag > 0) & (low <= self.frequency_hz) & (self.frequency_hz <= high)
        return np.flatnonzero(inside).tolist()

    @property
    def unstable(self) -> list[int]:
        """Indices of the modes that grow, oscillatory or not, one of each pair, the fastest first."""
        grows = (self.eigenvalues.real > ZERO) & (self.eigenvalues.imag >= 0)
        return sorted(np.flatnonzero(grows).tolist(), key=lambda k: -self.eigenvalues[k].real)

    @property
    def stable(self) -> bool:
        """Whether no mode grows; zero eigenvalues and undamped oscillations do not."""
        return not self.unstable

    def controllability(self) -> np.ndarray:
        """Controllability W^H B (modes, inputs): how strongly an input excites a mode."""
        return self.left.conj().T @ self.linear.B

    def observability(self) -> np.ndarray:
        """Observability C V (outputs, modes): how strongly a mode appears in an output."""
        return self.linear.C @ self.right

    def residues(self, output: str | int = 0, input: str | int = 0) -> np.ndarray:
        """Residues (modes) of the transfer function from an input to an output.

        They are also the derivatives of the eigenvalues with respect to the gain k of the feedback u = k y, at k = 0.

        Parameters
        ----------
        output, input : str or int
            Their names, labels or indices.

        Examples
        --------
        >>> modes = st.load("two_area").closed_loop(inputs="vref:2", outputs="speed:2").modes()
        >>> abs(modes.residues("speed:2", "vref:2"))[modes.swings()].round(4)
        array([0.0113, 0.2098, 0.0399])
        """
        i, j = index(self.linear, output, "output"), index(self.linear, input, "input")
        return self.observability()[i] * self.controllability()[:, j]

    @property
    def df(self) -> "pd.DataFrame":
        """All modes, or those of the band and those that grow, one of each pair; `swing`: electromechanical ones."""
        import pandas as pd

        every = np.flatnonzero(self.eigenvalues.imag >= 0).tolist()
        shown = every if self.band is None else sorted({*self.within(*self.band), *self.unstable})
        columns = {
            "frequency_hz": self.frequency_hz[shown],
            "damping_ratio": self.damping_ratio[shown],
            "real": self.eigenvalues.real[shown],
            "imag": self.eigenvalues.imag[shown],
            "swing": self.electromechanical[shown],
            "mode": [self.label(k) for k in shown],
        }
        return pd.DataFrame(columns)

    def to_control(self) -> "control.StateSpace":
        """The linear model as a python-control system with the same labels.

        Examples
        --------
        >>> st.load("two_area").closed_loop(inputs="vref:2", outputs="speed:2").modes().to_control().nstates
        56
        """
        return (eliminated(self.linear) if isinstance(self.linear, Descriptor) else self.linear).to_control()

    def __str__(self) -> str:
        name, swings = self.linear.point.case.name, counted(len(self.swings()), "electromechanical mode")
        text = f"{name}: {self._number()}, {swings}"
        for k, which in zip(self.least_damped(), ("least damped", "of the electromechanical ones"), strict=False):
            hz, ratio = self.frequency_hz[k], self.damping_ratio[k]
            text += f"; {which}: {hz:.3f} Hz, damping ratio {ratio:z.4f} ({self.label(k)})"
        return text + ("." if self.stable else f"; the operating point is unstable: {self.fastest_growing()}.")

    def _number(self) -> str:
        return counted(len(self), "eigenvalue")

    def fastest_growing(self) -> str:
        """The eigenvalue with the largest real part, and its mode."""
        s = self.eigenvalues[k := int(self.eigenvalues.real.argmax())]
        swing = f" +- {abs(s.imag):.4g}j" if s.imag else ""
        return f"eigenvalue {s.real:.4g}{swing} 1/s ({self.label(k)})"


def swings(
    values: np.ndarray, shares: np.ndarray, speeds: np.ndarray, rotor: np.ndarray, point: OperatingPoint
) -> np.ndarray:
    """Which modes are electromechanical: oscillatory, with rotor angles and speeds, machines against each other.

    `speeds` (machines, modes) are the speed parts of the right eigenvectors, `rotor` the indices of angles and speeds.
    """
    return (values.imag != 0) & (shares[rotor].sum(axis=0) > SWING) & (_together(speeds, point) < TOGETHER)


def _together(speeds: np.ndarray, point: OperatingPoint) -> np.ndarray:
    """|sum H s| / sum H |s| (modes) in the island that moves most; 0 with an infinite bus there, which stands still."""
    if not len(speeds):
        return np.zeros(speeds.shape[1])
    H = point.inertia[:, None] * (point.rotor_island[:, None] == point.rotor_island[np.abs(speeds).argmax(axis=0)])
    whole = (H * np.abs(speeds)).sum(axis=0)
    moves = (whole > 0) & (H.max(axis=0) < STANDING)
    return np.divide(np.abs((H * speeds).sum(axis=0)), whole, out=np.zeros(speeds.shape[1]), where=moves)


def zero(linear: Linear, right: np.ndarray, left: np.ndarray, reference: int | None) -> str:
    """Why an eigenvalue is zero; none of these is an instability. `reference` is the number of an angle reference."""
    if reference is not None:
        own = np.flatnonzero(linear.rotation()[:, reference])
        if linear.rotation().shape[1] == 1:
            return "angle reference (rotating all angles together changes nothing)"
        return f"angle reference (rotating {linear.states[own[0]]} and all other angles of its island changes nothing)"
    fixed = [k for k in range(len(left)) if not linear.A[k].any() and abs(left[k]) > 0.5 * np.abs(left).max()]
    if fixed:
        return f"constant state {linear.states[fixed[0]]} (its circuit is open, or limits hold it)"
    if (
        len(linear.speeds())
        and np.abs(left[linear.speeds()]).max() >= 0.5 * np.abs(left[np.r_[linear.speeds(), linear.angles()]]).max()
    ):
        return "frequency reference (no governor or damping restores the common speed)"
    return f"integral of {linear.states[int(np.abs(right).argmax())]}"


def against(shape: np.ndarray, weight: np.ndarray, names: Sequence[int | str], virtual: np.ndarray) -> str:
    """Which machines swing against which: "machine 34 against the rest", "1, 2 against 3, converter 4"."""
    both = sorted((side for side in sides(shape, weight) if len(side)), key=min)
    called = [f"converter {name}" if is_virtual else name for name, is_virtual in zip(names, virtual, strict=True)]
    front, *back = (listed([str(called[i]) for i in (*sorted(side[:MOST]), *side[MOST:])], MOST) for side in both)
    if back:
        return f"{front} against {back[0]}"
    return f"machine {front} against the rest" if front == str(names[both[0][0]]) else f"{front} against the rest"


def sides(shape: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Machines in phase with the dominant one, and those against it, largest `weight` (participation) first."""
    strong = np.argsort(-weight)
    strong = strong[weight[strong] >= NAMED * weight.max()]
    ahead = (shape[strong] * shape[strong[0]].conjugate()).real >= 0
    return strong[ahead], strong[~ahead]


def leader(linear: Linear, share: np.ndarray, speeds: np.ndarray, oscillates: bool) -> str:
    """Name of a mode that is not a swing mode: the common frequency, a loop of converters, or its dominant state."""
    rotor = np.r_[linear.speeds(), linear.angles()]
    if oscillates and share[rotor].sum() > SWING and _together(speeds[:, None], linear.point)[0] >= TOGETHER:
        return "common frequency: all machines together"
    return converter_loop(linear, share) or linear.states[leading(share)]


def converter_loop(linear: Linear, share: np.ndarray) -> str | None:
    """Name of a mode by the control loop of converters that takes part most; None if it is not theirs."""
    found: dict[tuple[str, str], dict[int, float]] = defaultdict(lambda: defaultdict(float))
    for place, part in zip(linear.places, share.tolist(), strict=True):
        device = devices.every().get(place.table) if part > LEAST else None
        if device is not None and device.role in ("converter", *devices.OF_CONVERTER):
            name = loops(linear.point, place.table, place.unit).get(place.name)
            if name is not None:
                found[device.name, name][place.unit] += part
    total = {key: sum(units.values()) for key, units in found.items()}
    if sum(total.values()) < CONVERTER:
        return None
    (device_name, name), units = max(found.items(), key=lambda item: total[item[0]])
    largest = max(units.values())
    strong = sorted(unit for unit, part in units.items() if part >= NAMED_LOOPS * largest)
    called = ", ".join(str(linear.point.case.machines[unit].called) for unit in strong[:MOST])
    more = f" and {len(strong) - MOST} more" if len(strong) > MOST else ""
    return f"{name} of {device_name} {called}{more}"


def index(linear: Linear, wanted: str | int, what: Literal["input", "output"]) -> int:
    """Place of an input or output of a model, given by its name, its label or as a number."""
    labels, kinds = (linear.inputs, INPUTS) if what == "input" else (linear.outputs, OUTPUTS)
    if isinstance(wanted, int) and 0 <= wanted < len(labels):
        return wanted
    label = wanted
    if isinstance(wanted, str) and wanted not in labels:
        with suppress(StudyError):  # not a signal of any model
            found = [s.label for s in chosen(linear.point.case, wanted, kinds)]
            label = found[0] if len(found) == 1 else wanted
    if label not in labels:
        raise StudyError(f"{wanted!r} is not an {what} of the model; its {what}s are {', '.join(labels) or 'none'}.")
    return labels.index(label)

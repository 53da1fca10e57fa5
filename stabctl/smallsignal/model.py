"""Linear models with named states, inputs and outputs, for python-control, NumPy and MATLAB.

Their transfer functions can be computed at many points of the s- or z-plane.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg as sl

from stabctl import devices
from stabctl._util import files
from stabctl._util.errors import StudyError, shown
from stabctl._util.verbs import verb
from stabctl._util.wording import counted
from stabctl.dynamics import family, layout
from stabctl.dynamics.jacobian import array, solved
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import Signal
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .descriptor import Descriptor, descriptor

if TYPE_CHECKING:
    import control
    import pandas as pd


STEPS = 400  # of a grid of frequencies
AROUND = np.tan(np.linspace(-1.5, 1.5, 31))  # its points around each resonance, in widths of it
NARROW = 1e-6  # least width, relative to the frequency, and
BESIDE = 0.05  # of it: distance from a pole on the imaginary axis


@dataclass(frozen=True, repr=False)
class Model:
    r"""A linear model with labels of its states, inputs and outputs, all deviations from an operating point.

    $$ \dot x = A x + B u, \qquad y = C x + D u $$
    """

    name: str
    A: np.ndarray  # (states, states)   1/s
    B: np.ndarray  # (states, inputs)
    C: np.ndarray  # (outputs, states)
    D: np.ndarray  # (outputs, inputs)
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    plot = verb("stabctl.view.figures.bode:plot_frequency_response")

    def to_control(self) -> "control.StateSpace":
        """The model as a python-control system with the same labels.

        Raises
        ------
        StudyError
            If it has no inputs or no outputs.
        """
        import control

        if not (self.inputs and self.outputs):
            missing = "outputs" if self.inputs else "inputs"
            raise StudyError(
                f"The linear model of {self.name} has no {missing}; linearize with inputs='vref', outputs='speed', "
                "for example."
            )
        labels = {k: [label.replace(".", " ") for label in getattr(self, k)] for k in ("states", "inputs", "outputs")}
        A, B, dt = self.transition()
        return control.ss(A, B, self.C, self.D, dt, name=self.name.replace(".", " "), **labels)

    def transition(self) -> tuple[np.ndarray, np.ndarray, float]:
        """A and B of x' = A x + B u and 0, or those of x+ = A x + B u and the time step (s)."""
        return self.A, self.B, 0.0

    @property
    def df(self) -> "pd.DataFrame":
        """[A B; C D] in one table, with the labels of states, inputs and outputs."""
        import pandas as pd

        rows, columns = [*self.states, *self.outputs], [*self.states, *self.inputs]
        return pd.DataFrame(np.block([[self.A, self.B], [self.C, self.D]]), rows, columns)

    def response(self, hz: np.ndarray) -> np.ndarray:
        """Frequency response C (jw - A)^-1 B + D (frequencies, outputs, inputs), complex, at frequencies in Hz."""
        try:
            jw = 2j * np.pi * np.atleast_1d(np.asarray(hz, float))
        except (TypeError, ValueError):
            raise StudyError(f"{shown(hz)} is not a list of frequencies; give numbers in Hz: [0.5, 1.0].") from None
        A, B, dt = self.transition()
        try:
            return Response(A, B, self.C, self.D)(np.exp(jw * dt) if dt else jw)
        except np.linalg.LinAlgError:
            raise StudyError(f"{self.name} has a pole at one of the frequencies {shown(hz)} Hz; give others.") from None

    def save(self, path: str | Path) -> Path:
        """Write A, B, C, D and the labels to a file, and return its path.

        Parameters
        ----------
        path : str or Path
            A file ending in .npz (NumPy) or .mat (MATLAB). An existing file is replaced only when the new one is
            complete.

        Raises
        ------
        StudyError
            If the file has another ending, or its folder does not exist.
        """
        path, file = files.path_of(path), BytesIO()
        matrices: dict[str, Any] = {k: getattr(self, k) for k in "ABCD"}
        labels: dict[str, Any] = {k: np.array(getattr(self, k), dtype=object) for k in ("states", "inputs", "outputs")}
        if path.suffix == ".npz":
            np.savez_compressed(file, **matrices, **{k: v.astype(str) for k, v in labels.items()}, name=self.name)
        elif path.suffix == ".mat":
            from scipy.io import savemat

            savemat(file, matrices | labels | {"name": self.name}, oned_as="column")  # type: ignore[arg-type]  # a file object, which the stubs lack
        else:
            raise StudyError(f"The file {path.name!r} must end in .npz or .mat.")
        if not path.parent.is_dir():
            raise StudyError(f"There is no folder {str(path.parent)!r} to write {path.name!r} to; create it first.")
        files.replace(path, file.getvalue())
        return path

    def __str__(self) -> str:
        shape = (counted(len(getattr(self, f"{kind}s")), kind) for kind in ("state", "input", "output"))
        return f"linear model of {self.name}: {', '.join(shape)}"

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>"


@dataclass(frozen=True, repr=False)
class Linear(Model):
    """The full linear model of an operating point.

    Attributes
    ----------
    name : str
        Name of the case.
    A, B, C, D : ndarray
        Matrices of the model; A in 1/s.
    states, inputs, outputs : tuple of str
        Labels.
    point : OperatingPoint
        The operating point.
    places : tuple of StatePlace
        Device, machine and name of every state.

    Examples
    --------
    >>> model = st.load("two_area").linearize(inputs="vref:2", outputs="speed:2")
    >>> model.states[:2], model.B.shape, model.outputs
    (('angle GENROU 1', 'speed GENROU 1'), (56, 1), ('speed GENROU 2',))
    """

    point: OperatingPoint
    places: tuple[layout.StatePlace, ...]

    reduce = verb("stabctl.smallsignal.reduce:reduce")

    def speeds(self) -> np.ndarray:
        """Indices of the speeds among the states, of the rotors whose speed is a state."""
        found = {p.unit: k for k, p in enumerate(self.places) if p.name == "omega"}
        rotors = self.point.rotors
        return np.array([found[unit] for unit in rotors.unit[rotors.speed < self.point.layout.nx]], int)

    def angles(self) -> np.ndarray:
        """Indices (rotor units) of the angles among the states."""
        found = {p.unit: k for k, p in enumerate(self.places) if p.name == "delta"}
        return np.array([found[unit] for unit in self.point.rotors.unit], int)

    def rotation(self) -> np.ndarray:
        """The change of the states (states, islands) when all angles of an island are rotated by 1 rad.

        Nothing else changes then.

        Examples
        --------
        >>> st.load("two_area").linearize().rotation().shape
        (56, 1)
        """
        every = {p.table: devices.every().get(p.table) for p in self.places}
        angles = {table: device.angles if device else ("delta",) for table, device in every.items()}
        r = np.array([p.name in angles[p.table] for p in self.places], float)
        phasors = {t: d.phasors for t, d in every.items() if d is not None and d.phasors}
        at = {(p.table, p.row, p.name): k for k, p in enumerate(self.point.layout.states)}
        for k, p in enumerate(self.places):
            for re, im in phasors.get(p.table, ()):  # j times the phasor
                if p.name in (re, im):
                    r[k] = self.point.s[at[p.table, p.row, im if p.name == re else re]] * (-1 if p.name == re else 1)
        turned, islands = np.flatnonzero(r), self._islands()
        own = [islands[at[p.table, p.row, p.name]] for p in (self.places[k] for k in turned)]
        found = np.zeros((len(r), max(own, default=0) + 1))
        found[turned, own] = r[turned]
        return found[:, found.any(axis=0)]

    def _islands(self) -> np.ndarray:
        """Island of the bus of every state of the system (states); 0 for a device without a bus."""
        places, islands = self.point.layout, self.point.island
        found = np.zeros(places.nx, int)
        for f in self.point.system.families:
            states, _, _, buses = family.size(f) if len(f.w) else (0, 0, 0, 0)
            if buses:
                bus = (f.w[:, family.BUS] - places.voltages.start) // 2
                found[f.w[:, [family.STATE]] + np.arange(states)] = islands[bus, None]
        return found


def linearize(
    base: Case | OperatingPoint,
    inputs: str | Iterable[str | Signal] = (),
    outputs: str | Iterable[str | Signal] = (),
    *,
    storage: "Fleet | None" = None,
) -> Linear:
    r"""Linearize a system at its operating point, with the bus voltages eliminated exactly.

    With $\dot x = f(x, v, u)$, $0 = g(x, v, u)$, $y = h(x, v, u)$ for states $x$, voltages $v$ and inputs $u$:

    $$ A = f_x - f_v g_v^{-1} g_x, \quad B = f_u - f_v g_v^{-1} g_u, \quad
    C = h_x - h_v g_v^{-1} g_x, \quad D = h_u - h_v g_v^{-1} g_u $$

    (P. Kundur, Power System Stability and Control, ch. 12).

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    inputs, outputs : str or iterable
        Signals of `stabctl.smallsignal.INPUTS` and `OUTPUTS`: "vref:2, storage:33" or ["speed:14", "voltage:7"]; a
        kind alone, such as "speed", means all signals of that kind.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    Linear

    Raises
    ------
    LinearizationError
        If the point is not an equilibrium, or a device is exactly at a limit; names the state or the limit.
    StudyError
        If a signal is not known.

    Examples
    --------
    >>> model = st.load("two_area").linearize(inputs="vref:2", outputs="speed:2, voltage:7")
    >>> model.A.shape, model.inputs, model.outputs
    ((56, 56), ('reference SEXS 2',), ('speed GENROU 2', 'voltage bus 7'))
    """
    return eliminated(descriptor(operating_point(base, storage), inputs, outputs))


def eliminated(d: Descriptor) -> Linear:
    """The model with the voltages v = -inv(gv) (gx x + gu u) eliminated."""
    p, nx = d.parts, len(d.rows)
    v = -solved(p.gv, np.hstack([array(p.gx), array(p.gu)]))
    A, B = (np.asarray(f + p.fv @ part) for f, part in ((p.fx, v[:, :nx]), (p.fu, v[:, nx:])))
    C, D = (np.asarray(h + p.hv @ part) for h, part in ((p.hx, v[:, :nx]), (p.hu, v[:, nx:])))
    for M in (A, B, C, D):
        M.setflags(write=False)
    inputs, outputs = (tuple(s.label for s in signals) for signals in (d.inputs, d.outputs))
    return Linear(d.name, A, B, C, D, d.states, inputs, outputs, d.point, d.places)


class Response:
    """C (s - A)^-1 B + D at points s; A is brought to upper triangular form (Schur) once.

    Source: A. Laub, IEEE Trans. Automatic Control 26, 1981.
    """

    def __init__(self, A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> None:
        self._T, Z = sl.schur(A, output="complex") if len(A) else (A.astype(complex), A)
        self._B, self._C, self._D = Z.conj().T @ B, C @ Z, D
        self._shifted = np.array(-self._T, order="F")  # s - T: only its diagonal changes
        self._diagonal = np.arange(len(self._T))

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A."""
        return np.diag(self._T)

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Transfer functions (points, outputs, inputs) at points (points), complex."""
        found, at = np.empty((len(s), *self._D.shape), complex), self._diagonal
        for k, point in enumerate(s):
            found[k] = self._D
            if len(at):
                self._shifted[at, at] = point - self.poles
                found[k] += self._C @ sl.solve_triangular(self._shifted, self._B, check_finite=False)
        return found


def grid(poles: np.ndarray, low: float, high: float, around: np.ndarray = AROUND) -> np.ndarray:
    """Frequencies (Hz) between two, dense around the resonances of poles (1/s): at these widths from each."""
    near = resonances(poles[poles.imag > 0], around) / (2 * np.pi)
    return np.unique(np.r_[np.geomspace(low, high, STEPS), near[(near > low) & (near < high)]])


def resonances(poles: np.ndarray, around: np.ndarray) -> np.ndarray:
    """Frequencies (rad/s) at these widths from the resonance of each pole (1/s), none at a pole itself."""
    s = poles[:, None]
    width = np.maximum(np.abs(s.real), NARROW * np.abs(s.imag))
    return np.asarray(np.abs(s.imag) + BESIDE * (width - np.abs(s.real)) + width * around).ravel()

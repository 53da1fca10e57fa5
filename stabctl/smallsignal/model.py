"""Linear models with names: matrices A, B, C, D as python-control, NumPy and MATLAB take them."""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from stabctl._util import files
from stabctl._util.verbs import verb
from stabctl.dynamics import layout
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .descriptor import Descriptor, descriptor
from .signals import Signal

if TYPE_CHECKING:
    import control
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Model:
    """x' = A x + B u, y = C x + D u, every state, input and output with its label; deviations from a point."""

    name: str
    A: np.ndarray  # (states, states)   1/s
    B: np.ndarray  # (states, inputs)
    C: np.ndarray  # (outputs, states)
    D: np.ndarray  # (outputs, inputs)
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    plot = verb("stabctl.plotting.frequency_response:plot")

    def to_control(self) -> "control.StateSpace":
        """The model for python-control, with its labels."""
        import control

        if not (self.inputs and self.outputs):
            missing = "outputs" if self.inputs else "inputs"
            raise StudyError(f"This model has no {missing}; give some, as linearize(inputs='vref', outputs='speed').")
        labels = {k: [label.replace(".", " ") for label in getattr(self, k)] for k in ("states", "inputs", "outputs")}
        system = control.ss(self.A, self.B, self.C, self.D, name=self.name.replace(".", " "), **labels)
        return system

    @property
    def df(self) -> "pd.DataFrame":
        """[A B; C D] in one table, with the labels of states, inputs and outputs."""
        import pandas as pd

        rows, columns = [*self.states, *self.outputs], [*self.states, *self.inputs]
        return pd.DataFrame(np.block([[self.A, self.B], [self.C, self.D]]), rows, columns)

    def response(self, hz: np.ndarray) -> np.ndarray:
        """Frequency response C (jw - A)^-1 B + D (frequencies, outputs, inputs), complex, at frequencies in Hz."""
        one, jw = np.eye(len(self.A)), 2j * np.pi * np.asarray(hz, float)
        return np.array([self.C @ np.linalg.solve(s * one - self.A, self.B) + self.D for s in jw])

    def save(self, path: str | Path) -> Path:
        """Write A, B, C, D and the labels to a .npz or MATLAB .mat file, by the ending; the path."""
        path, file = Path(path), BytesIO()
        matrices = {k: getattr(self, k) for k in "ABCD"}
        labels = {k: np.array(getattr(self, k), dtype=object) for k in ("states", "inputs", "outputs")}
        if path.suffix == ".npz":
            np.savez_compressed(file, **matrices, **{k: v.astype(str) for k, v in labels.items()}, name=self.name)
        elif path.suffix == ".mat":
            from scipy.io import savemat

            savemat(file, matrices | labels | {"name": self.name}, oned_as="column")
        else:
            ending = path.suffix or "nothing"
            raise StudyError(f"The file {path.name!r} ends in {ending}; give a name ending in .npz or .mat.")
        if not path.parent.is_dir():
            raise StudyError(f"There is no folder {str(path.parent)!r} to write {path.name!r} into; make it first.")
        files.replace(path, file.getvalue())
        return path

    def __str__(self) -> str:
        shape = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"linear model of {self.name}: {shape}"

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}</p>"


@dataclass(frozen=True, repr=False)
class Linear(Model):
    """The linear model of an operating point, all its states."""

    point: OperatingPoint
    places: tuple[layout.StatePlace, ...]  # device, machine and name of every state

    def speeds(self) -> np.ndarray:
        """Places (rotor units) of the speeds among the states."""
        return self.angles() + 1

    def angles(self) -> np.ndarray:
        """Places (rotor units) of the angles among the states."""
        found = {p.unit: k for k, p in enumerate(self.places) if p.name == "delta"}
        return np.array([found[unit] for unit in self.point.rotors.unit], int)


def linearize(
    base: Case | OperatingPoint,
    inputs: str | Iterable[str | Signal] = (),
    outputs: str | Iterable[str | Signal] = (),
    *,
    storage: "Fleet | None" = None,
) -> Linear:
    """The linear model of an operating point: A = fx - fv inv(gv) gx, the voltages eliminated exactly.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    inputs, outputs : str or iterable
        Signals as in `signals.INPUTS` and `signals.OUTPUTS`: "vref:2, storage:33" or ["speed:14", "voltage:7"]; a kind
        alone, "speed", means all.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    Linear

    Raises
    ------
    LinearizationError
        Where the point is no equilibrium, or rests on a limit; names the state or the limit.
    StudyError
        For unknown signals.
    """
    return eliminated(descriptor(operating_point(base, storage), inputs, outputs))


def eliminated(d: Descriptor) -> Linear:
    """The model without its voltages, v = -inv(gv) (gx x + gu u)."""
    nx = len(d.rows)
    v = -splu(d.gv).solve(np.hstack([d.gx.toarray(), d.gu.toarray()]))
    A, B = d.fx + d.fv @ v[:, :nx], d.fu + d.fv @ v[:, nx:]
    C, D = d.hx + d.hv @ v[:, :nx], d.hu + d.hv @ v[:, nx:]
    matrices = [np.asarray(M) for M in (A, B, C, D)]
    for M in matrices:
        M.setflags(write=False)
    names = [tuple(s.label for s in signals) for signals in (d.inputs, d.outputs)]
    return Linear(d.name, *matrices, d.states, *names, d.point, d.places)

"""Linear models with names: matrices A, B, C, D as python-control, NumPy and MATLAB take them."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from stabctl.dynamics import layout
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError

from .descriptor import Descriptor, descriptor
from .signals import Signal

if TYPE_CHECKING:
    import control


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

    def to_control(self) -> "control.StateSpace":
        """The model for python-control, with its labels."""
        import control

        labels = {k: [label.replace(".", " ") for label in getattr(self, k)] for k in ("states", "inputs", "outputs")}
        system = control.ss(self.A, self.B, self.C, self.D, name=self.name.replace(".", " "), **labels)
        return system

    def save(self, path: str | Path) -> Path:
        """Write A, B, C, D and the labels to a .npz or MATLAB .mat file, by the ending; the path."""
        path = Path(path)
        matrices = {k: getattr(self, k) for k in "ABCD"}
        labels = {k: np.array(getattr(self, k), dtype=object) for k in ("states", "inputs", "outputs")}
        if path.suffix == ".npz":
            np.savez_compressed(path, **matrices, **{k: v.astype(str) for k, v in labels.items()}, name=self.name)
        elif path.suffix == ".mat":
            from scipy.io import savemat

            savemat(path, matrices | labels | {"name": self.name}, oned_as="column")
        else:
            ending = path.suffix or "nothing"
            raise StudyError(f"The file {path.name!r} ends in {ending}; give a name ending in .npz or .mat.")
        return path

    def __str__(self) -> str:
        shape = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"linear model of {self.name}: {shape}"

    __repr__ = __str__


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
        return np.array([k for k, p in enumerate(self.places) if p.name == "delta" and p.unit >= 0], int)


def linearize(
    point: OperatingPoint, inputs: Iterable[str | Signal] = (), outputs: Iterable[str | Signal] = ()
) -> Linear:
    """The linear model of an operating point: A = fx - fv inv(gv) gx, the voltages eliminated exactly.

    Signals are named as in `signals.INPUTS` and `signals.OUTPUTS`, e.g. `storage:33`, `speed:14` or `speed` for all.
    Errors as in `descriptor`.
    """
    return eliminated(descriptor(point, inputs, outputs))


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

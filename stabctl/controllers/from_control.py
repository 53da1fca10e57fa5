"""The parts of a controller from a python-control system."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stabctl._util.errors import StudyError, shown

from .timing import checked_frames


def parts(
    system: Any, inputs: str | Sequence[str] | None, outputs: str | Sequence[str] | None, rate: int | None
) -> dict[str, Any]:
    """Fields of `Controller` from a python-control system; see `Controller.from_control`."""
    import control

    if isinstance(system, control.TransferFunction):
        system = _state_space(system)
    if not isinstance(system, control.StateSpace):
        raise StudyError(f"{shown(system)} is not a python-control StateSpace or TransferFunction.")
    names: dict[str, Any] = {}
    for key, given, labels in (("inputs", inputs, system.input_labels), ("outputs", outputs, system.output_labels)):
        names[key] = tuple(labels) if given is None else given
        if given is None and any(label.startswith(("u[", "y[")) for label in labels):
            raise StudyError(
                f"The {key} of the python-control system have no names ({', '.join(labels)}); give {key}=..., such as "
                f"{key}={'speed:2' if key == 'inputs' else 'vs:2'!r}."
            )
    A, B, C, D = (np.asarray(M, float) for M in (system.A, system.B, system.C, system.D))
    if system.dt is True:
        raise StudyError("The python-control system is sampled, but its dt is True; set dt in seconds.")
    if system.dt:
        own = 1 / system.dt
        if abs(own - round(own)) > 1e-6 * own:
            raise StudyError(f"The dt of {system.dt:g} s is not a whole number of frames per second; use dt = 1/60.")
        if rate not in (None, round(own)):
            raise StudyError(
                f"The python-control system has {round(own)} frames per second, not {rate}; omit the rate."
            )
        rate = round(own)
    elif rate is not None:
        checked_frames("controller", rate, 0.0)
        A, B, C, D = tustin(A, B, C, D, rate)
    return {**names, "A": A, "B": B, "C": C, "D": D, "rate": rate}


def _state_space(system: Any) -> Any:
    """A transfer function as a state-space system. Raises `StudyError` if it is improper."""
    import control

    for i in range(system.noutputs):
        for j in range(system.ninputs):
            over, under = (np.trim_zeros(c[i][j], "f") for c in (system.num, system.den))
            if len(over) > len(under):
                raise StudyError(
                    f"The transfer function from {system.input_labels[j]} to {system.output_labels[i]} is improper: "
                    f"its numerator has degree {len(over) - 1}, its denominator {len(under) - 1}; add fast poles."
                )
    labels = {"inputs": system.input_labels, "outputs": system.output_labels}
    if system.noutputs == system.ninputs == 1:
        return control.ss(control.tf2ss(system), **labels)
    rows = []
    for i in range(system.noutputs):
        row = [control.tf2ss(system.num[i][j], system.den[i][j]) for j in range(system.ninputs)]
        rows.append(row)
    return _grid(rows, system.dt, labels)


def _grid(rows: list[list[Any]], dt: Any, labels: dict[str, Any]) -> Any:
    """A system with one block per pair of input and output."""
    import control
    from scipy.linalg import block_diag

    blocks = [block for row in rows for block in row]
    A = block_diag(*(b.A for b in blocks))
    B, C = np.zeros((len(A), len(rows[0]))), np.zeros((len(rows), len(A)))
    at = 0
    for i, row in enumerate(rows):
        for j, block in enumerate(row):
            n = len(block.A)
            B[at : at + n, j], C[i, at : at + n] = block.B[:, 0], block.C[0]
            at += n
    D = np.array([[block.D[0, 0] for block in row] for row in rows])
    return control.ss(A, B, C, D, dt, **labels)


def tustin(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, rate: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A continuous system sampled with the trapezoidal rule."""
    from scipy.signal import cont2discrete

    sampled: Any = cont2discrete((A, B, C, D), 1 / rate, method="bilinear")
    return sampled[:4]

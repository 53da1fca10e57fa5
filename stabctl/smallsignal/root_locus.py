"""Root locus: eigenvalues as a function of a gain or a parameter, each tracked from one value to the next.

The first-order prediction for the next value is s + w^H (A' - A) v; the new eigenvalues are matched to the predictions
so that the sum of the distances is smallest.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl._util.errors import StudyError
from stabctl.devices import models
from stabctl.dynamics import operating_point
from stabctl.model import naming
from stabctl.model.case import Case

from . import modes
from .analysis import analyze
from .eigen import eigen
from .model import Linear, linearize
from .modes import Modes


@dataclass(frozen=True, repr=False)
class Locus:
    """Eigenvalues at each value of a parameter; column k is one mode, numbered as in `start`."""

    parameter: str
    values: np.ndarray  # (values)
    eigenvalues: np.ndarray  # (values, modes) complex, 1/s
    start: Modes  # at the first value

    def damping_ratio(self) -> np.ndarray:
        """Damping ratio -Re / |eigenvalue| (values, modes); 1 for a zero eigenvalue."""
        size = np.abs(self.eigenvalues)
        return np.divide(-self.eigenvalues.real, size, out=np.ones_like(size), where=size > 0)

    def __str__(self) -> str:
        swings = self.start.swings()
        text = f"{self.parameter} from {self.values[0]:g} to {self.values[-1]:g}"
        if not swings:
            return text
        ratio = self.damping_ratio()[:, swings]
        best = int((ratio[-1] - ratio[0]).argmax())
        moved = f"{ratio[0, best]:z.3f} to {ratio[-1, best]:z.3f}"
        return f"{text}: the damping ratio of the mode {self.start.label(swings[best])} changes from {moved}"

    __repr__ = __str__


def feedback_locus(linear: Linear, output: str | int, input: str | int, gains: Iterable[float]) -> Locus:
    """Root locus of the feedback u = k y from one output to one input: eigenvalues of A + B k (1 - D k)^-1 C.

    Parameters
    ----------
    linear : Linear
        The open-loop model.
    output, input : str or int
        Names (speed:1), labels or indices of the signals.
    gains : iterable of float
        Values of k.

    Returns
    -------
    Locus

    Raises
    ------
    StudyError
        If the model has no such signal, there are fewer than two finite gains, or a gain makes an algebraic loop.
    """
    i = modes.index(linear, output, "output")
    j = modes.index(linear, input, "input")
    b, c, d = linear.B[:, j], linear.C[i], linear.D[i, j]
    values = _values(gains)
    for k in values:
        if abs(1 - d * k) < 1e-9:
            raise StudyError(f"The gain {k:g} makes an algebraic loop (1 - D k = 0); choose another gain.")
    name = f"gain from {linear.outputs[i]} to {linear.inputs[j]}"
    return _follow(name, values, linear, lambda k: linear.A + np.outer(b, c) * k / (1 - d * k))


def parameter_locus(
    case: Case, table: str, parameter: str, values: Iterable[float], machines: Sequence[int | str] | None = None
) -> Locus:
    """Root locus of a device parameter; the case is initialized again for every value.

    Parameters
    ----------
    case : Case
        The system.
    table, parameter : str
        Device table and parameter, such as "pss" and "K".
    values : iterable of float
        Values of the parameter.
    machines : sequence of int or str, optional
        Machines at which it varies, of a load model buses; by default all that have the device.

    Returns
    -------
    Locus

    Raises
    ------
    StudyError
        If the case has no such table, parameter or machine, or a value adds or removes states.
    """
    rows = case.devices.get(table, {})
    if table not in models() or not rows:
        raise StudyError(f"{case.name} has no table {table!r}; it has {', '.join(case.devices)}.")
    if parameter not in models()[table].Par._fields:
        raise StudyError(f"{table} has no parameter {parameter!r}; it has {', '.join(models()[table].Par._fields)}.")
    keys = list(rows)
    chosen = keys if machines is None else [keys[naming.row(case, table, n)] for n in machines]

    def model(value: float) -> Linear:
        changed = {n: par._replace(**{parameter: float(value)}) if n in chosen else par for n, par in rows.items()}
        return linearize(operating_point.solve(replace(case, devices={**case.devices, table: changed})))

    given = _values(values)
    first = model(given[0])

    def matrix(value: float) -> np.ndarray:
        new = model(value)
        if new.states != first.states:
            raise StudyError(
                f"{parameter} = {value:g} adds or removes states; a root locus needs the same states at every value."
            )
        return new.A

    return _follow(f"{parameter} of {models()[table].name}", given, first, matrix)


def _values(values: Iterable[float]) -> np.ndarray:
    found = np.array([float(v) for v in values])
    if len(found) < 2 or not np.isfinite(found).all():
        raise StudyError("A root locus needs at least two finite values.")
    return found


def _follow(name: str, values: np.ndarray, linear: Linear, matrix: Callable[[float], np.ndarray]) -> Locus:
    from scipy.optimize import linear_sum_assignment

    first = replace(linear, A=matrix(values[0]))
    start = analyze(first)
    A, (s, V, W) = first.A, (start.eigenvalues, start.right, start.left)
    rows = [start.eigenvalues]
    for value in values[1:]:
        new = matrix(value)
        expected = s + np.einsum("ij,ij->j", W.conj(), (new - A) @ V)
        found = eigen(new, linear.rotation())
        order = linear_sum_assignment(np.abs(expected[:, None] - found.values))[1]
        A, (s, V, W) = new, (found.values[order], found.right[:, order], found.left[:, order])
        rows.append(s)
    return Locus(name, values, np.array(rows), start)

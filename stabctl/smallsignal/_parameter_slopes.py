"""Derivatives of an eigenvalue with respect to the parameters of the devices, at a given power flow.

With the linearized equations of `descriptor`, the outputs of the devices kept, an eigenvalue s = w^H A v is

    s = sum over entries e of the local derivatives of the devices:  l[row of e] e r[column of e],

where r are the changes of states, voltages and outputs in the mode, l those of the left eigenvector. s is stationary
with respect to both, so ds/dp is the same sum over de/dp (P. Kundur, Power System Stability and Control, sec. 12.2).
An entry depends on the parameters of its device and on the equilibrium z(p), where F(z, p) = 0 (`dynamics.newton`):

    de/dp = e_p + e_z dz/dp,    dz/dp = -F_z^-1 F_p.

Entries and F_z are exact; e_p, F_p and the derivative of the entries along dz/dp are finite differences. Devices of
different units are coupled only through the network, whose voltages stay: one evaluation of all equations serves a
parameter of every unit at once.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from stabctl import devices
from stabctl._util.errors import StabctlError, StudyError
from stabctl._util.schema import hints
from stabctl.dynamics import family
from stabctl.dynamics.jacobian import matrix, solved
from stabctl.dynamics.newton import Newton, opened
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.start import automatic
from stabctl.model import checks, naming, tables

from ._linearization_checks import JUMP, nudges
from .descriptor import Descriptor

SIDES = {  # points of a difference, in steps -> weights of the values there
    (-1.0, 0.0, 1.0): (-0.5, 0.0, 0.5),
    (0.0, 1.0, 2.0): (-1.5, 2.0, -0.5),
    (0.0, -1.0, -2.0): (1.5, -2.0, 0.5),
}
ROUNDING = 1e-10  # relative to the largest entry of a row: change that is no kink
BEND = np.array([1.0, -2.0, 1.0])
SAME = 1e-6  # relative difference of the eigenvalue from that of the equations


class Slope(NamedTuple):
    """Derivative of the eigenvalue with respect to a parameter, and by how much it depends on the side.

    The sides are those of the parameter, and of the equilibrium. The difference is infinite if a constant state, such
    as that of a bypassed block, becomes one of the model.
    """

    slope: complex
    bend: float


class ParameterSlopes:
    """One eigenvalue as a function of the parameters.

    Parameters
    ----------
    d : Descriptor
        The linearized equations, of a point without added signals.
    s : complex, 1/s
        The eigenvalue.
    v, w : ndarray (states)
        Right and left eigenvector, w^H v = 1.

    Raises
    ------
    StudyError
        If they are not those of the equations.
    """

    def __init__(self, d: Descriptor, s: complex, v: np.ndarray, w: np.ndarray) -> None:
        self.point, self.equations = d.point, d.point.equations
        point, equations, pattern = d.point, d.point.equations, d.point.equations.pattern
        left, self._of_bus, self._right = vectors(d, s, v, w)
        self._weight = left[pattern.rows] * self._right[pattern.columns]
        constant = np.ones(pattern.total, bool)
        constant[d.rows], constant[point.layout.nx :] = False, False
        self._constant = constant[pattern.rows]  # entries of the rates of constant states, which are none of the model
        self._of_device, self._of_row, self._of_signal = _units(point)
        V = point.flow.V[point.net.machine_bus]
        current = (point.flow.S / V).conj()
        self._newton = Newton(point.system, equations, point.flow.V, current, point.case.base_mva)
        first = np.cumsum([0, *(len(f.w) for f in equations.families)]).tolist()
        self._first = {f.name: k for f, k in zip(equations.families, first, strict=False)}
        self.rows = {model: rows_of(point, model) for model in point.case.devices}
        self._given = {f.name: f.k for f in equations.families}
        for name, rows in self.rows.items():
            self._given[name] = np.array([self._constants(name, key, {}) for key in rows], float)
        self._nudge, size = nudges(point), np.zeros(pattern.total)
        np.maximum.at(size, pattern.rows, np.abs(equations.entries(point.s.copy())[0]))
        self._size = size[pattern.rows]  # largest entry of the row
        self._computed = any(f.device.automatic is not None for f in equations.families)

    def slopes(self, model: str, name: str, keys: Sequence[naming.Key], step: float) -> dict[naming.Key, Slope | str]:
        """The derivatives with respect to a parameter of some devices of a model, or why there is none.

        `step` is that of the finite differences, relative to the parameter, or in its unit if it is 0.
        """
        found: dict[naming.Key, Slope | str] = {}
        batches: list[dict[naming.Key, _Steps]] = []
        for key in keys:
            steps = self._steps(model, name, key, step)
            if isinstance(steps, str):
                found[key] = steps
                continue
            unit = self._unit(model, key)
            free = (batch for batch in batches if all(self._unit(model, other) != unit for other in batch))
            batch = next(free, None)
            if batch is None:
                batches.append(batch := {})
            batch[key] = steps
        for batch in batches:
            try:
                found |= self._together(model, batch)
            except StabctlError as error:
                found |= dict.fromkeys(batch, str(error).rstrip("."))
        return found

    def _unit(self, model: str, key: naming.Key) -> int:
        return int(self._of_device[self._first[model] + self.rows[model][key]])

    def _steps(self, model: str, name: str, key: naming.Key, step: float) -> "_Steps | str":
        """The constants at the points of a difference, on the sides that are allowed."""
        if key not in self.rows[model]:
            return "its load has no share in this model"
        value = float(getattr(self.point.case.devices[model][key], name))
        h, reason = step * (abs(value) or 1.0), ""
        for points, weights in SIDES.items():
            try:
                k = [self._constants(model, key, {name: value + h * t} if t else {}) for t in points]
            except (StabctlError, ArithmeticError, ValueError) as error:
                reason = reason or str(error).rstrip(".")
                continue
            if np.isfinite(k).all():
                return _Steps(h * np.array(points), np.array(weights) / h, np.array(k))
        return reason or "its equations have no finite value beside it"

    def _constants(self, model: str, key: naming.Key, changed: dict[str, float]) -> list[float]:
        """Constants of a device with a parameter changed, before those that follow from the starting point.

        Raises `CaseError` for a value that is not allowed.
        """
        device, j = devices.models()[model], self.rows[model][key]
        par = self.point.case.devices[model][key]._replace(**changed)
        if changed:
            checks.values(model, device.Par, [par])
            checks.parameters(model, 0, key, par)
        filled = zip(device.Par._fields, self.point.system.family(model).k[j].tolist(), strict=True)
        computed = {name: value for name, value in filled if hints(device.Par)[name] is None}
        return list(device.prepared(par._replace(**computed)))

    def _together(self, model: str, batch: "dict[naming.Key, _Steps]") -> dict[naming.Key, Slope]:
        """The derivatives for devices of different units."""
        rows = np.array([self.rows[model][key] for key in batch])
        unit = self._of_device[self._first[model] + rows]
        t, weights = np.zeros((2, 3, 1 + max(self._of_signal.max(), self._of_device.max())))
        t[:, unit] = np.stack([one.points for one in batch.values()], axis=1)
        weights[:, unit] = np.stack([one.weights for one in batch.values()], axis=1)
        given = []
        for i in range(3):
            own = self._given[model].copy()
            own[rows] = [one.k[i] for one in batch.values()]
            given.append(self._given | {model: own})
        s, moved = self.point.s, np.zeros(len(self.point.s))
        for _ in range(1 + self._computed):  # parameters that follow from the starting point are known after the first
            rest, driven = self._values(model, self._all(self._given, s)), np.zeros(self.equations.pattern.total)
            for i in range(3):
                values = self._values(model, self._all(given[i], s + t[i, self._of_signal] * moved))
                driven += weights[i, self._of_row] * (values - rest)
            moved = self._newton.moved(s, driven)
        at = [s + t[i, self._of_signal] * moved for i in range(3)]
        k = [self._all(given[i], at[i]) for i in range(3)]

        def changes(nudge: np.ndarray | float) -> np.ndarray:
            """Changes of the entries (3, entries) along the equilibrium, which may be moved by a little."""
            base = self.equations.entries(s + nudge, swept=False)[0]
            found = [
                self.equations.entries(a + nudge, _flat(list(c.values())), swept=False)[0]
                for a, c in zip(at, k, strict=True)
            ]
            return np.array(found) - base

        change, of_entry = changes(0.0), self._of_row[self.equations.rows]
        sums = np.zeros((3, t.shape[1]), complex)
        for i in range(3):
            part = change[i] * self._weight
            sums[i] = np.bincount(of_entry, part.real, t.shape[1]) + 1j * np.bincount(of_entry, part.imag, t.shape[1])
            sums[i, unit] -= self._of_sources(model, k[i][model], rows)
        slopes, h = (weights * sums).sum(axis=0)[unit], np.ptp(t, axis=0)[unit] / 2
        above, below = ((weights[:, of_entry] * changes(by)).sum(axis=0) for by in (self._nudge, -self._nudge))
        rough = self._rough(above, below, np.ptp(t, axis=0)[of_entry]) | (self._constant & (change != 0).any(axis=0))
        bend = np.where(np.isin(unit, of_entry[rough]), np.inf, np.abs(BEND @ sums)[unit] / h)
        return {key: Slope(complex(a), float(b)) for key, a, b in zip(batch, slopes, bend, strict=True)}

    def _rough(self, above: np.ndarray, below: np.ndarray, width: np.ndarray) -> np.ndarray:
        """Entries whose derivatives differ between the two sides of the equilibrium, beyond rounding in the entries.

        `width` is that of the difference, in the unit of the parameter.
        """
        rows, largest = self.equations.rows, np.zeros(self.equations.pattern.total)
        np.maximum.at(largest, rows, JUMP * np.maximum(np.abs(above), np.abs(below)))
        moved = (self._weight != 0) & (width > 0)
        return moved & (np.abs(above - below) * width > largest[rows] * width + ROUNDING * self._size)

    def _all(self, given: dict[str, np.ndarray], s: np.ndarray) -> dict[str, np.ndarray]:
        """Constants of every family, with those that follow from the starting point s."""
        return {f.name: automatic(f._replace(k=given[f.name]), s) for f in self.equations.families}

    def _values(self, model: str, k: dict[str, np.ndarray]) -> np.ndarray:
        """The equations of Newton's method at the equilibrium with these constants."""
        f, lay = self.point.system.family(model), self.point.layout
        inside = [opened(one._replace(k=k[one.name])) for one in self.equations.families]
        values = self.equations.entries(self.point.s.copy(), _flat(inside), swept=False)[1]
        if f.device.admittance is not None:  # the power flow gives the current of a source less that of its admittance
            part, first = self.equations.injections[model], lay.nx + lay.outputs
            V = self.point.s[f.w[:, [family.BUS]] + np.arange(2)].view(complex)[:, 0]
            values[first + 2 * part.start : first + 2 * part.stop] -= (f.device.admittances(k[model]) * V).view(float)
        return values

    def _of_sources(self, model: str, k: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """The part of the source admittances of devices in the eigenvalue: they are in the network, with a minus."""
        f = self.point.system.family(model)
        if f.device.admittance is None:
            return np.zeros(len(rows), complex)
        Y, bus = f.device.admittances(k[rows]), f.w[rows, family.BUS]
        (a, b), (re, im) = (self._of_bus[bus], self._of_bus[bus + 1]), (self._right[bus], self._right[bus + 1])
        return Y.real * (a * re + b * im) + Y.imag * (b * re - a * im)


class _Steps(NamedTuple):
    """Points of a difference (in the unit of the parameter), weights of the values there, constants there."""

    points: np.ndarray  # (3)
    weights: np.ndarray  # (3)
    k: np.ndarray  # (3, constants)


def _flat(k: list[np.ndarray]) -> np.ndarray:
    """Constants of all families, one after the other."""
    return np.concatenate([np.zeros(0), *(one.ravel() for one in k)])


def rows_of(point: OperatingPoint, model: str) -> dict[naming.Key, int]:
    """Key of each device of a model -> its row in the system; a load has none if its model has no share of it."""
    case = point.case
    keys: Sequence[naming.Key] = list(case.devices[model])
    if tables.role(model) == "load":
        loads = zip(naming.keys(case, "loads"), case.loads, strict=True)
        keys = [key for key, load in loads if key in case.devices[model] and load.model_share]
    return {key: j for j, key in enumerate(keys)}


def _units(point: OperatingPoint) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Number of the unit of every device, row and signal: of all that is connected without the network."""
    lay, pattern = point.layout, point.equations.pattern
    count = int(pattern.device.max(initial=-1)) + 1
    apart = np.zeros(lay.size, bool)
    apart[lay.voltages] = apart[lay.step : lay.first_output] = True
    inside = ~apart[pattern.columns]
    outputs = np.flatnonzero(pattern.device[lay.nx : lay.nx + lay.outputs] >= 0)
    ends = np.r_[pattern.device[pattern.rows[inside]], pattern.device[lay.nx + outputs]]
    others = count + np.r_[pattern.columns[inside], lay.first_output + outputs]
    size = count + lay.size
    label = connected_components(
        sp.coo_matrix((np.ones(len(ends)), (ends, others)), shape=(size, size)), directed=False
    )[1]
    return label[:count], label[:count][pattern.device], label[count:]


def vectors(d: Descriptor, s: complex, v: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The left vector of the rows of the equations, that of the bus voltages (at their places), the right one."""
    lay, equations, parts = d.point.layout, d.point.equations, d.parts
    pattern, first = equations.pattern, lay.nx + lay.outputs
    ahead, back = -_solved(parts.gv, parts.gx @ v), -_solved(parts.gv.T, parts.fv.T @ w.conj())
    found = w.conj() @ (parts.fx @ v + parts.fv @ ahead)
    if abs(found - s) > SAME * max(1.0, abs(s)):
        raise StudyError("These modes are not those of the system at its operating point; take those of base.modes().")
    left, right, of_bus = np.zeros(pattern.total, complex), *np.zeros((2, lay.size), complex)
    left[d.rows], right[d.rows], right[lay.voltages], of_bus[lay.voltages] = w.conj(), v, ahead, back
    places = np.stack([equations.injecting, equations.injecting + 1], axis=1)
    left[first:] = of_bus[places].ravel()
    J = matrix(
        equations.entries(d.point.s.copy())[0], (pattern.rows, pattern.columns), (pattern.total, lay.size), False
    )
    rows, columns = slice(lay.nx, first), slice(lay.first_output, lay.first_memory)
    for _ in range(lay.outputs):  # outputs never form a loop: this ends with the longest chain of them
        before = left[rows].copy(), right[columns].copy()
        right[columns], left[rows] = (J @ right)[rows], (J.T @ left)[columns]
        if np.array_equal(before[0], left[rows]) and np.array_equal(before[1], right[columns]):
            break
    return left, of_bus, right


def _solved(M: Any, b: np.ndarray) -> np.ndarray:
    """inv(M) b for a complex b."""
    re, im = solved(M, np.stack([b.real, b.imag], axis=1)).T
    return np.asarray(re + 1j * im)

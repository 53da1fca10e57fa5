"""Newton's method on the equations that are simulated, with all limits opened.

The unknowns are the states, the outputs and the free set-points; the bus voltages are known. The equations are

    0 = rates,    0 = output equations - outputs,    0 = injected currents - those of the power flow.

Devices of different units are coupled only through the network, so the Jacobian separates into dense blocks, one per
unit with its controls. Its rows and columns are grouped once, by the pattern alone; groups of equal shape are solved
together.
"""

import contextlib
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from stabctl._util.errors import EquilibriumError

from . import family
from .assembly import System
from .family import Family
from .jacobian import Equations

TOLERANCE = 1e-11  # largest residual, 1/s and pu; of a current, pu on 100 MVA
ROUNDOFF = 1e-15  # the same relative to the largest derivative of its equation, for fast blocks
STALLED = 1e-14  # of the sum of the terms of an equation: residual that is rounding, if no step reduces it any more
FAR = 1e9  # value of an opened limit
STEPS = 30
EQUAL = 0.999  # of the largest, from which on sizes are equal but for rounding


class Newton:
    """The Newton iteration for one system at its power flow.

    Parameters
    ----------
    system, equations
        The devices.
    V
        Bus voltages (buses), complex, pu.
    current
        Current out of every unit (units), complex, pu on the system base.
    base_mva
        The system base, MVA.
    """

    def __init__(
        self, system: System, equations: Equations, V: np.ndarray, current: np.ndarray, base_mva: float
    ) -> None:
        layout = system.layout
        self.equations, self.nx, self.outputs = equations, layout.nx, layout.outputs
        self.constants, self.continued = _constants(equations.families)
        self.owners, self.injections, self.target = _power_flow(system, equations, V, current)
        self._unit = np.r_[np.ones(self.nx + self.outputs), np.full(len(self.injections), 100.0 / base_mva)]
        free = [layout.first_setpoint + k for k, p in enumerate(layout.setpoints) if p.start is None]
        outputs = layout.first_output + np.arange(layout.outputs)
        self.unknown = np.r_[np.arange(layout.nx), outputs, np.array(free, int)].astype(int)
        kept = equations.pattern.kept
        if "newton" not in kept:
            kept["newton"] = self._structure(layout.size)
        self._inside, self._rows, self.groups = kept["newton"]

    def _structure(self, size: int) -> "tuple[np.ndarray, np.ndarray, Groups]":
        """Entries of the equations that are in the Jacobian, rows of these and of the outputs, and its groups."""
        nx, own = self.nx, self.nx + self.outputs + np.arange(len(self.injections))
        row, column = np.full(nx + self.outputs + 2 * self.equations.injecting.size, -1), np.full(size, -1)
        row[: nx + self.outputs] = np.arange(nx + self.outputs)
        row[nx + self.outputs + self.injections] = own
        column[self.unknown] = np.arange(len(self.unknown))
        rows, columns = row[self.equations.rows], column[self.equations.columns]
        inside = np.flatnonzero((rows >= 0) & (columns >= 0))
        of_outputs = nx + np.arange(self.outputs)
        all_rows = np.r_[rows[inside], of_outputs]
        shape = nx + self.outputs + len(self.injections), len(self.unknown)
        return inside, all_rows, Groups(all_rows, np.r_[columns[inside], of_outputs], shape)

    def solve(self, s: np.ndarray) -> tuple[int, float, int]:
        """Solve the equations, introducing saturation in steps.

        Parameters
        ----------
        s
            All signals (layout.size), changed to the solution.

        Returns
        -------
        steps : int
            Newton steps made.
        fastest : float
            Largest magnitude (1/s) of an eigenvalue of a unit with its controls at given voltage.
        stiffest : int
            State with the largest participation in this eigenvalue; -1 without states.

        Raises
        ------
        Unsolved
            If the iteration does not converge.
        """
        steps = 0
        for share in (0.0, 0.25, 0.5, 0.75, 1.0) if self.constants[self.continued].any() else (1.0,):
            k = self.constants.copy()
            k[self.continued] *= share
            steps += self._iterate(s, k)
        simulated = np.concatenate([np.zeros(0), *(opened(f, closed=False).ravel() for f in self.equations.families)])
        return steps, *self._fastest(self._entries(self.equations.entries(s, simulated)[0]))

    def _iterate(self, s: np.ndarray, k: np.ndarray) -> int:
        """Solve with the parameters k; returns the number of steps."""
        first, before = self.nx + self.outputs, np.inf
        for made in range(STEPS + 1):
            derivatives, values = self.equations.entries(s, k)
            mismatch = values[first + self.injections] - self.target
            f = np.concatenate([values[: self.nx], np.zeros(self.outputs), mismatch])
            entries = self._entries(derivatives)
            if not (np.isfinite(f).all() and np.isfinite(entries).all()):
                break
            slope = self._unit.copy()
            np.maximum.at(slope, self._rows, np.abs(entries))
            if ((np.abs(f) < TOLERANCE * self._unit) | (np.abs(f) < ROUNDOFF * slope)).all():
                return made
            miss = float((np.abs(f) / (STALLED * self._terms(derivatives, s))).max(initial=0.0))
            if 0.5 * before < miss < 1:
                return made
            before = miss
            s[self.unknown] -= self.groups.solve(entries, f)
        worst = int(np.argmax(np.where(np.isfinite(f), np.abs(f), np.inf)))
        raise Unsolved(worst, float(f[worst]))

    def moved(self, s: np.ndarray, change: np.ndarray) -> np.ndarray:
        """The change of the signals (layout.size) that keeps an equilibrium one.

        Parameters
        ----------
        s
            All signals of the equilibrium.
        change
            Changes of the rates, output equations and injections that something else causes, to first order.
        """
        first, found = self.nx + self.outputs, np.zeros(len(s))
        f = np.r_[change[:first], change[first + self.injections]]
        found[self.unknown] = -self.groups.solve(self._entries(self.equations.entries(s.copy(), self.constants)[0]), f)
        return found

    def _terms(self, derivatives: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Size of every equation: the sum of the magnitudes of its linear terms, and 1 pu on 100 MVA (1 for a rate)."""
        equations, first = self.equations, self.nx + self.outputs
        found = np.bincount(equations.rows, np.abs(derivatives * s[equations.columns]), equations.pattern.total)
        return self._unit + np.r_[found[:first], found[first + self.injections] + np.abs(self.target)]

    def _entries(self, derivatives: np.ndarray) -> np.ndarray:
        """Entries of the Jacobian, from those of all equations."""
        return np.concatenate([derivatives[self._inside], np.full(self.outputs, -1.0)])

    def _fastest(self, entries: np.ndarray) -> tuple[float, int]:
        """Largest magnitude of an eigenvalue of the states, outputs eliminated, group by group, and its main state."""
        largest, nx, end = 0.0, self.nx, self.nx + self.outputs
        stiff = np.zeros((0, 0)), np.zeros(0, int)
        for alike in self.groups.alike:
            blocks, columns = self.groups.blocks(entries, alike), alike.columns
            states, both = (columns < nx).sum(axis=1), (columns < end).sum(axis=1)
            for n, m in {(n, m) for n, m in zip(states.tolist(), both.tolist(), strict=True) if n}:
                these = (states == n) & (both == m)
                J = blocks[these]
                inner = np.linalg.solve(J[:, n:m, n:m], J[:, n:m, :n])
                A = J[:, :n, :n] - J[:, :n, n:m] @ inner
                size = np.abs(np.linalg.eigvals(A)).max(axis=1)
                k = leading(size)
                if size[k] * EQUAL > largest:
                    stiff = A[k], columns[these][k, :n]
                largest = max(largest, float(size.max()))
        return largest, _main(*stiff)


class Unsolved(EquilibriumError):
    """No solution was found; `row` is the equation with the largest residual."""

    def __init__(self, row: int, residual: float) -> None:
        super().__init__(f"{STEPS} Newton steps (residual {abs(residual):.1e})")
        self.row = row


def _constants(families: list[Family]) -> tuple[np.ndarray, np.ndarray]:
    """All constants with their limits opened, and the places of those that models list in CONTINUATION."""
    opened_up, continued, start = [np.zeros(0)], [np.zeros(0, int)], 0
    for f in families:
        k = opened(f)
        opened_up.append(k.ravel())
        for name in f.device.continuation:
            continued.append(start + k.shape[1] * np.arange(len(k)) + f.device.Par._fields.index(name))
        start += k.size
    return np.concatenate(opened_up), np.concatenate(continued)


def opened(f: Family, closed: bool = True) -> np.ndarray:
    """Parameters of a family without limits (but levels) and deadbands and, if `closed`, every rotor circuit closed."""
    k, names = f.k.copy(), f.device.Par._fields
    for i, name in enumerate(names):
        if (side := family.side(f.device, name)) and name not in f.device.levels:
            k[:, i] = side * FAR
        elif name in f.device.deadbands:
            k[:, i] = 0.0
        elif closed and name in f.device.closed:
            k[:, i] = np.where(k[:, i] > 0, k[:, i], 1.0)
    return k


def _power_flow(
    system: System, equations: Equations, V: np.ndarray, current: np.ndarray
) -> tuple[list[tuple[int, str]], np.ndarray, np.ndarray]:
    """The devices whose currents the power flow gives: a unit's its own, a shunt's 0.

    Returns their units (-1: none) and names, the rows of these currents (real and imaginary part) among the injections,
    and the currents (pu).
    """
    owners: list[tuple[int, str]] = []
    rows, target = [np.zeros(0, int)], [np.zeros(0, complex)]
    for f in equations.families:
        part = equations.injections.get(f.name)
        if part is None or f.device.role not in ("machine", "converter", "shunt"):
            continue
        unit = f.w[:, family.UNIT]
        own = np.where(unit >= 0, current[unit], 0.0)
        if f.device.admittance is not None:
            own = own + f.device.admittances(f.k) * V[system.unit_bus[unit]]
        owners += [(int(i), f"{f.device.name} of {key}") for i, key in zip(unit, f.keys, strict=True)]
        rows.append(np.arange(part.start, part.stop))
        target.append(own)
    pairs = (2 * np.concatenate(rows)[:, None] + np.arange(2)).ravel()
    return owners, pairs, np.concatenate(target).view(float)


def _main(A: np.ndarray, states: np.ndarray) -> int:
    """The one of these states with the largest participation in the eigenvalue of A of largest magnitude; -1: none."""
    if not len(states):
        return -1
    values, right = np.linalg.eig(A)
    k = int(np.abs(values).argmax())
    share = np.abs(np.linalg.pinv(right)[k] * right[:, k])
    return int(states[leading(share)])


def leading(sizes: np.ndarray) -> int:
    """Place of the largest; the first of those that are equal but for rounding."""
    return int((sizes >= EQUAL * sizes.max()).argmax())


class Alike(NamedTuple):
    """Groups of equal shape."""

    rows: np.ndarray  # (groups, height)
    columns: np.ndarray  # (groups, width)
    entries: np.ndarray  # entries of the matrix that lie in these groups
    places: np.ndarray  # where each of them goes in the (groups, height, width) blocks, flattened


class Groups:
    """A sparse pattern that separates into independent groups of rows and columns.

    Parameters
    ----------
    rows, columns
        Row and column of every entry; the values of repeated entries are added.
    shape
        Numbers of rows and columns.
    """

    def __init__(self, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> None:
        self.width = shape[1]
        pattern = sp.coo_matrix((np.ones(len(rows)), (rows, columns + shape[0])), shape=(sum(shape), sum(shape)))
        count, group = connected_components(pattern, directed=False)
        of_row, of_column = group[: shape[0]], group[shape[0] :]
        heights, widths = np.bincount(of_row, minlength=count), np.bincount(of_column, minlength=count)
        by_row, by_column = np.argsort(of_row, kind="stable"), np.argsort(of_column, kind="stable")
        first_row, first_column = np.cumsum(heights) - heights, np.cumsum(widths) - widths
        local_row, local_column = np.empty(shape[0], np.int64), np.empty(shape[1], np.int64)
        local_row[by_row] = np.arange(shape[0]) - np.repeat(first_row, heights)
        local_column[by_column] = np.arange(shape[1]) - np.repeat(first_column, widths)
        of_entry, number = of_row[rows], np.empty(count, np.int64)
        self.alike: list[Alike] = []
        for height, width in sorted(set(zip(heights.tolist(), widths.tolist(), strict=True))):
            these = (heights == height) & (widths == width)
            members = np.flatnonzero(these)
            number[members] = np.arange(len(members))
            entries = np.flatnonzero(these[of_entry])
            r, c = rows[entries], columns[entries]
            self.alike.append(
                Alike(
                    by_row[first_row[members][:, None] + np.arange(height)],
                    by_column[first_column[members][:, None] + np.arange(width)],
                    entries,
                    (number[of_entry[entries]] * height + local_row[r]) * width + local_column[c],
                )
            )

    def blocks(self, data: np.ndarray, alike: Alike) -> np.ndarray:
        """The blocks (groups, height, width) of the entries `data`."""
        shape = (*alike.rows.shape, alike.columns.shape[1])
        return np.bincount(alike.places, data[alike.entries], int(np.prod(shape))).reshape(shape)

    def solve(self, data: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Solve J x = f for the entries `data` of J; x is 0 for empty rows and columns (bypassed blocks)."""
        x = np.zeros(self.width)
        for alike in self.alike:
            if alike.rows.size and alike.columns.size:
                x[alike.columns] = _solved(self.blocks(data, alike), f[alike.rows])
        return x


def _solved(blocks: np.ndarray, f: np.ndarray) -> np.ndarray:
    """inv(block) f of every block; the least-squares solution if a block is singular or not square.

    An unknown without an entry is exactly 0: rounding would move states that rest at a limit.
    """
    used = (blocks != 0).any(axis=1)
    if blocks.shape[1] == blocks.shape[2]:
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.linalg.solve(_filled(blocks), f[..., None])[..., 0]
    found = np.stack([np.linalg.lstsq(block, one, rcond=None)[0] for block, one in zip(blocks, f, strict=True)])
    return np.where(used, found, 0.0)


def _filled(blocks: np.ndarray) -> np.ndarray:
    """The same with a 1 where an empty row meets an empty column."""
    present = blocks != 0
    row, column = ~present.any(axis=2), ~present.any(axis=1)
    if (row.sum(axis=1) == column.sum(axis=1)).all():
        (group, r), (_, c) = np.nonzero(row), np.nonzero(column)
        blocks[group, r, c] = 1.0
    return blocks

"""Coherent areas: machines that swing together in the slow modes (slow coherency).

Each machine has a row in the matrix of slow eigenvectors, and coherent machines have nearly equal rows. The machines
with the most linearly independent rows become the references; every other machine joins the reference whose row is
closest to its own.
Source: J. H. Chow (ed.), Time-Scale Modeling of Dynamic Networks, 1982, ch. 5 (grouping algorithm).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from numbers import Integral

import numpy as np

from stabctl._util.errors import CaseError, StudyError, shown
from stabctl._util.wording import counted, listed
from stabctl.model import naming
from stabctl.model.case import Case
from stabctl.model.location import circuit

from .modes import Modes

MOST = 40  # areas, and machines of an area, that are printed


@dataclass(frozen=True, repr=False)
class Areas:
    """Groups of machines, largest inertia first; the first machine of each group is its reference."""

    name: str
    groups: tuple[tuple[int | str, ...], ...]  # names or numbers of machines
    modes: tuple[int, ...]  # the slow modes that define them
    frequencies_hz: tuple[float, ...]
    agreement: float  # smallest correlation of a machine's row with its reference's

    def of(self, machine: int | str) -> int:
        """Index of the group of a machine. Raises `StudyError` if there is no such machine."""
        for k, group in enumerate(self.groups):
            if machine in group:
                return k
        raise StudyError(f"There is no machine {machine} in the areas of {self.name}.")

    def moved(self, other: "Areas") -> tuple[int | str, ...]:
        """Machines that changed groups; each group of `other` is matched to the one it shares most machines with."""
        from scipy.optimize import linear_sum_assignment

        common = np.array([[len(set(a) & set(b)) for b in other.groups] for a in self.groups])
        pairs = dict(zip(*(side.tolist() for side in linear_sum_assignment(-common)), strict=True))
        moved = (m for group in self.groups for m in group if pairs.get(self.of(m)) != other.of(m))
        return tuple(sorted(moved, key=naming.order))

    def __str__(self) -> str:
        groups = [listed([*map(str, sorted(group, key=naming.order))], MOST) for group in self.groups]
        more = f"; and {len(groups) - MOST} more" if len(groups) > MOST else ""
        return f"{self.name}: {len(groups)} areas: {'; '.join(groups[:MOST])}{more}"

    __repr__ = __str__


def areas(modes: Modes, count: int | None = None) -> Areas:
    """Divide the machines into coherent areas by the slowest swing modes.

    Parameters
    ----------
    modes : Modes
        All modes of the system.
    count : int, optional
        Number of areas, found from the `count - 1` slowest swing modes; in a network of n islands, from the `count - n`
        slowest, and there are n areas at least. By default, counts from n + 1 to a third of the machines are tried, and
        the one with the best agreement is kept.

    Returns
    -------
    Areas

    Raises
    ------
    StudyError
        If the system has no rotor, or fewer swing modes than that.

    References
    ----------
    J. H. Chow (ed.), Time-Scale Modeling of Dynamic Networks, 1982, ch. 5.
    """
    name = modes.linear.point.case.name
    if not len(modes.linear.point.rotors.unit):
        raise StudyError(f"{name} has no machine or grid-forming converter, so it has no coherent areas.")
    swings, (machines, islands) = modes.swings(), modes.linear.point.members.shape
    most = len(swings) + islands
    if count is None:
        tried = range(min(islands + 1, most), max(islands + 1, min(machines // 3, most - 1)) + 1)
        return max((_split(modes, swings[: k - islands]) for k in tried), key=lambda found: found.agreement)
    if isinstance(count, bool) or not isinstance(count, Integral):
        raise StudyError(f"count = {shown(count)} is not a number of areas; give a whole number.")
    if not islands <= count <= most:
        raise StudyError(
            f"{name} cannot be divided into {counted(count, 'area')}: it has {counted(len(swings), 'swing mode')}; "
            f"choose {islands} to {most} areas."
        )
    return _split(modes, swings[: count - islands])


def _split(modes: Modes, slow: list[int]) -> Areas:
    """The machines grouped by the common motion of each island and these swing modes."""
    point, rows = modes.linear.point, _rows(modes, slow)
    count = rows.shape[1]
    references = _references(rows)
    along = rows @ np.linalg.inv(rows[references])
    member = along.argmax(axis=1)
    unit = rows / np.linalg.norm(rows, axis=1)[:, None]
    agreement = float((unit * unit[references][member]).sum(axis=1).min())
    H, names = point.inertia, point.rotor_names
    groups = []
    for g in sorted(range(count), key=lambda g: -float(H[member == g].sum())):
        others = [int(i) for i in np.flatnonzero(member == g) if i != references[g]]
        groups.append(tuple(names[i] for i in [references[g], *others]))
    return Areas(
        point.case.name, tuple(groups), tuple(slow), tuple(float(f) for f in modes.frequency_hz[slow]), agreement
    )


def _rows(modes: Modes, slow: list[int]) -> np.ndarray:
    """Angles of the machines in the common motions and the slow modes (machines, count), real, columns of norm 1."""
    angles = modes.right[modes.linear.angles()][:, slow]
    turn = np.exp(-0.5j * np.angle((angles**2).sum(axis=0)))
    columns = np.column_stack([modes.linear.point.members, (angles * turn).real])
    return columns / np.linalg.norm(columns, axis=0)


def _references(rows: np.ndarray) -> list[int]:
    """Reference machines, each the farthest from the span of those before: Gaussian elimination, full pivoting."""
    left, chosen = rows.copy(), []
    free = list(range(rows.shape[1]))
    for _ in range(rows.shape[1]):
        i, j = np.unravel_index(np.abs(left[:, free]).argmax(), (len(left), len(free)))
        column = free.pop(int(j))
        chosen.append(int(i))
        left = left - np.outer(left[:, column] / left[i, column], left[i])
    return chosen


def opened(case: Case, circuits: Iterable[str]) -> Case:
    """Take circuits out of service, to study the system without them.

    Parameters
    ----------
    case : Case
        The system.
    circuits : iterable of str
        Circuits, such as "7-8" or "7-8#2".

    Returns
    -------
    Case

    Raises
    ------
    StudyError
        If there is no such circuit, or part of the network would be isolated.
    """
    named = list(circuits)
    gone = [circuit(case, text)[0] for text in named]
    kept = tuple(k for i, k in enumerate(case.branches) if i not in gone)
    try:
        return replace(case, branches=kept) if gone else case
    except CaseError as error:
        why = getattr(error, "text", str(error)).partition(";")[0]
        raise StudyError(f"Without {', '.join(named)} {case.name} has no operating point: {why}.") from None

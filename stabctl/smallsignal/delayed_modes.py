"""Modes of a loop with continuous delays: its exact roots, with vectors in the states of the linear model."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util import cores
from stabctl._util.wording import counted

from .eigen import eigen
from .modes import Modes

if TYPE_CHECKING:
    from .closed_loop import ClosedLoop


@dataclass(frozen=True, repr=False)
class DelayedModes(Modes):
    """The roots of a loop with continuous delays in a circle around 0, and all that grow; infinitely many others decay.

    Attributes
    ----------
    radius : float, 1/s
        Radius of the circle.
    decay : float, 1/s
        Roots in the circle that decay faster are left out; inf unless rounding hides them because the delays are long.
    counted : int or None
        Number of roots in the circle or with a real part of at least 0, by the argument principle; None if they cannot
        be counted.
    growing : int or None
        Number of roots that grow, at any frequency, by the argument principle; None if they cannot be counted.
    correction : float, 1/s
        Largest distance of an electromechanical mode from that of the Pade approximation.

    The others are those of `Modes`.
    """

    radius: float = 0.0
    decay: float = np.inf
    counted: int | None = 0
    growing: int | None = 0
    correction: float = 0.0

    @property
    def certified(self) -> bool:
        """Whether as many roots were found as counted."""
        return self.counted == len(self)

    @property
    def stable(self) -> bool:
        """Whether no root grows, at any frequency."""
        return self.growing == 0

    def _fastest_growing(self) -> str:
        if self.growing is None:
            return "its direct path does not bound the growing roots"
        known = int((self.eigenvalues.real > 0).sum())
        return super()._fastest_growing() if known else f"{counted(self.growing, 'root')} that grow were not found"

    def __str__(self) -> str:
        moved = f"the approximation in the simulation moves swings by {self.correction:.1e} 1/s"
        return f"{super().__str__()} {self.proof()}; {moved}."

    def proof(self) -> str:
        """What is counted and found, as a sentence without its end."""
        where = f"below {self.radius:.3g} 1/s"
        if self.decay < self.radius:
            where += f" that decay with less than {self.decay:.3g} 1/s"
        if self.counted is None:
            return f"Continuous delays are exact, but the roots {where} cannot be counted: {len(self)} found"
        found = "all found" if self.certified else f"{len(self)} found"
        return f"Continuous delays are exact: {counted(self.counted, 'root')} {where} or growing, {found}"

    __repr__ = __str__


def delayed_modes(loop: "ClosedLoop") -> DelayedModes:
    """The exact modes of a closed loop with continuous delays."""
    opened = loop.opened
    assert opened is not None
    rotation = loop.rotation()
    near = eigen(loop.A, rotation)
    zero = near.some(near.values == 0)
    with cores.one_thread():
        roots = opened.roots(rotation)
    values, right, left = list(zero.values), list(zero.right.T), list(zero.left.T)
    for root in sorted(roots.found, key=lambda root: (root.s.imag, root.s.real)):
        v, w = opened.vectors(root)
        both = root.s.imag > 0
        values += [root.s, root.s.conjugate()] if both else [complex(root.s.real)]
        right += [v, v.conj()] if both else [v.real + 0j]
        left += [w, w.conj()] if both else [w.real + 0j]
    parts = np.array(values), np.array(right).T, np.array(left).T
    for part in parts:
        part.setflags(write=False)
    known = Modes(loop, *parts)
    moved = [np.abs(near.values - known.eigenvalues[k]).min() for k in known.swings()]
    return DelayedModes(
        loop,
        *parts,
        radius=roots.region.radius,
        decay=roots.region.left,
        counted=None if roots.counted is None else roots.counted + 1,  # with the angle reference
        growing=roots.growing,
        correction=float(max(moved, default=0.0)),
    )

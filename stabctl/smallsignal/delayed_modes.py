"""Modes of a loop with continuous delays: its exact roots, with vectors in the states of the linear model."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stabctl._util.wording import counted

from .eigen import eigen
from .modes import Modes

if TYPE_CHECKING:
    from .closed_loop import ClosedLoop


@dataclass(frozen=True, repr=False)
class DelayedModes(Modes):
    """The roots of a loop with continuous delays inside a circle around 0; there are infinitely many outside.

    Attributes
    ----------
    radius : float, 1/s
        Radius of the circle.
    counted : int
        Number of roots inside, by the argument principle.
    correction : float, 1/s
        Largest distance of an electromechanical mode from that of the Pade approximation.

    The others are those of `Modes`.
    """

    radius: float = 0.0
    counted: int = 0
    correction: float = 0.0

    @property
    def certified(self) -> bool:
        """Whether as many roots were found as counted."""
        return self.counted == len(self)

    def __str__(self) -> str:
        found = "all found" if self.certified else f"only {len(self)} found"
        return (
            f"{super().__str__()} Continuous delays are exact: {counted(self.counted, 'root')} below {self.radius:.3g} "
            f"1/s, {found}; the approximation in the simulation moves swings by {self.correction:.1e} 1/s."
        )

    __repr__ = __str__


def delayed_modes(loop: "ClosedLoop") -> DelayedModes:
    """The exact modes of a closed loop with continuous delays."""
    opened = loop.opened
    assert opened is not None
    radius, rotation = opened.radius(), loop.rotation()
    near = eigen(loop.A, rotation)
    zero = near.some(near.values == 0)
    roots = sorted(opened.roots(radius, rotation), key=lambda root: (root.s.imag, root.s.real))
    values, right, left = list(zero.values), list(zero.right.T), list(zero.left.T)
    for root in roots:
        v, w = opened.vectors(root)
        both = root.s.imag > 0
        values += [root.s, root.s.conjugate()] if both else [complex(root.s.real)]
        right += [v, v.conj()] if both else [v.real + 0j]
        left += [w, w.conj()] if both else [w.real + 0j]
    parts = np.array(values), np.array(right).T, np.array(left).T
    for part in parts:
        part.setflags(write=False)
    modes = DelayedModes(loop, *parts, radius=radius, counted=opened.count(radius))
    moved = [np.abs(near.values - modes.eigenvalues[k]).min() for k in modes.swings()]
    return DelayedModes(loop, *parts, radius=radius, counted=modes.counted, correction=float(max(moved, default=0.0)))

"""Modes in a band of frequencies and damping ratios, from the sparse descriptor."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import splu

from stabctl._util.wording import counted

from .count import Sector
from .descriptor import Descriptor
from .modes import Modes

DAMPING = (-0.1, 0.3)  # damping ratios of a selection


@dataclass(frozen=True, repr=False)
class Selected(Modes):
    """The modes in a band of frequencies and damping ratios, one of each pair; counted, so that none is missing."""

    linear: Descriptor  # type: ignore[assignment]  # sparse, in place of the dense model
    damping: tuple[float, float] = DAMPING
    counted: int = 0  # eigenvalues in the band by the argument principle
    incomplete: tuple[Sector, ...] = ()  # parts of the band in which not all eigenvalues counted were found

    @property
    def certified(self) -> bool:
        """Whether as many modes were found as counted, in every part of the band."""
        return self.counted == len(self) and not self.incomplete

    def controllability(self) -> np.ndarray:
        """W^H B (modes, inputs), B = fu - fv inv(gv) gu."""
        d = self.linear
        return self.left.conj().T @ (d.fu.toarray() - d.fv @ splu(d.gv).solve(d.gu.toarray()))

    def observability(self) -> np.ndarray:
        """C V (outputs, modes), C = hx - hv inv(gv) gx."""
        d, factors = self.linear, splu(self.linear.gv)
        currents = d.gx @ self.right
        return d.hx @ self.right - d.hv @ (factors.solve(currents.real) + 1j * factors.solve(currents.imag))

    def __str__(self) -> str:
        (slow, fast), (low, high) = self.band or (0.0, np.inf), self.damping
        asked = f"{slow:g} to {fast:g} Hz with damping ratios from {low:g} to {high:g}"
        whole = super().__str__().partition(": ")[2].replace("eigenvalue", "mode", 1)
        return f"{self.linear.name}, {len(self.linear.states)} states, only modes from {asked}: {whole} {self.proof()}."

    def proof(self) -> str:
        """What is certified, or where modes are missing."""
        if self.certified:
            return f"certified: {counted(self.counted, 'eigenvalue')} counted in the band"
        hz = (f"{part.low / (2 * np.pi):.4g} to {part.high / (2 * np.pi):.4g} Hz" for part in self.incomplete)
        found = f"{counted(self.counted, 'eigenvalue')} counted in the band, {len(self)} found"
        return f"not complete: {found}; some are missing from {', '.join(hz)}"

    __repr__ = __str__

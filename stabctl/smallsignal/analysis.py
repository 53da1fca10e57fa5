"""The modes of a system: all of them, or of a large system those of a band of frequencies and damping ratios."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.linalg import splu

from stabctl._util import units
from stabctl._util.errors import StudyError
from stabctl._util.wording import counted
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from . import _band_search
from ._argument_principle import Sector
from .descriptor import Descriptor, descriptor
from .eigen import Eigen, eigen
from .model import Linear, eliminated
from .modes import Modes

LARGE = 2000  # states beyond which only modes of a band are computed: all would take minutes
BAND = (0.1, 2.5)  # Hz   electromechanical modes
DAMPING = (-0.5, 0.3)  # damping ratios of a selection


def modes(
    base: Case | OperatingPoint,
    band: str | Sequence[str | float] | None = None,
    *,
    storage: "Fleet | None" = None,
    damping: tuple[float, float] = DAMPING,
    sparse: bool | None = None,
) -> Modes:
    """Compute the modes of a system at its operating point.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    band : str or pair, optional
        Frequencies of the modes in `df`: "0.1..2Hz", or two numbers in Hz. Up to 2000 states all modes are computed;
        above that, only those of the band (0.1 to 2.5 Hz by default).
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    damping : tuple of float
        Lowest and highest damping ratio, if only the modes of a band are computed.
    sparse : bool, optional
        Whether only the modes of the band are computed (`Selected`), or all; by default all, up to 2000 states.

    Returns
    -------
    Modes

    Raises
    ------
    LinearizationError
        If the point is not an equilibrium, or a device is exactly at a limit; names the state or the limit.
    StudyError
        If the band is not a band of frequencies.

    Examples
    --------
    >>> st.load("two_area").modes("0.1..2Hz").df.query("swing")[["frequency_hz", "damping_ratio", "mode"]].round(3)
       frequency_hz  damping_ratio               mode
    0         0.611          0.120  1, 2 against 3, 4
    1         1.263          0.362        1 against 2
    2         1.341          0.375        3 against 4
    """
    chosen = None if band is None else units.band(band)
    d = descriptor(operating_point(base, storage))
    if sparse or (sparse is None and len(d.rows) > LARGE):
        return analyze(d, chosen or BAND, damping)
    return replace(analyze(eliminated(d)), band=chosen)


def analyze(
    model: Linear | Descriptor,
    band: tuple[float, float] | None = None,
    damping: tuple[float, float] = DAMPING,
    *,
    said: Callable[[float], None] = lambda _: None,
) -> Modes:
    """Compute the modes of a linear model or of a sparse descriptor.

    Parameters
    ----------
    model : Linear or Descriptor
        Of a linear model all modes are computed (LAPACK); of a descriptor those of a band (`band_search`).
    band : tuple of float, Hz, optional
        Lowest and highest frequency. A descriptor without a band is treated as a linear model up to `LARGE` states,
        and with the band `BAND` above that.
    damping : tuple of float
        Lowest and highest damping ratio of the modes in a band.
    said : callable, optional
        Called with the part of the work done, from 0 to 1, while the modes of a band are computed.

    Returns
    -------
    Modes

    Raises
    ------
    StudyError
        If the band or the damping ratios are not possible.
    """
    if isinstance(model, Descriptor):
        if band is not None or len(model.rows) > LARGE:
            band = BAND if band is None else band
            found = _band_search.band(model, *band, damping, said)
            return Selected(model, *_fixed(found.modes), band, damping, found.counted, found.incomplete)
        model = eliminated(model)
    elif band is not None:
        raise StudyError(
            "Computing only the modes of a band needs a sparse model; use stabctl.smallsignal.descriptor to linearize."
        )
    if model.transition()[2]:
        raise StudyError(f"{model.name} has sampled controllers; use modes() of its closed loop, or no rates.")
    return Modes(model, *_fixed(eigen(model.A, model.rotation())))


def _fixed(found: Eigen) -> Eigen:
    for part in found:
        part.setflags(write=False)
    return found


@dataclass(frozen=True, repr=False)
class Selected(Modes):
    """The modes in a band of frequencies and damping ratios, one of each pair; counted, so that none is missing."""

    linear: Descriptor  # type: ignore[assignment]  # sparse, in place of the dense model
    damping: tuple[float, float] = DAMPING
    counted: int = 0  # eigenvalues in the band by the argument principle
    incomplete: tuple[Sector, ...] = ()  # parts of the band in which not all eigenvalues counted were found

    @property
    def references(self) -> int:  # type: ignore[override]
        """None: the band begins above 0 Hz."""
        return 0

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

    @property
    def asked(self) -> str:
        """The band and the damping ratios, in words."""
        (slow, fast), (low, high) = self.band or (0.0, np.inf), self.damping
        return f"from {slow:g} to {fast:g} Hz with damping ratios from {low:g} to {high:g}"

    def __str__(self) -> str:
        whole = super().__str__().partition(": ")[2].replace("eigenvalue", "mode", 1)
        states = f"{len(self.linear.states)} states"
        return f"{self.linear.name}, {states}, only modes {self.asked}: {whole} {self.proof()}."

    def proof(self) -> str:
        """What is certified, or where modes are missing."""
        if self.certified:
            return f"certified: {counted(self.counted, 'eigenvalue')} counted in the band"
        hz = (f"{part.low / (2 * np.pi):.4g} to {part.high / (2 * np.pi):.4g} Hz" for part in self.incomplete)
        found = f"{counted(self.counted, 'eigenvalue')} counted in the band, {len(self)} found"
        return f"not complete: {found}; some are missing from {', '.join(hz)}"

    __repr__ = __str__

"""The linear model of a system with controllers: exact, whether they are continuous, sampled or both.

Continuous controllers close the loop x' = A x + B y, u = C x + D y directly. With sampled ones the closed loop is the
map over the common period of all rates, from [x | outputs held, states and delay lines of the controllers]: the plant
moves exactly with its inputs held, x(t + T) = exp(A T) x + (integral of exp(A t)) B u, and at a frame a controller
reads the system with the outputs held before. Eigenvalues z of the map over the period T are the modes s = log(z) / T,
unique below half of 1/T. Those that decay to less than a fifth within one frame of the fastest controller are left
out: a delay line has a z for every frame, near (loop gain)^(1 / frames), among those of the fastest modes of the plant.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl._util import units
from stabctl._util.errors import StudyError
from stabctl.controllers.controller import Controller
from stabctl.controllers.law import Law
from stabctl.dynamics.layout import StatePlace, unique
from stabctl.dynamics.named import Named, all_named
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal, chosen
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

from .delayed_loop import FAST, DelayedLoop, delayed_modes
from .eigen import Eigen, eigen, values
from .interconnection import Plant, common_period, over_a_period, plant_of
from .model import Linear
from .modes import Modes

EMPTY = 0.2  # |z| per frame, up to which modes are left out


@dataclass(frozen=True, repr=False)
class ClosedLoop(Linear):
    r"""The linear model of a system with controllers.

    Without sampled controllers, A, B, C, D are those of $\dot x = A x + B u$, $y = C x + D u$. With them,
    $A = (M - 1) / T$ for the map $M$ of the states over the common period $T$ of the frames, and B and D are those of
    inputs held over the period. Its other attributes are those of `Linear`.

    Attributes
    ----------
    controllers : tuple of Controller
        The controllers.
    period : float, s
        Common period of the frames; 0 if all controllers are continuous.
    frames : int
        Frames of the fastest controller in a period.
    opened : DelayedLoop or None
        The loop with exact delays, if continuous controllers have delays and none is sampled.

    Examples
    --------
    >>> law = st.Controller.from_function(lambda seen: 100 * seen["deviation"], "deviation", "order", delay="50ms")
    >>> loop = st.load("two_area").closed_loop(law, storage="50MW", outputs="speed:1")
    >>> loop.A.shape, loop.outputs, loop.modes().stable
    ((72, 72), ('speed GENROU 1',), True)
    """

    controllers: tuple[Controller, ...] = ()
    period: float = 0.0
    frames: int = 0
    opened: DelayedLoop | None = None

    def transition(self) -> tuple[np.ndarray, np.ndarray, float]:
        """As for other models; with sampled controllers, the map over the period, with the inputs held."""
        if not self.period:
            return super().transition()
        return np.eye(len(self.A)) + self.period * self.A, self.period * self.B, self.period

    @property
    def floor(self) -> float:
        """Real part (1/s) above which modes are known: -1.61 times the fastest rate, or -inf without a sampled one."""
        return float(np.log(EMPTY)) * self.frames / self.period if self.period else -np.inf

    def eigenvalues(self) -> np.ndarray:
        """Eigenvalues (1/s), without that of the angle reference; with sampled controllers, those above `floor`."""
        if self.opened is not None:
            return self.opened.eigenvalues(self.rotation())
        s = values(self.A, self.rotation())
        if not self.period:
            return s
        z = 1 + self.period * s
        return np.log(z[np.abs(z) > EMPTY**self.frames]) / self.period

    def modes(self, band: str | Sequence[str | float] | None = None) -> Modes:
        """The modes of the closed loop.

        With sampled controllers they are those with a real part above -1.61 times the fastest rate (`floor`): faster
        ones of the plant are left out with those of emptying delay lines, which cannot be told from them. With
        continuous delays they are the exact roots below 10 Hz, and all that grow (`delayed_loop`): `DelayedModes`.

        Parameters
        ----------
        band : str or pair, optional
            Frequencies of the modes in `df`: "0.1..2Hz", or two numbers in Hz. All modes are computed.

        Returns
        -------
        Modes

        Raises
        ------
        StudyError
            If the band is not a band of frequencies, or with continuous delays is above 10 Hz.

        Examples
        --------
        >>> loop = st.load("two_area").closed_loop(st.Feedback(0.2), storage="1=50MW")
        >>> loop.modes("0.1..1Hz").df[["frequency_hz", "damping_ratio", "mode"]].round(3)
           frequency_hz  damping_ratio               mode
        0         0.581          0.337  1, 2 against 3, 4
        """
        selected = None if band is None else units.band(band)
        if self.opened is not None and selected and selected[1] > FAST:
            raise StudyError(
                f"With continuous delays the modes below {FAST:g} Hz are found; give a band that ends there, not at "
                f"{selected[1]:g} Hz."
            )
        return replace(self._modes(), band=selected)

    def _modes(self) -> Modes:
        if self.opened is not None:
            return delayed_modes(self, self.opened)
        found = eigen(self.A, self.rotation())
        if not self.period:
            return Modes(self, *found)
        z = 1 + self.period * found.values
        with np.errstate(divide="ignore"):
            s = np.where(found.values == 0, 0, np.log(np.where(z == 0, 1e-300, z)) / self.period)
        kept = np.abs(z) > EMPTY**self.frames
        order = np.flatnonzero(kept)[np.lexsort((-s[kept].imag, s[kept].real, np.abs(s[kept].imag)))]
        references = self.rotation().shape[1]
        order = np.r_[np.arange(references), order[order >= references]]
        parts = Eigen(s[order], found.right[:, order], found.left[:, order])
        for part in parts:
            part.setflags(write=False)
        return SampledModes(self, *parts)


@dataclass(frozen=True, repr=False)
class SampledModes(Modes):
    """Modes s = log(z) / T of a map over the period T."""

    linear: ClosedLoop

    def _number(self) -> str:
        return f"{super()._number()} with real parts above {self.linear.floor:.3g} 1/s"

    def controllability(self) -> np.ndarray:
        """W^H G / (z T) (modes, inputs), G of inputs held over the period, so that residues are derivatives of s."""
        return super().controllability() * np.exp(-self.eigenvalues * self.linear.period)[:, None]


def closed_loop(
    base: Case | OperatingPoint,
    *controllers: Controller | Law,
    inputs: str | Iterable[str | Signal] = (),
    outputs: str | Iterable[str | Signal] = (),
    storage: "Fleet | None" = None,
) -> ClosedLoop:
    """Linearize a system with controllers.

    Deadbands and relays have no derivative: linearly, such a controller gives nothing. Limits and gates do not act on
    small deviations, and gates are taken as open.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    *controllers : Controller or Law
        The controllers; a law of storage devices acts as its `controllers`.
    inputs, outputs : str or iterable
        Signals of the model, as in `linearize`.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    LinearizationError, StudyError
        As `linearize`; also if a controller reads or drives what the case does not have, or a law has no linear model.

    Examples
    --------
    >>> loop = st.load("two_area_thyristor").closed_loop(st.Feedback(10.0), storage="50MW")
    >>> print(loop.modes())
    two_area_thyristor: 28 eigenvalues, 0 electromechanical modes; least damped: 3.477 Hz, ...
    """
    point = operating_point(base, storage)
    own = all_named(point, controllers)
    wanted = chosen(point.case, inputs, INPUTS), chosen(point.case, outputs, OUTPUTS)
    return joined(plant_of(point, own, *wanted), own, *wanted)


def joined(
    plant: Plant, own: Sequence[Named], inputs: Sequence[Signal] = (), outputs: Sequence[Signal] = ()
) -> ClosedLoop:
    """The closed loop of a linear model and controllers, whose signals are among its inputs and outputs."""
    late = any(one.controller.delay for one in own) and not any(one.controller.rate for one in own)
    opened = DelayedLoop.of(plant, own) if late else None
    for one in own:
        if one.controller.rate is None:
            plant = plant.with_continuous(one)
    controllers = tuple(one.controller for one in own)
    sampled = [one for one in own if one.controller.rate]
    m = plant.model
    labels = tuple(s.label for s in inputs), tuple(s.label for s in outputs)
    columns, rows = plant.columns(inputs), plant.rows(outputs)
    if not sampled:
        parts = m.A, m.B[:, columns], m.C[rows], m.D[np.ix_(rows, columns)]
        return ClosedLoop(m.name, *parts, m.states, *labels, m.point, m.places, controllers, opened=opened)
    rates = [one.controller.rate or 1 for one in sampled]
    period = common_period(rates)
    M, G, H, J, names = over_a_period(plant, sampled, period, columns, rows)
    places = [StatePlace("controller", 0, -1, name, name) for name in names]
    T = float(period)
    states = unique((*m.states, *names))
    A = (M - np.eye(len(M))) / T
    frames = round(max(rates) * T)
    return ClosedLoop(
        m.name, A, G / T, H, J, states, *labels, m.point, (*m.places, *places), controllers, T, frames
    )  # fmt: skip

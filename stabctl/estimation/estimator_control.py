"""Controls with estimated signals: a storage law, or controllers of anything, behind PMUs and an estimator."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from math import inf
from numbers import Integral, Real
from typing import Annotated, get_args

import numpy as np
from annotated_types import Ge

from stabctl._util.errors import StudyError, shown
from stabctl._util.validation import guard
from stabctl._util.verbs import verb
from stabctl.controllers import BangBang, Law, SampledLaw
from stabctl.controllers.controller import Controller

from .estimators import Engine, EstimatorName
from .pmu import Pmu
from .rotor_units import USUAL_NOISE, ProcessNoise


@dataclass(frozen=True)
class EstimatorControl:
    """A storage law, or controllers, with estimated signals.

    A law acts at the PMU rate, on estimated speeds. A `Controller` is the same as without: its own rate and delay, but
    each of its inputs is an estimate or a measurement, new at every PMU frame: speeds and angles of rotors from the
    estimator; voltages, frequencies and powers of buses, lines and terminals from PMUs there. A controller that drives
    one machine has the reports of that machine at once; all others arrive with the latency of the PMUs.

    Parameters
    ----------
    control : control law, Controller, or list of them
        `BangBang()`, `Feedback(...)`, controllers; at most one law.
    estimator : {"ideal", "frequency", "kinematic", "kalman"}
        How the speeds are estimated; see `estimators`.
    pmu : Pmu
        Rate, noise, latency and losses of the PMUs.
    seed : int
        Seed of noise and losses.
    engine : {"batched", "filterpy"}
        All filters at once, or, as the reference with the same numbers, one filterpy filter per machine.
    process : ProcessNoise
        Process noise of the filters.
    inertia_factor, reactance_factor : float, or tuple with one per machine
        Multiply every H and x that the estimator uses, to study wrong machine data or to mend them (`Estimates.fit`).
    check_pmus : bool
        Find bad PMUs with the network model, and use them no longer.

    Examples
    --------
    >>> late = st.EstimatorControl(st.BangBang(), "kalman", st.Pmu(latency="100ms"))
    >>> fault = st.Contingency("7", clear="10cyc", trip="7-8")
    >>> st.load("two_area").simulate(fault, "5s", storage="50MW", control=late).outcome.stable
    True
    """

    control: Law | Controller | Sequence[Law | Controller] = field(default_factory=BangBang)
    estimator: EstimatorName = "kalman"
    pmu: Pmu = field(default_factory=Pmu)
    _: KW_ONLY
    seed: Annotated[int, "-", "seed of noise and losses", Ge(0)] = 1
    engine: Engine = "batched"
    process: ProcessNoise = USUAL_NOISE
    inertia_factor: float | tuple[float, ...] = 1.0
    reactance_factor: float | tuple[float, ...] = 1.0
    check_pmus: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.seed, Integral):
            object.__setattr__(self, "seed", int(self.seed))
        guard(self)
        if isinstance(self.control, list):
            object.__setattr__(self, "control", tuple(self.control))
        for one in self._several:
            if isinstance(one, type) or not (isinstance(one, Controller) or callable(getattr(one, "par", None))):
                raise StudyError(
                    f"control = {shown(one)} is not a control law; give BangBang(), Feedback(...) or a Controller."
                )
            if isinstance(one, SampledLaw):
                raise StudyError("A law behind PMUs acts once per PMU frame; leave out sampled().")
        if len(self._several) - len(self.controllers) > 1 or not self._several:
            raise StudyError("An EstimatorControl takes one storage law, or controllers; give only one law.")
        if not isinstance(self.pmu, Pmu):
            raise StudyError(f"pmu = {shown(self.pmu)} does not describe PMUs; give Pmu(...).")
        if not isinstance(self.process, ProcessNoise):
            raise StudyError(f"process = {shown(self.process)} is no process noise; give ProcessNoise(...).")
        if not isinstance(self.check_pmus, bool | np.bool_):
            raise StudyError(f"check_pmus = {shown(self.check_pmus)} is not allowed; give True or False.")
        for name in ("inertia_factor", "reactance_factor"):
            given = getattr(self, name)
            given = tuple(np.atleast_1d(given).tolist()) if isinstance(given, np.ndarray) else given
            object.__setattr__(self, name, given)
            several = given if isinstance(given, Sequence) and not isinstance(given, str) else (given,)
            if not all(isinstance(k, Real) and not isinstance(k, bool) and 0 < float(k) < inf for k in several):
                raise StudyError(f"{name} = {shown(given)} is not allowed; give numbers above 0.")
        for name, allowed in (("estimator", EstimatorName), ("engine", Engine)):
            if getattr(self, name) not in get_args(allowed):
                raise StudyError(
                    f"{name} = {getattr(self, name)!r} is not known; choose one of {', '.join(get_args(allowed))}."
                )

        for signal in ("acceleration", "angle"):
            if self.estimator == "frequency" and self.law is not None and self.law.reads(signal):
                raise StudyError(
                    f"{self.law} reads the {signal}, which the estimator 'frequency' does not give; choose 'kalman'."
                )

    @property
    def _several(self) -> tuple[Law | Controller, ...]:
        return self.control if isinstance(self.control, tuple) else (self.control,)  # type: ignore[return-value]

    @property
    def law(self) -> Law | None:
        """The storage law, if any."""
        return next((one for one in self._several if not isinstance(one, Controller)), None)

    @property
    def controllers(self) -> tuple[Controller, ...]:
        """The controllers."""
        return tuple(one for one in self._several if isinstance(one, Controller))

    @property
    def timed(self) -> bool:
        """Whether PMUs fail at given instants."""
        return self.pmu.outage is not None or bool(self.pmu.bad)

    @property
    def rate(self) -> int:
        """Frames per second."""
        return self.pmu.rate

    pilot = verb("stabctl.estimation.estimator_loop:pilot")

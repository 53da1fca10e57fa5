"""The simulation of a contingency with estimated speeds, in one call."""

from collections.abc import Iterable
from dataclasses import replace
from numbers import Integral
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import seconds
from stabctl.controllers import BangBang
from stabctl.dynamics.operating_point import Fleet, OperatingPoint, operating_point
from stabctl.model.case import Case
from stabctl.simulation.contingency import Disturbance, timed_events
from stabctl.simulation.control import Control, carry
from stabctl.simulation.criterion import DEFAULT, Criterion, checked
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

from .estimates import Estimates
from .estimator_control import EstimatorControl
from .estimator_loop import EstimatorLoop
from .estimators import EstimatorName
from .pmu import Pmu

OBSERVE = 5.0  # s   after the last event, if no end is given


def estimate(
    base: Case | OperatingPoint,
    contingency: "Disturbance | None" = None,
    until: str | float | None = None,
    *,
    storage: "Fleet | None" = None,
    control: Control | EstimatorControl = None,
    estimator: EstimatorName | None = None,
    pmu: Pmu | None = None,
    seeds: int | Iterable[int] | None = None,
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    record: bool = True,
) -> Estimates:
    """Simulate a contingency while an estimator follows the rotor speeds from PMU reports.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    contingency : Contingency, event, str, or list of them, optional
        The disturbance, as in `simulate`. By default there is none.
    until : str or float, optional
        End of the simulation: "10s", or seconds; by default 5 s after the last event.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    control : control law, Controller, list of them, or EstimatorControl, optional
        The control law of the storage devices, with estimated speeds, `BangBang()` by default, and controllers. An
        `EstimatorControl` has its own estimator and PMUs; then give neither here.
    estimator : {"ideal", "frequency", "kinematic", "kalman"}, optional
        How the speeds are estimated; "kalman" by default.
    pmu : Pmu, optional
        Rate, noise, latency and losses of the PMUs.
    seeds : int or iterable of int, optional
        Seeds of noise and losses; each gives a simulation of its own. By default that of the `EstimatorControl`, or 1.
    step, criterion
        As in `simulate`.
    record : bool
        Keep the trajectories; without them only their outcomes are known.

    Returns
    -------
    Estimates

    Raises
    ------
    StudyError
        For invalid arguments, and if the simulation ends before its last event.

    Examples
    --------
    >>> base = st.load("two_area").classical().initialize(storage="50MW")
    >>> print(base.estimate(st.Contingency("7", clear="8cyc", trip="7-8"), "3s", seeds=[1, 2]))
    two_area, kalman estimator: 180 frames at 60 per second, 2 seeds
    """
    point = operating_point(base, storage)
    hz = point.case.frequency_hz
    end = None if until is None else seconds(until, hz)
    events = timed_events(point.case, contingency, end)
    last = max((event.at for event in events), default=0.0)
    chosen = _control(control, estimator, pmu)
    given = chosen.seed if seeds is None else seeds
    seeds = tuple(given) if isinstance(given, Iterable) else (given,)
    if len(set(seeds)) < len(seeds):
        raise StudyError(f"seeds = {shown(given)} has a number twice; give each once.")
    if not seeds or not all(isinstance(seed, Integral) and seed >= 0 for seed in seeds):
        raise StudyError(f"seeds = {shown(given)} is not allowed; give one or more whole numbers of at least 0.")
    h = None if step is None else seconds(step, hz)
    rules = checked(criterion, hz)
    system = setup(point, chosen, step=h, criterion=rules)
    simulations = [Simulation(system, events, record=record) for _ in seeds]
    loop = EstimatorLoop(chosen, simulations, seeds)
    called = [one for s in simulations for one in s.frames]
    carry(simulations, [(chosen.rate, loop), *called], [last + OBSERVE if end is None else end])
    return replace(loop.estimates(), runs=tuple(s.finish() for s in simulations), cleared_s=last)


def _control(control: Any, estimator: EstimatorName | None, pmu: Pmu | None) -> EstimatorControl:
    """The control with its estimator."""
    if isinstance(control, type):
        raise StudyError(f"control = {control.__name__} is a class; give an instance, {control.__name__}().")
    named = ("estimator", estimator), ("pmu", pmu)
    given: dict[str, Any] = {name: value for name, value in named if value is not None}
    if not isinstance(control, EstimatorControl):
        return EstimatorControl(BangBang() if control is None else control, **given)
    if given:
        raise StudyError(f"EstimatorControl has its own {' and '.join(given)}; give it there: EstimatorControl(...).")
    return control

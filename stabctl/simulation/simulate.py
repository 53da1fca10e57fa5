"""The simulation of a contingency, from a case or an operating point, in one call."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import seconds
from stabctl.dynamics.operating_point import Fleet, OperatingPoint, operating_point
from stabctl.model.case import Case

from .contingency import Disturbance
from .control import Control, acting, idle
from .criterion import DEFAULT, Criterion, checked
from .simulation import run
from .trajectory import Trajectory


def simulate(
    base: Case | OperatingPoint,
    contingency: "Disturbance | None" = None,
    until: str | float = "10s",
    *,
    storage: "Fleet | None" = None,
    control: Control = None,
    step: str | float | None = None,
    criterion: Criterion = DEFAULT,
    record: bool = True,
    every: str | float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate the response of a system to a contingency.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system; a case is initialized first.
    contingency : Contingency, event, str, or list of them, optional
        The disturbance. A text is an event: "7-8@1s" (a line opens), "14@2s" (a machine trips), "7:+50MW@1s" (a load
        changes). By default there is none.
    until : str or float
        End of the run: "10s", or seconds.
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own: "50MW" at every machine, "14=50MW,13=20MW", {14: "50MW"}, rows.
    control : control law, Controller, or list of them, optional
        A law of the storage devices, `BangBang()` or `Feedback(...)`, and controllers of anything; without a law or
        controller storage devices stay idle, and the run says so when it is printed.
    step : str or float, optional
        Time step: "2ms", or seconds; by default 1/120 s, or what the fastest eigenvalue allows.
    criterion : Criterion
        When the run counts as lost and ends.
    record : bool
        Keep the trajectory; without it only the outcome is known.
    every : str or float
        Least time between two rows of the trajectory: "50ms", or seconds; by default every step is a row. There is
        also a row after every event, and a last one.
    progress : callable, optional
        Called with the simulated time (s) at intervals.

    Returns
    -------
    Trajectory

    Raises
    ------
    StudyError
        If the case lacks something named, or an argument is invalid.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Contingency("7-8@0.4", clear="150ms"), until="5s")
    >>> print(run.outcome)
    All machines stayed in synchronism until 5.000 s; frequency 59.97 (machine 3) to 60.31 Hz (machine 2), ...
    """
    point = operating_point(base, storage)
    law = checked_control(control, point.case)
    hz = point.case.frequency_hz
    h = None if step is None else seconds(step, hz)
    end = seconds(until, hz)
    rules, apart = checked(criterion, hz), seconds(every, hz)
    if not 0 <= apart < float("inf"):
        raise StudyError(f"every = {apart:g} s is not allowed; it must be at least 0.")
    if not isinstance(record, bool):
        raise StudyError(f"record = {shown(record)} is not allowed; give True or False.")
    options: Any = {"step": h, "criterion": rules, "record": record, "every": apart, "progress": progress}
    return replace(run(point, contingency, end, law, **options), idle=idle(point.case, law))


def checked_control(control: Any, case: Case) -> Control:
    """The control of a study, checked; laws need storage devices to control."""
    acting(control, bool(case.storage))
    return control

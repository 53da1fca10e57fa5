"""One machine of a case and the center of inertia of the others: equal areas and phase plane of a bolted fault."""

import math
from contextlib import suppress
from typing import Any

import numpy as np

from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.theory.equal_area import critical_clearing
from stabctl.theory.from_case import equivalent
from stabctl.theory.phase import separatrix
from stabctl.theory.swing_curve import swing_curve
from stabctl.theory.two_machine import Equivalent

LONGEST = 3.0  # s   of the motion in the phase plane


def answer(case: Case, machine: int | None, cycles: float) -> dict[str, Any]:
    """The curves of a fault of so many cycles at the terminal of a machine; without one, of the first that has any."""
    machine, pair = _first(case) if machine is None else (machine, equivalent(case, machine))
    m, edge = pair.omib, separatrix(pair.omib, 121)
    critical = critical_clearing(m)
    curve = swing_curve(m, max(cycles, 1e-6) / m.fb, until=LONGEST + cycles / m.fb)
    near = abs(curve.angle) < 4.0
    try:
        area = pair.equal_area(cycles)
        sizes, marks = str(area), (area.start, area.clearing, area.stop)
    except StudyError as error:
        sizes, marks = str(error), (m.start, m.unstable, m.unstable)
    return {
        "machine": machine,
        "critical": critical.cycles,
        "stable": bool(curve.stable),
        "text": sizes,
        "Pm": m.Pm,
        "Pmax": m.Pmax_post,
        "marks": np.rad2deg(marks).tolist(),
        "unstable": math.degrees(m.unstable),
        "separatrix": _shown(edge.angle, edge.speed),
        "curve": _shown(curve.angle[near], curve.speed[near]),
        "cleared": int((curve.t[near] <= curve.clearing).sum()) - 1,
    }


def _shown(angle: np.ndarray, speed: np.ndarray) -> list[list[float]]:
    """Angles (rad) in degrees, and speed deviations (rad/s) in Hz."""
    return [np.rad2deg(angle).tolist(), (speed / (2 * np.pi)).tolist()]


def _first(case: Case) -> tuple[int, Equivalent]:
    """The first machine with an equivalent, and this; raises `StudyError` as for the first machine if none has one."""
    for m in case.machines:
        with suppress(StudyError):
            return m.machine, equivalent(case, m.machine)
    first = case.machines[0].machine
    return first, equivalent(case, first)

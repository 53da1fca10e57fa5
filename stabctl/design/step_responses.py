"""Step responses: of the closed loop to a load, and of every controller alone."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.controllers.from_control import tustin
from stabctl.dynamics.named import named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.frames import held

SECONDS = 10.0
RATE = 60  # 1/s   of continuous responses
SHARE = 0.01  # of the largest load, that is switched on
INPUTS = 12  # of a controller, up to which its own step is shown


@dataclass(frozen=True, repr=False)
class StepResponses:
    """Step responses.

    Attributes
    ----------
    bus, mw
        Where load is switched on, and how much.
    machines
        Names of the machines.
    before, after
        Times (s) and speed deviations from the COI of the others (times, machines), pu, without and with the
        controllers.
    own
        Name of every controller and its input, times (s), and the outputs (times, outputs) after a unit step of it.
    """

    bus: int
    mw: float
    machines: tuple[str, ...]
    before: tuple[np.ndarray, np.ndarray]
    after: tuple[np.ndarray, np.ndarray]
    own: tuple[tuple[str, np.ndarray, np.ndarray], ...]


def step_responses(point: OperatingPoint, controllers: Sequence[Controller]) -> StepResponses:
    """The step responses of a closed loop and of its controllers."""
    case = point.case
    if not case.loads:
        raise StudyError(f"{case.name} has no load, so there is no load step to show.")
    load = max(case.loads, key=lambda one: one.p)
    mw = SHARE * load.p

    def response(*own: Controller) -> tuple[np.ndarray, np.ndarray]:
        m = closed_loop(point, *own, inputs=f"load_p:{load.bus}", outputs="deviation")
        A, B, T = m.transition()
        if not T:
            T = 1 / RATE
            A, B = held(A, B, T)
        return _step(A, B * mw / case.base_mva, m.C, m.D * mw / case.base_mva, T)

    machines = tuple(str(name) for name in point.rotor_names)
    alone = [one for c in controllers for one in _own(point, c)]
    return StepResponses(load.bus, mw, machines, response(), response(*controllers), tuple(alone))


def _own(point: OperatingPoint, c: Controller) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """The outputs of a controller after a step of each of its inputs, with its delay."""
    names = named(point, c).names
    if len(names) > INPUTS:
        return []
    rate = c.rate or RATE
    A, B, C, D = (c.A, c.B, c.C, c.D) if c.rate else tustin(c.A, c.B, c.C, c.D, rate)
    late = round(c.delay * rate)
    found = []
    for j, name in enumerate(names):
        t, y = _step(A, B[:, [j]], C, D[:, [j]], 1 / rate)
        found.append((f"{c.name}: {name}", t, np.vstack([np.zeros((late, y.shape[1])), y])[: len(t)]))
    return found


def _step(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and outputs of x+ = A x + B, y = C x + D from rest."""
    count = int(SECONDS / T) + 1
    x, y = np.zeros(len(A)), np.empty((count, len(C)))
    for k in range(count):
        y[k] = C @ x + D[:, 0]
        x = A @ x + B[:, 0]
    return T * np.arange(count), y

"""Power-oscillation damper by the residue method.

A feedback u = k H(s) y moves an eigenvalue by k H(s) R for small k, R the residue of the transfer function from u to y.
The compensator H turns H(s) exp(-s delay) R into the negative real axis, so that the gain adds damping alone.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.modes import Modes
from stabctl.units import hertz

from .lead_lag import compensator, time
from .loop import Loop
from .requirement import Requirement
from .result import Design, operating_points
from .tuning import Scenario, common


def pod(
    base: "Case | OperatingPoint | Sequence[OperatingPoint]",
    input: str,
    output: str,
    *,
    damping: float = 0.1,
    mode: str | float | None = None,
    rate: int | None = None,
    delay: str | float = 0.0,
    washout: str | float = 3.0,
    limits: tuple[float, float] | float | None = None,
    storage: "Fleet | None" = None,
    name: str = "pod",
) -> Design:
    """Design a power-oscillation damper from one signal to one input.

    Parameters
    ----------
    base : Case, OperatingPoint, or sequence of OperatingPoint
        The system; of several operating points the first gives the phase, and the gain serves all of them.
    input, output : str
        The signal that is read, such as "deviation:1" or "flow:7-8", and the input that is driven, such as "order:1@5".
    damping : float
        Damping ratio that the mode shall reach; no other mode of 0.1 to 3 Hz may fall below it, or below what it had.
    mode : str or float, Hz, optional
        Frequency of the mode; by default the least damped electromechanical one.
    rate : int, 1/s, optional
        Frames per second; continuous without it.
    delay : str or float, s
        From reading to action.
    washout : str or float, s
        Time constant of the washout.
    limits : pair of float, optional
        Limits of the output, in the unit of the input driven.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    name : str
        Name of the controller.

    Returns
    -------
    Design

    Raises
    ------
    StudyError
        If there is no such signal, or the mode cannot be damped with it.
    """
    points = operating_points(base, storage)
    first = points[0]
    if len(chosen(first.case, input, OUTPUTS)) != 1 or len(chosen(first.case, output, INPUTS)) != 1:
        raise StudyError(f"A damper has one input and one output; give one place each, not {input!r} and {output!r}.")
    modes = closed_loop(first, inputs=output, outputs=input).modes()
    k = _mode(modes, None if mode is None else hertz(mode))
    residue, s = complex(modes.residues()[k]), complex(modes.eigenvalues[k])
    if abs(residue) < 1e-9:
        raise StudyError(
            f"The mode at {modes.frequency_hz[k]:.3f} Hz is not seen in {input}, or not moved by {output}; "
            "choose others."
        )
    hz = float(modes.frequency_hz[k])
    late, Tw = time(delay), time(washout)
    held = late + (0.5 / rate if rate else 0.0)
    phase = np.pi - np.angle(residue) + s.imag * held
    H = compensator(phase, s.imag, Tw)
    bounds: Any = (-np.inf, np.inf) if limits is None else limits
    one = Controller.from_control(H, input, output, rate=rate, delay=late, limits=bounds, name=name)
    unit = abs(s) / abs(residue)  # the gain that moves the eigenvalue by its own size, to first order
    loops = [Loop(point, [one]) for point in points]
    wanted = [Requirement(damping).sparing(loop.eigenvalues([one.scaled(0.0)]), hz) for loop in loops]
    scenarios = [Scenario(loop, 1.0, asked) for loop, asked in zip(loops, wanted, strict=True)]

    def make(gain: np.ndarray) -> list[Controller]:
        return [one.scaled(float(gain[0]))]

    gain, spare = common(scenarios, make, np.array([unit]), np.geomspace(0.01, 3.0, 40))
    return Design.of(points, make(gain), spare >= 0)


def _mode(modes: Modes, hz: float | None) -> int:
    """Index of the mode at a frequency, or of the least damped swing."""
    swings = modes.swings()
    if not swings:
        raise StudyError("The system has no electromechanical mode to damp.")
    if hz is None:
        return min(swings, key=lambda k: modes.damping_ratio[k])
    return min(swings, key=lambda k: abs(modes.frequency_hz[k] - hz))

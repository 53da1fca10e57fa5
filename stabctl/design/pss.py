"""Power system stabilizers by phase compensation.

GEP(s) is the transfer function from the stabilizer input of an exciter to the electrical torque of its machine, with
the rotor of that machine held and all others free. A stabilizer with the opposite phase gives torque in phase with the
speed: damping. Source: E. Larsen, D. Swann, Applying Power System Stabilizers, IEEE Trans. PAS-100, 1981; P. Kundur,
Power System Stability and Control, 1994, section 12.5.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.smallsignal.model import Linear, linearize
from stabctl.units import hertz

from .lead_lag import compensator, time
from .result import Design, operating_points, tuned

BAND = (0.2, 2.0)  # Hz   in which the phase is compensated


def pss(
    base: "Case | OperatingPoint | Sequence[OperatingPoint]",
    machines: Iterable[int] | None = None,
    *,
    damping: float = 0.1,
    washout: str | float = 10.0,
    limits: tuple[float, float] | float = (-0.1, 0.1),
    center: str | float | None = None,
) -> Design:
    """Design stabilizers from the speed of machines to their exciters, with one gain for all.

    Parameters
    ----------
    base : Case, OperatingPoint, or sequence of OperatingPoint
        The system; of several operating points the first gives the phases, and the gain serves all of them.
    machines : iterable of int, optional
        Machines that get a stabilizer; by default all with an exciter and without a stabilizer.
    damping : float
        Damping ratio that all modes of 0.1 to 3 Hz shall reach.
    washout : str or float, s
        Time constant of the washout.
    limits : pair of float, pu
        Limits of the output.
    center : str or float, Hz, optional
        Frequency at which the phase is compensated exactly; by default the middle of 0.2 to 2 Hz.

    Returns
    -------
    Design

    Raises
    ------
    StudyError
        If a machine has no exciter.
    """
    points = operating_points(base)
    first = points[0]
    case = first.case
    numbers = list(machines) if machines is not None else [
        m.machine
        for m in case.machines
        if case.model(m.machine, "exciter") and not case.model(m.machine, "stabilizer")
    ]  # fmt: skip
    if not numbers:
        raise StudyError(f"{case.name} has no machine with an exciter and without a stabilizer; name the machines.")
    hz = float(np.sqrt(BAND[0] * BAND[1])) if center is None else hertz(center)
    model = linearize(first, [f"vs:{n}" for n in numbers], [f"pe:{n}" for n in numbers])
    ones = []
    for i, number in enumerate(numbers):
        response = gep(model, number, i, np.array([hz]))[0]
        H = compensator(-float(np.angle(response)), 2 * np.pi * hz, time(washout))
        ones.append(Controller.from_control(H, f"speed:{number}", f"vs:{number}", limits=limits, name=f"pss {number}"))
    return tuned(points, lambda gain: [c.scaled(gain) for c in ones], damping, np.geomspace(0.5, 100.0, 30))


def gep(model: Linear, machine: int, column: int, hz: np.ndarray) -> np.ndarray:
    """Transfer function GEP (frequencies) from an exciter's input to the torque of its machine, its rotor held.

    Parameters
    ----------
    model : Linear
        Linear model with inputs "vs" and outputs "pe" of the same machines.
    machine : int
        Number of the machine.
    column : int
        Its input and output in the model.
    hz : ndarray
        Frequencies, Hz.
    """
    row = list(model.point.rotor_numbers).index(machine)
    angle = int(model.angles()[row])
    free = np.delete(np.arange(len(model.A)), [angle, angle + 1])
    A, b, c = model.A[np.ix_(free, free)], model.B[free, column], model.C[column, free]
    one = np.eye(len(free))
    return np.array([c @ np.linalg.solve(2j * np.pi * f * one - A, b) + model.D[column, column] for f in hz])

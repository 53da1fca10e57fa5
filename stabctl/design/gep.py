"""GEP(s): from the stabilizer input of an exciter to the electrical torque of its machine, at constant speed.

A stabilizer with the opposite phase gives torque in phase with the speed: damping. Sources: E. Larsen, D. Swann,
Applying Power System Stabilizers, IEEE Trans. PAS-100, 1981; M. Gibbard, D. Vowles, Reconciliation of Methods of
Compensation for PSSs in Multimachine Systems, IEEE Trans. Power Systems 19, 2004 (all rotors held).
"""

from typing import Literal

import numpy as np

from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.smallsignal.model import Linear, Model, linearize

Others = Literal["held", "free"]


def gep(base: "Case | OperatingPoint", machine: int, *, others: Others = "held") -> Model:
    """Transfer function from the stabilizer input of a machine to its electrical torque, its rotor held.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    machine : int
        Number of the machine, which needs an exciter.
    others : {"held", "free"}
        The rotors of the other machines: held too, which is smooth over the frequency and the basis of `pss`, or free
        to swing, which shows the resonances of the other machines.

    Returns
    -------
    Model
        One input (pu) and one output (pu on the machine's base); `response(hz)`, `plot()` and `to_control()`.

    Raises
    ------
    StudyError
        If there is no such machine, or it has no exciter.
    """
    if others not in ("held", "free"):
        raise StudyError(f"others = {shown(others)} is not allowed; choose 'held' or 'free'.")
    model = linearize(operating_point(base), f"vs:{machine}", f"pe:{machine}")
    return held(model, machine, 0, others)


def held(model: Linear, machine: int, column: int, others: Others) -> Model:
    """The part of a linear model with inputs "vs" and outputs "pe" in which the rotor of a machine is held."""
    angles = model.angles()[~model.point.rotors.virtual]
    if others == "free":
        angles = model.angles()[[model.point.rotor_numbers.index(machine)]]
    free = np.delete(np.arange(len(model.A)), np.r_[angles, angles + 1])
    labels = (model.inputs[column],), (model.outputs[column],)
    return Model(
        f"GEP of machine {machine} of {model.name}",
        model.A[np.ix_(free, free)],
        model.B[free][:, [column]],
        model.C[[column]][:, free],
        model.D[[column]][:, [column]],
        tuple(model.states[k] for k in free),
        *labels,
    )

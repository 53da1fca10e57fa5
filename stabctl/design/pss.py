"""Power system stabilizers: tuned together from the operating points given, and GEP(s), the phase that they lead.

GEP(s) leads from the stabilizer input of an exciter to the electrical torque of its machine, at constant speed. A
stabilizer with the opposite phase gives torque in phase with the speed: damping. Sources: E. Larsen, D. Swann, Applying
Power System Stabilizers, IEEE Trans. PAS-100, 1981; M. Gibbard, D. Vowles, Reconciliation of Methods of Compensation
for PSSs in Multimachine Systems, IEEE Trans. Power Systems 19, 2004 (all rotors held).
"""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl.controllers.timing import duration
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model.case import Case
from stabctl.smallsignal.model import Linear, Model, linearize

from .outages import Outages
from .tuning.devices import stabilizers
from .tuning.result import Tuned
from .tuning.tune import tune

Others = Literal["held", "free"]


def pss(
    base: "Case | OperatingPoint | Outages | Sequence[OperatingPoint]",
    machines: Iterable[int | str] | None = None,
    *,
    damping: float | None = None,
    stages: int = 2,
    gain: float = 20.0,
    fast: float = 200.0,
    washout: str | float = 10.0,
    noise_filter: str | float = 0.02,
    limits: tuple[float, float] | float = 0.1,
    sensitivity: float | None = 2.0,
    starts: int = 5,
    seed: int = 0,
) -> Tuned:
    """Tune stabilizers from the speed of machines to their exciters, in place of those of the case.

    This is `tune` with stabilizers at the operating points given, and without other gains or load levels.

    Parameters
    ----------
    base : Case, OperatingPoint, Outages, or sequence of OperatingPoint
        The system; several operating points are all served.
    machines : iterable of int or str, optional
        Machines that get a stabilizer; by default all with an exciter.
    damping : float, optional
        Damping ratio that every mode above 0.1 Hz shall reach; then the gains are lowered. Without it, as much damping
        as possible.
    stages : int
        Number of lead-lag stages.
    gain, fast : float, pu
        Largest gain K, and largest K T1/T2 T3/T4, pu of exciter voltage per pu of speed.
    washout : str or float, s
        Time constant of the washout.
    noise_filter : str or float, s
        Time constant of the lag 1/(1+sTf) that filters the speed; 0: none.
    limits : pair of float, pu
        Limits of the output.
    sensitivity : float or None
        Bound of the largest sensitivity |S| of every loop; None: no bound.
    starts, seed : int
        Starts of the search, and their seed.

    Returns
    -------
    Tuned

    Raises
    ------
    StudyError
        If a machine has no exciter, or an argument is invalid.

    Examples
    --------
    >>> found = st.design.pss(st.load("two_area_thyristor"), [1, 3], damping=0.1, starts=1)
    >>> found.reached, len(found.controllers)
    (True, 2)
    """
    Tw = duration("washout", washout)
    if not Tw:
        raise StudyError(f"washout = {shown(washout)} is not allowed; give a time above 0 s.")
    shape: dict[str, Any] = {"stages": stages, "gain": gain, "fast": fast, "washout": (Tw, Tw), "limits": limits}
    own = stabilizers(machines, noise_filter=noise_filter, **shape)
    more: dict[str, Any] = {"sensitivity": sensitivity, "starts": starts, "seed": seed}
    return tune(base, own, damping=damping, outages="none", levels=(1.0,), gains=(), **more)


def gep(base: "Case | OperatingPoint", machine: int | str, *, others: Others = "held") -> Model:
    """Transfer function from the stabilizer input of a machine to its electrical torque, its rotor held.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    machine : int or str
        Number or name of the machine, which needs an exciter.
    others : {"held", "free"}
        The rotors of the other machines: held too, which is smooth over the frequency and shows the phase that a
        stabilizer leads, or free to swing, which shows the resonances of the other machines.

    Returns
    -------
    Model
        One input (pu) and one output (pu on the machine's base); `response(hz)`, `plot()` and `to_control()`.

    Raises
    ------
    StudyError
        If there is no such machine, or it has no exciter.

    Examples
    --------
    >>> model = st.design.gep(st.load("two_area"), 1)
    >>> abs(model.response([0.5, 1.0])).ravel().round(2)
    array([2.27, 2.35])
    """
    if others not in ("held", "free"):
        raise StudyError(f"others = {shown(others)} is not allowed; choose 'held' or 'free'.")
    point = operating_point(base)
    machine = point.case.machine(machine).machine
    model = linearize(point, f"vs:{machine}", f"pe:{machine}")
    return held(model, machine, 0, others)


def held(model: Linear, machine: int, column: int, others: Others) -> Model:
    """The part of a linear model with inputs "vs" and outputs "pe" in which the rotor of a machine is held."""
    angles = model.angles()[~model.point.rotors.virtual]
    if others == "free":
        angles = model.angles()[[model.point.rotor_numbers.index(machine)]]
    free = np.delete(np.arange(len(model.A)), np.r_[angles, angles + 1])
    labels = (model.inputs[column],), (model.outputs[column],)
    return Model(
        f"GEP of machine {model.point.case.called[machine]} of {model.name}",
        model.A[np.ix_(free, free)],
        model.B[free][:, [column]],
        model.C[[column]][:, free],
        model.D[[column]][:, [column]],
        tuple(model.states[k] for k in free),
        *labels,
    )

"""Power system stabilizers by phase compensation: washout and lead-lag stages against the phase of GEP(s).

GEP(s) leads from the stabilizer input of an exciter to the electrical torque of its machine, at constant speed. A
stabilizer with the opposite phase gives torque in phase with the speed: damping. Sources: E. Larsen, D. Swann, Applying
Power System Stabilizers, IEEE Trans. PAS-100, 1981; M. Gibbard, D. Vowles, Reconciliation of Methods of Compensation
for PSSs in Multimachine Systems, IEEE Trans. Power Systems 19, 2004 (all rotors held).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl.controllers.controller import Controller
from stabctl.controllers.timing import duration
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model.case import Case
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.model import Linear, Model, linearize

from ._phase_compensation import fitted
from ._tuning import Loop, Scenario, common, separate, worst
from .outages import Outages
from .result import Design, Requirement, largest_gain, operating_points
from .tuning.devices import with_exciter, without_stabilizers

BAND = (0.2, 2.5)  # Hz   in which the phase is compensated
BOUND = 0.99  # of the largest gain allowed, from which it decides
POINTS = 25  # frequencies in the band
GAINS = np.geomspace(0.01, 1.0, 34)  # common gains that are tried, of the largest one allowed
LARGEST, MAX_GAIN = 1e6, 200.0  # pu of exciter voltage per pu of speed, at any frequency
Others = Literal["held", "free"]


def pss(
    base: "Case | OperatingPoint | Outages | Sequence[OperatingPoint]",
    machines: Iterable[int] | None = None,
    *,
    damping: float = 0.1,
    washout: str | float = 10.0,
    limits: tuple[float, float] | float = (-0.1, 0.1),
    band: tuple[float, float] = BAND,
    noise_filter: str | float = 0.02,
    max_gain: float = MAX_GAIN,
    others: Others = "held",
) -> Design:
    """Design stabilizers from the speed of machines to their exciters.

    One gain for all machines is raised until every mode reaches the damping at every operating point. If none does,
    every machine gets a gain of its own. The linear design knows no clearing times, which may become shorter, also than
    with the stabilizers of the case; `st.design.evidence` compares them.

    Parameters
    ----------
    base : Case, OperatingPoint, Outages, or sequence of OperatingPoint
        The system; of several operating points the first gives the phases, and the gains serve all of them.
    machines : iterable of int, optional
        Machines that get a stabilizer; by default all with an exciter. The stabilizers that they have are taken out.
    damping : float
        Damping ratio that all modes of 0.1 to 3 Hz shall reach.
    washout : str or float, s
        Time constant of the washout.
    limits : pair of float, pu
        Limits of the output.
    band : pair of float, Hz
        Frequencies over which the phase is compensated.
    noise_filter : str or float, s
        Time constant of the lag 1/(1+sTf) that filters the speed; 0: none.
    max_gain : float, pu
        Largest gain of a stabilizer at any frequency, pu of exciter voltage per pu of speed.
    others : {"held", "free"}
        The rotors of the other machines in GEP(s); see `gep`.

    Returns
    -------
    Design

    Raises
    ------
    StudyError
        If a machine has no exciter, or an argument is invalid.
    """
    if not 0 < max_gain <= LARGEST:
        raise StudyError(f"max_gain = {shown(max_gain)} is not allowed; give a gain above 0 and up to {LARGEST:g} pu.")
    given = operating_points(base)
    numbers = with_exciter(given[0].case, machines)
    points = [_without_stabilizers(point, numbers) for point in given]
    hz = np.geomspace(*band, POINTS)
    model = linearize(points[0], [f"vs:{n}" for n in numbers], [f"pe:{n}" for n in numbers])
    ones = []
    for i, number in enumerate(numbers):
        phase = np.unwrap(np.angle(held(model, number, i, others).response(hz)[:, 0, 0]))
        H = fitted(hz, -phase, duration("washout", washout), duration("noise_filter", noise_filter))
        ones.append(Controller.from_control(H, f"speed:{number}", f"vs:{number}", limits=limits, name=f"pss {number}"))
    most = max_gain / np.array([largest_gain(c) for c in ones])

    def make(gains: np.ndarray) -> list[Controller]:
        return [c.scaled(float(gain)) for c, gain in zip(ones, gains, strict=True)]

    scenarios = [Scenario(Loop(point, ones), 1.0, Requirement(damping)) for point in points]
    gains, spare = common(scenarios, make, np.ones(len(ones)), GAINS * most.min())
    if spare < 0 and len(ones) > 1:
        scale = np.full(len(ones), max(gains.max(), 1.0))
        gains, spare = separate(scenarios, make, gains, scale, most=most, positive=True)
    used = [c for c in make(gains) if np.any(c.C) or np.any(c.D)]
    found = Design.of(points, used, short=-spare, needed=worst(scenarios, make, 0 * gains) < 0)
    replaced = () if points[0] is given[0] else tuple(closed_loop(point).modes() for point in given)
    found = replace(found, replaced=replaced)
    return replace(found, remarks=(*found.remarks, *_remarks(found, max_gain)))


def _without_stabilizers(point: OperatingPoint, numbers: Sequence[int]) -> OperatingPoint:
    """The operating point without the stabilizers that some machines have."""
    case = without_stabilizers(point.case, numbers)
    return point if case is point.case else operating_point(case)


def _remarks(found: Design, max_gain: float) -> Iterator[str]:
    """The largest gains, whether their bound decides, and what the stabilizers of the case achieve."""
    largest = max(found.largest_gains.values(), default=0.0)
    if found.controllers:
        least = min(found.largest_gains.values())
        yield f"Their largest gains are {least:.0f} to {largest:.0f} pu; up to {max_gain:g} pu are allowed."
    if not found.reached and largest > BOUND * max_gain:
        yield f"No stabilizers with gains of at most {max_gain:g} pu were found that reach the damping."
    if found.worst_replaced is not None:
        yield (
            f"The stabilizers of the case, which they replace, give {found.worst_replaced:.4f}; compare the clearing "
            "times, too."
        )


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

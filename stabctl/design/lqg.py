"""Linear-quadratic-Gaussian regulator: a sampled controller that reads measurements and estimates the states itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stabctl.controllers.controller import Controller
from stabctl.controllers.law import checked_frames, duration
from stabctl.dynamics.coerce import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signal_kinds import INPUTS, OUTPUTS
from stabctl.dynamics.signals import Signal, chosen
from stabctl.errors import StudyError, shown
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet
from stabctl.smallsignal.closed_loop import closed_loop
from stabctl.smallsignal.reduce import Reduced, balanced
from stabctl.units import megawatts

from .compensator import compensator, response
from .lqr import stable
from .pairs import written
from .quadratic import Weights, driven, quadratic, weighed
from .regulator import Regulator
from .result import least
from .robustness import plant, robustness

NOISE = {"rad": 2e-3, "pu": 2e-3}  # standard deviation of a measurement by its unit
SPEEDS = ("speed", "rest_speed", "coi_speed", "deviation", "bus_frequency")
SPEED_NOISE = 5e-3  # Hz
LIMITED = (
    "The design ignores the limits of the outputs, and the estimator does not know when they act; check the regulator "
    "by simulation."
)
DROPPED = 1e-3  # of the sum of the Hankel singular values that the reduction drops, by default


def lqg(
    base: "Case | OperatingPoint",
    outputs: str | Sequence[str] = "order",
    inputs: str | Sequence[str] = "deviation",
    *,
    rate: int = 60,
    delay: str | float = 0.0,
    speed: str | float = 0.1,
    angle: str | float | None = None,
    effort: float = 1.0,
    disturbance: str | float = "10MW",
    noise: float = 1.0,
    order: int | None = None,
    limits: tuple[float, float] | float | None = None,
    storage: "Fleet | None" = None,
    name: str = "lqg",
) -> Regulator:
    """Design a sampled regulator with its own state estimator, from measurements to some inputs.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    outputs : str or sequence of str
        Inputs of the system that it drives, such as "order".
    inputs : str or sequence of str
        Signals that it reads, such as "deviation", "flow:7-8" or "bus_frequency".
    rate : int, 1/s
        Frames per second.
    delay : str or float, s
        Time from measurement to output, which the estimator knows; a whole number of frames.
    speed, angle, effort
        Weights, as in `lqr`.
    disturbance : str or float, MW
        Random change of the load at every machine within a second (standard deviation).
    noise : float
        Noise of the measurements: 1 is 5 mHz for speeds and frequencies, 2 mrad for angles, 0.002 pu otherwise.
    order : int, optional
        States of the reduced plant; by default 99.9 % of the sum of the Hankel singular values is kept.
    limits : pair of float, optional
        Limits of the outputs. The design ignores them, and the estimator takes every output as given in full, so its
        states are wrong while an output is at a limit; check such a regulator by simulation.
    storage : str, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.
    name : str
        Name of the controller.

    Returns
    -------
    Regulator
        With the margins of the continuous feedback of all states, and of the regulator in the full model.

    Raises
    ------
    StudyError
        If the system cannot be stabilized with these inputs and measurements.
    """
    point = operating_point(base, storage)
    drives, weights = driven(point, outputs), Weights(speed, angle, effort)
    reads = chosen(point.case, inputs, OUTPUTS)
    if not reads:
        raise StudyError(f"{point.case.name} has no signal {inputs!r}; choose other inputs for the regulator.")
    late = duration("delay", delay)
    power = megawatts(disturbance)
    if not 0 < power <= 1e6:
        raise StudyError(f"disturbance = {shown(disturbance)} is not allowed; give more than 0 and at most 1e6 MW.")
    frames = checked_frames(name, rate, late)
    if isinstance(noise, bool) or not isinstance(noise, int | float) or not 1e-6 <= noise <= 1e6:
        raise StudyError(f"noise = {shown(noise)} is not allowed; give a number from 1e-6 to 1e6.")
    if order is not None and (isinstance(order, bool) or not isinstance(order, int) or order < 1):
        raise StudyError(f"order = {shown(order)} is not a number of states; give at least 1.")
    scales = _Scales(effort, power / point.case.base_mva, noise * _noise(point, reads))
    small = _reduced(point, drives, reads, scales, weights, order)
    bounds: Any = (-np.inf, np.inf) if limits is None else limits
    matrices = compensator(small, len(drives), len(reads), rate, frames, name)
    bare = Controller(
        tuple(map(written, reads)), tuple(map(written, drives)), *matrices,
        name=name, rate=rate, delay=late, limits=bounds,
    )  # fmt: skip
    one = replace(bare, B=bare.B / scales.noise, C=effort * bare.C, D=effort * bare.D / scales.noise)
    cost, after = quadratic(point, drives, weights, reads), stable(point, one)
    seen = plant(cost.modes, cost.C, cost.D, rate)
    own = robustness(lambda w: -response(one, w) @ seen(w), least(after)[0], rate / 2)
    said = () if limits is None else (LIMITED,)
    return Regulator.of_cost(cost, one, after, full=cost.robustness(cost.optimal(effort)), own=own, remarks=said)


@dataclass(frozen=True)
class _Scales:
    """Units in which inputs and measurements of the plant are about 1."""

    effort: float
    power: float  # pu
    noise: np.ndarray


def _noise(point: OperatingPoint, reads: Sequence[Signal]) -> np.ndarray:
    hz = point.case.frequency_hz
    return np.array([SPEED_NOISE / hz if s.kind in SPEEDS else NOISE.get(s.unit, 2e-3) for s in reads])


def _reduced(
    point: OperatingPoint,
    drives: Sequence[Signal],
    reads: Sequence[Signal],
    scales: _Scales,
    weights: Weights,
    order: int | None,
) -> Reduced:
    """The plant with scaled inputs [u, load changes] and outputs [y, cost], without the rotation of all angles."""
    loads = chosen(point.case, list(dict.fromkeys(f"storage:{m.storage_bus}" for m in point.case.machines)), INPUTS)
    swings, sizes = weighed(point, weights)
    seen = tuple(dict.fromkeys([*reads, *swings]))
    model = closed_loop(point, inputs=[*drives, *loads], outputs=seen)
    rows = [seen.index(s) for s in (*reads, *swings)]
    ins = np.repeat([scales.effort, scales.power], [len(drives), len(loads)])
    outs = np.r_[scales.noise, sizes][:, None]
    labels = tuple(s.label for s in reads), tuple(f"cost {s.label}" for s in swings)
    scaled = replace(
        model, B=model.B * ins, C=model.C[rows] / outs, D=model.D[rows] * ins / outs, outputs=labels[0] + labels[1]
    )
    modes = replace(model.modes(), linear=scaled)
    loose = int((modes.eigenvalues.real >= 0).sum())
    if order is None:
        hankel = balanced(modes, loose + 1).hankel
        left = hankel.sum() - np.cumsum(hankel)
        order = loose + int(np.argmax(left <= DROPPED * hankel.sum())) + 1
    small = balanced(modes, order)
    return replace(small, A=small.A[1:, 1:], B=small.B[1:], C=small.C[:, 1:], states=small.states[1:])

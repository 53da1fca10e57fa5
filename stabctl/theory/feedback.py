"""The four feedback laws of section 3 on one fault: phase plane (Figure 7), peak angle, speed swing and damping."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from stabctl.errors import StudyError

from .laws import acceleration_size, speed_acceleration
from .omib import OMIB
from .phase import Separatrix, separatrix
from .trajectory import Law, Trajectory, simulate

GREATEST = 10.0  # pu/(rad/s), pu/(rad/s^2)   beyond it the motion is too stiff to follow


class Feedback(NamedTuple):
    """Gains of law (13) or, with `size`, of law (14)."""

    name: str
    Kv: float = 0.0  # pu/(rad/s)
    Ka: float = 0.0  # pu/(rad/s^2)
    size: bool = False  # (14): the size of the acceleration with the sign of the speed


def four(Kv: float = 0.02, Ka: float = -0.004, Ka_size: float = 0.007) -> tuple[Feedback, ...]:
    """The four combinations of section 3 with their gains."""
    return (
        Feedback("acceleration", Ka=Ka),
        Feedback("speed", Kv=Kv),
        Feedback("speed and acceleration", Kv=Kv, Ka=Ka),
        Feedback("size of acceleration, sign of speed", Ka=Ka_size, size=True),
    )


@dataclass(frozen=True)
class Response:
    """What one law makes of the fault."""

    name: str
    stable: bool
    peak_angle: float  # rad
    min_angle: float  # rad
    max_speed: float  # rad/s
    min_speed: float  # rad/s
    damping: float  # damping ratio between the first two peaks of the angle, nan where there are not two
    trajectory: Trajectory

    def __str__(self) -> str:
        angle = f"angle {self.min_angle:.4f} to {self.peak_angle:.4f} rad"
        speed = f"speed {self.min_speed:.4f} to {self.max_speed:.4f} rad/s"
        return f"{self.name}: {'stable' if self.stable else 'lost'}, {angle}, {speed}, damping {self.damping:.3f}"


@dataclass(frozen=True)
class Comparison:
    """Figure 7: the responses to one fault, and the separatrix of the machine without a device."""

    start: float  # rad
    cycles: float
    separatrix: Separatrix
    responses: tuple[Response, ...]

    def __str__(self) -> str:
        return "\n".join(map(str, self.responses))


def law_of(m: OMIB, feedback: Feedback) -> Law:
    """The law as P_C of the machine. Raises StudyError where the gain leaves no single acceleration."""
    name, Kv, Ka, size = feedback
    if not (abs(Kv) <= GREATEST and abs(Ka) <= GREATEST):
        sizes = f"must be numbers of at most {GREATEST:g} in size"
        raise StudyError(f"law '{name}': the gains Kv = {Kv:g} and Ka = {Ka:g} {sizes}")
    if Ka <= -m.M or (size and Ka >= m.M):
        allowed = f"between -{m.M:.6g} and {m.M:.6g}" if size else f"above -{m.M:.6g}"
        raise StudyError(f"law '{name}': Ka = {Ka:g} pu/(rad/s^2) must be {allowed}, the inertia 2H/wb of the machine")
    if size:
        return lambda _speed, side, Pa: acceleration_size(side, Pa, m.M, Ka)
    return lambda speed, _side, Pa: speed_acceleration(speed, Pa, m.M, Kv, Ka)


def respond(m: OMIB, clearing: float, feedback: Feedback, until: float = 5.0) -> Response:
    """Simulate one law, acting from clearing (s) on, to `until` (s). Raises StudyError as `law_of` and `simulate`."""
    run = simulate(m, clearing, law_of(m, feedback), until)
    peaks = [angle for _, angle in run.rests[::2]]
    damping = math.nan
    if run.stable and len(peaks) > 1 and peaks[1] > m.stable:
        decrement = math.log((peaks[0] - m.stable) / (peaks[1] - m.stable))
        damping = decrement / math.hypot(2 * math.pi, decrement)
    swing = (float(x) for x in (run.angle.max(), run.angle.min(), run.speed.max(), run.speed.min()))
    return Response(feedback.name, run.stable, *swing, damping, run)


def compare(m: OMIB, cycles: float = 15, laws: tuple[Feedback, ...] | None = None, until: float = 5.0) -> Comparison:
    """Figure 7: every law (by default the four) on a fault of so many cycles, to `until` (s)."""
    responses = tuple(respond(m, m.seconds(cycles), law, until) for law in laws or four())
    return Comparison(m.start, cycles, separatrix(m), responses)

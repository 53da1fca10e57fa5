"""The feedback laws (13), (14) of section 3 on one fault: phase plane (Figure 7), peak angle, speeds and damping.

The device slows the machine by the power P that it absorbs, and P depends on the acceleration a that it causes:

    M a = Pa - P,   Pa = Pm - Pe,   M = 2H/wb

so each law is solved for P in closed form. A negative acceleration gain acts as negative inertia, M + Ka < M.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from stabctl._util.errors import StudyError
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb

from .omib import OMIB, PowerLaw, SwingCurve, swing_curve
from .phase_plane import Separatrix, separatrix

if TYPE_CHECKING:
    import pandas as pd

LARGEST = 10.0  # pu/(rad/s), pu/(rad/s^2)   larger gains make the equation too stiff to integrate


class FeedbackLaw(NamedTuple):
    """Gains of law (13), or of law (14) with `magnitude`."""

    name: str
    Kv: float = 0.0  # pu/(rad/s)
    Ka: float = 0.0  # pu/(rad/s^2)
    magnitude: bool = False  # (14): the magnitude of the acceleration with the sign of the speed


def paper_laws(Kv: float = 0.02, Ka: float = -0.004, Ka_magnitude: float = 0.007) -> tuple[FeedbackLaw, ...]:
    """The four laws of section 3 with their gains."""
    return (
        FeedbackLaw("acceleration", Ka=Ka),
        FeedbackLaw("speed", Kv=Kv),
        FeedbackLaw("speed and acceleration", Kv=Kv, Ka=Ka),
        FeedbackLaw("size of acceleration, sign of speed", Ka=Ka_magnitude, magnitude=True),
    )


@dataclass(frozen=True)
class FeedbackResponse:
    """The response of the machine to one fault under one law."""

    name: str
    stable: bool
    peak_angle: float  # rad
    min_angle: float  # rad
    max_speed: float  # rad/s
    min_speed: float  # rad/s
    damping: float  # damping ratio from the first two peaks of the angle; NaN if there are fewer
    curve: SwingCurve

    def __str__(self) -> str:
        angle = f"angle {self.min_angle:.4f} to {self.peak_angle:.4f} rad"
        speed = f"speed {self.min_speed:.4f} to {self.max_speed:.4f} rad/s"
        return f"{self.name}: {'stable' if self.stable else 'unstable'}, {angle}, {speed}, damping {self.damping:z.3f}"


@dataclass(frozen=True, repr=False)
class FeedbackComparison(Tabular):
    """Figure 7: the responses to one fault, and the separatrix of the machine without a device."""

    start: float  # rad
    cycles: float
    separatrix: Separatrix
    responses: tuple[FeedbackResponse, ...]

    plot = verb("stabctl.view.figures.one_machine:feedback")

    @property
    def df(self) -> "pd.DataFrame":
        """A row per law."""
        import pandas as pd

        rows = [
            (r.name, r.stable, r.min_angle, r.peak_angle, r.min_speed, r.max_speed, r.damping) for r in self.responses
        ]
        angles, speeds = ["min_angle_rad", "peak_angle_rad"], ["min_speed_rad_s", "max_speed_rad_s"]
        return pd.DataFrame(rows, columns=["law", "stable", *angles, *speeds, "damping_ratio"])

    def __str__(self) -> str:
        return "\n".join(map(str, self.responses))


def speed_acceleration(speed: float, Pa: float, *, M: float, Kv: float, Ka: float) -> float:
    """P = Kv speed + Ka a (13), pu, for M + Ka > 0.

    Parameters
    ----------
    speed : float, rad/s
    Pa : float, pu
        Accelerating power Pm - Pe.
    M : float, s^2/rad
    Kv : float, pu/(rad/s)
    Ka : float, pu/(rad/s^2)
    """
    return Kv * speed + Ka * (Pa - Kv * speed) / (M + Ka)


def acceleration_magnitude(sign: int, Pa: float, *, M: float, Ka: float) -> float:
    """P = Ka |a| sgn(speed) (14), pu, for |Ka| < M, so that a has the sign of Pa; `sign` is that of the speed."""
    same = sign if Pa > 0 else -sign
    return Ka * same * Pa / (M + Ka * same)


def power_law(m: OMIB, law: FeedbackLaw) -> PowerLaw:
    """The law as P_C of the machine. Raises StudyError for gains that leave no unique acceleration."""
    name, Kv, Ka, magnitude = law
    if not (abs(Kv) <= LARGEST and abs(Ka) <= LARGEST):
        raise StudyError(
            f"Law '{name}': the gains Kv = {Kv:g} and Ka = {Ka:g} must be numbers from -{LARGEST:g} to {LARGEST:g}."
        )
    if Ka <= -m.M or (magnitude and Ka >= m.M):
        allowed = f"between -{m.M:.6g} and {m.M:.6g}" if magnitude else f"above -{m.M:.6g}"
        raise StudyError(
            f"Law '{name}': Ka = {Ka:g} pu/(rad/s^2) must be {allowed}; the limit is 2H/wb of the machine."
        )
    if magnitude:
        return lambda _speed, sign, Pa: acceleration_magnitude(sign, Pa, M=m.M, Ka=Ka)
    return lambda speed, _sign, Pa: speed_acceleration(speed, Pa, M=m.M, Kv=Kv, Ka=Ka)


def respond(m: OMIB, clearing: float, law: FeedbackLaw, *, until: float = 5.0) -> FeedbackResponse:
    """Simulate a fault with one law acting from clearing (s) to `until` (s).

    Raises StudyError as `power_law` and `swing_curve` do, and where the speed would grow by more than 1000.
    """
    power = power_law(m, law)
    growth = -law.Kv / (m.M + law.Ka) * until
    if not law.magnitude and growth > 7:
        least = -7 * (m.M + law.Ka) / until
        raise StudyError(f"Law {law.name!r}: with Kv = {law.Kv:g} the speed grows; give at least {least:.3g}.")
    curve = swing_curve(m, clearing, power, until=until)
    peaks = [angle for _, angle in curve.rests[::2]]
    damping = math.nan
    if curve.stable and len(peaks) > 1 and peaks[1] > m.stable:
        decrement = math.log((peaks[0] - m.stable) / (peaks[1] - m.stable))
        damping = decrement / math.hypot(2 * math.pi, decrement)
    high, low = float(curve.angle.max()), float(curve.angle.min())
    fast, slow = float(curve.speed.max()), float(curve.speed.min())
    return FeedbackResponse(law.name, curve.stable, high, low, fast, slow, damping, curve)


def compare(
    m: OMIB, cycles: float = 15, laws: tuple[FeedbackLaw, ...] | None = None, *, until: float = 5.0
) -> FeedbackComparison:
    """Figure 7: every law (by default the four of the paper) on a fault of so many cycles, to `until` (s)."""
    responses = tuple(respond(m, m.seconds(cycles), law, until=until) for law in laws or paper_laws())
    return FeedbackComparison(m.start, cycles, separatrix(m), responses)

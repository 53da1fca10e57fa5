"""PMUs that report wrong phasors: frozen, with a drifting clock, or with a jump or a ramp of the angle.

An error of the clock turns voltage and current alike, so that the power stays right.
"""

from dataclasses import KW_ONLY, dataclass
from math import pi
from typing import Annotated

from annotated_types import Interval

from stabctl._util.guard import guard

TURN = Interval(ge=-pi, le=pi)


@dataclass(frozen=True)
class BadPmu:
    """What is wrong with the PMU of a machine from an instant on. Quantities may be text, as jump="5deg", drift="10us".

    Parameters
    ----------
    machine : int
        Number of the machine.
    at : float, s
        Instant from which it is wrong.
    frozen : bool
        It repeats its last report.
    drift : float, s
        Error of its clock that is added in every second.
    jump : float, rad
        Angle by which its phasors are turned.
    ramp : float, rad
        Angle by which they are turned further in every second, as by a spoofed time signal.
    until : float, s
        Instant from which it is right again.

    Raises
    ------
    StudyError
        For a value out of range.
    """

    machine: int
    at: Annotated[float, "s", "instant from which a PMU is bad", Interval(ge=0, le=1e6)]
    _: KW_ONLY
    frozen: bool = False
    drift: Annotated[float, "s", "error of a clock per second", Interval(ge=-1, le=1)] = 0.0
    jump: Annotated[float, "rad", "jump of the angles of a PMU", TURN] = 0.0
    ramp: Annotated[float, "rad", "turn of the angles of a PMU per second", TURN] = 0.0
    until: Annotated[float, "s", "instant from which a PMU is right again", Interval(ge=0, le=1e6)] = 1e6

    def __post_init__(self) -> None:
        guard(self)

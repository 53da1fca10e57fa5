"""The criterion of stability: when a run counts as lost and ends early. Every study uses the same one."""

from numbers import Real
from typing import NamedTuple

from stabctl.errors import StudyError


class Criterion(NamedTuple):
    """When a run is lost.

    Parameters
    ----------
    max_angle : float, rad
        Change of a rotor angle against the center of inertia of its island at which the machine loses synchronism.
    low_voltage_s : float, s
        A load that long below its voltage threshold, with no fault on, is a voltage collapse; 0 turns this off.
    slowest, fastest : float, pu
        A machine outside this range of speed has run away.
    """

    max_angle: float = 3.5
    low_voltage_s: float = 0.5
    slowest: float = 0.5
    fastest: float = 1.5


DEFAULT = Criterion()


def checked(criterion: object) -> Criterion:
    """The criterion with every value a float. `StudyError` where it is none."""
    if not isinstance(criterion, Criterion):
        raise StudyError(f"{criterion!r} is not a criterion of stability; write Criterion(max_angle=3.5).")
    for name, value in criterion._asdict().items():
        if isinstance(value, bool) or not isinstance(value, Real) or not value >= 0:
            raise StudyError(
                f"The {name} {value!r} of the criterion is not allowed; it must be a number of at least 0."
            )
    if criterion.max_angle == 0:
        raise StudyError("The max_angle 0 of the criterion is not allowed; it must be more than 0.")
    return Criterion(*map(float, criterion))

"""The criterion of stability: when a run counts as lost and ends early. Every study uses the same one."""

from numbers import Real
from typing import NamedTuple

from stabctl.errors import StudyError
from stabctl.units import quantity


class Criterion(NamedTuple):
    """When a run is lost; values are numbers, or text with a unit ("200deg", "500ms").

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
UNITS = "rad", "s", "pu", "pu"  # of its values


def checked(criterion: object) -> Criterion:
    """The criterion with every value a float. `StudyError` if it is not one."""
    if not isinstance(criterion, Criterion):
        raise StudyError(f"{criterion!r} is not a criterion of stability; write Criterion(max_angle=3.5).")
    found = []
    for name, given, unit in zip(criterion._fields, criterion, UNITS, strict=True):
        value = quantity(given, unit) if isinstance(given, str) else given
        number = isinstance(value, Real) and not isinstance(value, bool)
        if not number or not (value > 0 if name == "max_angle" else value >= 0):
            least = "above 0" if name == "max_angle" else "of at least 0"
            raise StudyError(f"The {name} {given!r} of the criterion is not allowed; it must be a number {least}.")
        found.append(float(value))
    return Criterion(*found)

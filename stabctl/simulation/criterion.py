"""The criterion of stability: when a run counts as unstable and ends early, and when its swings count as decaying.

Every study uses the same one.
"""

from numbers import Real
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.units import hertz, quantity
from stabctl._util.words import record
from stabctl.dynamics import family
from stabctl.dynamics.assembly import System

Coi = Literal["all", "machines"]


@record
class Criterion(NamedTuple):
    """When a run counts as unstable. Values are numbers, or text with a unit ("200deg", "57Hz", "500ms").

    Parameters
    ----------
    max_angle : float, rad
        Change of a rotor angle, or of the virtual angle of a converter, relative to the center of inertia of its island
        that counts as loss of synchronism.
    low_voltage_s : float, s
        Time that a load or a terminal of an HVDC link may stay below its voltage threshold, with no fault on, before it
        counts as voltage collapse; 0 turns this check off. Loads of constant admittance alone are not watched.
    slowest, fastest : float, pu
        A machine or grid-forming converter outside this speed range has run away.
    min_frequency, max_frequency : float, pu
        Allowed frequency of an island (the speed of its center of inertia): 57 to 62 Hz in a 60 Hz system.
    frequency_delay_s : float, s
        Time that an island may stay outside this range without interruption before it counts as frequency instability;
        0 turns this check off.
    decay : float
        Ratio of the swings of a rotor in the last 2.5 s to those in the 2.5 s before, below which they decay. A run
        whose swings do not decay is stable to its end only; clearing times and screens then watch it longer, and the
        sentence of the outcome says so if they grow, or last. 0 turns this judgement off.
    coi : "all" or "machines"
        What makes up a center of inertia (COI): the synchronous machines and the virtual rotors of grid-forming
        converters of its island, each weighted with inertia constant times rating, or the machines alone. In an island
        without a machine it is the virtual rotors in both cases, without a converter those of grid-forming storage.

    Notes
    -----
    The equivalent inertia constant of a converter with droop is TPf/(2 mp), from the filter of its power (D'Arco and
    Suul, IEEE Trans. Smart Grid 5, 2014). A phase-locked loop has no weight: it is judged by `max_angle` against the
    COI of its island, as a rotor is. The choice of the COI is part of the criterion: it changes no motion, and laws
    and controllers read the COI of all.

    Outside this range units may trip: the no-trip zones of NERC PRC-024-3, Attachment 1, end between 57.0 and 57.8 Hz
    and at 61.7 or 61.8 Hz (Western and Eastern Interconnection), those of Regulation (EU) 2016/631, Article 13, at 47.5
    and 51.5 Hz. The delay of 1 s excludes swings, and is less than the 2 s after which the limits of NERC PRC-006-5 for
    islands begin to narrow. A decay to 0.7 in 2.5 s is a damping ratio of 4.5 % at 0.5 Hz and of 2.3 % at 1 Hz. In a
    system without any governor or grid-forming converter nothing restores the frequency, so it is checked only if one
    of these three values is not the default.

    Examples
    --------
    >>> case = st.load("two_area")
    >>> case.clearing_time("7-8@0.4", criterion=st.Criterion(max_angle="60deg")).cycles
    20.375
    """

    max_angle: float = 3.5
    low_voltage_s: float = 0.5
    slowest: float = 0.5
    fastest: float = 1.5
    min_frequency: float = 57 / 60
    max_frequency: float = 62 / 60
    frequency_delay_s: float = 1.0
    decay: float = 0.7
    coi: Coi = "all"


DEFAULT = Criterion()
UNITS = "rad", "s", "pu", "pu", "pu", "pu", "s", "1"  # of its numbers


def checked(criterion: object, frequency_hz: float) -> Criterion:
    """The criterion with every value a float, for a system of this frequency. Raises `StudyError` if it is not one."""
    if not isinstance(criterion, Criterion):
        raise StudyError(f"{criterion!r} is not a stability criterion; write Criterion(max_angle=3.5).")
    found: dict[str, Any] = {}
    for name, given, unit in zip(criterion._fields[:-1], criterion[:-1], UNITS, strict=True):
        value = _value(given, unit, frequency_hz) if isinstance(given, str) else given
        number = isinstance(value, Real) and not isinstance(value, bool)
        if not number or not (value > 0 if name == "max_angle" else value >= 0):
            least = "above 0" if name == "max_angle" else "of at least 0"
            raise StudyError(
                f"{name} = {given!r} of the stability criterion is not allowed; it must be a number {least}."
            )
        found[name] = float(value)
    if criterion.coi not in get_args(Coi):
        raise StudyError(
            f"coi = {shown(criterion.coi)} of the stability criterion is not allowed; choose 'all' or 'machines'."
        )
    made = criterion._replace(**found)
    if not made.min_frequency < 1 < made.max_frequency:
        raise StudyError(
            f"The frequency range {frequency_range(made, frequency_hz)} is not allowed; it must include the rated "
            f"{frequency_hz:g} Hz."
        )
    if not made.slowest < 1 < made.fastest:
        raise StudyError(
            f"The speed range {made.slowest:g} to {made.fastest:g} pu is not allowed; it must include the rated 1 pu."
        )
    return made


def with_frequency(criterion: Criterion, system: System) -> np.ndarray:
    """Whether the frequency of the island of every rotor is judged (rotor units).

    One that nothing governs is judged only if limits or delay were changed.
    """
    rotors, island = system.rotors, system.island[system.unit_bus]
    governors = [f.w[:, family.UNIT] for f in system.families if f.device.role == "governor"]
    governed = island[np.concatenate([rotors.unit[rotors.virtual], *governors])]
    return np.isin(island[rotors.unit], governed) | (criterion[4:7] != DEFAULT[4:7])


def numbers(criterion: Criterion) -> Any:
    """The criterion for compiled code, which knows the weights of the center of inertia: every field a float."""
    values: dict[str, Any] = dict(zip(criterion._fields, [*map(float, criterion[:-1]), 0.0], strict=True))
    return criterion._replace(**values)


def frequency_range(criterion: Criterion, frequency_hz: float) -> str:
    """The frequency range in words: `57 to 62 Hz`."""
    return f"{criterion.min_frequency * frequency_hz:.4g} to {criterion.max_frequency * frequency_hz:.4g} Hz"


def _value(text: str, unit: str, frequency_hz: float) -> float:
    """A quantity in its unit; a frequency in Hz as a speed in pu."""
    return hertz(text) / frequency_hz if unit == "pu" and text.strip().lower().endswith("hz") else quantity(text, unit)

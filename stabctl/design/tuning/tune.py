"""Tuning of every controller at once, over every network that may occur."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from stabctl._util import process
from stabctl._util.errors import StudyError, shown
from stabctl._util.units import quantity
from stabctl._util.validation import checks_arguments
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.jobs.runner import Runner
from stabctl.model.case import Case
from stabctl.simulation.contingency import Contingency

from ..outages import Outages
from .case_values import Device
from .devices import stabilizers
from .networks import networks
from .parts import Asked, Parts
from .problem import Peak
from .result import Tuned
from .rounds import TUNING, Rounds

MOST_STARTS = 100


@checks_arguments
def tune(
    bases: "Case | OperatingPoint | Outages | Sequence[OperatingPoint]",
    devices: "Device | Iterable[Device] | None" = None,
    *,
    damping: str | float | None = None,
    outages: Literal["all", "none"] = "all",
    levels: Iterable[float] = (0.8, 1.0),
    contingencies: Iterable[Contingency | str] = (),
    gains: Iterable[float] = (0.7, 1.3),
    doubled: float | None = 0.0,
    sensitivity: float | None = 2.0,
    disk_margin: float | None = None,
    together: bool = False,
    one_out: bool = False,
    reserve: float | None = None,
    check_levels: Iterable[float] = (0.9,),
    checks: int = 3,
    starts: int = 5,
    seed: int = 0,
    store: str | Path | None = None,
    workers: int | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Tuned:
    """Tune all parameters of stabilizers, dampers and other controllers at once, over many networks.

    The worst damping ratio of all networks is raised: of every mode above 0.1 Hz, those of exciters and controllers
    included. Once the damping wanted is reached, the gains are lowered: K and the gain at high frequencies of all
    controllers, each relative to its bound, of which the largest counts. Method: sequential quadratic programs with the
    derivatives of eigenvalues and of peaks of sensitivity, in a trust region, from several starts; every network is
    looked at before the end. Local optima may remain.

    Parameters
    ----------
    bases : Case, OperatingPoint, Outages, or sequence of OperatingPoint
        The system, or several, such as other dispatches.
    devices : device or iterable of devices, optional
        What is tuned: `stabilizers`, `damper`, `pi`, `values`; by default stabilizers of all machines with an exciter.
    damping : str or float, optional
        Damping ratio wanted; without it, as much as possible.
    outages : {"all", "none"}
        Whether every N-1 branch outage of each base is a network, too.
    levels : iterable of float
        Load levels of each base, as in `with_load_level`; of `Outages` too.
    contingencies : iterable of Contingency or str
        Contingencies whose networks at the end are networks, too: with all circuits open that they open. Those that
        open none, or trip a machine or change a load, are left out.
    gains : iterable of float
        Factors of all gains with which the damping counts, too.
    doubled : float or None
        Damping ratio that must remain with doubled gains; None: not asked.
    sensitivity : float or None
        Bound of the largest sensitivity |S| of every loop, opened at its output with all others closed: 2 leaves a gain
        margin of at least 6 dB and a phase margin of 29 deg. None: no bound.
    disk_margin : float, optional
        Least disk margin of every loop: gain and phase change together. 0.8 bounds |S - 1/2| by 1.25.
    together : bool
        Bound the sensitivity and the disk margin of all loops together, not only of each.
    one_out : bool
        Count the damping with each controller out of service, in the networks without outage.
    reserve : float, optional
        Share of the limits of every controller that three standard deviations of its noise, given with the device, must
        leave. The loop may amplify the noise by as much as its sensitivity.
    check_levels : iterable of float
        Load levels at which the result is checked, with the same outages, without being tuned for.
    checks : int
        Most critical line faults whose clearing times are compared, of a screen of the case as it is; 0: none.
    starts : int
        Starts of the search, in pairs with and without estimated curvature; the first pair is plain, others are random.
    seed : int
        Seed of the starts.
    store : str or Path, optional
        Folder in which every round of the search is kept: an interrupted tuning goes on from there.
    workers : int, optional
        Threads; by default one per core. They do not change the result.
    progress : callable, optional
        Called with a text and the share done.

    Returns
    -------
    Tuned

    Raises
    ------
    StudyError
        If there is nothing to tune, an argument is invalid, or limits contradict each other.

    Examples
    --------
    >>> options = {"outages": "none", "levels": [1.0], "check_levels": [], "checks": 0, "starts": 1}
    >>> some = st.design.stabilizers([1, 3], stages=1, gain=10, fast=100)
    >>> found = st.design.tune(st.load("two_area_thyristor"), some, damping=0.1, **options)
    >>> found.reached
    True
    """
    asked = _asked(damping, gains, doubled, sensitivity, disk_margin, together, one_out, reserve)
    if isinstance(starts, bool) or not isinstance(starts, int) or not 1 <= starts <= MOST_STARTS:
        raise StudyError(f"starts = {shown(starts)} is not allowed; give 1 to {MOST_STARTS}.")
    given = [devices] if isinstance(devices, Device) else [stabilizers()] if devices is None else devices
    given = list(given) if isinstance(given, Iterable) else [given]
    for one in given:
        if not isinstance(one, Device):
            raise StudyError(
                f"{shown(one)} cannot be tuned; give st.design.stabilizers(), damper(...), pi(...) or values(...)."
            )
    if isinstance(checks, bool) or not isinstance(checks, int) or checks < 0:
        raise StudyError(f"checks = {shown(checks)} is not allowed; give a number of clearing times, or 0.")
    levels = tuple(levels)
    tell = progress or (lambda text, share: None)
    with process.one_thread():
        tell("networks", 0.0)
        every, left_out = networks(bases, given, outages, levels, contingencies)
        parts, unmoved = Parts.of(every, given).movable(asked.damping)
        with Runner(TUNING, store=store, workers=workers) as runner:
            best = Rounds(runner, parts, asked, given, tell).best(starts, seed)
        tell("evidence", 1.0)
        other = [networks(bases, given, outages, [level], ()) for level in check_levels if level not in levels]
        left_out += [*unmoved, *(pair for found, out in other if not found for pair in out)]
        elsewhere = [Parts.of(found, given) for found, _ in other if found]
        more: dict[str, Any] = {"elsewhere": elsewhere, "checks": checks, "seed": seed}
        return Tuned.found(parts, asked, best, left_out=tuple(left_out), **more)


def _asked(
    damping: Any,
    gains: Any,
    doubled: Any,
    sensitivity: Any,
    disk_margin: Any,
    together: bool,
    one_out: bool,
    reserve: Any,
) -> Asked:
    def number(name: str, value: Any, low: float, high: float) -> float:
        found = quantity(value, "-") if isinstance(value, str) else value
        if isinstance(found, bool) or not isinstance(found, int | float) or not low <= found < high:
            raise StudyError(f"{name} = {shown(value)} is not allowed; give a number from {low:g} to below {high:g}.")
        return float(found)

    def optional(name: str, value: Any, low: float, high: float) -> float | None:
        return None if value is None else number(name, value, low, high)

    factors = tuple(number("a factor in gains", k, 0.01, 100.0) for k in gains)
    largest, disk = optional("sensitivity", sensitivity, 1.01, 1e6), optional("disk_margin", disk_margin, 0.01, 2.0)
    peaks = [Peak(largest, 0.0, together)] if largest else []
    peaks += [Peak(1 / disk, 0.5, together)] if disk else []
    return Asked(
        optional("damping", damping, 0.0, 1.0),
        tuple(k for k in dict.fromkeys(factors) if k != 1),
        optional("doubled", doubled, -1.0, 1.0),
        tuple(peaks),
        one_out,
        optional("reserve", reserve, 0.0, 1.0),
    )

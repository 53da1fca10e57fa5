"""The time step of a run, and the time constant that makes it short."""

import math
import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import StudyError
from stabctl._util.schema import hints
from stabctl.devices.blocks import SHORT
from stabctl.dynamics.family import Family
from stabctl.dynamics.layout import StatePlace
from stabctl.dynamics.operating_point import OperatingPoint, loops

STEP = 1 / 120  # s   default
SHORTEST = 1e-4  # s   default step for a closed loop
LEAST_STEP = 1e-7  # s
FEW = 100  # steps that are always affordable
MOST = 50_000_000  # steps of a run
REACH = 2.5  # largest |step * eigenvalue| that RK4 carries, with a margin (it is unstable beyond 2.785)
FASTER = 1.1  # than all open loops: an eigenvalue that the control makes
NEAR = 3.0  # between the inverse of a time constant and the eigenvalue that it explains


def checked(point: OperatingPoint, step: float | None, loop: float = 0.0, most: float = STEP) -> float:
    """The step given, or the default one, `most` at most (s); `loop` is the fastest eigenvalue of closed loops (1/s).

    A loop that needs a default step of less than `SHORTEST` is not followed (`trusted`).
    Raises `StudyError` if the step is not stable, or far too short.
    """
    fastest, moving = max(_fastest(point), loop), max(point.fastest, loop)
    longest = REACH / fastest if fastest else math.inf  # infinite buses alone do not move
    if step is None:
        shortest = min(SHORTEST, checked(point, None)) if loop else 0.0
        return max(min(most, longest, REACH / moving / 2 if moving else math.inf), shortest)
    if not LEAST_STEP <= step < np.inf:
        raise StudyError(f"The step {step:g} s is not allowed; it must be at least {LEAST_STEP:g} s.")
    if step > longest:
        because = forced_by(point, loop) if longest < STEP else ""
        raise StudyError(
            f"The step {step:.4g} s is too long for {point.case.name}, whose fastest eigenvalue is near "
            f"{fastest:.0f} 1/s{because}; give at most {longest:.3g} s."
        )
    return step


def trusted(step: float, loop: float) -> bool:
    """Whether a step (s) is short enough for the closed loops, whose fastest eigenvalue is `loop` (1/s)."""
    return step * loop <= REACH


def elsewhere(point: OperatingPoint) -> tuple[float, str]:
    """Largest eigenvalue (1/s) that a device may come to away from the start, 0 if there is none, and of what it is.

    The fluxes of a running motor move slowly; those of a stopped one turn at rated frequency against its rotor. The
    controllers that hold a converter at a limit rest within it.
    """
    worst = [(0.0, "")]
    for f in (f for f in point.system.families if f.device.elsewhere is not None):
        rates = f.device.call("elsewhere", f.device.Par(*f.k.T))
        key, motor = f.keys[int(rates.argmax())], f.device.role == "load"
        what = f"the motor of {key}, if it stops" if motor else f"{f.device.name} of {key}, at a limit of its power"
        worst.append((float(rates.max()), what))
    return max(worst)


def _fastest(point: OperatingPoint) -> float:
    """The largest eigenvalue (1/s) at the operating point, or of a device away from it."""
    return max(point.fastest, elsewhere(point)[0])


class Steps(NamedTuple):
    """Consecutive steps."""

    starts: np.ndarray  # s
    sizes: np.ndarray  # s
    due: np.ndarray  # bits of the frame rates due at the start of each; empty without rates


NONE = Steps(np.empty(0), np.empty(0), np.empty(0, np.int64))


def steps(start: float, end: float, step: float, rates: Sequence[int] = (), *, whole: float = 0.0) -> Steps:
    """Steps of at most `step` (s) from start to end that begin at every frame.

    Frame j of a rate is at j / rate. One that falls on the start belongs to this interval, one on the end to the next;
    a frame within 1e-7 s of the start counts as there. Between two frames all steps are equal. If the interval
    goes on to `whole`, which may be infinite, the steps are those of all of it, the last of them cut off at the end.
    """
    if whole == math.inf and not rates:
        number = max(1, math.ceil((end - start) / step - 1e-6))
        starts, sizes = start + step * np.arange(number), np.full(number, step)
        sizes[-1] = end - starts[-1]
        return Steps(starts, sizes, NONE.due)
    due: dict[float, int] = {}
    for bit, rate in enumerate(rates):
        for j in range(math.ceil(start * rate - 1e-6), math.ceil(end * rate - 1e-6)):
            at = start if j / rate < start + 1e-7 else round(j / rate, 12)
            due[at] = due.get(at, 0) | 1 << bit
    marks = sorted({start, *due})
    cut = whole > end
    beyond = min([whole, *(math.ceil(end * rate - 1e-6) / rate for rate in rates)]) if cut else end
    length = np.diff([*marks, beyond])
    count = np.maximum(1, np.ceil(length / step - 1e-6)).astype(int)
    first, sizes = np.cumsum(count) - count, np.repeat(length / count, count)
    starts = np.repeat(marks, count) + sizes * (np.arange(len(sizes)) - np.repeat(first, count))
    bits = np.zeros(len(sizes) if rates else 0, np.int64)
    if rates:
        bits[first] = [due.get(t, 0) for t in marks]
    if cut:
        made = starts < end - 1e-6 * sizes
        starts, sizes, bits = starts[made], sizes[made], bits[made[: len(bits)]]
        sizes[-1] = end - starts[-1]
    return Steps(starts, sizes, bits)


def whole(start: float, end: float, step: float, rates: Sequence[int] = ()) -> float:
    """The last instant (s), not after the end, at which steps from the start on begin however far they go."""
    if not rates:
        return start + step * math.floor((end - start) / step + 1e-6)
    return max(start, *(math.floor(end * rate + 1e-6) / rate for rate in rates))


def affordable(point: OperatingPoint, step: float, length: float, width: float, loop: float = 0.0) -> None:
    """Check the length of a run before it starts.

    Parameters
    ----------
    point
        The operating point, for the message.
    step, length
        Time step and length of the run, s.
    width
        Signals recorded per step; 0 records nothing.
    loop
        The fastest eigenvalue of closed loops, 1/s.

    Raises
    ------
    StudyError
        If there are too many steps, or the record would fill the memory.
    """
    count = length / step
    if count < FEW:
        return
    if not count <= MOST:
        because = forced_by(point, loop) if step == checked(point, None, loop) < STEP else ""
        raise StudyError(
            f"A run of {length:g} s takes {count:.2g} steps{because}, more than the {MOST:g} allowed; choose a longer "
            "step or a shorter run."
        )
    size, most = count * width * 8, memory() / 2
    if size > most:
        raise StudyError(
            f"The record of a run of {length:g} s takes {size / 1e9:.3g} GB, more than half of the memory "
            f"({most / 1e9:.3g} GB); keep fewer rows (every, --every 50ms), choose a shorter run, or record nothing."
        )


def memory() -> float:
    """Physical memory, bytes; infinite where the system does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def forced_by(point: OperatingPoint, loop: float = 0.0) -> str:
    """The cause of a short step in brackets, empty if none is known."""
    return f" ({text})" if (text := cause(point, loop)) else ""


def cause(point: OperatingPoint, loop: float = 0.0) -> str:
    """What makes the fastest eigenvalue, or empty.

    A motor that may stop, `T2d = 1e-05 s of genrou, machine 3 at bus 3`, a controller, or without such a time constant
    the control loop or state that takes part most: `PLL of REGC_C 5`, `Ed REGC_C 5`.
    """
    rate, what = elsewhere(point)
    if loop > FASTER * max(rate, point.fastest):
        return "that of the loop closed by the control; reduce its gain"
    if rate > 2 * point.fastest:
        return f"that of {what}"
    for f in point.system.families:
        if f.device.fastest is not None and point.fastest < NEAR * f.device.fastest(f.k[0]):
            return f"that of controller {f.keys[0]}"
    if point.stiffest < 0:
        return ""
    place = point.layout.states[point.stiffest]
    f = point.system.family(place.table)
    return _time_constant(f, place.row, point.fastest) or _loop(point, place) or place.label


def _time_constant(f: Family, row: int, fastest: float) -> str:
    """The time constant of a device whose inverse is nearest to an eigenvalue (1/s), empty if none is near."""
    best, text = NEAR, ""
    names = f.device.Par._fields
    for name, field in hints(f.device.Par).items():
        value = f.k[row, names.index(name)] if field and field.unit == "s" else 0.0
        if not value > 0:
            continue
        off = max(value * fastest, 1 / (value * fastest))
        if off < best:
            bypass = "" if f.device.role == "machine" else f"; a control lag below {1e3 * SHORT:g} ms is bypassed"
            best, text = off, f"{name} = {value:g} s of {f.name}, {f.keys[row]}{bypass}"
    return text


def _loop(point: OperatingPoint, place: StatePlace) -> str:
    """The control loop of a converter that a state belongs to, empty if it belongs to none."""
    name = loops(point, place.table, place.unit).get(place.name)
    called = point.case.machines[place.unit].called if place.unit >= 0 else ""
    return f"{name} of {point.system.family(place.table).device.name} {called}" if name else ""

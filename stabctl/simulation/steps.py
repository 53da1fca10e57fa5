"""The time step of a run, and the time constant that makes it short."""

import math
import os

import numpy as np

from stabctl.devices.blocks import SHORT
from stabctl.dynamics import family
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.errors import StudyError
from stabctl.schema import hints

STEP = 1 / 120  # s   default
LEAST_STEP = 1e-7  # s
MOST = 50_000_000  # steps of a run
REACH = 2.5  # largest |step * eigenvalue| that RK4 carries, with a margin (it is unstable beyond 2.785)
NEAR = 3.0  # between the inverse of a time constant and the eigenvalue that it explains


def checked(point: OperatingPoint, step: float | None) -> float:
    """The step given, or the default one (s). `StudyError` if it is not stable, or far too short."""
    longest = REACH / point.fastest if point.fastest else math.inf  # infinite buses alone do not move
    if step is None:
        return min(STEP, longest / 2)
    if not LEAST_STEP <= step < np.inf:
        raise StudyError(f"The step {step:g} s is not allowed; it must be at least {LEAST_STEP:g} s.")
    if step > longest:
        because = forced_by(point) if longest < STEP else ""
        raise StudyError(
            f"The step {step:.4g} s is too long for {point.case.name}, whose fastest eigenvalue is near "
            f"{point.fastest:.0f} 1/s{because}; give at most {longest:.3g} s."
        )
    return step


def affordable(point: OperatingPoint, step: float, length: float, width: int) -> None:
    """Check the length of a run before it starts.

    Parameters
    ----------
    point
        The operating point, for the message.
    step, length
        Time step and length of the run, s.
    width
        Signals recorded at every step; 0 records nothing.

    Raises
    ------
    StudyError
        If there are too many steps, or the record would fill the memory.
    """
    count = length / step
    if not count <= MOST:
        because = forced_by(point) if step < STEP else ""
        raise StudyError(
            f"A run of {length:g} s takes {count:.2g} steps{because}, more than the {MOST:g} allowed; choose a longer "
            "step or a shorter run."
        )
    size, most = count * width * 8, memory() / 2
    if size > most:
        raise StudyError(
            f"The record of a run of {length:g} s takes {size / 1e9:.3g} GB, more than half of the memory "
            f"({most / 1e9:.3g} GB); choose a longer step or a shorter run, or record nothing."
        )


def memory() -> float:
    """Physical memory, bytes; infinite where the system does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def forced_by(point: OperatingPoint) -> str:
    """The cause of a short step in brackets, empty if none is known."""
    return f" ({text})" if (text := cause(point)) else ""


def cause(point: OperatingPoint) -> str:
    """The time constant behind the fastest eigenvalue: `T2d = 1e-05 s of genrou, machine 3 at bus 3`; empty if none."""
    best, text = NEAR, ""
    for f in point.system.families:
        columns = [(name, field) for name, field in hints(f.device.Par).items() if field and field.unit == "s"]
        names = family.fields(f.device, "Par")
        for name, _ in columns:
            values = f.k[:, names.index(name)]
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where(values > 0, 1 / (values * point.fastest), np.inf)
            off = np.maximum(ratio, 1 / ratio)
            row = int(np.argmin(off)) if len(off) else 0
            if len(off) and off[row] < best:
                bypass = "" if f.device.ROLE == "machine" else f"; a control lag below {1e3 * SHORT:g} ms is bypassed"
                best = float(off[row])
                text = f"{name} = {values[row]:g} s of {f.name}, {f.keys[row]}{bypass}"
    return text

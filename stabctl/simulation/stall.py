"""Motor loads that have stalled: beyond the slip of their largest torque, they draw several times their current."""

from typing import NamedTuple

import numpy as np

from stabctl._util.wording import listed, named
from stabctl.dynamics import family
from stabctl.dynamics.operating_point import OperatingPoint


class Stalled(NamedTuple):
    """Stalled motor loads at the end of a run."""

    buses: tuple[int, ...]  # bus numbers
    slip: tuple[float, ...]  # pu

    def __str__(self) -> str:
        """A sentence; empty if there are none."""
        if not self.buses:
            return ""
        low, high = (f"{100 * one:.0f}" for one in (min(self.slip), max(self.slip)))
        slips = f"{low} %" if low == high else f"{low} to {high} %"
        loads, have = ("load", "has") if len(self.buses) == 1 else ("loads", "have")
        where = f"{named(len(self.buses), 'bus')} {listed([str(bus) for bus in self.buses])}"
        return f"The motor {loads} at {where} {have} stalled, with a slip of {slips}."


def stalled(point: OperatingPoint, s: np.ndarray, alive: np.ndarray) -> Stalled:
    """The motor loads that have stalled, at buses with voltage.

    Parameters
    ----------
    point : OperatingPoint
        Its devices.
    s : (signals,) array
        All signals.
    alive : (buses,) array of bool
        Buses with voltage.
    """
    found: list[tuple[int, float]] = []
    for f in point.system.families:
        if f.device.stalled is None:
            continue
        states, n = f.device.State._fields, len(f.device.State._fields)
        x = f.device.State(*s[f.w[:, [family.STATE]] + np.arange(n)].T)
        rows = (f.w[:, family.BUS] - point.layout.nx) // 2
        for j in np.flatnonzero(f.device.stalled(x, f.device.Par(*f.k.T)) & alive[rows]):
            found.append((point.case.buses[rows[j]].bus, float(x[states.index("slip")][j])))
    return Stalled(*zip(*found, strict=True)) if found else Stalled((), ())

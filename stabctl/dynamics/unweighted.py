"""Angles without weight in a center of inertia: phase-locked loops, and the virtual rotors of grid-forming storage."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from . import family
from .tables import Family

NONE = -1


class Angle(NamedTuple):
    """An angle that is judged as that of a rotor."""

    unit: int  # row of the unit, -1 of a storage device
    bus: int  # row of the bus
    place: int  # among the states
    virtual: bool  # that of a virtual rotor, or else of a phase-locked loop
    name: str  # in messages, such as "ESD 1@2"
    frequency: int  # place of the frequency of the phase-locked loop, -1: none
    least: float  # pu   of this frequency
    most: float  # pu


class Unweighted(NamedTuple):
    """All of them, as columns."""

    rows: tuple[Angle, ...]

    def column(self, name: str) -> np.ndarray:
        """The column of this name, of integers."""
        return np.array([getattr(row, name) for row in self.rows], np.int64)


def unweighted(families: Iterable[Family], nx: int) -> Unweighted:
    """The angles of the devices of some families; the voltages begin at nx."""
    return Unweighted(tuple(sorted(row for f in families for row in _angles(f, nx))))


def _angles(f: Family, nx: int) -> Iterator[Angle]:
    storage = f.device.role == "storage"
    name = f.device.pll or ("delta" if storage and f.device.source else None)
    if name is None:
        return
    states, outputs, constants = (f.device.fields(record) for record in ("State", "Output", "Par"))
    for w, k, key in zip(f.w, f.k, f.keys, strict=True):
        p = dict(zip(constants, k, strict=True))
        frequency = int(w[-1]) + outputs.index("wpll") if "wpll" in outputs else NONE
        range_ = (1 + p[limit] / p["wb"] if limit in p else inf for limit, inf in (("wmin", -np.inf), ("wmax", np.inf)))
        unit = NONE if storage else int(w[family.UNIT])
        if not storage or p["mva"] > 0:
            bus, place = (int(w[family.BUS]) - nx) // 2, int(w[family.STATE]) + states.index(name)
            yield Angle(unit, bus, place, not f.device.pll, key, frequency, *range_)

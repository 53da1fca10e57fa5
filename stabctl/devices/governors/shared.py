"""Inputs and output of every governor, and the curve from gate opening to power."""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np

from stabctl.devices.ports import PORT


class Input(NamedTuple):
    """Signals at a governor with a load reference."""

    Pref: Annotated[float, "pu", "load reference", PORT]
    omega: Annotated[float, "pu", "speed"]


class Metered(NamedTuple):
    """Signals at a governor with a load reference that measures the electrical power."""

    Pref: Annotated[float, "pu", "load reference", PORT]
    omega: Annotated[float, "pu", "speed"]
    P: Annotated[float, "pu", "electrical power, machine base"]


class Output(NamedTuple):
    """Signal of a governor."""

    Pm: Annotated[float, "pu", "mechanical power, machine base"]


# The curve from gate opening to power, through (G0, 0), (G1, P1), (G2, P2) and (1, P3).


def ascending(par: Any) -> Iterator[tuple[str, str]]:
    """Field and sentence of the first gate opening or power that does not rise along the curve."""
    rising = (("G1", par.G0), ("G2", par.G1), ("P1", 0.0), ("P2", par.P1), ("P3", par.P2))
    for name, below in rising:
        if getattr(par, name) <= below:
            yield name, f"must be above {below:g}, the point before it"
    if par.G2 >= 1:
        yield "G2", "must be below 1, full gate"


def opening(power, p):
    """Gate opening at a power (pu)."""
    return float(np.interp(power, (0.0, p.P1, p.P2, p.P3), (p.G0, p.G1, p.G2, 1.0)))

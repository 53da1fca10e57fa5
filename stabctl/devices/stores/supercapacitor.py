"""Supercapacitor: its voltage falls with its energy, its series resistance loses power, and its current is limited.

v^2 = Vcmin^2 + (1 - Vcmin^2) energy/capacity       voltage of the capacitance over that of a full one
P = (v + Rs i) i,   d energy/dt = v i               i > 0 charges
take = (v + Rs Icmax) Icmax/k, give = k (v - Rs Icmax) Icmax, both at most 1

`capacity` is the energy between the lowest voltage Vcmin, at which the device is empty, and the full one: 1 - Vcmin^2
of C V^2/2. Currents are in power rating over full voltage, Rs in full voltage squared over power rating.
Valid for seconds to minutes: the capacitance is constant (that of a cell rises with the voltage by a tenth or two), and
neither self-discharge nor the slow redistribution of charge inside a cell is represented.
Source: R. L. Spyker, R. M. Nelms, Classical equivalent circuit parameters for a double-layer capacitor, IEEE Trans.
Aerosp. Electron. Syst. 36 (2000); the first branch of L. Zubieta, R. Bonert, Characterization of double-layer
capacitors for power electronics applications, IEEE Trans. Ind. Appl. 36 (2000).
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_least, at_most

NAME = "SUPERCAP"
FINITE = True


class Par(NamedTuple):
    """Parameters of the store of one device."""

    inverse: Annotated[float, "1/pu", "1 over the power rating, 0 without one", FROM_CASE] = 0.0
    running: Annotated[float, "-", "whether the start is over; before, v is that of the start", FROM_CASE] = 0.0
    Vcmin: Annotated[float, "pu", "lowest voltage, at which it is empty", Interval(gt=0, le=1)] = 0.5
    Rs: Annotated[float, "pu", "series resistance", NOT_NEGATIVE] = 0.02
    Icmax: Annotated[float, "pu", "current limit", POSITIVE] = 2.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if 2 * self.Rs * self.Icmax > self.Vcmin:
            yield "Icmax", f"must be at most Vcmin/(2 Rs) = {self.Vcmin / (2 * self.Rs):.4g}, the current of most power"


def automatic(p):
    """Parameters after the start."""
    return p._replace(running=1.0)


@inline
def voltage(x, p):
    """Voltage of the capacitance (pu of the full one)."""
    low, energy = p.Vcmin * p.Vcmin, x.energy if p.running > 0.5 else p.stored + 0 * x.energy
    return np.sqrt(at_least(low + (1 - low) * energy / p.capacity, 1e-6))


@inline
def current(v, P, p):
    """Current at the power P (pu system over full voltage): the root of Rs i^2 + v i = P that is 0 without power."""
    return 2 * P / (v + np.sqrt(at_least(v * v + 4 * p.Rs * p.inverse * P, 0.0)))


@inline
def most(x, p):
    """Largest power that it takes and gives, over the rating, k^2 the round-trip efficiency of the conversion."""
    v, drop, k = voltage(x, p), p.Rs * p.Icmax, p.efficiency
    return at_most((v + drop) * p.Icmax / k, 1.0), at_most((v - drop) * p.Icmax * k, 1.0)


@inline
def rate(x, P, p):
    """Derivative of its energy (pu)."""
    v = voltage(x, p)
    return v * current(v, P, p)

"""The limits of the steady current of REGFM_B1, through the angle ahead of the phase-locked loop and the voltage.

Idmax = kf ImaxSS, Iqmax = sqrt(ImaxSS^2 - idf^2) with PQFlag = 1;  Idmax = sqrt(ImaxSS^2 - iqf^2), Iqmax = kf ImaxSS
kI (Idmax - idf) -> [1/s], 0..asin(XL ImaxSS) -> dmax;   kI (-Ke Idmax - idf) -> [1/s], -asin(XL ImaxSS)..0 -> dmin
Emax, Emin = sqrt((vm +/- Iqmax XL)^2 + (idf XL)^2)

With ESFlag = 0, dmin is 0: no power is taken in. dmax and dmin are asin(XL ImaxSS) less the states `over` and `under`,
which rest at 0.
Source: see `regfm_b1`.
"""

from typing import Any

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, beyond_rate, magnitude

from .electrical import root


def widest(p: Any) -> Any:
    """Parameters with the largest angles that ImaxSS allows."""
    most = float(np.arcsin(min(p.XL * p.ImaxSS, 1.0)))
    return p._replace(deltamax=most, deltamin=-most if p.ESFlag > 0.5 else 0.0)


@inline
def most(x, p):
    """Limits of the active and the reactive current in steady state (pu)."""
    if p.PQFlag > 0.5:
        return p.kf * p.ImaxSS, root(p.ImaxSS, x.idf)
    return root(p.ImaxSS, x.iqf), p.kf * p.ImaxSS


@inline
def voltage_limits(x, p):
    """Emin and Emax (pu), at which the reactive current is at its limit."""
    _, iq = most(x, p)
    ahead = x.idf * p.XL
    return magnitude(at_least(x.vm - iq * p.XL, 0.0), ahead), magnitude(x.vm + iq * p.XL, ahead)


@inline
def leads(x, p):
    """Least and largest angle (rad) of the internal voltage ahead of the phase-locked loop."""
    return p.deltamin + x.under, p.deltamax - x.over


@inline
def reductions(x, p):
    """State derivatives (rad/s) of the reductions of both angles, while the active current is beyond its limit."""
    idmax, _ = most(x, p)
    taking = p.kI if p.ESFlag > 0.5 else 0.0
    return beyond_rate(p.kI, x.idf - idmax, x.over), beyond_rate(taking, -p.Ke * idmax - x.idf, x.under)

"""Saturation of machines from S10 and S12: the extra excitation over the flux, at 1.0 and 1.2 pu; one of them 0: none.

Quadratic, S(E) = B (E - A)^2 / E, or exponential, S(E) = S10 E^n.
Source: PSS/E Model Library, GENROU and GENROE.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import through


def points(S10, S12):
    """A and B of the quadratic saturation; 0, 0 if there is none."""
    return through(1.0, S10, 1.2, S12) if S10 > 0 else (0.0, 0.0)


def exponent(S10, S12):
    """n and S10 of the exponential saturation; 0, 0 if there is none."""
    return (float(np.log(S12 / S10) / np.log(1.2)), S10) if S10 > 0 and S12 > 0 else (0.0, 0.0)


def mistakes(p: Any) -> Iterator[tuple[str, str]]:
    """Field and sentence if no curve passes through the two points."""
    if 0 < p.S12 <= p.S10:
        yield "S12", f"must be more than S10 = {p.S10:g}, or 0 for no saturation"


@inline
def along(i, S, p):
    """Extra excitation of the d and q axis, S times the flux; the q axis scaled by its air gap."""
    return S * i.psid, S * i.psiq * (p.xq - p.xl) / (p.xd - p.xl)

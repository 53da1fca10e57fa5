"""ESD behind a grid-following converter with a plant controller: REPC_A, then REGC_C with REEC_C.

The equations of both parts are those of `esd_regc_c` and `plant`.
"""

from typing import Any

from stabctl._util.jit import inline

from . import esd_regc_c, joined, plant
from .esd_regc_c import (
    ANGLES,
    CURRENT_LIMIT,
    LIMITS,
    PLL,
    STOPS,
    UPPER,
    Internal,
    Output,
    admittance,
    current,
    internal,
    moved,
    output,
    power,
    prepare,
)
from .plant import DEADBANDS, Input

NAME = "ESD_REGC_C_REPC"
ROLE = "storage"
Par: Any = joined.joined(esd_regc_c.Par, plant.Par)
State: Any = joined.joined(esd_regc_c.State, plant.State)
KIT = plant.kit(esd_regc_c.KIT)
__all__ = [
    "ANGLES", "CURRENT_LIMIT", "DEADBANDS", "LIMITS", "PLL", "STOPS", "UPPER", "Input", "Internal",
    "Output", "admittance", "current", "internal", "output", "prepare",
]  # fmt: skip


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 and wb are filled from the case."""
    return joined.from_row(KIT, Par, device, base_mva, wb=0.0, P0=0.0, running=0.0)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    return State(*esd_regc_c.guess(V, p), *plant.guess(V, p))


@inline
def derivatives(x, i, u, v, y, p):
    """State derivatives (1/s); y is this device's own output."""
    P, Q = power(i, v, y)
    g = plant.rates(x, u, y.vt, P, Q, p)
    d = moved(x, i, u, v, y, plant.references(x, u, y.vt, P, Q, p), p)
    return State(
        d.share, d.energy, d.reactive, d.vm, d.vq, d.iv, d.iqr, d.pord, d.theta_pll, d.xpll, d.ip, d.iq,
        d.vfilt, d.xp, d.xq, d.Ed, d.Eq,
        g.meas, g.xq, g.xf, g.pf, g.xp, g.pg,
    )  # fmt: skip

"""ESD behind a grid-following converter with a plant controller: REPC_A, then REGC_B with REEC_C.

The equations of both parts are those of `esd_regc_b` and `plant`.
"""

from typing import Any

from stabctl._util.jit import inline

from . import esd_regc_b, joined, plant
from .esd_regc import power
from .esd_regc_b import (
    CURRENT_LIMIT,
    LIMITS,
    STOPS,
    UPPER,
    Output,
    admittance,
    current,
    moved,
    output,
    prepare,
)
from .plant import DEADBANDS, Input

NAME = "ESD_REGC_B_REPC"
ROLE = "storage"
Par: Any = joined.joined(esd_regc_b.Par, plant.Par)
State: Any = joined.joined(esd_regc_b.State, plant.State)
KIT = plant.kit(esd_regc_b.KIT)
__all__ = [
    "CURRENT_LIMIT", "DEADBANDS", "LIMITS", "STOPS", "UPPER", "Input", "Output", "admittance", "current",
    "output", "prepare",
]  # fmt: skip


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 is filled from the power flow."""
    return joined.from_row(KIT, Par, device, base_mva, P0=0.0, running=0.0)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    return State(*esd_regc_b.guess(V, p), *plant.guess(V, p))


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this device's own output."""
    P, Q = power(y, p)
    g = plant.rates(x, u, y.vt, P, Q, p)
    d = moved(x, u, y, plant.references(x, u, y.vt, P, Q, p), p)
    return State(
        d.share, d.energy, d.reactive, d.vm, d.vq, d.iv, d.iqr, d.pord, d.ip, d.iq, d.vfilt, d.Ed, d.Eq,
        g.meas, g.xq, g.xf, g.pf, g.xp, g.pg,
    )  # fmt: skip

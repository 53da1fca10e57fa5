"""What the exciters with a DC machine share: regulator, rotating exciter, and the parameters that PSS/E computes.

The regulator has a lead-lag and a lag, the exciter saturation and a stabilizing feedback of its voltage.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import clip, derivative, field_demand, lag, lead_lag, quadratic

from . import shared
from .shared import Output


class State(NamedTuple):
    """Transducer, first stage, regulator, exciter and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]
    efd: Annotated[float, "pu", "field voltage"]
    vf: Annotated[float, "pu", "lagged field voltage of the feedback"]


@inline
def output(x):
    """Field voltage Efd (pu)."""
    return Output(x.efd)


@inline
def rates(x, u, p, scale):
    """State derivatives (1/s); `scale` multiplies the limits of the regulator."""
    vf, d_vf = derivative(p.KF, p.TF, x.efd, x.vf)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    va, d_va = lead_lag(p.TC, p.TB, u.Vref - vm + u.Vs - vf, x.va)
    vr, d_vr = lag(p.TA, p.KA * va, x.vr)
    drive = clip(vr, p.VRmin * scale, p.VRmax * scale)
    d_efd = (drive - field_demand(x.efd, p.KE, p.SA, p.SB)) / p.TE
    return State(vm=d_vm, va=d_va, vr=d_vr, efd=d_efd, vf=d_vf)


def automatic(p: Any, y: Any) -> Any:
    """KE = 0 is computed so that the regulator starts at a tenth of VRmax: KE = VRmax/(10 Efd) - SE(Efd)."""
    if p.KE != 0:
        return p
    return p._replace(KE=(p.VRmax / 10 - quadratic(y.Efd, p.SA, p.SB)) / y.Efd)


def computed(values: dict[str, float]) -> tuple[dict[str, float], list[str]]:
    """The values of a PSS/E record with what it leaves to be computed, and sentences about it.

    VRMAX = 0 becomes the regulator output (SE(E2) + KE) E2 that holds the field voltage E2.
    """
    values, said = shared.ordered(values)
    if values["VRmax"] == 0:
        ceiling = (values["SE2"] + max(values["KE"], 0.0)) * values["E2"]
        if ceiling <= 0:
            raise ValueError("VRMAX = 0 cannot be computed, because there is no saturation at E2; give VRMAX.")
        values = values | {"VRmax": ceiling, "VRmin": -ceiling}
        said = [*said, f"VRMAX = 0: computed from saturation as {ceiling:.4g}, VRMIN as its negative."]
    if values["KE"] == 0:
        said = [*said, "KE = 0: computed at the start so that the regulator is at a tenth of VRMAX."]
    return values, said

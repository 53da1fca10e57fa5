"""ST6B: bus-fed static exciter with a PID regulator, an inner field-voltage loop and a limit of the field current.

Vt -> [1/(1+sTR)] -> Vm -> (-)
Vref + Vs -----------------> + -> [KPA + KIA/s], limited VAmin..VAmax, + [sKDA/(1+sTDA)] -> VA
KFF VA + KM (VA - VG), limited VRmin..VRmax, at most max(VRmin, KLR (KCI ILR - Ifd)) -> x Vm -> Efd
VG = Efd [KG/(1+sTG)]

The gates for excitation limiters are not represented.
Source: IEEE Std 421.5-2005, type ST6B; PSS/E Model Library, ST6B.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import at_least, clip, derivative, integral, lag, lag_rate, low_value, pi

from .shared import LoadedInput as Input
from .shared import Output, gains

NAME = "ST6B"
ROLE = "exciter"
UPPER = ("ILR",)
DYR = {"ST6B": "_OEL TR KPA KIA KDA TDA VAmax VAmin KFF KM KCI KLR ILR VRmax VRmin KG TG"}
__all__ = ["DYR", "NAME", "ROLE", "UPPER", "Input", "Output", "Par", "State", "equations", "guess"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KPA: Annotated[float, "pu", "proportional gain", NOT_NEGATIVE]
    KIA: Annotated[float, "1/s", "integral gain", NOT_NEGATIVE]
    KDA: Annotated[float, "s", "derivative gain", NOT_NEGATIVE]
    TDA: Annotated[float, "s", "lag of the derivative (0: no derivative)", NOT_NEGATIVE]
    VAmax: Annotated[float, "pu", "limit of the proportional and integral part"]
    VAmin: Annotated[float, "pu", "limit of the proportional and integral part"]
    KFF: Annotated[float, "pu", "gain around the inner loop", NOT_NEGATIVE]
    KM: Annotated[float, "pu", "gain of the inner loop", NOT_NEGATIVE]
    KCI: Annotated[float, "pu", "adjustment of the field current limiter", NOT_NEGATIVE]
    KLR: Annotated[float, "pu", "gain of the field current limiter", NOT_NEGATIVE]
    ILR: Annotated[float, "pu", "reference of the field current limiter"]
    VRmax: Annotated[float, "pu", "limit of the voltage at the bridge, at 1 pu terminal voltage"]
    VRmin: Annotated[float, "pu", "limit of the voltage at the bridge, at 1 pu terminal voltage"]
    KG: Annotated[float, "pu", "inner feedback gain", NOT_NEGATIVE]
    TG: Annotated[float, "s", "inner feedback lag", Ge(1e-3)]

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        return gains(self, ("KPA", "KIA"), ("KM", "KFF"))


class State(NamedTuple):
    """Transducer, integral and derivative of the regulator, inner feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    vi: Annotated[float, "pu", "integral of the regulator"]
    vd: Annotated[float, "pu", "lagged control error of the derivative"]
    vg: Annotated[float, "pu", "inner feedback"]


@inline
def equations(x, u, p):
    """Field voltage Efd = VR Vm (pu), and state derivatives (1/s)."""
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    error = u.Vref - vm + u.Vs
    vi, d_vi = pi(p.KPA, p.KIA, error, integral(p.KIA, x.vi), p.VAmin, p.VAmax)
    vd, d_vd = derivative(p.KDA, p.TDA, error, x.vd)
    va = vi + vd
    vr = clip(p.KFF * va + p.KM * (va - x.vg), p.VRmin, p.VRmax)
    efd = vm * low_value(vr, at_least(p.KLR * (p.KCI * p.ILR - u.Ifd), p.VRmin))
    return Output(efd), State(vm=d_vm, vi=d_vi, vd=d_vd, vg=lag_rate(p.TG, p.KG * efd, x.vg))


def guess(V, I, p):
    """Initial guess: no signal, so that the field current limiter does not act."""
    return State(1.0, 0.0, 0.0, 0.0)

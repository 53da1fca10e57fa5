"""ST8C: static exciter with cascaded PI regulators of terminal voltage and field current (IEEE type ST8C).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KPR + KIR/s], limited VPImin..VPImax -> (+) -> [KPA + KIA/s], limited VAmin..VAmax
                                          Ifd -> [KF/(1+sTF)] -> (-)                      |
                                       [KA/(1+sTA)], held VRmin..VRmax -> x VB1 -> (+) VB2 -> Efd

VB1 = min(VB1max, VE FEX(KC1 Ifd/VE));  VE = KP where SW1 = 0, |KP Vt + j (KI1 + KP XL) It| where SW1 = 1, KP at the
angle THETAP;  VB2 = min(VB2max, KI2 It FEX(KC2 Ifd/(KI2 It))).
The inputs for excitation limiters are not represented.
Source: IEEE Std 421.5-2016, type ST8C; PSS/E Model Library, ST8C.
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import at_most, clip, compound, integral, lag, magnitude, pi, rectified

from .shared import CompoundInput as Input
from .shared import Output, gains

NAME = "ST8C"
ROLE = "exciter"
LIMITS = {"va": ("VRmin", "VRmax")}
LEVELS = ("VB1max", "VB2max")
DYR = {
    "ST8C": "+SW1 _UEL _OEL _SCL TR KPR KIR VPImax VPImin KPA KIA VAmax VAmin KA TA VRmax VRmin KF TF KC1 KP KI1 XL "
    "THETAP VB1max KC2 KI2 VB2max",
}
__all__ = ["DYR", "LEVELS", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KPR: Annotated[float, "pu", "proportional gain of the voltage regulator", NOT_NEGATIVE]
    KIR: Annotated[float, "1/s", "integral gain of the voltage regulator", NOT_NEGATIVE]
    VPImax: Annotated[float, "pu", "limit of the voltage regulator"]
    VPImin: Annotated[float, "pu", "limit of the voltage regulator"]
    KPA: Annotated[float, "pu", "proportional gain of the current regulator", NOT_NEGATIVE]
    KIA: Annotated[float, "1/s", "integral gain of the current regulator", NOT_NEGATIVE]
    VAmax: Annotated[float, "pu", "limit of the current regulator"]
    VAmin: Annotated[float, "pu", "limit of the current regulator"]
    KA: Annotated[float, "pu", "gain of the bridge", POSITIVE]
    TA: Annotated[float, "s", "lag of the bridge", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "limit of the bridge"]
    VRmin: Annotated[float, "pu", "limit of the bridge"]
    KF: Annotated[float, "pu", "gain of the field current transducer", NOT_NEGATIVE]
    TF: Annotated[float, "s", "field current transducer", NOT_NEGATIVE]
    KC1: Annotated[float, "pu", "loading of the first rectifier", NOT_NEGATIVE]
    KP: Annotated[float, "pu", "gain of the potential source", POSITIVE]
    KI1: Annotated[float, "pu", "gain of the current source", NOT_NEGATIVE] = 0.0
    XL: Annotated[float, "pu", "reactance of the potential source", NOT_NEGATIVE] = 0.0
    THETAP: Annotated[float, "-", "angle of the potential source, degrees"] = 0.0
    VB1max: Annotated[float, "pu", "limit of the first source"] = 99.0
    KC2: Annotated[float, "pu", "loading of the second rectifier", NOT_NEGATIVE] = 0.0
    KI2: Annotated[float, "pu", "gain of the second, current-fed source", NOT_NEGATIVE] = 0.0
    VB2max: Annotated[float, "pu", "limit of the second source"] = 99.0
    SW1: Annotated[int, "-", "0: constant source, 1: fed by the terminals", Interval(ge=0, le=1)] = 0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        return gains(self, ("KPR", "KIR"), ("KPA", "KIA"))


class State(NamedTuple):
    """Transducers of voltage and current, the integrals of the regulators, and the bridge."""

    vc: Annotated[float, "pu", "measured terminal voltage"]
    xr: Annotated[float, "pu", "integral of the voltage regulator"]
    xa: Annotated[float, "pu", "integral of the current regulator"]
    va: Annotated[float, "pu", "signal of the bridge"]
    ifd: Annotated[float, "pu", "measured field current"]


@inline
def equations(x, u, v, p):
    """Field voltage Efd = VA VB1 + VB2 (pu), and state derivatives (1/s)."""
    vc, d_vc = lag(p.TR, u.vt, x.vc)
    ifd, d_ifd = lag(p.TF, p.KF * u.Ifd, x.ifd)
    wanted, d_xr = pi(p.KPR, p.KIR, u.Vref - vc + u.Vs, integral(p.KIR, x.xr), p.VPImin, p.VPImax)
    drive, d_xa = pi(p.KPA, p.KIA, wanted - ifd, integral(p.KIA, x.xa), p.VAmin, p.VAmax)
    va, d_va = lag(p.TA, p.KA * drive, x.va)
    ve = p.KP + 0 * u.vt if p.SW1 == 0 else compound(v, u, p.KP, p.THETAP, p.KI1, p.XL)
    efd = clip(va, p.VRmin, p.VRmax) * at_most(rectified(ve, p.KC1, u.Ifd), p.VB1max)
    if p.KI2 > 0:
        efd = efd + at_most(rectified(p.KI2 * magnitude(u.id, u.iq), p.KC2, u.Ifd), p.VB2max)
    return Output(efd), State(vc=d_vc, xr=d_xr, xa=d_xa, va=d_va, ifd=d_ifd)


def from_record(kind: str, values: dict[str, Any]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    return Par(**(values | {"SW1": int(values["SW1"])})), []

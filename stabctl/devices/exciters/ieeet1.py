"""IEEET1: DC exciter with a continuously acting regulator (IEEE type 1, 1968).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KA/(1+sTA)], held between VRmin and VRmax -> (+) -> [1/(sTE)] -> Efd
       (-) [sKF/(1+sTF)] <- Efd                                           (-) (KE + SE(Efd)) Efd

SE(Efd) Efd = B (Efd - A)^2 through (E1, SE1) and (E2, SE2); SE2 = 0 means no saturation. It is an EXDC2 without the
first stage, with regulator limits that do not depend on the terminal voltage. KE and VRmax are used as given; unlike in
PSS/E, a value of 0 does not mean that they are computed.
Source: IEEE Committee Report, Computer representation of excitation systems, IEEE Trans. PAS-87 (1968), type 1; PSS/E
Model Library, IEEET1.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl.devices.blocks import SHORT, clip, lag, lag_rate, quadratic, through
from stabctl.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE

from .signals import Input, Output

NAME = "IEEET1"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax")}
__all__ = ["LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit"]
    VRmin: Annotated[float, "pu", "regulator limit"]
    KE: Annotated[float, "pu", "exciter constant"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE]
    TF: Annotated[float, "s", "stabilizing feedback lag (0: no feedback)", NOT_NEGATIVE] = 1.0
    E1: Annotated[float, "pu", "field voltage of SE1", POSITIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "field voltage of SE2", POSITIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "field voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.SE2 > 0 and not (self.E2 > self.E1 and self.SE2 > self.SE1):
            yield "SE2", f"must lie above the first point, SE1 = {self.SE1:g} at E1 = {self.E1:g}"


class State(NamedTuple):
    """Transducer, regulator, exciter and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    vr: Annotated[float, "pu", "regulator output"]
    efd: Annotated[float, "pu", "field voltage"]
    vf: Annotated[float, "pu", "lagged field voltage of the feedback"]


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = through(p.E1, p.SE1, p.E2, p.SE2)
    return p._replace(SA=SA, SB=SB)


@inline
def output(x):
    """Field voltage Efd (pu)."""
    return Output(x.efd)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    damping = p.KF / p.TF * (x.efd - x.vf) if p.TF >= SHORT else 0 * x.efd
    wanted = p.KA * (u.Vref - lag(p.TR, u.vt, x.vm) + u.Vs - damping)
    vr = clip(lag(p.TA, wanted, x.vr), p.VRmin, p.VRmax)
    iron = quadratic(x.efd, p.SA, p.SB)
    return State(
        lag_rate(p.TR, u.vt, x.vm),
        lag_rate(p.TA, wanted, x.vr),
        (vr - p.KE * x.efd - iron) / p.TE,
        lag_rate(p.TF, x.efd, x.vf),
    )

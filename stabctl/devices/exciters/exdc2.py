"""EXDC2: DC commutator exciter with a regulator supplied from the terminals (IEEE DC2A).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [(1+sTC)/(1+sTB)] -> [KA/(1+sTA)], held Vt VRmin..Vt VRmax -> (+) -> [1/(sTE)] -> Efd
       (-) [sKF/(1+sTF)] <- Efd                                                           (-) (KE + SE(Efd)) Efd

SE(Efd) Efd is quadratic through (E1, SE1) and (E2, SE2); SE2 = 0 means no saturation. The limits are those of the
regulator and proportional to the terminal voltage.
Source: IEEE Std 421.5, type DC2A.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl.devices.blocks import SHORT, clip, lag, lag_rate, lead_lag, quadratic, through
from stabctl.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE

from .signals import Input, Output

NAME = "EXDC2"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax", "vt")}
__all__ = ["LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    TB: Annotated[float, "s", "lag of the first stage", NOT_NEGATIVE]
    TC: Annotated[float, "s", "lead of the first stage", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit at 1 pu terminal voltage"]
    VRmin: Annotated[float, "pu", "regulator limit at 1 pu terminal voltage"]
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
    """Transducer, first stage, regulator, exciter and stabilizing feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    va: Annotated[float, "pu", "lagged control error"]
    vr: Annotated[float, "pu", "regulator output"]
    efd: Annotated[float, "pu", "field voltage"]
    vf: Annotated[float, "pu", "lagged field voltage of the feedback"]


def prepare(p):
    """The parameters, with those computed from others."""
    SA, SB = through(p.E1, p.SE1, p.E2, p.SE2)
    return p._replace(SA=SA, SB=SB)


@inline
def demand(x, u, p):
    """Control error, and the regulator output it demands (pu)."""
    damping = p.KF / p.TF * (x.efd - x.vf) if p.TF >= SHORT else 0 * x.efd
    error = u.Vref - lag(p.TR, u.vt, x.vm) + u.Vs - damping
    return error, p.KA * lead_lag(p.TC, p.TB, error, x.va)


@inline
def output(x):
    """Field voltage Efd (pu)."""
    return Output(x.efd)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    error, wanted = demand(x, u, p)
    vr = clip(lag(p.TA, wanted, x.vr), p.VRmin * u.vt, p.VRmax * u.vt)
    iron = quadratic(x.efd, p.SA, p.SB)
    return State(
        lag_rate(p.TR, u.vt, x.vm),
        lag_rate(p.TB, error, x.va),
        lag_rate(p.TA, wanted, x.vr),
        (vr - p.KE * x.efd - iron) / p.TE,
        lag_rate(p.TF, x.efd, x.vf),
    )

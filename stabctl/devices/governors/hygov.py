"""HYGOV: hydro turbine and governor with transient droop.

Pref -> (+) -> [1/(1+sTf)] -> e -> [(1+sTr)/(s r Tr)], rate at most VELM, Gmin to Gmax -> c -> [1/(1+sTg)] -> gate
        (-) <- omega - 1 + R c
q/gate squared -> h,    dq/dt = (1 - h)/Tw
Pm = At h (q - qNL) - Dturb gate (omega - 1)

Nonlinear turbine with an inelastic water column: q is the flow, h the head.
Source: PSS/E Model Library, HYGOV; IEEE Working Group, Hydraulic Turbine and Turbine Control Models, IEEE Trans. Power
Syst. 7 (1992), section III.
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lag, lag_rate, rate_limit

from .shared import Input, Output

NAME = "HYGOV"
ROLE = "governor"
LIMITS = {"desired": ("Gmin", "Gmax")}
UPPER = ("VELM",)
DYR = {"HYGOV": "R r Tr Tf Tg VELM Gmax Gmin Tw At Dturb qNL"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "UPPER", "Input", "Output", "Par", "State", "derivatives", "output"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    R: Annotated[float, "pu", "permanent droop", NOT_NEGATIVE]
    r: Annotated[float, "pu", "temporary droop", POSITIVE]
    Tr: Annotated[float, "s", "governor (dashpot) time constant", POSITIVE]
    Tf: Annotated[float, "s", "filter", Ge(1e-3)]
    Tg: Annotated[float, "s", "gate servo", NOT_NEGATIVE]
    Tw: Annotated[float, "s", "water starting time", POSITIVE]
    At: Annotated[float, "pu", "turbine gain", POSITIVE] = 1.2
    Dturb: Annotated[float, "pu", "turbine damping, power over speed deviation and gate", NOT_NEGATIVE] = 0.0
    qNL: Annotated[float, "pu", "flow without load", NOT_NEGATIVE] = 0.08
    VELM: Annotated[float, "pu/s", "largest rate of the gate", POSITIVE] = 0.2
    Gmax: Annotated[float, "pu", "gate limit"] = 1.0
    Gmin: Annotated[float, "pu", "gate limit"] = 0.0


class State(NamedTuple):
    """Filter, desired gate, gate and flow."""

    error: Annotated[float, "pu", "filtered control error"]
    desired: Annotated[float, "pu", "desired gate opening"]
    gate: Annotated[float, "pu", "gate opening"]
    flow: Annotated[float, "pu", "turbine flow"]


@inline
def opening(x, p):
    """Gate opening and head (pu)."""
    gate, _ = lag(p.Tg, clip(x.desired, p.Gmin, p.Gmax), x.gate)
    return gate, (x.flow / gate) * (x.flow / gate)


@inline
def output(x, omega, p):
    """Mechanical power (pu machine)."""
    gate, head = opening(x, p)
    return Output(p.At * head * (x.flow - p.qNL) - p.Dturb * gate * (omega - 1))


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    _, head = opening(x, p)
    d_error = (u.Pref - (u.omega - 1) - p.R * x.desired - x.error) / p.Tf
    d_desired = rate_limit((x.error + p.Tr * d_error) / (p.r * p.Tr), -p.VELM, p.VELM)
    d_gate = lag_rate(p.Tg, x.desired, x.gate)
    return State(error=d_error, desired=d_desired, gate=d_gate, flow=(1 - head) / p.Tw)

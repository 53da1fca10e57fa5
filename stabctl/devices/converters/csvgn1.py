"""CSVGN1: static VAR compensator, a thyristor-controlled reactor beside a fixed capacitor.

|V| - Vref -> K (1+sT1)(1+sT2)/((1+sT3)(1+sT4)), Vmin..Vmax -> [1/(1+sT5)], Rmin/Rbase..1 -> y
B = Cbase/Sbase - y Rbase/Sbase,   current j B V out of the bus

y is the conducting share of the reactor Rbase, the MVA of the unit. It takes the place of the machine of a unit without
active power, whose reactive power is that of the power flow.
Source: PSS/E Model Library, CSVGN1; NREL-Sienna/PowerSimulationsDynamics.jl, CSVGN1.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import clip, lead_lag, magnitude, non_windup
from stabctl.devices.ports import PORT

NAME = "CSVGN1"
ROLE = "converter"
LIMITS = {"y": ("ymin", 1.0)}
LOOPS = {"voltage control": ("x1", "x2"), "thyristors": ("y",)}
DYR = {"CSVGN1": "K T1 T2 T3 T4 T5 Rmin Vmax Vmin Cbase"}


class Par(NamedTuple):
    """Parameters of one compensator."""

    mva: Annotated[float, "-", "reactor MVA over system MVA", FROM_CASE]
    base: Annotated[float, "MVA", "reactor", FROM_CASE]
    ymin: Annotated[float, "pu", "smallest share of the reactor, Rmin/Rbase", FROM_CASE]
    K: Annotated[float, "pu", "gain", POSITIVE]
    T1: Annotated[float, "s", "lead time constant", NOT_NEGATIVE]
    T2: Annotated[float, "s", "lead time constant", NOT_NEGATIVE]
    T3: Annotated[float, "s", "lag time constant", NOT_NEGATIVE]
    T4: Annotated[float, "s", "lag time constant", NOT_NEGATIVE]
    T5: Annotated[float, "s", "thyristor delay", POSITIVE]
    Rmin: Annotated[float, "MVA", "smallest reactor"] = 0.0
    Vmax: Annotated[float, "pu", "largest regulator output"] = 1.0
    Vmin: Annotated[float, "pu", "smallest regulator output"] = 0.0
    Cbase: Annotated[float, "MVA", "capacitor", NOT_NEGATIVE] = 0.0


class State(NamedTuple):
    """Regulator and reactor."""

    x1: Annotated[float, "pu", "lagged voltage error of the first stage"]
    x2: Annotated[float, "pu", "lagged output of the first stage"]
    y: Annotated[float, "pu", "share of the reactor"]


class Input(NamedTuple):
    """Signal that the compensator reads."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]


class Output(NamedTuple):
    """Power and voltage at the terminals."""

    P: Annotated[float, "pu", "active power delivered, unit base"]
    Q: Annotated[float, "pu", "reactive power delivered, unit base"]
    vt: Annotated[float, "pu", "terminal voltage"]


def prepare(p: Par) -> Par:
    """Parameters with the smallest share of the reactor."""
    return p._replace(ymin=p.Rmin / p.base)


@inline
def susceptance(x, p):
    """Susceptance (pu unit)."""
    return p.Cbase / p.base - x.y


@inline
def current(x, v, p):
    """Current into the network (pu system), real and imaginary part."""
    b = p.mva * susceptance(x, p)
    return b * v[1], -b * v[0]


@inline
def output(x, v, p):
    """Power and voltage at the terminals (pu unit)."""
    vt = magnitude(v[0], v[1])
    return Output(0 * vt, susceptance(x, p) * vt * vt, vt)


@inline
def derivatives(x, u, y, p):
    """State derivatives (1/s); y is this compensator's own output."""
    error = p.K * (y.vt - u.Vref)
    first, d_x1 = lead_lag(p.T1, p.T3, error, x.x1)
    order, d_x2 = lead_lag(p.T2, p.T4, first, x.x2)
    d_y = (clip(order, p.Vmin, p.Vmax) - x.y) / p.T5
    return State(x1=d_x1, x2=non_windup(d_x2, order, p.Vmin, p.Vmax), y=d_y)


def guess(V: complex, I: complex, p: Par) -> State:
    """States at the reactive power of the power flow."""
    share = p.Cbase / p.base - float((V * I.conjugate()).imag) / abs(V) ** 2
    return State(share, share, share)

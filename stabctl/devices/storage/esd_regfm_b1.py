"""ESD behind a grid-forming converter controlled as a virtual synchronous machine, REGFM_B1.

order   -> [1/(1+sTlag)] -> share    -> (zero if full or empty) -> Pref = -rated share    -> REGFM_B1
order_q -> [1/(1+sTlag)] -> reactive -> (what P leaves of Smax) -> Qref = -rated reactive -> REGFM_B1

The equations are those of `regfm_b1`, with Vref at the voltage of the power flow plus `order_v`, so that the output is
zero at the start. A full device takes no power as one with ESFlag = 0: its angle stays ahead of the phase-locked loop;
an empty one gives none, as its angle stays behind. What flows while the angle comes there, within some 50 ms, is
counted, so the charge may pass 0 or 1 by a little. `rated` is the power rating over the MVA; per unit on the MVA of the
converter.
Source: see `regfm_b1`.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, available
from stabctl.devices.converters import regfm_b1
from stabctl.devices.converters.forming import correction, short_circuit
from stabctl.devices.converters.regfm_b1 import admittance, angle, between, leads, prepare, voltage

from . import esd, joined
from .esd import rates
from .esd_regfm import Vref, references
from .joined import Input

NAME = "ESD_REGFM_B1"
UNVERIFIED = regfm_b1.UNVERIFIED
ROLE = "storage"
LIMITS = regfm_b1.LIMITS
UPPER = regfm_b1.UPPER
ANGLES = regfm_b1.ANGLES
CURRENT_LIMIT = "ImaxF"
Par: Any = joined.joined(joined.Store, regfm_b1.Par, Vref)
__all__ = ["Input", "admittance", "prepare"]


State: Any = joined.joined(esd.State, regfm_b1.State)


class Output(NamedTuple):
    """Power at the terminals, charge, currents, virtual speed, voltages."""

    P: Annotated[float, "pu", "power absorbed, system base"]
    Q: Annotated[float, "pu", "reactive power absorbed, system base"]
    charge: Annotated[float, "-", "state of charge; 0 if the capacity is unlimited"]
    Ip: Annotated[float, "pu", "active current delivered, converter base"]
    Iq: Annotated[float, "pu", "reactive current delivered, converter base"]
    omega: Annotated[float, "pu", "virtual speed"]
    vt: Annotated[float, "pu", "terminal voltage"]
    E: Annotated[float, "pu", "internal voltage before the current limit"]


def errors(values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Name and message for each combination of parameters that is not possible."""
    if not values["mq"]:
        yield "mq", "must be above 0; without droop nothing determines the reactive power at rest"


KIT = joined.Kit("REGFM_B1 of storage", (regfm_b1.Par,), {}, (), errors)


def from_case(device: Any, base_mva: float) -> Any:
    """Parameters from a row of storage.csv; V0 and wb are filled from the case."""
    return joined.from_row(KIT, Par, device, base_mva, wb=0.0, deltamax=0.0, deltamin=0.0)


def guess(V: complex, p: Any) -> Any:
    """States at rest: no power, and the initial energy."""
    return State(0.0, p.stored, 0.0, *regfm_b1.guess(V, 0j, p))


@inline
def limits(x, p):
    """Least and largest angle (rad) ahead of the phase-locked loop that the store allows."""
    low, high = leads(x, p)
    return available(low, x.energy, p.floor, p.capacity), available(high, x.energy, p.floor, p.capacity)


@inline
def source(x, u, p):
    """Short-circuit current of the internal voltage without limit (pu system), real and imaginary part."""
    low, high = limits(x, p)
    return short_circuit(voltage(x, references(x, u, p), p)[0], angle(x, low, high), p)


@inline
def current(x, u, v, p):
    """Current that the limit adds to that of the source (pu system), real and imaginary part."""
    low, high = limits(x, p)
    return correction(voltage(x, references(x, u, p), p)[0], angle(x, low, high), v, p)


@inline
def equations(x, u, v, p):
    """Power absorbed (pu system), charge, currents and voltages (pu converter), virtual speed; derivatives (1/s)."""
    low, high = limits(x, p)
    y, d = between(x, references(x, u, p), v, p, low, high)
    P, divisor = -p.mva * y.P, at_least(y.vt, 1e-9)
    s = rates(x, u, P, p)
    return Output(P, -p.mva * y.Q, x.energy / p.capacity, y.P / divisor, y.Q / divisor, y.omega, y.vt, y.E), State(
        s.share, s.energy, s.reactive, d.delta, d.dw, d.xd, d.wf, d.pf, d.qf, d.vm, d.idf, d.iqf, d.e, d.over, d.under,
        d.theta_pll, d.xpll,
    )  # fmt: skip

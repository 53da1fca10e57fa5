"""Stator of every machine, with its inputs and outputs.

(ra + j x'')(iq - j id) = w psi'' - V exp(-j delta) with psi'' = psi''d + j psi''q, in the rotor frame.
Per unit on the machine base. As in PSS/E, w is 1: the effect of the speed on the stator voltage and that of neglected
stator transients nearly cancel (Kundur, section 5.1). With the speed factor of GENROU it is the speed.
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import magnitude
from stabctl.devices.ports import PORT

WITHOUT = {
    "1": "a machine without this circuit has x1q = xq, one with a constant flux a large T1q, such as 999 s",
    "2": "a machine without subtransient circuits is a two_axis",
}


class Input(NamedTuple):
    """Signals at a machine."""

    Efd: Annotated[float, "pu", "field voltage (classical machine: internal voltage E')", PORT]
    Pm: Annotated[float, "pu", "mechanical power, machine base", PORT]


class Output(NamedTuple):
    """Stator quantities, per unit on the machine base."""

    id: Annotated[float, "pu", "stator current, d axis"]
    iq: Annotated[float, "pu", "stator current, q axis"]
    Te: Annotated[float, "pu", "electrical torque (classical machine: air-gap power)"]
    P: Annotated[float, "pu", "active power at the terminals"]
    Q: Annotated[float, "pu", "reactive power at the terminals"]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "terminal voltage corrected for the speed deviation, supply of a rectifier exciter"]
    Ifd: Annotated[float, "pu", "field current, Xad Ifd (classical machine: E')"]
    Ilq: Annotated[float, "pu", "q-axis rotor current, Xaq I1q"]


class Internal(NamedTuple):
    """Rotor position and subtransient flux, used by source and stator."""

    sin: Annotated[float, "-", "sine of the rotor angle"]
    cos: Annotated[float, "-", "cosine of the rotor angle"]
    psid: Annotated[float, "pu", "subtransient flux linkage, d axis"]
    psiq: Annotated[float, "pu", "subtransient flux linkage, q axis"]
    w: Annotated[float, "pu", "factor of the stator voltage: the speed, or 1"]


def absent(p: Any, *circuits: tuple[str, str, str]) -> Iterator[tuple[str, str]]:
    """Field and sentence of every circuit (time constant, reactances with and without it) that is wrongly absent.

    Only where both reactances are equal does nothing depend on its flux.
    """
    for T, closed, opened in circuits:
        if getattr(p, T) == 0 and getattr(p, closed) != getattr(p, opened):
            text = f"must be above 0 where {opened} = {getattr(p, opened):g} is not {closed} = {getattr(p, closed):g}"
            yield T, f"{text}; {WITHOUT[T[1]]}"


@inline
def source(i, p):
    """Short-circuit current of the source w psi'' behind ra + j x'' (pu system), real and imaginary part."""
    er, ei = i.w * (i.cos * i.psid - i.sin * i.psiq), i.w * (i.sin * i.psid + i.cos * i.psiq)
    k = p.mva / (p.ra * p.ra + p.x2 * p.x2)
    return k * (p.ra * er + p.x2 * ei), k * (p.ra * ei - p.x2 * er)


@inline
def stator(i, v, p):
    """id, iq, torque, P, Q, terminal voltage, and terminal voltage corrected for the speed deviation (pu machine)."""
    vr, vi = i.cos * v[0] + i.sin * v[1], i.cos * v[1] - i.sin * v[0]
    er, ei = i.w * i.psid - vr, i.w * i.psiq - vi
    k = 1 / (p.ra * p.ra + p.x2 * p.x2)
    iq, id_ = k * (p.ra * er + p.x2 * ei), k * (p.x2 * er - p.ra * ei)
    slip = i.w - 1
    return (
        id_,
        iq,
        i.psid * iq - i.psiq * id_,
        vr * iq - vi * id_,
        vr * id_ + vi * iq,
        magnitude(vr, vi),
        magnitude(vr - slip * i.psid, vi - slip * i.psiq),
    )


@inline
def admittance(p):
    """Norton admittance 1/(ra + j x'') (pu system), real and imaginary part."""
    k = p.mva / (p.ra * p.ra + p.x2 * p.x2)
    return k * p.ra, -k * p.x2


# Transient saliency: the source has another reactance on the d than on the q axis.
#
# vq = psid - ra iq - xd id,    vd = -psiq - ra id + xq iq
#
# The network equations have psi = psid + j psiq behind ra + j x, 1/x the mean of 1/xd and 1/xq; the rest of the current
# depends on the angle between voltage and rotor.


@inline
def terminal(i, v):
    """Terminal voltage in the rotor frame, vq and -vd."""
    return i.cos * v[0] + i.sin * v[1], i.cos * v[1] - i.sin * v[0]


@inline
def solved(er, ei, ra, xd, xq):
    """Currents iq and id (pu machine) from the voltages er + j ei over the impedances."""
    k = 1 / (ra * ra + xd * xq)
    return k * (ra * er + xd * ei), k * (xq * er - ra * ei)


@inline
def mean(ra, xd, xq):
    """Conductance and susceptance of ra + j x (pu machine)."""
    x = 2 * xd * xq / (xd + xq)
    k = 1 / (ra * ra + x * x)
    return k * ra, -k * x


@inline
def torque(x, u, p):
    """Mechanical torque (pu machine): the power Pm over the speed, or Pm itself with the parameter `torque`."""
    return u.Pm / x.omega if p.torque < 1 else u.Pm


@inline
def norton(i, p, xd, xq):
    """Short-circuit current of the source behind ra + j x (pu system), real and imaginary part."""
    g, b = mean(p.ra, xd, xq)
    er, ei = i.cos * i.psid - i.sin * i.psiq, i.sin * i.psid + i.cos * i.psiq
    return p.mva * (g * er - b * ei), p.mva * (g * ei + b * er)


@inline
def rest(i, v, p, flow, xd, xq):
    """What the stator currents `flow`, iq and id, have beyond those through ra + j x (pu system)."""
    vr, vi = terminal(i, v)
    g, b = mean(p.ra, xd, xq)
    er, ei = i.psid - vr, i.psiq - vi
    re, im = flow[0] - (g * er - b * ei), -flow[1] - (g * ei + b * er)
    return p.mva * (i.cos * re - i.sin * im), p.mva * (i.sin * re + i.cos * im)

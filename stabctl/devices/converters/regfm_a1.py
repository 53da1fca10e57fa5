"""REGFM_A1: droop-controlled grid-forming converter, a voltage source behind a coupling reactance without a rotor.

P -> [1/(1+sTPf)] -> pf;   omega - 1 = mp (Pref - pf) - over(pf) + under(pf) -> [wb/s] -> delta
Q -> [1/(1+sTQf)] -> qf;   Vcmd = Vref + mq (Qref - qf) - over(qf) + under(qf)
vt -> [1/(1+sTVf)] -> vm;  E = [kpv + kiv/s] (Vcmd - vm) between Emin and Emax with VFlag = 1, otherwise E = Vcmd
over(pf) = [kpp + kip/s] (pf - Pmax) and under(pf) = [kpp + kip/s] (Pmin - pf), both at least 0
over(qf) = [kpq + kiq/s] (qf - Qmax) and under(qf) = [kpq + kiq/s] (Qmin - qf), both at least 0
I = (E exp(j delta) - V)/(RL + jXL), reduced to the magnitude ImaxF where it is larger, at the same angle

The controllers `over` and `under` rest at 0 within the limits; their integrals do not fall below 0. A steady change dP
of the load changes the frequency by -mp dP until Pmax or Pmin is reached. The filter of P acts as an inertia constant
of TPf/(2 mp), which is the weight of the virtual rotor in a center of inertia. The voltage controller goes on while the
current is limited. Vref is solved for at Qref = 0 (QVFlag = 1 in the source; QVFlag = 0 divides the same sum
otherwise). kpp, kip, kpq and kiq are kppmax, kipmax, kpqmax and kiqmax of the source; with VFlag = 0, kpq = 0.1 and
kiq = 10 are usual. Per unit on the converter's own MVA; `mva` converts currents to the system base.
Source: W. Du et al., Model Specification of Droop-Controlled, Grid-Forming Inverters (REGFM_A1), PNNL-32278, 2023;
inertia: S. D'Arco, J. A. Suul, Equivalence of Virtual Synchronous Machines and Frequency-Droops for Converter-Based
MicroGrids, IEEE Trans. Smart Grid 5 (2014).
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, beyond, clip, pi

from .forming import Input, Output, admittance, correction, short_circuit, terminals

__all__ = ["Input", "admittance"]

NAME = "REGFM_A1"
ROLE = "converter"
UPPER = ("ImaxF",)
FILTER = Interval(ge=SHORT)
SWITCH = Interval(ge=0, le=1)
LIMITS = dict.fromkeys(("pmax", "pmin", "qmax", "qmin"), (0.0, np.inf))
LOOPS = {
    "power droop": ("delta", "pf"),
    "voltage control": ("e", "vm"),
    "reactive power droop": ("qf",),
    "power limits": ("pmax", "pmin"),
    "reactive power limits": ("qmax", "qmin"),
}


class Par(NamedTuple):
    """Parameters of one converter."""

    mva: Annotated[float, "-", "converter MVA over system MVA", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    XL: Annotated[float, "pu", "coupling reactance", POSITIVE] = 0.15
    RL: Annotated[float, "pu", "coupling resistance", NOT_NEGATIVE] = 0.0
    mp: Annotated[float, "pu", "frequency droop: frequency over active power", POSITIVE] = 0.01
    mq: Annotated[float, "pu", "voltage droop: voltage over reactive power", NOT_NEGATIVE] = 0.05
    kpv: Annotated[float, "pu", "proportional gain of the voltage controller", NOT_NEGATIVE] = 0.0
    kiv: Annotated[float, "1/s", "integral gain of the voltage controller", NOT_NEGATIVE] = 5.86
    kpp: Annotated[float, "pu", "proportional gain at a limit of P: frequency over power", POSITIVE] = 0.01
    kip: Annotated[float, "1/s", "integral gain at a limit of P", NOT_NEGATIVE] = 0.1
    kpq: Annotated[float, "pu", "proportional gain at a limit of Q: voltage over power", POSITIVE] = 3.0
    kiq: Annotated[float, "1/s", "integral gain at a limit of Q", NOT_NEGATIVE] = 20.0
    TPf: Annotated[float, "s", "filter of the active power", FILTER] = 0.01
    TQf: Annotated[float, "s", "filter of the reactive power", FILTER] = 0.01
    TVf: Annotated[float, "s", "filter of the voltage", FILTER] = 0.01
    ImaxF: Annotated[float, "pu", "current limit", POSITIVE] = 2.0
    Emax: Annotated[float, "pu", "upper limit of the internal voltage", POSITIVE] = 1.15
    Emin: Annotated[float, "pu", "lower limit of the internal voltage"] = 0.0
    Pmax: Annotated[float, "pu", "upper limit of the active power"] = 1.0
    Pmin: Annotated[float, "pu", "lower limit of the active power"] = 0.0
    Qmax: Annotated[float, "pu", "upper limit of the reactive power"] = 0.44
    Qmin: Annotated[float, "pu", "lower limit of the reactive power"] = -0.44
    VFlag: Annotated[float, "-", "voltage controller (1: on, 0: the droop gives E)", SWITCH] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        for low, high in (("Emin", "Emax"), ("Pmin", "Pmax"), ("Qmin", "Qmax")):
            if getattr(self, low) >= getattr(self, high):
                yield high, f"must be above {low} = {getattr(self, low):g}"
        if self.VFlag > 0 and not self.kpv + self.kiv:
            yield "kiv", "must be above 0 where kpv = 0, or set VFlag = 0"


class State(NamedTuple):
    """Virtual angle, filters, and integrals of the controllers."""

    delta: Annotated[float, "rad", "angle of the internal voltage relative to the synchronous frame"]
    pf: Annotated[float, "pu", "filtered active power"]
    qf: Annotated[float, "pu", "filtered reactive power"]
    vm: Annotated[float, "pu", "filtered terminal voltage"]
    e: Annotated[float, "pu", "integral of the voltage controller"]
    pmax: Annotated[float, "pu", "integral of the controller at Pmax"]
    pmin: Annotated[float, "pu", "integral of the controller at Pmin"]
    qmax: Annotated[float, "pu", "integral of the controller at Qmax"]
    qmin: Annotated[float, "pu", "integral of the controller at Qmin"]


def inertia(p: Par) -> float:
    """Equivalent inertia constant (s) of droop with a filter of P."""
    return p.TPf / (2 * p.mp)


def elsewhere(p: Par) -> np.ndarray:
    """Largest eigenvalue (1/s) of converters (arrays) at the limits of their power, at a stiff bus.

    There Q changes by dE/XL and P by d delta/XL. The loop of Q has a filter and a proportional gain, that of P a
    filter and the integral from frequency to angle.
    """
    gain = np.where(p.VFlag > 0.5, p.kpv, 1.0) * (p.mq + p.kpq) / p.XL
    return np.asarray(np.maximum((1 + gain) / p.TQf, np.sqrt(p.wb * (p.mp + p.kpp) / (p.XL * p.TPf))))


@inline
def voltage(x, u, p):
    """Magnitude of the internal voltage (pu), and derivatives (1/s) of the integrals e, qmax and qmin."""
    over, d_qmax = beyond(p.kpq, p.kiq, x.qf - p.Qmax, x.qmax)
    under, d_qmin = beyond(p.kpq, p.kiq, p.Qmin - x.qf, x.qmin)
    wanted = u.Vref + p.mq * (u.Qref - x.qf) - over + under
    E, d_e = pi(p.kpv, p.kiv, wanted - x.vm, x.e, p.Emin, p.Emax)
    if p.VFlag > 0.5:
        return E, d_e, d_qmax, d_qmin
    return clip(wanted, p.Emin, p.Emax), 0 * d_e, d_qmax, d_qmin


@inline
def span(x, p):
    """Limits of the active power (pu converter)."""
    return p.Pmin, p.Pmax


@inline
def norton(x, u, p, low, high):
    """`source`, whatever the limits of the active power are."""
    return short_circuit(voltage(x, u, p)[0], x.delta, p)


@inline
def added(x, u, v, p, low, high):
    """`current`, whatever the limits of the active power are."""
    return correction(voltage(x, u, p)[0], x.delta, v, p)


@inline
def source(x, u, p):
    """Short-circuit current of the internal voltage without limit (pu system), real and imaginary part."""
    return norton(x, u, p, p.Pmin, p.Pmax)


@inline
def current(x, u, v, p):
    """Current that the limit adds to that of the source (pu system), real and imaginary part."""
    return added(x, u, v, p, p.Pmin, p.Pmax)


@inline
def between(x, u, v, p, low, high):
    """Output and state derivatives (1/s) with these limits of the active power (pu converter)."""
    E, d_e, d_qmax, d_qmin = voltage(x, u, p)
    P, Q, vt = terminals(E, x.delta, v, p)
    over, d_pmax = beyond(p.kpp, p.kip, x.pf - high, x.pmax)
    under, d_pmin = beyond(p.kpp, p.kip, low - x.pf, x.pmin)
    omega = 1 + p.mp * (u.Pref - x.pf) - over + under
    return Output(P, Q, vt, omega, E), State(
        delta=p.wb * (omega - 1),
        pf=(P - x.pf) / p.TPf,
        qf=(Q - x.qf) / p.TQf,
        vm=(vt - x.vm) / p.TVf,
        e=d_e,
        pmax=d_pmax,
        pmin=d_pmin,
        qmax=d_qmax,
        qmin=d_qmin,
    )


@inline
def equations(x, u, v, p):
    """Power and voltage at the terminals, virtual speed, internal voltage (pu converter); state derivatives (1/s)."""
    return between(x, u, v, p, p.Pmin, p.Pmax)


def guess(V: complex, I: complex, p: Par) -> State:
    """States of the power flow."""
    E, S = V + complex(p.RL, p.XL) * I, V * I.conjugate()
    e = abs(E) if p.VFlag > 0.5 else 0.0
    return State(float(np.angle(E)), S.real, S.imag, abs(V), e, 0.0, 0.0, 0.0, 0.0)

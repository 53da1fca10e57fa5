"""CIM: induction motor load with one or two cages, started from the power of the load.

V = Ra is + j (Xa is + psim),  psim = Xm (is + i1 + i2)
0 = Rk ik + dpsik/dt/wb + j s psik,  s = 1 - w
kind 1: psik = Xk ik + psim;  kind 2: psi1 = X1 (i1 + i2) + psim, psi2 = psi1 + X2 i2
2H dw/dt = Im(conj(psis) is) - T (A w^2 + B w + C0 + D w^E)

The stator transients are neglected. R2 = X2 = 0 is one cage. At the start the slip is solved so that the motor draws
the active power of the load, or of its model_share, at its voltage; T is the torque there, and a constant susceptance
makes up the reactive power. The motor's MVA are Mbase or, if that is 0, Pmult times its power in MW. With CIM5, the
torque is T w^D. The torque of the load resists, but does not drive: a motor that has stopped (s = 1) stays so until the
voltage is high enough to start it. Beyond the breakdown slip, that of the first peak of the torque from slip 0, less
speed gives less torque: it stalls, unless its load resists with still less. Two cages may have a second peak.
Not represented: saturation, the trip below VI. The default circuit is that of one-cage motors in a PSS/E data set of
the 39-bus system (changgang/steps, IEEE39_v33).
Source: PSS/E Model Library, CIM5BL and CIM6BL; PowerWorld, Load Characteristic CIM5 and CIM6; Kundur, Power System
Stability and Control, section 7.2; Krause, Analysis of Electric Machinery, chapter 4.
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from stabctl._util.errors import EquilibriumError
from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import power

NAME = "CIM"
ROLE = "load"
PHASORS = (("re1", "im1"), ("re2", "im2"))
LIMITS = {"slip": (-np.inf, 1.0)}
_CIRCUIT = "+kind Ra Xa Xm R1 X1 R2 X2 _E1 S1 _E2 S2 Mbase Pmult H VI _TI _TB"
SCOPES = ("BL", "OW", "ZN", "AR", "AL")
DYR = {f"CIM5{scope}": f"{_CIRCUIT} D _Tnom" for scope in SCOPES}
DYR |= {f"CIM6{scope}": f"{_CIRCUIT} A B D E C0 _Tnom" for scope in SCOPES}


class Par(NamedTuple):
    """Parameters of one motor, per unit on its MVA."""

    P0: Annotated[float, "pu", "active power at V0, system base", FROM_CASE]
    Q0: Annotated[float, "pu", "reactive power at V0, system base", FROM_CASE]
    V0: Annotated[float, "pu", "voltage of the power flow", FROM_CASE]
    vlow: Annotated[float, "pu", "voltage below which the load counts as lost", FROM_CASE]
    wb: Annotated[float, "rad/s", "base speed, 2 pi f", FROM_CASE]
    system: Annotated[float, "MVA", "system base", FROM_CASE]
    mva: Annotated[float, "-", "motor MVA over system MVA", FROM_CASE]
    slip: Annotated[float, "pu", "slip of the start", FROM_CASE]
    T: Annotated[float, "pu", "torque factor", FROM_CASE]
    Bsh: Annotated[float, "pu", "susceptance for the rest of the reactive power, system base", FROM_CASE]
    pull_out: Annotated[float, "pu", "breakdown slip: first peak of the torque", FROM_CASE]
    Ra: Annotated[float, "pu", "stator resistance", NOT_NEGATIVE] = 0.01
    Xa: Annotated[float, "pu", "stator leakage reactance", POSITIVE] = 0.09
    Xm: Annotated[float, "pu", "magnetizing reactance", POSITIVE] = 4.2
    R1: Annotated[float, "pu", "resistance of the first cage", POSITIVE] = 0.035
    X1: Annotated[float, "pu", "reactance of the first cage", POSITIVE] = 0.09
    R2: Annotated[float, "pu", "resistance of the second cage (0: none)", NOT_NEGATIVE] = 0.0
    X2: Annotated[float, "pu", "reactance of the second cage (0: none)", NOT_NEGATIVE] = 0.0
    H: Annotated[float, "s", "inertia constant", POSITIVE] = 0.5
    Mbase: Annotated[float, "MVA", "motor MVA (0: Pmult times the power)", NOT_NEGATIVE] = 0.0
    Pmult: Annotated[float, "-", "motor MVA over its power in MW", POSITIVE] = 1.25
    A: Annotated[float, "-", "share of the torque that is quadratic in speed"] = 0.0
    B: Annotated[float, "-", "share that is proportional to speed"] = 0.0
    C0: Annotated[float, "-", "constant share"] = 1.0
    D: Annotated[float, "-", "share of w^E"] = 0.0
    E: Annotated[float, "-", "exponent of the speed"] = 0.0
    kind: Annotated[int, "-", "circuit of the cages (1: beside each other, 2: behind X1)", Interval(ge=1, le=2)] = 1

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and sentence of everything the equations cannot be formed with."""
        if not any((self.A, self.B, self.C0, self.D)):
            yield "C0", "leaves the motor no load torque, since A, B and D are 0, too; give one of these shares"


class State(NamedTuple):
    """Fluxes of the cages in the frame of the network, and slip."""

    re1: Annotated[float, "pu", "flux of the first cage, real part"]
    im1: Annotated[float, "pu", "imaginary part"]
    re2: Annotated[float, "pu", "flux of the second cage, real part"]
    im2: Annotated[float, "pu", "imaginary part"]
    slip: Annotated[float, "pu", "slip"]


def from_record(kind: str, values: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of a record; saturation is refused, a trip at low voltage is told."""
    if values.pop("S1") or values.pop("S2"):
        raise ValueError("saturation (SE1, SE2) of a motor is not modeled")
    if kind.startswith("CIM5"):
        values |= {"A": 0.0, "B": 0.0, "C0": 0.0, "E": values["D"], "D": 1.0}
    trip = values.pop("VI")
    return values, [f"the trip below {trip:g} pu is not modeled."] if trip else []


def cages(slip: Any, p: Par) -> tuple[Any, Any]:
    """Currents of the cages over the voltage behind the stator, at a slip."""
    if p.R2 == 0:
        return -1 / (p.R1 / slip + 1j * p.X1), 0j
    if p.kind == 1:
        return -1 / (p.R1 / slip + 1j * p.X1), -1 / (p.R2 / slip + 1j * p.X2)
    second = p.R2 / slip + 1j * p.X2
    both = 1j * p.X1 + 1 / (slip / p.R1 + 1 / second)
    return -(1 - 1j * p.X1 / both) * slip / p.R1, -(1 - 1j * p.X1 / both) / second


def steady(slip: Any, p: Par) -> tuple[Any, Any, Any]:
    """Currents of stator and cages (pu motor) at a slip and the voltage V0."""
    one, two = cages(slip, p)
    inner = 1 / (1 / (1j * p.Xm) - one - two)
    stator = p.V0 / (p.Ra + 1j * p.Xa + inner)
    return stator, one * inner * stator, two * inner * stator


def prepare(p: Par) -> Par:
    """Parameters with the motor MVA, slip, torque and susceptance of the start.

    Raises
    ------
    EquilibriumError
        If the motor cannot draw the power of the load at its voltage.
    """
    from scipy.optimize import brentq, minimize_scalar  # a slow import

    p = p._replace(mva=p.Mbase / p.system if p.Mbase > 0 else p.Pmult * p.P0)
    if not p.mva > 0:
        raise EquilibriumError(f"A motor load needs a positive power; its load is {p.P0 * p.system:g} MW.")

    def drawn(slip: float) -> float:
        return p.V0 * steady(slip, p)[0].real * p.mva

    def torque(slip: Any) -> Any:
        stator, *_ = steady(slip, p)
        return p.V0 * stator.real - p.Ra * abs(stator) ** 2

    slips = np.geomspace(1e-6, 1, 1000)
    k = int(np.argmax(np.diff(torque(slips), append=-np.inf) < 0))  # the first peak, or slip 1
    ends = slips[max(k - 1, 0)], slips[min(k + 1, len(slips) - 1)]
    fine: Any = {"bounds": ends, "method": "bounded", "options": {"xatol": 1e-9}}
    pull_out = float(minimize_scalar(lambda slip: -torque(slip), **fine).x)
    if not drawn(1e-9) <= p.P0 <= drawn(pull_out):
        raise EquilibriumError(
            f"A motor load cannot draw {p.P0 * p.system:g} MW at {p.V0:.3f} pu: its largest power, at its breakdown "
            f"slip of {100 * pull_out:.2g} %, is {drawn(pull_out) * p.system:.4g} MW; check its Mbase and Pmult."
        )
    slip = float(brentq(lambda s: drawn(s) - p.P0, 1e-9, pull_out, xtol=1e-16, rtol=1e-14))
    rest = p.Q0 + p.V0 * steady(slip, p)[0].imag * p.mva
    return p._replace(slip=slip, T=torque(slip) / load(1 - slip, p), Bsh=rest / p.V0**2, pull_out=pull_out)


def stepped(p: Par, power: complex) -> Par:
    """The parameters with more motors of the same kind, or fewer, that draw some power (pu, system base) at V0."""
    more, own = 1 + power.real / p.P0, p.Q0 - p.Bsh * p.V0**2
    Q0 = p.Q0 + power.imag
    return p._replace(P0=p.P0 + power.real, Q0=Q0, mva=more * p.mva, Bsh=(Q0 - more * own) / p.V0**2)


@inline
def load(w, p):
    """Torque of the load over T."""
    return p.A * w * w + p.B * w + p.C0 + p.D * power(w, p.E)


@inline
def shares(p):
    """What a flux of either cage adds to the sum of the cage currents (pu)."""
    if p.R2 == 0 or p.kind == 2:
        return 1 / (p.X1 + p.Xm), 0.0
    det = p.X1 * p.X2 + p.Xm * (p.X1 + p.X2)
    return p.X2 / det, p.X1 / det


@inline
def currents(psi1, psi2, p):
    """Currents of the cages (pu) from their fluxes without the share of the stator."""
    if p.R2 == 0:
        return psi1 / (p.X1 + p.Xm), 0 * psi2
    if p.kind == 2:
        second = (psi2 - psi1) / p.X2
        return psi1 / (p.X1 + p.Xm) - second, second
    det = p.X1 * p.X2 + p.Xm * (p.X1 + p.X2)
    apart = p.Xm * (psi1 - psi2)
    return (p.X2 * psi1 + apart) / det, (p.X1 * psi2 - apart) / det


@inline
def stator(x, v, p):
    """Stator current and voltage behind X'' (pu motor), real and imaginary parts."""
    one, two = shares(p)
    er = -p.Xm * (one * x.im1 + two * x.im2)
    ei = p.Xm * (one * x.re1 + two * x.re2)
    X = p.Xa + p.Xm - p.Xm * p.Xm * (one + two)
    z2 = p.Ra * p.Ra + X * X
    dr, di = v[0] - er, v[1] - ei
    return (p.Ra * dr + X * di) / z2, (p.Ra * di - X * dr) / z2, er, ei


@inline
def current(x, v, p):
    """Current into the network (pu system), real and imaginary part."""
    ir, ii, _, _ = stator(x, v, p)
    return -p.mva * ir - p.Bsh * v[1], -p.mva * ii + p.Bsh * v[0]


@inline
def derivatives(x, v, p):
    """State derivatives (1/s)."""
    ir, ii, er, ei = stator(x, v, p)
    re1, re2 = currents(x.re1 - p.Xm * ir, x.re2 - p.Xm * ir, p)
    im1, im2 = currents(x.im1 - p.Xm * ii, x.im2 - p.Xm * ii, p)
    second = p.wb if p.R2 > 0 else 0.0
    return State(
        -p.wb * (p.R1 * re1 - x.slip * x.im1),
        -p.wb * (p.R1 * im1 + x.slip * x.re1),
        -second * (p.R2 * re2 - x.slip * x.im2),
        -second * (p.R2 * im2 + x.slip * x.re2),
        (p.T * load(1 - x.slip, p) - (er * ir + ei * ii)) / (2 * p.H),
    )


def elsewhere(p: Par) -> np.ndarray:
    """Largest eigenvalue (1/s, absolute) of the fluxes of stopped motors (arrays) at a given voltage: wb |j - rate|."""
    two, X2 = p.R2 > 0, np.where(p.R2 > 0, p.X2, 1.0)
    behind = p.Xa * p.Xm / (p.Xa + p.Xm)
    X11, X12 = p.X1 + behind, behind + np.where(p.kind == 2, p.X1, 0.0)
    det = X11 * (X12 + X2) - X12**2
    total = (p.R1 * (X12 + X2) + p.R2 * X11) / det
    rate = np.where(two, total / 2 + np.sqrt(total**2 / 4 - p.R1 * p.R2 / det), p.R1 / X11)
    return np.asarray(p.wb * np.abs(1j - rate))


def stalled(x: State, v: Any, p: Par) -> bool:
    """Whether a motor is beyond its breakdown slip and does not reaccelerate: with hardly more torque than its load."""
    ir, ii, er, ei = stator(x, v, p)
    return bool(x.slip > p.pull_out and p.T * load(1 - x.slip, p) >= 0.99 * (er * ir + ei * ii))


def guess(V: complex, p: Par) -> State:
    """States at the slip of the start."""
    turn = V / abs(V)
    _, one, two = steady(p.slip, p)
    psi1, psi2 = 1j * p.R1 * one / p.slip * turn, 1j * p.R2 * two / p.slip * turn
    return State(psi1.real, psi1.imag, psi2.real, psi2.imag, p.slip)

"""IEEET2: DC exciter with a stabilizing feedback of the regulator output (IEEE type 2, 1968).

Vt -> [1/(1+sTR)] -> (-)
Vref + Vs -----------> + -> [KA/(1+sTA)], held between VRmin and VRmax -> VR (+) -> [1/(sTE)] -> Efd
       (-) [sKF/((1+sTF1)(1+sTF2))] <- VR                                    (-) (KE + SE(Efd)) Efd

SE(Efd) Efd = B (Efd - A)^2 through (E1, SE1) and (E2, SE2); SE2 = 0 means no saturation. KE = 0 is computed at the
start: KE = VRmax/(10 Efd) - SE(Efd).
Source: IEEE Committee Report, Computer representation of excitation systems, IEEE Trans. PAS-87 (1968), type 2; PSS/E
Model Library, IEEET2.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE, POSITIVE
from stabctl.devices.blocks import SHORT, clip, derivative, field_demand, lag

from . import dc, shared
from .dc import automatic, output
from .shared import Input, Output, prepare

NAME = "IEEET2"
ROLE = "exciter"
LIMITS = {"vr": ("VRmin", "VRmax")}
DYR = {"IEEET2": "TR KA TA VRmax VRmin KE TE KF TF1 TF2 E1 SE1 E2 SE2"}
__all__ = [
    "DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "automatic", "derivatives", "from_record",
    "output", "prepare",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one exciter."""

    TR: Annotated[float, "s", "voltage transducer", NOT_NEGATIVE]
    KA: Annotated[float, "pu", "regulator gain", POSITIVE]
    TA: Annotated[float, "s", "regulator lag", NOT_NEGATIVE]
    VRmax: Annotated[float, "pu", "regulator limit"]
    VRmin: Annotated[float, "pu", "regulator limit"]
    KE: Annotated[float, "pu", "exciter constant (0: computed at the start)"]
    TE: Annotated[float, "s", "exciter time constant", Ge(1e-3)]
    KF: Annotated[float, "pu", "stabilizing feedback gain", NOT_NEGATIVE]
    TF1: Annotated[float, "s", "first feedback lag (0: no feedback)", NOT_NEGATIVE] = 1.0
    TF2: Annotated[float, "s", "second feedback lag", NOT_NEGATIVE] = 0.0
    E1: Annotated[float, "pu", "field voltage of SE1", NOT_NEGATIVE] = 3.0
    SE1: Annotated[float, "pu", "saturation at E1", NOT_NEGATIVE] = 0.0
    E2: Annotated[float, "pu", "field voltage of SE2", NOT_NEGATIVE] = 4.0
    SE2: Annotated[float, "pu", "saturation at E2 (0: unsaturated)", NOT_NEGATIVE] = 0.0
    SA: Annotated[float, "pu", "field voltage at which saturation begins, from the two points", FROM_CASE] = 0.0
    SB: Annotated[float, "1/pu", "slope of saturation, from the two points", FROM_CASE] = 0.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.KF > 0 and self.TA < SHORT:
            yield "TA", f"must be at least {SHORT:g} s with a feedback KF = {self.KF:g}"
        yield from shared.errors(self)


class State(NamedTuple):
    """Transducer, regulator, exciter and the two lags of the feedback."""

    vm: Annotated[float, "pu", "measured terminal voltage"]
    vr: Annotated[float, "pu", "regulator output"]
    efd: Annotated[float, "pu", "field voltage"]
    vf: Annotated[float, "pu", "lagged regulator output of the feedback"]
    damping: Annotated[float, "pu", "stabilizing feedback"]


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    vf, d_vf = derivative(p.KF, p.TF1, clip(x.vr, p.VRmin, p.VRmax), x.vf)
    damping, d_damping = lag(p.TF2, vf, x.damping)
    vm, d_vm = lag(p.TR, u.vt, x.vm)
    vr, d_vr = lag(p.TA, p.KA * (u.Vref - vm + u.Vs - damping), x.vr)
    d_efd = (clip(vr, p.VRmin, p.VRmax) - field_demand(x.efd, p.KE, p.SA, p.SB)) / p.TE
    return State(vm=d_vm, vr=d_vr, efd=d_efd, vf=d_vf, damping=d_damping)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected."""
    values, said = dc.computed(values)
    return Par(**values), said

"""ZIP load: constant power, constant current and constant admittance.

The current into the network is -conj(Sp/m^2 + Sc/m + Sz) V with m = max(|V|, vlow). Below vlow the load changes
continuously to a constant admittance, so that the network always has a solution. Unless the load changes during a
simulation, its constant-admittance part is in the network matrix instead (Pz = Qz = 0).
Source: Kundur, Power System Stability and Control, section 7.1.1.
"""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, magnitude

NAME = "ZIP"
ROLE = "load"


class Par(NamedTuple):
    """Parameters of one load."""

    Pp: Annotated[float, "pu", "constant power, active"]
    Qp: Annotated[float, "pu", "constant power, reactive"]
    Pc: Annotated[float, "pu", "constant current, active, at 1 pu voltage"]
    Qc: Annotated[float, "pu", "constant current, reactive, at 1 pu voltage"]
    Pz: Annotated[float, "pu", "constant admittance, active, at 1 pu voltage"]
    Qz: Annotated[float, "pu", "constant admittance, reactive, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which the load is an admittance"]


def parts(load: Any) -> tuple[complex, complex, complex]:
    """What a row of loads.csv draws in the power flow: s0 + s1 |V| + s2 |V|^2 (MVA); s0 alone if it has no voltage."""
    if not load.v:
        return complex(load.p, load.q), 0j, 0j
    power, current = (
        complex(load.p * load.p_power, load.q * load.q_power),
        complex(load.p * load.p_current, load.q * load.q_current),
    )
    return power, current / load.v, (complex(load.p, load.q) - power - current) / load.v**2


def drawn(load: Any, V: float) -> complex:
    """Power (MVA) that a row of loads.csv draws at the power-flow voltage V (pu)."""
    s0, s1, s2 = parts(load)
    return s0 + s1 * V + s2 * V * V


def from_case(load: Any, P: float, Q: float, V: float) -> Par:
    """Parameters from the shares in a row of loads.csv, for a power P + jQ (pu) at the voltage V (pu)."""
    pp, qp, pc, qc = load.p_power, load.q_power, load.p_current, load.q_current
    rest = (1 - pp - pc) * P / V**2, (1 - qp - qc) * Q / V**2
    return Par(pp * P, qp * Q, pc * P / V, qc * Q / V, *rest, load.v_low)


def draws(load: Any) -> bool:
    """Whether a row of loads.csv has a part that is not constant admittance."""
    return any((load.p_power, load.q_power, load.p_current, load.q_current))


def admittance(p: Par) -> complex:
    """Admittance of the constant-admittance part (pu)."""
    return complex(p.Pz, -p.Qz)


@inline
def current(v, p):
    """Current into the network (pu), real and imaginary part."""
    m = at_least(magnitude(v[0], v[1]), p.vlow)
    g, b = (p.Pp / m + p.Pc) / m + p.Pz, (p.Qp / m + p.Qc) / m + p.Qz
    return -(g * v[0] + b * v[1]), b * v[0] - g * v[1]

"""ZIP load: its constant-power and constant-current parts (the admittance part stands in the network matrix).

Current into the network -conj(Sp/m^2 + Sc/m) V with m = max(|V|, vlow): below vlow the load passes continuously to a
constant admittance, so that the network always has a solution.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import at_least, magnitude


class Par(NamedTuple):
    """Constants of one load."""

    Pp: Annotated[float, "pu", "constant power, active"]
    Qp: Annotated[float, "pu", "constant power, reactive"]
    Pc: Annotated[float, "pu", "constant current, active, at 1 pu voltage"]
    Qc: Annotated[float, "pu", "constant current, reactive, at 1 pu voltage"]
    vlow: Annotated[float, "pu", "voltage below which the load is an admittance"]


@inline
def output(v, p):
    """Current into the network (pu), real and imaginary part."""
    m = at_least(magnitude(v[0], v[1]), p.vlow)
    g, b = (p.Pp / m + p.Pc) / m, (p.Qp / m + p.Qc) / m
    return -(g * v[0] + b * v[1]), b * v[0] - g * v[1]

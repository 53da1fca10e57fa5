"""Power into a circuit from one of its ends, V conj(Y1 V + Y2 V2), with the two-port admittances of its pi section."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline

NAME = "line power"
ROLE = "sensor"


class Par(NamedTuple):
    """Admittances of the circuit, seen from the end where it is measured."""

    g: Annotated[float, "pu", "own conductance"]
    b: Annotated[float, "pu", "own susceptance"]
    gm: Annotated[float, "pu", "mutual conductance"]
    bm: Annotated[float, "pu", "mutual susceptance"]


class Output(NamedTuple):
    """Power into the circuit."""

    P: Annotated[float, "pu", "active power, system base"]
    Q: Annotated[float, "pu", "reactive power, system base"]


@inline
def into(v1, v2, p):
    """Current into the circuit from the end with voltage v1, real and imaginary part."""
    re = p.g * v1[0] - p.b * v1[1] + p.gm * v2[0] - p.bm * v2[1]
    return re, p.b * v1[0] + p.g * v1[1] + p.bm * v2[0] + p.gm * v2[1]


@inline
def output(v1, v2, p):
    """Power into the circuit from the end with voltage v1."""
    re, im = into(v1, v2, p)
    return Output(v1[0] * re + v1[1] * im, v1[1] * re - v1[0] * im)

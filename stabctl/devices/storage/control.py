"""REEC_C in storage, whose charge is that of the store, and which holds no power factor."""

from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.blocks import lag
from stabctl.devices.converters import electrical, reec_c
from stabctl.devices.converters.electrical import Own, curves

from .joined import Kit


class State(NamedTuple):
    """States of REEC_C in storage."""

    vm: Annotated[float, "pu", "filtered terminal voltage of REEC_C"]
    vq: Annotated[float, "pu", "integral of the reactive power error"]
    iv: Annotated[float, "pu", "integral of the voltage error"]
    iqr: Annotated[float, "pu", "lagged reactive current"]
    pord: Annotated[float, "pu", "power order"]


def kit(converter: Any, store: Any, before: Any) -> Kit:
    """The published models of a grid-following converter of storage."""
    name, parts = f"{converter.NAME} and REEC_C of storage", (converter.Par, reec_c.Par, store.Par)
    defaults = {"Pmin": -1.0, "Qmin": -1.0, "Qmax": 1.0}
    without = ("PfFlag", "Tp", "T", "SOCini", "SOCmax", "SOCmin")
    made: Kit = before.kit(Kit(name, parts, defaults, without, finite=store.FINITE))
    return made


def guess(V, p):
    """States at rest."""
    return State(abs(V), abs(V) if p.QFlag > 0 else 0.0, 0.0, 0.0, 0.0)


@inline
def commands(x, r, p):
    """Active and reactive current command (pu), and state derivatives (1/s); r is what REEC_C reads."""
    e = electrical.State(x.vm, 0 * x.vm, x.vq, x.iv, x.iqr, x.pord)
    vf, _ = lag(p.Trv, r.vt, x.vm)
    ip, iq, d = electrical.commands(e, r, p, Own(r.Pref, 0.0, vf, 0.0, -1.0, 0.0, *curves(vf, p)))
    return ip, iq, State(vm=d.vm, vq=d.vq, iv=d.iv, iqr=d.iq, pord=d.pord)

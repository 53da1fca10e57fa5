"""REPC_A between the orders of storage and REEC_C: what the storage models with a plant controller share.

share    -> (zero if full or empty) -> -rated share    -> Pset -> REPC_A -> Pref -> REEC_C
reactive -> (what P leaves of Smax) -> -rated reactive -> Qset -> REPC_A -> Qext -> REEC_C
V0 + order_v -------------------------------------------> Vset -> REPC_A

Parameters and states have the names of `repc_a` after `repc_`. It measures voltage, frequency and power at the bus of
the device. While a full or empty store blocks the power, the integral xp takes the place of P, so it returns to zero as
fast as the regulator is, and nothing has wound up when the order reverses.
Kp is by default low enough for control of reactive power too (RefFlag = 0).
Source: see `repc_a`.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple, get_type_hints

from stabctl._util.jit import inline
from stabctl.devices.blocks import available
from stabctl.devices.converters import electrical, repc_a
from stabctl.devices.ports import At, fixed

from . import joined

NAME = "REPC_A"
PREFIX = "repc_"
DEADBANDS = tuple(PREFIX + name for name in repc_a.DEADBANDS)
DEFAULTS = {"FFlag": 1.0, "Kp": 0.5, "Dup": 20.0, "Pmin": -1.0, "Qmin": -1.0, "Qmax": 1.0}


class Input(NamedTuple):
    """Signals at a device behind a converter with a plant controller."""

    order: Annotated[float, "-", "share of the rating to absorb", fixed(0.0)]
    order_q: Annotated[float, "-", "reactive power to absorb, over the power rating", fixed(0.0)]
    order_v: Annotated[float, "pu", "change of the voltage reference", fixed(0.0)]
    f: Annotated[float, "pu", "frequency of the bus", At("bus_frequency", "repc_bus")]


def prefixed(record: Any) -> Any:
    """The record with the names of its fields after `repc_`, and its defaults."""
    hints = get_type_hints(record, include_extras=True)
    made: Any = NamedTuple(record.__name__, [(PREFIX + name, hint) for name, hint in hints.items()])  # type: ignore[misc]
    made._field_defaults = {PREFIX + name: value for name, value in record._field_defaults.items()}
    made.__new__.__defaults__ = tuple(made._field_defaults.values())
    return made


Par: Any = prefixed(repc_a.Par)
State: Any = prefixed(repc_a.State)


def errors(values: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Name and message for each combination of parameters that is not possible."""
    if values["QFlag"] > values["VFlag"] and values["repc_Qmax"] <= 1:
        yield "repc_Qmax", "limits the voltage reference with QFlag=1 VFlag=0; set it above the voltage, such as 1.1"


def kit(of: joined.Kit) -> joined.Kit:
    """The published models of a storage device, and REPC_A."""
    defaults = {**of.defaults, **{PREFIX + name: value for name, value in DEFAULTS.items()}}
    own: dict[str, Any] = {
        "name": f"{NAME}, {of.name}",
        "parts": (*of.parts, Par),
        "without": (*of.without, PREFIX + "bus"),
    }
    return of._replace(defaults=defaults, errors=errors, **own)


def guess(V: complex, p: Any) -> Any:
    """States at rest; Qext is the voltage where it is a voltage reference."""
    held = abs(V) if p.QFlag > p.VFlag else 0.0
    return State(abs(V) if p.repc_RefFlag > 0 else 0.0, held, held, 0.0, 0.0, 0.0)


@inline
def parameters(p):
    """The parameters of REPC_A."""
    return repc_a.Par(
        0, p.repc_VcFlag, p.repc_RefFlag, p.repc_FFlag, p.repc_Tfltr, p.repc_Kp, p.repc_Ki, p.repc_Tft, p.repc_Tfv,
        p.repc_Vfrz, p.repc_Rc, p.repc_Xc, p.repc_Kc, p.repc_emax, p.repc_emin, p.repc_dbd1, p.repc_dbd2, p.repc_Qmax,
        p.repc_Qmin, p.repc_Kpg, p.repc_Kig, p.repc_Tp, p.repc_fdbd1, p.repc_fdbd2, p.repc_femax, p.repc_femin,
        p.repc_Pmax, p.repc_Pmin, p.repc_Tg, p.repc_Ddn, p.repc_Dup,
    )  # fmt: skip


@inline
def states(x):
    """The states of REPC_A."""
    return repc_a.State(x.repc_meas, x.repc_xq, x.repc_xf, x.repc_pf, x.repc_xp, x.repc_pg)


@inline
def references(x, u, shares, vt, P, Q, p):
    """What REEC_C reads, the references of REPC_A, and state derivatives (1/s) of REPC_A."""
    active, reactive = shares
    blocked = available(x.repc_xp, x.energy, p.floor, p.capacity) != x.repc_xp
    seen = repc_a.Input(
        p.V0 + u.order_v, -p.rated * reactive, -p.rated * active, 1.0, vt, u.f, x.repc_xp if blocked else P, Q
    )
    r, d = repc_a.equations(states(x), seen, parameters(p))
    return electrical.Input(r.Pref, r.Qext, 0 * vt, vt, P, Q), d[:]

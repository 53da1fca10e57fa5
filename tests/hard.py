"""Systems whose voltages the fixed-point iteration does not find at every stage."""

from collections.abc import Iterator
from dataclasses import replace

from systems import with_shares

import stabctl as st
from stabctl.devices.loads import cim
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.model.replicate import replicate
from stabctl.model.tables import Load

MOTOR = cim.Par(*(0,) * 11, 0.01, 0.09, 4.2, 0.035, 0.09, H=1.5, Pmult=1.5)
AWAY = 32, 34, 36, 38  # buses of `ieee39` whose machines become injections


def constant_power(case: Case) -> Case:
    """Loads of constant power above their thresholds."""
    return with_shares(case, p_power=1.0, q_power=1.0, p_current=0.0, q_current=0.0)


def mixed(copies: int = 1) -> Case:
    """`ieee39` with motors for 60 % of its loads, constant power for the rest, and four machines as injections."""
    case = constant_power(st.load("ieee39"))
    away = {m.machine: m for m in case.machines if m.bus in AWAY}
    S = dict(zip((m.machine for m in case.machines), powerflow.solve(case).S * case.base_mva, strict=True))
    loads = [load._replace(model_share=0.6) if load.p > 20 else load for load in case.loads]
    injections = [
        Load(m.bus, -S[k].real, -S[k].imag, 1.0, 1.0, v_low=0.7, id="m", kind="injection") for k, m in away.items()
    ]
    tables = {name: {k: par for k, par in table.items() if k not in away} for name, table in case.devices.items()}
    case = replace(
        case,
        buses=tuple(bus._replace(kind="pq") if bus.bus in AWAY else bus for bus in case.buses),
        machines=tuple(m for m in case.machines if m.machine not in away),
        devices={**tables, "cim": {load.bus: MOTOR for load in loads if load.p > 20}},
        loads=(*loads, *injections),
    )
    return replicate(case, copies, x=0.02, spread=0.2) if copies > 1 else case


def hard() -> Iterator[tuple[str, Case]]:
    """Names and cases."""
    yield "wscc9", st.load("wscc9")
    for name in ("two_area", "ieee39", "wnaps"):
        yield f"{name}, constant power", constant_power(st.load(name))
    yield "ieee39, motors, injections", mixed()
    yield "four of them", mixed(4)

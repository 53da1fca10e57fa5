"""Typical machines, exciters and governors for a case without dynamic data, from `typical_units.csv`.

A machine gets the unit of its kind that is nearest in rating, per unit on its own rating: a GENROU (steam, gas,
nuclear) or a GENSAL (hydro, condenser) with an EXST1 and, if it produces power, an IEESGO. Loads draw constant active
current and are a constant admittance for reactive power; generators behind converters supply constant current.
Source: Anderson and Fouad, Power System Control and Stability, 2nd ed., appendix D, see the table; for loads, IEEE Task
Force on Load Representation for Dynamic Performance, Load Representation for Dynamic Performance Analysis, IEEE
Transactions on Power Systems 8 (2), 1993.
"""

import csv
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from stabctl._util.errors import StudyError
from stabctl._util.wording import counted
from stabctl.devices.blocks import quadratic
from stabctl.devices.machines.saturation import points

from . import powerflow, tables
from .case import Case, as_case
from .loads import LOW, TYPICAL
from .tables import Load, Machine

Kind = Literal["steam", "gas", "hydro", "nuclear", "condenser", "converter"]
TABLE = Path(__file__).with_name("typical_units.csv")
SOURCE = "Anderson and Fouad, Power System Control and Stability, appendix D"
LABEL = " with typical machines"  # of the name of the case, which every output shows
POWER_FACTOR = 0.85  # of a rating computed from the power
ABSORBED = 0.3  # pu   largest reactive power absorbed, on the rating
PRODUCES = 1e-3  # MW   smallest power of a generator that is not a condenser
CEILING = 0.9  # largest field voltage, over the ceiling of the exciter at the terminal voltage
RESERVE = 0.98  # largest power, over the limit of the governor
SALIENT = ("hydro", "condenser")
_CURRENT: dict[str, float] = {"p_current": 1.0, "q_current": 1.0, "v_low": LOW["current"]}
_ROUND = "H D ra xl xd x1d x2 T1d T2d xq x1q T1q T2q S10 S12"
_SALIENT = "H D ra xl xd x1d x2 T1d T2d xq T2q S10 S12"
EXCITER = {
    **{"TR": 0.0, "VImax": 99.0, "VImin": -99.0, "TC": 0.0, "TB": 0.0},  # not used
    **{"KA": 200.0, "TA": 0.3575, "KF": 0.0529, "TF": 1.0, "VRmax": 5.73, "VRmin": -5.73},  # unit F18
}


class Known(NamedTuple):
    """What the files of a case say about a generator."""

    kind: Kind | None = None  # None: a condenser if it produces no power, otherwise steam
    mva: float = 0.0  # rating, MVA; 0: unknown


def with_typical_machines(case: Case, known: Mapping[int, Known] = MappingProxyType({})) -> Case:
    """The case with a typical machine, exciter and governor for every generator; its name and notes say so.

    A rating is that of the file or the case, raised to what the power flow needs: the machine's power, the limit of its
    governor, and a field voltage of at most 90 % of the exciter's ceiling. Generators behind converters (wind, solar,
    batteries) become constant-current injections, since converters limit their current. Constant-power loads, which a
    power flow cannot tell from others, become constant-current for active power and a constant admittance for reactive
    power.

    Parameters
    ----------
    case : Case
        A system without dynamic data.
    known : mapping of int to Known, optional
        Kind and rating of generators, by machine number.

    Raises
    ------
    StudyError
        If the case has dynamic data.
    PowerFlowError
        If its power flow, which gives the ratings, has no solution.

    Examples
    --------
    >>> list(st.read_matpower("nine.m").with_typical_machines().devices)
    ['genrou', 'exst1', 'ieesgo']
    """
    case = as_case(case)
    if any(model in case.devices for model in tables.of_role(*tables.UNIT_ROLES)):
        raise StudyError(f"{case.name} has dynamic data; typical machines are for a case without any.")
    flow = powerflow.solve(case)
    power = dict(zip((m.machine for m in case.machines), (flow.S * case.base_mva).tolist(), strict=True))
    voltage = dict(zip((b.bus for b in case.buses), abs(flow.V).tolist(), strict=True))
    swing = {b.bus for b in case.buses if b.kind == "swing"}
    kept: list[Machine] = []
    loads: list[Load] = []
    raised = 0
    devices: dict[str, dict[Any, Any]] = {model: dict(rows) for model, rows in case.devices.items()}
    for m in case.machines:
        S, about = power[m.machine], known.get(m.machine, Known(None, m.base))
        if about.kind == "converter" and m.bus not in swing:
            name = str(m.called)
            loads.append(Load(m.bus, -S.real, -S.imag, **_CURRENT, id=name, kind="injection"))
            continue
        unit, rating = _sized(about, S, voltage[m.bus])
        raised += rating > about.mva > 0
        kept.append(m._replace(base=rating, p=S.real, q=S.imag))
        for model, par in _devices(unit, S).items():
            devices.setdefault(model, {})[m.machine] = par
    at = {m.bus for m in kept}
    return replace(
        case,
        name=case.name + LABEL,
        title=f"{case.title}{LABEL}",
        source=f"{case.source}; machines: {SOURCE}",
        buses=tuple(b if b.bus in at else b._replace(kind="pq") for b in case.buses),
        machines=tuple(kept),
        loads=(*map(_load, case.loads), *(load for load in loads if load.p or load.q)),
        devices=devices,
        notes=(*_notes(case, len(kept), len(loads), raised), *case.notes),
    )


def _load(load: Load) -> Load:
    """A load of constant power as a typical one; others, and injections, as they are."""
    if load.kind != "load" or (load.p_power, load.q_power) != (1, 1):
        return load
    return load._replace(p_power=0.0, q_power=0.0, p_current=1.0, v_low=LOW["current"])


def _sized(about: Known, S: complex, V: float) -> tuple[dict[str, Any], float]:
    """The unit for a generator that supplies S (MW, Mvar) at a voltage of V (pu), and its rating (MVA)."""
    kind = about.kind if about.kind not in (None, "converter") else ("steam" if S.real > PRODUCES else "condenser")
    kind = "steam" if kind == "condenser" and S.real > PRODUCES else kind
    mva = about.mva or (abs(S) / POWER_FACTOR if abs(S) > PRODUCES else 1.0)
    units = [unit for unit in _units() if unit["kind"] == kind]
    unit = min(units, key=lambda unit: abs(math.log(unit["mva"] / mva)))
    limit = RESERVE * unit["Pmax"] if S.real > PRODUCES else 1.0
    rating = max(mva, abs(S), S.real / limit, -S.imag / ABSORBED)
    while _field(unit, S / rating, V) > CEILING * V * EXCITER["VRmax"]:
        rating *= 1.02
    return unit, rating


def _field(unit: dict[str, Any], S: complex, V: float) -> float:
    """Field voltage (pu) of a unit that supplies S (pu of its rating) at the voltage V (pu).

    With the rotor on the q axis of V + (ra + j xq) I: Efd = Vq + ra Iq + xd Id + saturation of E'q (salient) or psi''.
    """
    current = S.conjugate() / V
    q = V + complex(unit["ra"], unit["xq"]) * current
    q /= abs(q)
    flux = V + complex(unit["ra"], unit["x2"]) * current
    Id, Iq, Vq = -(current / q).imag, (current / q).real, (V / q).real
    if unit["kind"] in SALIENT:
        flux = (Vq + unit["ra"] * Iq + unit["x1d"] * Id) * q
    iron = quadratic(abs(flux), *points(unit["S10"], unit["S12"])) * (flux / q).real / abs(flux)
    return Vq + unit["ra"] * Iq + unit["xd"] * Id + iron


def _devices(unit: dict[str, Any], S: complex) -> dict[str, Any]:
    """Parameters of machine, exciter and governor by model."""
    salient = unit["kind"] in SALIENT
    names = _SALIENT if salient else _ROUND
    made = {
        "gensal" if salient else "genrou": {name: unit[name] for name in names.split()},
        "exst1": EXCITER,
    }
    if S.real > PRODUCES:
        lags = {f"T{k}": unit[f"GT{k}"] for k in range(1, 6)}
        made["ieesgo"] = {**lags, "T6": 0.0, "K1": 1 / unit["R"], "K2": 1 - unit["F"], "Pmax": unit["Pmax"]}
    return {model: tables.parameters(model, **values) for model, values in made.items()}


def _notes(case: Case, machines: int, converters: int, raised: int) -> list[str]:
    said = [
        f"{case.name}: its {machines} machines, exciters and governors are typical, chosen by rating from {SOURCE}; "
        "they are not those of the system."
    ]
    if raised:
        said.append(
            f"{case.name}: ratings raised to what the machine's power and field voltage need: "
            f"{counted(raised, 'machine')}."
        )
    if converters:
        said.append(f"{case.name}: constant-current injections behind converters: {counted(converters, 'generator')}.")
    typical = sum(_load(load) != load for load in case.loads)
    if typical:
        said.append(
            f"{case.name}: {counted(typical, 'load')} of constant power in the power flow: {TYPICAL}; "
            "--loads power keeps the power constant."
        )
    return said


@cache
def _units() -> tuple[dict[str, Any], ...]:
    """The rows of the table, numbers as numbers; what a unit does not have is 0."""
    with TABLE.open(newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return tuple(
            {key: text if key in ("unit", "kind") else float(text or 0) for key, text in row.items()} for row in rows
        )

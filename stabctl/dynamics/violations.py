"""Limits that an equilibrium found without limits exceeds."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stabctl._util.schema import fields
from stabctl.model.case import Case

from . import family
from .assembly import System
from .family import limits
from .jacobian import Equations
from .newton import opened

STILL = 1e-8  # 1/s   largest rate of an equilibrium
SLACK = 1e-9  # pu   of a state at its limit, above the accuracy of the power flow and the initialization


class Violation(NamedTuple):
    """A limit that is exceeded at the start.

    Attributes
    ----------
    device : str
        Name of the model.
    table : str
        Its table.
    owner : str
        What the device belongs to: machine 3.
    unit : int
        Row of the machine; -1 if there is none.
    limit : str
        Parameter, or the state if its limit is a number; empty if the unit is not at rest for another reason.
    value : float
        The limit; NaN if there is none.
    needed : float
        What the power flow needs of the limited state; NaN if the limit is not one of a state.
    suffix : str
        The unit of the limit after a space; empty if it has none.
    low : bool
        Whether it is a lower limit.
    parameter : bool
        Whether the limit is a parameter, and not a number in the model or computed from parameters.
    """

    device: str
    table: str
    owner: str
    unit: int
    limit: str
    value: float
    needed: float = np.nan
    suffix: str = " pu"
    low: bool = False
    parameter: bool = True

    def sentence(self, case: Case) -> str:
        """What is exceeded, and what to do about it."""
        if not self.device:
            return f"{self.owner} of {case.name} is not in equilibrium at the power flow; check its data."
        start = f"{self.device} of {self.owner} cannot be initialized: "
        what = f", but the power flow needs {self.needed:.4g}{self.suffix}"
        if not self.parameter:
            side = "least" if self.low else "most"
            text = f"its {self.limit} must be at {side} {self.value:g}{self.suffix}{what}"
            return f"{start}{text}; check its parameters and the power there."
        what = what if np.isfinite(self.needed) else " is exceeded at the power flow"
        limit, widened = f"{self.limit} = {self.value:g}{self.suffix}", widen(case, self.table, self.unit, self.limit)
        return f"{start}{limit}{what}; {widened} or change the power or voltage there."


def widen(case: Case, table: str, unit: int, limit: str) -> str:
    """How to widen a limit: in a table of the case, and for a device of a machine also with an option."""
    option = f" (--set {table}.{case.machines[unit].machine}.{limit}=...)" if unit >= 0 else ""
    return f"widen {limit} in {table}.csv{option}"


def find(case: Case, system: System, equations: Equations, s: np.ndarray) -> Iterator[Violation]:
    """The limits that are exceeded, those of states first.

    Parameters
    ----------
    case
        The case, for the names of machines.
    system, equations
        Its devices.
    s
        All signals (layout.size) of an equilibrium without limits.
    """
    of_states = list(_of_states(system, s))
    found, beyond = {(one.table, one.owner, one.limit) for one in of_states}, {one.unit for one in of_states}
    yield from of_states
    rates = np.abs(equations.entries(s)[1][: system.layout.nx])
    moving = np.flatnonzero(~(rates < STILL))
    units = list(dict.fromkeys(system.layout.states[i].unit for i in moving[np.argsort(-rates[moving])]))
    if not units:
        return
    alone = list(_of_units(system, equations, s))
    for unit in units:
        own = [one for one in alone if one.unit == unit]
        yield from (one for one in own if (one.table, one.owner, one.limit) not in found)
        if not own and unit not in beyond:
            name = f"Machine {case.machines[unit].called}" if unit >= 0 else "A device"
            yield Violation("", "", name, unit, "", np.nan)


def within(system: System, s: np.ndarray) -> np.ndarray:
    """The signals with every limited state moved to within its limits."""
    lim = limits(system.families, system.layout.one)
    made = s.copy()
    made[lim.state] = np.clip(s[lim.state], lim.low * s[lim.scale], lim.high * s[lim.scale])
    return made


def _of_states(system: System, s: np.ndarray) -> Iterator[Violation]:
    """States beyond their limits."""
    lim = limits(system.families, system.layout.one)
    value, per = s[lim.state], s[lim.scale]
    for k in np.flatnonzero((value < lim.low * per - SLACK) | (value > lim.high * per + SLACK)):
        high = bool(value[k] > lim.high[k] * per[k])
        state = system.layout.states[lim.state[k]]
        limit, name = (lim.high if high else lim.low)[k], lim.names[k][int(high)]
        f = system.family(state.table)
        fixed = name not in fields(f.device.Par)
        yield Violation(
            f.device.name,
            f.name,
            f.keys[state.row],
            state.unit,
            state.name if fixed else str(name),
            float(limit),
            float(value[k] / per[k]),
            family.suffix(f.device.State if fixed else f.device.Par, state.name if fixed else str(name)),
            not high,
            not fixed,
        )


def _of_units(system: System, equations: Equations, s: np.ndarray) -> Iterator[Violation]:
    """The limits that prevent equilibrium of a unit when each alone is enforced, at all units at once."""
    free, of_state = [opened(f) for f in equations.families], np.array([p.unit for p in system.layout.states], int)
    for i, f in enumerate(equations.families):
        for c, name, side in family.given_limits(f.device):
            trial = free.copy()
            trial[i] = free[i].copy()
            trial[i][:, c] = f.k[:, c]
            values = equations.entries(s.copy(), np.concatenate([k.ravel() for k in trial]))[1]
            moved = set(of_state[~(np.abs(values[: system.layout.nx]) < STILL)].tolist())
            for j, unit in enumerate(f.w[:, family.UNIT].tolist()):
                if unit in moved:
                    suffix = family.suffix(f.device.Par, name)
                    value = float(f.k[j, c])
                    yield Violation(f.device.name, f.name, f.keys[j], unit, name, value, np.nan, suffix, side < 0)

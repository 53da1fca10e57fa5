"""Checks of an initialization, with the limits in place."""

import numpy as np

from stabctl.errors import EquilibriumError
from stabctl.model.case import Case

from . import family
from .assembly import System
from .jacobian import Equations
from .limits import limits
from .newton import opened

STILL = 1e-8  # largest rate (1/s)


def check(case: Case, system: System, equations: Equations, s: np.ndarray) -> None:
    """Check that no rotor is reversed, that states are within their limits, and that no active limit moves anything.

    Parameters
    ----------
    case
        The case, for the names in messages.
    system, equations
        Its devices.
    s
        All signals (layout.size) of an equilibrium without limits.

    Raises
    ------
    EquilibriumError
        If a check fails; names device, machine and limit.
    """
    _upright(case, system, s)
    _inside(system, s)
    values = equations.entries(s)[1]
    _no_current(system, equations, values)
    rates = values[: system.layout.nx]
    if np.abs(rates).max(initial=0.0) >= STILL:
        worst = system.layout.states[int(np.abs(rates).argmax())]
        raise EquilibriumError(_binding(case, system, equations, s, worst.unit))


def _upright(case: Case, system: System, s: np.ndarray) -> None:
    rotors, V = system.rotors, s[system.layout.voltages].view(complex)
    angle = np.angle(V[system.unit_bus[rotors.unit]])
    reversed_ = np.flatnonzero(np.cos(s[rotors.angle] - angle) < -0.5)
    if len(reversed_):
        number = case.machines[rotors.unit[reversed_[0]]].called
        raise EquilibriumError(
            f"Machine {number} of {case.name} initializes with a reversed rotor; check its reactances."
        )


def _inside(system: System, s: np.ndarray) -> None:
    lim = limits(system.families, system.layout.one)
    value, per = s[lim.state], s[lim.scale]
    for k in np.flatnonzero((value < lim.low * per - 1e-12) | (value > lim.high * per + 1e-12)):
        above = value[k] > lim.high[k] * per[k]
        state = system.layout.states[lim.state[k]]
        what = f", but the power flow needs {value[k] / per[k]:.4g} pu"
        limit, name = (lim.high if above else lim.low)[k], lim.names[k][int(above)]
        if isinstance(name, float):
            f = system.family(state.table)
            raise EquilibriumError(
                f"{f.device.NAME} of {f.keys[state.row]} cannot be initialized: its {state.name} must be at "
                f"{'most' if above else 'least'} {name:g} pu{what}; check its parameters and the power there."
            )
        raise EquilibriumError(_beyond(system, state.table, state.row, name, limit, what))


def _no_current(system: System, equations: Equations, values: np.ndarray) -> None:
    """Check that shunts and storage devices draw no current at the power flow, which does not include them."""
    first = system.layout.nx + system.layout.outputs
    for f in equations.families:
        part = equations.injections[f.name]
        if f.device.ROLE not in ("shunt", "storage") or part.start == part.stop:
            continue
        size = np.abs(values[first + 2 * part.start : first + 2 * part.stop].view(complex))
        if size.max() > STILL:
            j = int(size.argmax())
            raise EquilibriumError(
                f"{f.device.NAME} of {f.keys[j]} draws {size[j]:.3g} pu of current at the power flow, which does not "
                "include it; its current must be zero initially."
            )


def _binding(case: Case, system: System, equations: Equations, s: np.ndarray, unit: int) -> str:
    """Find the limit of a unit's devices that prevents equilibrium when it alone is enforced."""
    free = [opened(f) for f in equations.families]
    for i, f in enumerate(equations.families):
        for j in np.flatnonzero(f.w[:, family.UNIT] == unit):
            for c, name in enumerate(family.fields(f.device, "Par")):
                if not family.side(f.device, name):
                    continue
                trial = [k.copy() for k in free]
                trial[i][j, c] = f.k[j, c]
                _, values = equations.entries(s.copy(), np.concatenate([k.ravel() for k in trial]))
                if np.abs(values[: system.layout.nx]).max() >= STILL:
                    return _beyond(system, f.name, int(j), name, f.k[j, c], " is exceeded at the power flow")
    if unit < 0:
        return f"A device of {case.name} is not in equilibrium at the power flow; check its data."
    number = case.machines[unit].called
    return f"Machine {number} of {case.name} is not in equilibrium at the power flow; check its data."


def _beyond(system: System, table: str, row: int, name: str, limit: float, what: str) -> str:
    f = system.family(table)
    return (
        f"{f.device.NAME} of {f.keys[row]} cannot be initialized: {name} = {limit:g} pu{what}; widen {name} in "
        f"{table}.csv or change the power or voltage there."
    )

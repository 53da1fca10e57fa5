"""Initialization: states and set-points at which every device is in equilibrium at its power-flow power.

Newton's method is applied to the equations that are simulated. Devices are coupled only through the network, whose
voltages are known here, so the Jacobian separates into one small block per unit.
"""

from typing import NamedTuple

import numpy as np

from stabctl.errors import EquilibriumError
from stabctl.model.case import Case

from . import automatic, family, start_checks
from .assembly import System
from .jacobian import Equations
from .newton import Newton, Unsolved


class Start(NamedTuple):
    """Result of the initialization."""

    system: System  # with the parameters that depend on the starting point
    equations: Equations  # of this system
    s: np.ndarray
    iterations: int
    fastest: float  # 1/s   largest eigenvalue of a unit with its controls at given voltage, or of a device
    stiffest: int  # the state that takes part most in it; -1: none


def start(case: Case, system: System, equations: Equations, V: np.ndarray, current: np.ndarray) -> Start:
    """The equilibrium of a system at its power flow, without limits.

    Parameters
    ----------
    case
        The case, for the names in messages.
    system, equations
        Its devices.
    V
        Bus voltages (buses), complex, pu.
    current
        Current out of every unit (units), complex, pu on the system base.

    Raises
    ------
    EquilibriumError
        If there is none; names device and machine.
    """
    layout = system.layout
    s = np.zeros(layout.size)
    s[layout.voltages] = V.view(float)
    s[layout.one] = 1.0
    s[layout.first_setpoint : layout.step] = [1.0 if p.start is None else p.start for p in layout.setpoints]
    _guess(system, V, current, s)
    _within_limits(system, equations, s)
    iterations, fastest, stiffest = _solve(case, system, equations, V, current, s)
    completed = automatic.completed(system, s)
    if completed is not system:
        system, equations = completed, Equations(completed)
        more, fastest, stiffest = _solve(case, system, equations, V, current, s)
        iterations += more
    start_checks.check(case, system, equations, s)
    return Start(system, equations, s, iterations, fastest, stiffest)


def _solve(
    case: Case, system: System, equations: Equations, V: np.ndarray, current: np.ndarray, s: np.ndarray
) -> tuple[int, float, int]:
    """Solve for the equilibrium, from and to `s`: Newton steps, the largest eigenvalue, and its main state."""
    newton = Newton(system, equations, V, current, case.base_mva)
    try:
        return newton.solve(s)
    except Unsolved as error:
        what, check = _unsolved(case, system, newton, error.row)
        raise EquilibriumError(f"{what} after {error}; check {check}.") from None


def _guess(system: System, V: np.ndarray, current: np.ndarray, s: np.ndarray) -> None:
    """Initial guess of the states: from the `guess` of each device, otherwise 1."""
    layout = system.layout
    s[: layout.nx] = 1.0
    for f in system.families:
        if f.device.guess is None:
            continue
        relative = "I" in f.device.arguments("guess")
        for w, k in zip(f.w, f.k, strict=True):
            par, unit, bus = f.device.Par(*k), w[family.UNIT], (w[family.BUS] - layout.nx) // 2
            own = current[unit] / getattr(par, "mva", 1.0) if unit >= 0 and relative else 0j
            known = {"V": V[bus], "I": own, "p": par}
            states = f.device.evaluate("guess", known)
            s[w[family.STATE] : w[family.STATE] + len(states)] = states


def _within_limits(system: System, equations: Equations, s: np.ndarray) -> None:
    """Clip states to their limits, where bypassed states remain."""
    lim = system.limits
    fixed = lim.scale == system.layout.one
    s[lim.state[fixed]] = np.clip(s[lim.state[fixed]], lim.low[fixed], lim.high[fixed])
    if not fixed.all():
        equations.entries(s)
        moving = ~fixed
        per = s[lim.scale[moving]]
        s[lim.state[moving]] = np.clip(1.0, lim.low[moving], lim.high[moving]) * per


def _unsolved(case: Case, system: System, newton: Newton, row: int) -> tuple[str, str]:
    """The device that an equation belongs to, and what to check there."""
    layout = system.layout
    if row < layout.nx:
        unit, name = layout.states[row].unit, layout.states[row].label
    else:
        unit, name = newton.owners[(row - layout.nx - layout.outputs) // 2]
    if unit < 0:
        what = f"{name} of {case.name} has no equilibrium with zero current"
        return what, "its data: the power flow does not include it"
    what = f"Machine {case.machines[unit].called} of {case.name} has no equilibrium at its power-flow power"
    return what, "its reactances, its saturation and its dispatch"

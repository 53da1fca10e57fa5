"""Initialization: states and set-points at which every device is in equilibrium at its power-flow power.

Newton's method solves the equations that are simulated, at the known voltages of the power flow; see `newton`. If
devices have parameters that depend on the starting point, they are solved again with these.
"""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from stabctl._util.errors import EquilibriumError
from stabctl.devices.loads import zip_load
from stabctl.model.case import Case

from . import family
from .assembly import System
from .family import Family
from .jacobian import Equations
from .newton import Newton, Unsolved

ACTIVE, REACTIVE = ("Pref", "Pset"), ("Qext", "Qset", "Qref")  # set-points that start at the power of the unit
LEAST = 1e-8  # pu on 100 MVA   current that counts
POWER = 1e-6  # MVA, or of the power of a load: what counts


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
        If there is none, a rotor is reversed there, a load does not draw its power, or a device outside the power flow
        draws current; names device and machine.
    """
    layout = system.layout
    s = np.zeros(layout.size)
    s[layout.voltages] = V.view(float)
    s[layout.one] = 1.0
    s[layout.first_setpoint : layout.step] = [1.0 if p.start is None else p.start for p in layout.setpoints]
    own = current * case.base_mva / np.array([m.base for m in case.machines])
    _set_points(system, V, own, s)
    _guess(system, V, own, s)
    _within_limits(system, equations, s)
    iterations, fastest, stiffest = _solve(case, system, equations, V, current, s)
    completed = _with_automatic(system, s)
    if completed is not system:
        system, equations = completed, Equations(completed)
        more, fastest, stiffest = _solve(case, system, equations, V, current, s)
        iterations += more
    _upright(case, system, s)
    injected = _injected(system, equations, s)
    _no_current(system, injected, s, LEAST * 100 / case.base_mva)
    _power_of_loads(case, system, injected, s)
    return Start(system, equations, s, iterations, fastest, stiffest)


def _set_points(system: System, V: np.ndarray, current: np.ndarray, s: np.ndarray) -> None:
    """Initial set-points of power: those of the power flow, where they remain if nothing reads them."""
    layout = system.layout
    for k, one in enumerate(layout.setpoints):
        if one.start is None and one.unit >= 0 and one.name in ACTIVE + REACTIVE:
            S = V[system.unit_bus[one.unit]] * current[one.unit].conjugate()
            s[layout.first_setpoint + k] = S.real if one.name in ACTIVE else S.imag


def _guess(system: System, V: np.ndarray, current: np.ndarray, s: np.ndarray) -> None:
    """Initial guess of the states: from the `guess` of each device, otherwise 1; currents are on the base of a unit."""
    layout = system.layout
    s[: layout.nx] = 1.0
    for f in system.families:
        if f.device.guess is None:
            continue
        for w, k in zip(f.w, f.k, strict=True):
            par, unit, bus = f.device.Par(*k), w[family.UNIT], (w[family.BUS] - layout.nx) // 2
            known = {"V": V[bus], "I": current[unit] if unit >= 0 else 0j, "p": par}
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


def _solve(
    case: Case, system: System, equations: Equations, V: np.ndarray, current: np.ndarray, s: np.ndarray
) -> tuple[int, float, int]:
    """Solve for the equilibrium, from and to `s`: Newton steps, the largest eigenvalue, and its main state."""
    newton = Newton(system, equations, V, current, case.base_mva)
    try:
        return newton.solve(s)
    except Unsolved as error:
        what, data = _unsolved(case, system, newton, error.row)
        raise EquilibriumError(f"{what} after {error}; check {data}.") from None


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
    if any(f.device.role == "converter" and unit in f.w[:, family.UNIT] for f in system.families):
        return what, "its dispatch, and the flags, gains and current curves of its controls"
    return what, "its reactances, its saturation and its dispatch"


def _with_automatic(system: System, s: np.ndarray) -> System:
    """The system with the parameters that devices compute from its starting point; the same object if there are none.

    The signals `s` are those of an equilibrium with the parameters as given.
    """
    for f in system.families:
        if f.device.automatic is None:
            continue
        k = automatic(f, s)
        if not np.array_equal(k, f.k):
            system = system.with_constants(f.name, k)
    return system


def automatic(f: Family, s: np.ndarray) -> np.ndarray:
    """Parameters of the devices of a family, with those computed from the starting point s."""
    return f.k if f.device.automatic is None else np.array([_automatic(f, j, s) for j in range(len(f.w))])


def _automatic(f: Family, j: int, s: np.ndarray) -> list[float]:
    """Parameters of one device, with those computed from its inputs and output at the starting point."""
    w, device = f.w[j], f.device
    inputs, outputs = device.Input._fields, device.Output._fields
    known = {
        "p": device.Par(*f.k[j]),
        "u": SimpleNamespace(**dict(zip(inputs, s[w[family.INPUTS : family.INPUTS + len(inputs)]], strict=True))),
        "y": SimpleNamespace(**dict(zip(outputs, s[w[-1] : w[-1] + len(outputs)], strict=True))),
    }
    return list(device.evaluate("automatic", known))


def _upright(case: Case, system: System, s: np.ndarray) -> None:
    """Check that no rotor is reversed."""
    rotors, V = system.rotors, s[system.layout.voltages].view(complex)
    angle = np.angle(V[system.unit_bus[rotors.unit]])
    reversed_ = np.flatnonzero(np.cos(s[rotors.angle] - angle) < -0.5)
    if len(reversed_):
        number = case.machines[rotors.unit[reversed_[0]]].called
        raise EquilibriumError(
            f"Machine {number} of {case.name} starts with a reversed rotor; check its power, rating and reactances."
        )


def _injected(system: System, equations: Equations, s: np.ndarray) -> list[tuple[Family, np.ndarray, np.ndarray]]:
    """The loads, shunts and storage devices, with the rows of their buses and their currents (pu) into these."""
    first, values = system.layout.nx + system.layout.outputs, equations.entries(s)[1]
    found = []
    for f in equations.families:
        part = equations.injections[f.name]
        if f.device.role in ("load", "shunt", "storage") and part.start < part.stop:
            current = values[first + 2 * part.start : first + 2 * part.stop].view(complex)
            found.append((f, (f.w[:, family.BUS] - system.layout.nx) // 2, current))
    return found


def _no_current(
    system: System, injected: list[tuple[Family, np.ndarray, np.ndarray]], s: np.ndarray, least: float
) -> None:
    """Check that shunts and storage devices draw no current (pu) at the power flow, which does not include them."""
    V = s[system.layout.voltages].view(complex)
    for f, bus, drawn in injected:
        if f.device.role == "load":
            continue
        size = np.abs(drawn - f.device.admittances(f.k) * V[bus])
        if size.max() > least:
            j = int(size.argmax())
            raise EquilibriumError(
                f"{f.device.name} of {f.keys[j]} draws {size[j]:.3g} pu of current at the power flow, which does not "
                "include it; its current must be zero initially."
            )


def _power_of_loads(
    case: Case, system: System, injected: list[tuple[Family, np.ndarray, np.ndarray]], s: np.ndarray
) -> None:
    """Check that the loads of every bus with a load model together draw their power of the power flow."""
    V = s[system.layout.voltages].view(complex)
    current = -system.fixed * V
    of_loads = [one for one in injected if one[0].device.role == "load"]
    models = {k: f.device.name for f, bus, _ in of_loads if f.name != "zip_load" for k in bus.tolist()}
    if not models:
        return
    for _, bus, more in of_loads:
        np.add.at(current, bus, more)
    wanted, drawn = np.zeros(len(V), complex), -case.base_mva * V * current.conj()
    for load in case.loads:
        k = case.row_of_bus[load.bus]
        wanted[k] += zip_load.drawn(load, abs(V[k]))
    for k, model in models.items():
        if not abs(drawn[k] - wanted[k]) < POWER * max(1.0, abs(wanted[k])):
            raise EquilibriumError(
                f"With the model {model}, the loads at bus {case.buses[k].bus} of {case.name} draw "
                f"{drawn[k].real:.5g} MW and {drawn[k].imag:.5g} Mvar at the power flow instead of "
                f"{wanted[k].real:.5g} MW and {wanted[k].imag:.5g} Mvar; the current into the bus must be that of "
                "-(P0 + jQ0) at V0."
            )

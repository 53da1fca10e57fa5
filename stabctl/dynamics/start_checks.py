"""Checks of an initialization."""

import numpy as np

from stabctl.errors import EquilibriumError
from stabctl.model.case import Case

from . import family
from .assembly import System
from .jacobian import Equations

LEAST = 1e-8  # pu on 100 MVA   current that counts


def check(case: Case, system: System, equations: Equations, s: np.ndarray) -> None:
    """Check that no rotor is reversed, and that devices outside the power flow draw no current.

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
        If a check fails; names device and machine.
    """
    _upright(case, system, s)
    _no_current(system, equations, s, LEAST * 100 / case.base_mva)


def _upright(case: Case, system: System, s: np.ndarray) -> None:
    rotors, V = system.rotors, s[system.layout.voltages].view(complex)
    angle = np.angle(V[system.unit_bus[rotors.unit]])
    reversed_ = np.flatnonzero(np.cos(s[rotors.angle] - angle) < -0.5)
    if len(reversed_):
        number = case.machines[rotors.unit[reversed_[0]]].called
        raise EquilibriumError(
            f"Machine {number} of {case.name} initializes with a reversed rotor; check its reactances."
        )


def _no_current(system: System, equations: Equations, s: np.ndarray, least: float) -> None:
    """Check that shunts and storage devices draw no current (pu) at the power flow, which does not include them."""
    first, values = system.layout.nx + system.layout.outputs, equations.entries(s)[1]
    for f in equations.families:
        part = equations.injections[f.name]
        if f.device.role not in ("shunt", "storage") or part.start == part.stop:
            continue
        drawn = values[first + 2 * part.start : first + 2 * part.stop].view(complex)
        if f.device.admittance is not None:
            drawn = drawn - f.device.admittances(f.k) * s[f.w[:, [family.BUS]] + np.arange(2)].view(complex)[:, 0]
        size = np.abs(drawn)
        if size.max() > least:
            j = int(size.argmax())
            raise EquilibriumError(
                f"{f.device.name} of {f.keys[j]} draws {size[j]:.3g} pu of current at the power flow, which does not "
                "include it; its current must be zero initially."
            )

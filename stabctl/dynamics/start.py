"""Initialization: states and set-points at which every device is in equilibrium at its power-flow power.

One Newton iteration on the very equations that are simulated. Devices meet only through the network, whose voltages are
known here, so the Jacobian falls into one small block per unit.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from stabctl.errors import EquilibriumError
from stabctl.model.case import Case

from . import family, groups
from .assembly import System
from .jacobian import Derivatives, Equations
from .limits import limits
from .program import Family

TOLERANCE = 1e-11  # largest residual, 1/s and pu
ROUNDOFF = 1e-15  # the same over the largest slope of its equation: a fast block cannot come closer
STILL = 1e-8  # largest rate (1/s) with the limits in place
FAR = 1e9  # value of an opened limit


class Start(NamedTuple):
    """Result of the initialization."""

    s: np.ndarray
    iterations: int
    fastest: float  # 1/s   largest eigenvalue of a unit with its controls at given voltage, or of a device


def start(case: Case, system: System, equations: Equations, V: np.ndarray, current: np.ndarray) -> Start:
    """The equilibrium of a system at its power flow.

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
        If there is none; names device, machine and limit.
    """
    layout = system.layout
    s = np.zeros(layout.size)
    s[layout.voltages] = V.view(float)
    s[layout.one] = 1.0
    s[layout.first_setpoint : layout.step] = [1.0 if p.start is None else p.start for p in layout.setpoints]
    _guess(system, V, current, s)
    lim = system.limits
    fixed = lim.scale == layout.one  # a bypassed state stays where it is, within its limits
    s[lim.state[fixed]] = np.clip(s[lim.state[fixed]], lim.low[fixed], lim.high[fixed])
    newton = _Newton(case, system, equations, V, current)
    newton.clip_moving(s)
    iterations, J = 0, sp.csr_matrix((0, 0))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0) if newton.eased(0.0) is not None else (1.0,):
        made, J = newton.solve(s, newton.constants(share))
        iterations += made
    fastest = groups.fastest(J[: layout.nx, : layout.nx])
    newton.check(s)
    return Start(s, iterations, fastest)


def _guess(system: System, V: np.ndarray, current: np.ndarray, s: np.ndarray) -> None:
    """States to start from: what each device's `guess` says, else 1."""
    layout = system.layout
    s[: layout.nx] = 1.0
    for f in system.families:
        if not hasattr(f.device, "guess"):
            continue
        names = family.arguments(f.device, "guess")
        for w, k in zip(f.w, f.k, strict=True):
            par, unit, bus = f.device.Par(*k), w[family.UNIT], (w[family.BUS] - layout.nx) // 2
            own = current[unit] / getattr(par, "mva", 1.0) if unit >= 0 else 0j
            given = {"V": V[bus], "I": own, "p": par}
            states = f.device.guess(*(given[n] for n in names))
            s[w[family.STATE] : w[family.STATE] + len(states)] = states


def opened(f: Family) -> np.ndarray:
    """Constants with every limit out of reach and every rotor circuit closed."""
    k, names = f.k.copy(), family.fields(f.device, "Par")
    for i, name in enumerate(names):
        if side := family.side(f.device, name):
            k[:, i] = side * FAR
        elif name in getattr(f.device, "CLOSED", ()):
            k[:, i] = np.where(k[:, i] > 0, k[:, i], 1.0)
    return k


class _Newton:
    """The iteration, and the checks of what it found."""

    def __init__(self, case: Case, system: System, equations: Equations, V: np.ndarray, current: np.ndarray) -> None:
        self.case, self.system, self.equations, self.V = case, system, equations, V
        layout = system.layout
        free = [k for k, p in enumerate(layout.setpoints) if p.start is None]
        self.unknown = np.r_[np.arange(layout.nx), layout.first_setpoint + np.array(free, int)].astype(int)
        rows, target = [], []
        for f in system.families:
            part = equations.injections.get(f.name)
            if part is None or f.device.ROLE not in ("machine", "converter"):
                continue
            unit = f.w[:, family.UNIT]
            rows.append(np.arange(part.start, part.stop))
            own = current[unit]
            if hasattr(f.device, "admittance"):
                g, b = f.device.admittance(f.device.Par(*f.k.T))
                own = own + (g + 1j * b) * V[system.unit_bus[unit]]
            target.append(own)
        self.rows = np.concatenate(rows) if rows else np.zeros(0, int)
        self.target = np.concatenate(target).view(float) if target else np.zeros(0)
        self.pairs = (2 * self.rows[:, None] + np.arange(2)).ravel()

    def constants(self, share: float) -> np.ndarray:
        """All constants, limits open, with a share of what comes in gradually (saturation)."""
        eased = self.eased(share)
        return np.concatenate([k.ravel() for k in (eased or [opened(f) for f in self._live()])])

    def _live(self) -> list[Family]:
        return [f for f in self.system.families if len(f.w) and not hasattr(f.device, "step")]

    def eased(self, share: float) -> list[np.ndarray] | None:
        """The opened constants of every family with a share of those it lists in EASED; None where all are zero."""
        out, any_of = [], False
        for f in self._live():
            k = opened(f)
            for name in getattr(f.device, "EASED", ()):
                i = f.device.Par._fields.index(name)
                any_of |= bool(k[:, i].any())
                k[:, i] *= share
            out.append(k)
        return out if any_of else None

    def clip_moving(self, s: np.ndarray) -> None:
        """Bring states within limits that move with a signal (a terminal voltage), which is worked out first."""
        lim = self.system.limits
        moving = lim.scale != self.system.layout.one
        if moving.any():
            self.equations.at(s)
            per = s[lim.scale[moving]]
            s[lim.state[moving]] = np.clip(1.0, lim.low[moving], lim.high[moving]) * per

    def residual(self, d: Derivatives) -> np.ndarray:
        """State rates (1/s), then the mismatch of the units' currents (pu)."""
        return np.r_[d.rates, d.injections.view(float)[self.pairs] - self.target]

    def solve(self, s: np.ndarray, k: np.ndarray, limit: int = 30) -> tuple[int, sp.csr_matrix]:
        """Bring the residual to zero; steps made, and the last Jacobian."""
        for iteration in range(limit + 1):
            d = self.equations.at(s, k)
            f = self.residual(d)
            J = sp.vstack([d.of_rates, d.of_injections[self.pairs]], format="csr")[:, self.unknown]
            if not np.isfinite(f).all():
                break
            slope = np.maximum(abs(J).max(axis=1).toarray().ravel(), 1.0) if J.nnz else np.ones(len(f))
            done = (np.abs(f) < TOLERANCE) | (np.abs(f) / slope < ROUNDOFF)
            if done.all():
                return iteration, J
            s[self.unknown] -= groups.solve(J, f)
        worst = int(np.argmax(np.where(np.isfinite(f), np.abs(f), np.inf)))
        raise EquilibriumError(
            f"{self._named(worst)} of {self.case.name} has no equilibrium at its power-flow power after {limit} Newton "
            f"steps (residual {abs(f[worst]):.1e}); check its reactances, its saturation and its dispatch."
        )

    def _named(self, row: int) -> str:
        layout = self.system.layout
        if row < layout.nx:
            place = layout.states[row]
            return f"Machine {self.case.machines[place.unit].machine}" if place.unit >= 0 else place.label
        unit = np.concatenate([f.w[:, family.UNIT] for f in self._live() if f.device.ROLE in ("machine", "converter")])
        return f"Machine {self.case.machines[unit[(row - layout.nx) // 2]].machine}"

    def check(self, s: np.ndarray) -> None:
        """Every rotor upright, every state within its limits, nothing moved by a limit that binds."""
        system, layout = self.system, self.system.layout
        for unit, angle in zip(system.rotors.unit, system.rotors.angle, strict=True):
            if np.cos(s[angle] - np.angle(self.V[system.unit_bus[unit]])) < -0.5:
                number = self.case.machines[unit].machine
                raise EquilibriumError(
                    f"Machine {number} of {self.case.name} initializes with a reversed rotor; check its reactances."
                )
        lim = limits(system.families, layout.one)
        for k, place in enumerate(lim.state):
            value, per = s[place], s[lim.scale[k]]
            low, high = lim.low[k], lim.high[k]
            if not low * per - 1e-12 <= value <= high * per + 1e-12:
                above = value > high * per
                state = layout.states[place]
                what = f", but the power flow needs {value / per:.4g} pu"
                limit, name = (high if above else low), lim.names[k][int(above)]
                raise EquilibriumError(self._beyond(state.table, state.row, name, limit, what))
        rates = self.equations.at(s).rates
        if np.abs(rates).max(initial=0.0) < STILL:
            return
        worst = layout.states[int(np.abs(rates).argmax())]
        raise EquilibriumError(self._binding(s, worst.unit))

    def _binding(self, s: np.ndarray, unit: int) -> str:
        """The limit of a unit's devices that alone, when enforced, prevents equilibrium."""
        free = [opened(f) for f in self._live()]
        for i, f in enumerate(self._live()):
            names = family.fields(f.device, "Par")
            for j in np.flatnonzero(f.w[:, family.UNIT] == unit):
                for c, name in enumerate(names):
                    if not family.side(f.device, name):
                        continue
                    trial = [k.copy() for k in free]
                    trial[i][j, c] = f.k[j, c]
                    rates = self.equations.at(s.copy(), np.concatenate([k.ravel() for k in trial])).rates
                    if np.abs(rates).max() >= STILL:
                        return self._beyond(f.name, int(j), name, f.k[j, c], " is exceeded at the power flow")
        if unit < 0:
            return f"A device of {self.case.name} is not in equilibrium at the power flow; check its data."
        number = self.case.machines[unit].machine
        return f"Machine {number} of {self.case.name} is not in equilibrium at the power flow; check its data."

    def _beyond(self, table: str, row: int, name: str, limit: float, what: str) -> str:
        f = self.system.family(table)
        return (
            f"{f.device.NAME} of {f.keys[row]} cannot be initialized: {name} = {limit:g} pu{what}; widen {name} in "
            f"{table}.csv or change the power or voltage there."
        )

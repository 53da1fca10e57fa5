"""What the estimators know of the rotor units, and the phasors at their terminals, which the PMUs measure."""

from dataclasses import dataclass

import numpy as np

from stabctl.devices.machines import gencls, genrou
from stabctl.dynamics.operating_point import Point
from stabctl.simulation.simulation import Simulation

REACTANCE = {"gencls": "x1d", "genrou": "x2"}  # model -> reactance behind which the internal voltage is formed
FLUX = ("xl", "xd", "xq", "x1q", "x2", "T1q", "T2q", "S10", "S12")  # constants of the q-axis flux of GENROU


@dataclass(frozen=True, repr=False, eq=False)
class RotorUnits:
    """Constants of the rotor units as the estimators know them: arrays (machines) on the machine base.

    `x` is the reactance behind which the internal voltage is formed: x'd of a classical machine, x'' of a full one.
    """

    bus: np.ndarray  # rows of the terminals
    inertia: np.ndarray  # s     H on the system base
    mva: np.ndarray  # -     machine MVA over system MVA
    H: np.ndarray  # s
    D: np.ndarray  # pu
    ra: np.ndarray  # pu
    x: np.ndarray  # pu
    with_flux: np.ndarray  # rows of the machines with flux dynamics
    flux: dict[str, np.ndarray]  # their constants
    frequency_hz: float

    def __str__(self) -> str:
        return f"{len(self.H)} rotor units, {len(self.with_flux)} of them with flux dynamics"

    __repr__ = __str__


def rotor_units(point: Point, inertia: float = 1.0, reactance: float = 1.0) -> RotorUnits:
    """The rotor units of an operating point; `inertia` and `reactance` multiply every H and x (1: exact)."""
    case = point.case
    models = [next(m for m in REACTANCE if k.machine in case.devices.get(m, {})) for k in case.machines]
    rows = [case.devices[model][k.machine] for model, k in zip(models, case.machines, strict=True)]
    mva = np.array([k.base for k in case.machines]) / case.base_mva
    H = inertia * np.array([row.H for row in rows])
    x = reactance * np.array([getattr(row, REACTANCE[model]) for model, row in zip(models, rows, strict=True)])
    with_flux = np.flatnonzero([model == "genrou" for model in models])
    flux = {name: np.array([getattr(rows[i], name) for i in with_flux], float) for name in FLUX}
    D, ra = (np.array([getattr(row, name) for row in rows], float) for name in ("D", "ra"))
    return RotorUnits(point.net.machine_bus, H * mva, mva, H, D, ra, x, with_flux, flux, case.frequency_hz)


class Terminals:
    """True phasors at the terminals of a simulation: V, and I = Norton current - y V (pu, out of the machine).

    The machines' own equations are evaluated on whole columns, which share the memory of the simulation.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, plant = simulation, simulation.point.plant
        known = rotor_units(simulation.point)
        self._bus, self._admittance = known.bus, known.mva / (known.ra + 1j * known.x)
        self._field, self._parts = simulation.signals.field, []
        for model, family in ((gencls, "gencls"), (genrou, "genrou")):
            table, state = getattr(plant, family), getattr(simulation.signals, family)
            x = model.State(*(np.asarray(state[name]) for name in model.State._fields))
            p = model.Par(*(np.asarray(table[name]) for name in model.Par._fields))
            if len(table):
                self._parts.append((model.norton, x, p, getattr(plant, f"{family}_machine")))

    def phasors(self, bus_voltages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Voltages and currents (machines), pu, now, of the bus voltages."""
        V, source = bus_voltages[self._bus], np.zeros(len(self._admittance), complex)
        for norton, x, p, at in self._parts:
            source.real[at], source.imag[at] = norton(x, self._field[at], p)
        return V, np.where(self.simulation.island >= 0, source - self._admittance * V, 0)

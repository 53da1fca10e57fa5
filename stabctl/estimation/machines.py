"""What the estimators know of the machines, and the terminals at which the PMUs stand."""

from dataclasses import dataclass

import numpy as np

from stabctl.devices.machines import gencls, genrou
from stabctl.dynamics.operating_point import Point, norton_admittances
from stabctl.simulation.simulation import Simulation

FIELDS = ("xl", "xd", "xq", "x1q", "x2", "T1q", "T2q", "S10", "S12")  # of GENROU, for the q-axis flux


@dataclass(frozen=True, repr=False, eq=False)
class Machines:
    """Constants as the estimators have them, arrays (machines) on the machine base; they may be wrong.

    `x` is the reactance behind which the internal voltage is formed: x'd of a classical machine, x'' of a full one.
    """

    bus: np.ndarray  # rows of the terminals
    inertia: np.ndarray  # s     H on the system base
    mva: np.ndarray  # -     machine MVA over system MVA
    H: np.ndarray  # s
    D: np.ndarray  # pu
    ra: np.ndarray  # pu
    x: np.ndarray  # pu
    round: np.ndarray  # rows of the machines with flux dynamics
    flux: dict[str, np.ndarray]  # their constants
    frequency_hz: float

    def __str__(self) -> str:
        return f"{len(self.H)} machines, {len(self.round)} of them with flux dynamics"

    __repr__ = __str__


def machines(point: Point, inertia: float = 1.0, reactance: float = 1.0) -> Machines:
    """The machines of an operating point, every H and x multiplied by these factors (1: exact)."""
    plant, m = point.plant, len(point.case.machines)
    columns = {name: np.zeros(m) for name in ("mva", "H", "D", "ra", "x")}
    for family, x in (("gencls", "x1d"), ("genrou", "x2")):
        par, at = getattr(plant, family), getattr(plant, f"{family}_machine")
        for name, column in columns.items():
            column[at] = par[x if name == "x" else name]
    columns["H"] = columns["H"] * inertia
    columns["x"] = columns["x"] * reactance
    flux = {name: np.array(plant.genrou[name], float) for name in FIELDS}
    return Machines(
        np.array(plant.machine_bus),
        plant.inertia * inertia,
        **columns,
        round=np.array(plant.genrou_machine),
        flux=flux,
        frequency_hz=point.case.frequency_hz,
    )


class Terminals:
    """True phasors at the terminals of a simulation: V, and I = Norton current - y V (system base, out of the machine).

    The machines' own equations are evaluated on whole columns, which share the memory of the simulation.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, plant = simulation, simulation.point.plant
        self._bus, self._admittance = plant.machine_bus, norton_admittances(plant)
        self._field, self._parts = simulation.signals.field, []
        for model, family in ((gencls, "gencls"), (genrou, "genrou")):
            table, state = getattr(plant, family), getattr(simulation.signals, family)
            x = model.State(*(np.asarray(state[name]) for name in model.State._fields))
            p = model.Par(*(np.asarray(table[name]) for name in model.Par._fields))
            if len(table):
                self._parts.append((model.norton, x, p, getattr(plant, f"{family}_machine")))

    def phasors(self, everywhere: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Voltages and currents (machines), pu, now, of the bus voltages."""
        V, source = everywhere[self._bus], np.zeros(len(self._admittance), complex)
        for norton, x, p, at in self._parts:
            source.real[at], source.imag[at] = norton(x, self._field[at], p)
        return V, np.where(self.simulation.island >= 0, source - self._admittance * V, 0)

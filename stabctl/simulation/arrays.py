"""The signals of a run as plain arrays, in the order of the tables of the case."""

from functools import cached_property

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.storage import Places, currents, places


class Arrays:
    """Signals of a run in the order of the case's tables, a row per recorded instant.

    Parameters
    ----------
    point
        The operating point that the run started from.
    rows
        All signals at every instant (rows, signals), as the stepper recorded them.
    """

    def __init__(self, point: OperatingPoint, rows: np.ndarray) -> None:
        self._point, self._rows = point, rows

    @cached_property
    def angle(self) -> np.ndarray:
        """Rotor angles relative to the synchronous frame (rows, rotor units), rad."""
        return _fixed(self._rows[:, self._point.rotors.angle])

    @cached_property
    def speed(self) -> np.ndarray:
        """Rotor speeds (rows, rotor units), pu."""
        return _fixed(self._rows[:, self._point.rotors.speed])

    @cached_property
    def coi_speed(self) -> np.ndarray:
        """Speed of the center of inertia of all rotors (rows), pu; valid for one island with all machines connected."""
        H = self._point.rotors.inertia
        return _fixed(self.speed @ H / H.sum())

    @cached_property
    def swing(self) -> np.ndarray:
        """Changes of the angles relative to the COI of the island (rows, rotor units), rad; valid without switching."""
        return _fixed(self._point.from_center(self.angle - self.angle[0], self._point.inertia))

    @cached_property
    def V(self) -> np.ndarray:
        """Bus voltages (rows, buses), complex, pu."""
        return _fixed(np.ascontiguousarray(self._rows[:, self._point.layout.voltages]).view(complex))

    @cached_property
    def P(self) -> np.ndarray:
        """Active power of the units (rows, units), MW."""
        layout, machines = self._point.layout, self._point.case.machines
        places = [layout.signals[unit, "P"] for unit in range(len(machines))]
        return _fixed(self._rows[:, places] * np.array([m.base for m in machines]))

    @cached_property
    def Pm(self) -> np.ndarray:
        """Mechanical powers (rows, rotor units), pu on the machine base; 0 for a disconnected unit."""
        return _fixed(self._of_units("Pm"))

    @cached_property
    def Efd(self) -> np.ndarray:
        """Field voltages (rows, rotor units), pu."""
        return _fixed(self._of_units("Efd"))

    def _of_units(self, name: str) -> np.ndarray:
        """A signal of every rotor unit; 0 for units without such a signal."""
        layout = self._point.layout
        return self._rows[:, [layout.signals.get((unit, name), layout.zero) for unit in self._point.rotors.unit]]

    @cached_property
    def storage(self) -> np.ndarray:
        """Power of the storage devices (rows, devices), MW, positive when absorbing."""
        return _fixed(self._rows[:, self._storage.P] * self._point.case.base_mva)

    @cached_property
    def energy(self) -> np.ndarray:
        """Energy in the storage devices (rows, devices), MWh; from the initial energy if unlimited."""
        return _fixed(self._rows[:, self._storage.energy] * self._point.case.base_mva / 3600)

    @cached_property
    def storage_current(self) -> np.ndarray:
        """Currents of the converters of storage (rows, devices), pu on their MVA; 0 of ideal devices."""
        return _fixed(currents(self._point.system, self._point.case, self._rows))

    @cached_property
    def order(self) -> np.ndarray:
        """Orders of the storage devices (rows, devices), in ratings, positive when absorbing: in sum from -1 to 1."""
        return _fixed(np.clip(self._rows[:, self._storage.order], -1.0, 1.0))

    @cached_property
    def _storage(self) -> Places:
        return places(self._point.system, self._point.case)


def _fixed(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array

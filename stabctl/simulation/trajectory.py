"""What a run gave: an immutable record of every signal, a row per step, with its units."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stabctl.dynamics.operating_point import Point
from stabctl.dynamics.system import first_state, sizes
from stabctl.errors import StudyError

from .outcome import Outcome

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True, repr=False, eq=False)
class Trajectory:
    """A run of the simulator. Columns stand in the order of the case's tables."""

    point: Point
    outcome: Outcome
    time: np.ndarray  # (rows) s
    rows: np.ndarray  # (rows, record)   as the stepper wrote them
    peak: np.ndarray  # (machines) rad   largest change of angle against the COI of the island
    step: float  # s
    steps: int
    wall_s: float  # s   time in the stepper

    def _part(self, name: str) -> np.ndarray:
        n = sizes(self.point.plant, len(self.point.V))
        z = len(self.point.z)
        starts = {
            "v": (n.states, n.voltages),
            "order": (z - n.storage, n.storage),
            "efd": (z, n.machines),
            "pm": (z + n.machines, n.machines),
            "pt": (z + 2 * n.machines, n.machines),
            "absorbed": (z + 3 * n.machines, n.storage),
        }
        first, count = starts[name]
        return self.rows[:, first : first + count]

    @cached_property
    def angle(self) -> np.ndarray:
        """Rotor angles against the synchronous frame (rows, machines), rad."""
        return _fixed(self.rows[:, self.point.plant.rotor])

    @cached_property
    def speed(self) -> np.ndarray:
        """Rotor speeds (rows, machines), pu."""
        return _fixed(self.rows[:, self.point.plant.rotor + 1])

    @cached_property
    def coi_speed(self) -> np.ndarray:
        """Speed of the center of inertia of all machines (rows), pu; for one island with every machine on."""
        H = self.point.plant.inertia
        return self.speed @ H / H.sum()

    @cached_property
    def V(self) -> np.ndarray:
        """Bus voltages (rows, buses), complex, pu."""
        return _fixed(np.ascontiguousarray(self._part("v")).view(complex))

    @property
    def Efd(self) -> np.ndarray:
        """Field voltages (rows, machines), pu."""
        return self._part("efd")

    @property
    def Pm(self) -> np.ndarray:
        """Mechanical powers (rows, machines), pu of the machine's base."""
        return self._part("pm")

    @property
    def Pe(self) -> np.ndarray:
        """Terminal powers (rows, machines), MW."""
        return self._part("pt") * self.point.case.base_mva

    @property
    def storage(self) -> np.ndarray:
        """Power of the storage devices (rows, devices), MW, absorbing positive."""
        return self._part("absorbed") * self.point.case.base_mva

    @property
    def energy(self) -> np.ndarray:
        """Energy in the storage devices (rows, devices), MWh; against the start where it is unlimited."""
        first = first_state(self.point.plant, "storage") + 1
        places = first + 2 * np.arange(len(self.point.case.storage))
        return self.rows[:, places] * self.point.case.base_mva / 3600

    @property
    def order(self) -> np.ndarray:
        """Orders of the storage devices (rows, devices), in ratings, absorbing positive."""
        return self._part("order")

    @property
    def max_angle_from_coi_deg(self) -> float:
        """Largest change of an angle against the COI of its island, degrees."""
        return float(np.rad2deg(self.peak.max()))

    def devices(self) -> list[str]:
        """Names of the storage devices: `14@33` is machine 14's, connected at bus 33."""
        return [f"{s.machine}@{s.bus}" for s in self.point.case.storage]

    def to_xarray(self) -> "xr.Dataset":
        """Every signal with its units; dimensions time, machine, bus and, where there is storage, device."""
        import xarray as xr

        case = self.point.case
        signals = {
            "angle": ("machine", self.angle, "rad", "rotor angle against the synchronous frame"),
            "speed": ("machine", self.speed, "pu", "rotor speed"),
            "field_voltage": ("machine", self.Efd, "pu", "field voltage"),
            "mechanical_power": ("machine", self.Pm, "pu", "mechanical power, machine base"),
            "electrical_power": ("machine", self.Pe, "MW", "terminal power"),
            "voltage": ("bus", np.abs(self.V), "pu", "voltage magnitude"),
            "voltage_angle": ("bus", np.angle(self.V), "rad", "voltage angle"),
        }
        if case.storage:
            signals["storage"] = ("device", self.storage, "MW", "power of the storage device, absorbing positive")
            signals["storage_order"] = ("device", self.order, "1", "order of the storage device, in ratings")
            signals["storage_energy"] = ("device", self.energy, "MWh", "energy in the storage device")
        data = {
            k: (("time", dim), a, {"units": unit, "long_name": text}) for k, (dim, a, unit, text) in signals.items()
        }
        coords = {
            "time": ("time", self.time, {"units": "s"}),
            "machine": [m.machine for m in case.machines],
            "bus": [b.bus for b in case.buses],
        }
        if case.storage:
            coords["device"] = self.devices()
        about = {"case": case.name, "outcome": self.outcome.kind.value, "message": self.outcome.message}
        return xr.Dataset(data, coords, about | {"step_s": self.step})

    def to_dataframe(self) -> "pd.DataFrame":
        """A row per step: time_s, then speed_pu, angle_rad of the machines, voltage_pu of the buses, storage_mw."""
        import pandas as pd

        case = self.point.case
        columns = {"time_s": self.time}
        for i, m in enumerate(case.machines):
            columns[f"speed_pu:{m.machine}"] = self.speed[:, i]
        for i, m in enumerate(case.machines):
            columns[f"angle_rad:{m.machine}"] = self.angle[:, i]
        size = np.abs(self.V)
        for i, b in enumerate(case.buses):
            columns[f"voltage_pu:{b.bus}"] = size[:, i]
        total: dict[str, np.ndarray] = {}
        for j, s in enumerate(case.storage):
            name = f"storage_mw:{s.machine}"
            total[name] = total.get(name, 0.0) + self.storage[:, j]
        return pd.DataFrame(columns | total)

    def save(self, path: str | Path) -> Path:
        """Write to a .csv or NetCDF (.nc) file, by the ending; the path."""
        path = Path(path)
        if path.suffix.lower() == ".csv":
            self.to_dataframe().to_csv(path, index=False)
        elif path.suffix.lower() == ".nc":
            self.to_xarray().to_netcdf(path, engine="scipy")
        else:
            raise StudyError(
                f"The file {path.name!r} ends in {path.suffix or 'nothing'}; give a name ending in .csv or .nc."
            )
        return path

    def __str__(self) -> str:
        return (
            f"{self.point.case.name}: {self.outcome} Largest change of angle "
            f"{self.max_angle_from_coi_deg:.1f} degrees; "
            f"{self.steps} steps of {1e3 * self.step:.3g} ms in {self.wall_s:.3f} s."
        )

    __repr__ = __str__


def _fixed(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array

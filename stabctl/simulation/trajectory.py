"""The result of a run: an immutable record of every signal with its units, and the signals as plain arrays."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util import files
from stabctl._util.errors import StudyError
from stabctl._util.tabular import csv_text
from stabctl._util.verbs import verb
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.storage import Places, currents, places

from .outcome import Outcome
from .swings import group
from .timeline import Change

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True, repr=False, eq=False)
class Trajectory:
    """A run of the simulator.

    Attributes
    ----------
    point
        The operating point it started from.
    outcome
        How it ended.
    time
        Instants (rows), s.
    rows
        All signals at every instant (rows, signals); `arrays` names them.
    peak
        Largest change of angle relative to the COI of the island (rotor units), rad.
    happened
        The events, and which units they tripped.
    step, steps, wall_s
        Time step (s), number of steps, and computing time (s).
    newton_stages
        Stages of the steps, of which each has four or more, at which Newton's method solved for the voltages.
    idle
        Whether there are storage devices that nothing gives orders to.

    Examples
    --------
    >>> run = st.load("two_area").simulate(st.Contingency("7-8@0.4", clear="150ms"), until="5s")
    >>> print(f"{60 * float(run.speed.sel(machine=1).max()):.2f} Hz, {run.max_angle_from_coi_deg:.1f} degrees")
    60.30 Hz, 20.0 degrees
    """

    point: OperatingPoint
    outcome: Outcome
    time: np.ndarray
    rows: np.ndarray
    peak: np.ndarray
    happened: "Happened"
    step: float
    steps: int
    wall_s: float
    newton_stages: int = 0
    idle: bool = False

    plot = verb("stabctl.view.figures.trajectory:plot")

    @cached_property
    def arrays(self) -> "Arrays":
        """The signals as plain arrays."""
        return Arrays(self.point, self.rows)

    @cached_property
    def on(self) -> np.ndarray:
        """Whether the unit of a rotor was on (rows, rotor units)."""
        return self.time[:, None] < self.happened.off_s[self.point.rotors.unit] - 1e-9

    @cached_property
    def angle_from_coi_deg(self) -> np.ndarray:
        """Angles (rows, rotor units) relative to the COI of the rotors of the same island that are on; nan if off."""
        angle = self.point.from_center(self.arrays.angle, self.point.inertia * self.on)
        return np.where(self.on, np.rad2deg(angle), np.nan)

    @cached_property
    def unstable_machines(self) -> tuple[int | str, ...]:
        """Machines that lost synchronism with the rest of their island: those on one side of the widest angle gap."""
        numbers, first = self.point.rotor_names, self.outcome.machine
        if first not in numbers or not len(self.rows):  # of a phase-locked loop or storage: that converter alone
            return () if first is None else (first,)
        lost, island = numbers.index(first), self.happened.island[self.point.rotors.unit]
        angle = self.arrays.angle
        found = group(angle[-1] - angle[0], lost, island == island[lost])
        return tuple(number for number, out in zip(numbers, found, strict=True) if out)

    @property
    def speed(self) -> "xr.DataArray":
        """Rotor speeds (time, machine), pu."""
        return self.dataset["speed"]

    @property
    def angle(self) -> "xr.DataArray":
        """Rotor angles relative to the synchronous frame (time, machine), rad."""
        return self.dataset["angle"]

    @property
    def voltage(self) -> "xr.DataArray":
        """Bus voltage magnitudes (time, bus), pu."""
        return self.dataset["voltage"]

    @property
    def field_voltage(self) -> "xr.DataArray":
        """Field voltages (time, machine), pu."""
        return self.dataset["field_voltage"]

    @property
    def electrical_power(self) -> "xr.DataArray":
        """Terminal powers (time, unit), MW."""
        return self.dataset["electrical_power"]

    @property
    def storage(self) -> "xr.DataArray":
        """Powers of the storage devices (time, device), MW, positive when absorbing; empty if there are none."""
        return self.dataset["storage"]

    @property
    def max_angle_from_coi_deg(self) -> float:
        """Largest change of a rotor angle relative to the COI of its island, degrees."""
        return float(np.rad2deg(self.peak.max(initial=0.0)))

    def devices(self) -> list[str]:
        """Names of the storage devices: `14@33` is machine 14's, connected at bus 33.

        Examples
        --------
        >>> st.load("two_area").simulate("7-8@1s", "2s", storage="1=50MW").devices()
        ['1@5']
        """
        return [f"{s.machine}@{s.bus}" for s in self.point.case.storage]

    @cached_property
    def dataset(self) -> "xr.Dataset":
        """Every signal with its units; dimensions time, machine (with a rotor), unit, bus and device (storage)."""
        import xarray as xr

        case, a = self.point.case, self.arrays
        signals = {
            "angle": ("machine", self._where_on(a.angle), "rad", "rotor angle relative to the synchronous frame"),
            "speed": ("machine", self._where_on(a.speed), "pu", "rotor speed"),
            "field_voltage": ("machine", a.Efd, "pu", "field voltage"),
            "mechanical_power": ("machine", a.Pm, "pu", "mechanical power, machine base"),
            "electrical_power": ("unit", a.P, "MW", "terminal power"),
            "voltage": ("bus", np.abs(a.V), "pu", "voltage magnitude"),
            "voltage_angle": ("bus", np.angle(a.V), "rad", "voltage angle"),
            "storage": ("device", a.storage, "MW", "power of the storage device, positive when absorbing"),
            "storage_order": ("device", a.order, "1", "order of the storage device, in ratings"),
            "storage_energy": ("device", a.energy, "MWh", "energy in the storage device"),
        }
        data = {
            k: (("time", dim), values, {"units": unit, "long_name": text})
            for k, (dim, values, unit, text) in signals.items()
        }
        coords = {
            "time": ("time", self.time, {"units": "s"}),
            "machine": list(self.point.rotor_names),
            "unit": [m.called for m in case.machines],
            "bus": [b.bus for b in case.buses],
            "device": np.array(self.devices(), dtype=str),
        }
        about: dict[str, Any] = {"case": case.name, "outcome": self.outcome.kind.value}
        return xr.Dataset(data, coords, about | {"message": self.outcome.message, "step_s": self.step})

    @cached_property
    def df(self) -> "pd.DataFrame":
        """The `table` with absolute angles."""
        return self.table()

    def table(self, angle_reference: int | str | None = None) -> "pd.DataFrame":
        """A row per step: time_s; of machines speed_pu, angle_rad (NaN once off); of buses voltage_pu; storage_mw.

        If the machines have names, as those of imported cases: speed_pu:30/1, angle_deg:30/1, efd_pu:30/1, v_pu:30.

        Parameters
        ----------
        angle_reference
            Name or number of the machine that angles are relative to; by default they are relative to the synchronous
            frame.

        Returns
        -------
        DataFrame

        Raises
        ------
        StudyError
            If there is no such machine, or it has no rotor.

        Examples
        --------
        >>> run = st.load("two_area").simulate("7-8@1s", until="2s")
        >>> run.table(angle_reference=1).filter(like="angle").tail(1).round(2)
             angle_rad:1  angle_rad:2  angle_rad:3  angle_rad:4
        240          0.0        -0.22        -0.96        -1.17
        """
        import pandas as pd

        case, a, names = self.point.case, self.arrays, self.point.rotor_names
        angle = a.angle if angle_reference is None else a.angle - a.angle[:, [self._rotor(angle_reference)]]
        signals = {"speed_pu": a.speed, "angle_rad": angle}
        if any(m.name for m in case.machines):
            signals = {"speed_pu": a.speed, "angle_deg": np.rad2deg(angle), "efd_pu": a.Efd}
        columns: dict[str, np.ndarray] = {"time_s": self.time}
        for name, given in signals.items():
            values = self._where_on(given)
            columns |= {f"{name}:{m}": values[:, i] for i, m in enumerate(names)}
        size, voltage = np.abs(a.V), "v_pu" if "efd_pu" in signals else "voltage_pu"
        columns |= {f"{voltage}:{b.bus}": size[:, i] for i, b in enumerate(case.buses)}
        total: dict[str, np.ndarray] = {}
        for j, s in enumerate(case.storage):
            name = f"storage_mw:{case.machine(s.machine).called}"
            total[name] = total.get(name, 0.0) + a.storage[:, j]
        return pd.DataFrame(columns | total)

    def _rotor(self, machine: int | str) -> int:
        """Place of a machine among those with a rotor."""
        row = self.point.case.machines.index(self.point.case.machine(machine))
        found = np.flatnonzero(self.point.rotors.unit == row)
        if not len(found):
            raise StudyError(
                f"Machine {machine} of {self.point.case.name} has no rotor; angles cannot be relative to it."
            )
        return int(found[0])

    def _where_on(self, values: np.ndarray) -> np.ndarray:
        """Values of rotor units (rows, rotor units), NaN after a unit is disconnected."""
        return np.where(self.on, values, np.nan)

    def save(self, path: str | Path, *, angle_reference: int | str | None = None) -> Path:
        """Write the trajectory to a file, atomically.

        Parameters
        ----------
        path : str or Path
            File to write: .csv for `table`, .nc for `dataset` as NetCDF.
        angle_reference : int or str, optional
            Machine to which the angles of a .csv file are relative.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        StudyError
            For another suffix, a reference without a rotor, or a file that cannot be written.

        Examples
        --------
        >>> st.load("two_area").simulate("7-8@1s", until="2s").save("run.csv")
        PosixPath('run.csv')
        """
        path = files.path_of(path)
        if path.suffix.lower() == ".csv":
            files.replace(path, csv_text(self.table(angle_reference)))
        elif path.suffix.lower() == ".nc":
            kept = self.dataset if self.point.case.storage else self.dataset.drop_dims("device")
            files.replace(path, bytes(kept.to_netcdf(engine="scipy")))
        else:
            raise StudyError(f"The file {path.name!r} must end in .csv or .nc.")
        return path

    def __str__(self) -> str:
        idle = " No orders are given to the storage: give control=BangBang(), for example." if self.idle else ""
        return (
            f"{self.point.case.name}: {self.outcome} Largest change of angle {self.max_angle_from_coi_deg:.1f} "
            f"degrees; {self.steps} steps of {1e3 * self.step:.3g} ms in {self.wall_s:.3f} s.{idle}"
        )

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{self}</p>"


class Happened(NamedTuple):
    """What happened to the network during a run."""

    changes: tuple[Change, ...]  # the network after every event
    off_s: np.ndarray  # (units) s   time at which a unit was disconnected; infinite if it was not
    island: np.ndarray  # (units) its island at the end, -1 if it is off


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
        """Orders of the storage devices (rows, devices), in ratings, positive when absorbing."""
        return _fixed(self._rows[:, self._storage.order])

    @cached_property
    def _storage(self) -> Places:
        return places(self._point.system, self._point.case)


def _fixed(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array

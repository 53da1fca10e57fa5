"""The result of a run: an immutable record of every signal with its units, and the signals as plain arrays."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from html import escape
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl._util import files
from stabctl._util.errors import StudyError, shown
from stabctl._util.tabular import csv_text
from stabctl._util.verbs import verb
from stabctl._util.wording import near
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model import naming

from . import channels as recorded
from .arrays import Arrays
from .channels import QUANTITIES
from .outcome import Outcome
from .swings import group
from .timeline import Change
from .topology import stage

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
    report = verb("stabctl.view.pages.pattern:report")
    judge = verb("stabctl.judgment:judge")

    @cached_property
    def arrays(self) -> "Arrays":
        """The signals as plain arrays. Raises `StudyError` if they were not recorded."""
        if not len(self.rows):
            raise StudyError("The run has no signals: they were not recorded; leave out record=False.")
        return Arrays(self.point, self.rows)

    @cached_property
    def on(self) -> np.ndarray:
        """Whether the unit of a rotor was on (rows, rotor units)."""
        return self.time[:, None] < self.happened.off_s[self.point.rotors.unit] - 1e-9

    @cached_property
    def _change(self) -> np.ndarray:
        """Which of the changes of the network came last (rows)."""
        return np.searchsorted([c.at for c in self.happened.changes], self.time + 1e-9, side="right") - 1

    @cached_property
    def energized(self) -> np.ndarray:
        """Whether a bus was in an island with a voltage source (rows, buses)."""
        return np.array([stage(self.point, c.switching).net.alive for c in self.happened.changes])[self._change]

    @cached_property
    def rotor_island(self) -> np.ndarray:
        """Island of every rotor (rows, rotor units); -1 if it is off."""
        found = [stage(self.point, c.switching).net.island[self.point.rotors.unit] for c in self.happened.changes]
        return np.array(found)[self._change]

    @cached_property
    def angle_from_coi_deg(self) -> np.ndarray:
        """Angles (rows, rotor units) relative to the COI of the rotors of the same island then; nan if off."""
        angle, found = self.arrays.angle, np.full(self.arrays.angle.shape, np.nan)
        for one in np.unique(self.rotor_island[self.rotor_island >= 0]):
            mine = self.rotor_island == one
            weight = self.point.inertia * mine
            center = (weight * angle).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9)
            found = np.where(mine, angle - center[:, None], found)
        return np.rad2deg(found)

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
        return list(map(str, naming.keys(self.point.case, "storage")))

    @cached_property
    def dataset(self) -> "xr.Dataset":
        """Every signal with its units; dimensions time, machine (with a rotor), unit, bus and device (storage)."""
        import xarray as xr

        case = self.point.case
        data = {
            name: (("time", q.of), self.values(name), {"units": q.unit, "long_name": q.meaning})
            for name, q in QUANTITIES.items()
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
        """The `table` of the usual channels."""
        return self.table()

    def table(self, channels: str | Iterable[str] = "", angle_reference: int | str | None = None) -> "pd.DataFrame":
        """Return channels of the run as a table, a row per recorded instant.

        Parameters
        ----------
        channels : str or iterable of str
            What the columns hold: "voltage:16,speed:2", or "speed" for all speeds. The quantities are speed, angle,
            field_voltage, mechanical_power, electrical_power, voltage, voltage_angle, storage, storage_order and
            storage_energy. By default speeds, angles, field voltages, bus voltages and powers of storage.
        angle_reference : int or str, optional
            Name or number of the machine that angles are relative to; by default they are relative to the synchronous
            frame.

        Returns
        -------
        DataFrame
            Columns time_s (s), and by machine speed_pu:2, angle_deg:2, efd_pu:2 (empty once it is off), pm_pu:2 and
            p_mw:2, by bus v_pu:16 and v_angle_deg:16, by storage device storage_mw:2@16 (positive when absorbing),
            storage_order:2@16 (in ratings) and storage_mwh:2@16.

        Raises
        ------
        StudyError
            If there is no such quantity, machine, bus or device, or the reference has no rotor.

        Examples
        --------
        >>> run = st.load("two_area").simulate(st.Contingency("8", clear="0.1s"), until=2)
        >>> [*run.table("voltage:8,speed:2")]
        ['time_s', 'v_pu:8', 'speed_pu:2']
        """
        import pandas as pd

        case, rotors = self.point.case, self.point.rotors.unit.tolist()
        usual = [name for name in recorded.TABLE if case.storage or QUANTITIES[name].of != "device"]
        wanted = recorded.chosen(case, channels or usual, rotors)
        values = {name: self.values(name) for name in dict.fromkeys(c.quantity for c in wanted)}
        if angle_reference is not None:
            row = naming.row(case, "machines", angle_reference)
            if row not in rotors:
                raise StudyError(
                    f"Machine {angle_reference} of {case.name} has no rotor; angles cannot be relative to it."
                )
            if "angle" in values:
                values["angle"] = values["angle"] - self.values("angle")[:, [rotors.index(row)]]
        columns = {
            f"{QUANTITIES[c.quantity].column}:{c.label}": QUANTITIES[c.quantity].factor * values[c.quantity][:, c.place]
            for c in wanted
        }
        return pd.DataFrame({"time_s": self.time} | columns)

    def values(self, quantity: str) -> np.ndarray:
        """Values of a quantity at every recorded instant.

        Parameters
        ----------
        quantity : str
            Name of the quantity, as in `table`.

        Returns
        -------
        ndarray (rows, machines, buses or devices)
            In the unit of `dataset`; NaN of a machine that is off.

        Examples
        --------
        >>> st.load("two_area").simulate("7-8@1s", until="2s").values("voltage").shape
        (241, 11)
        """
        if not isinstance(quantity, str) or quantity not in QUANTITIES:
            raise StudyError(f"There is no quantity {shown(quantity)}; {near(str(quantity), QUANTITIES, 'there are')}")
        found = QUANTITIES[quantity].values(self.arrays)
        return np.where(self.on, found, np.nan) if QUANTITIES[quantity].while_on else found

    def save(
        self, path: str | Path, *, channels: str | Iterable[str] = "", angle_reference: int | str | None = None
    ) -> Path:
        """Write the trajectory to a file, atomically.

        Parameters
        ----------
        path : str or Path
            File to write: .csv for `table`, .nc for `dataset` as NetCDF.
        channels : str or iterable of str
            Columns of a .csv file, as in `table`.
        angle_reference : int or str, optional
            Machine to which the angles of a .csv file are relative.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        StudyError
            For another suffix, an unknown channel, a reference without a rotor, either of them with .nc, or a file that
            cannot be written.

        Examples
        --------
        >>> st.load("two_area").simulate("7-8@1s", until="2s").save("run.csv")
        PosixPath('run.csv')
        """
        path = files.path_of(path)
        if path.suffix.lower() == ".csv":
            files.replace(path, csv_text(self.table(channels, angle_reference)))
        elif path.suffix.lower() == ".nc":
            if channels or angle_reference is not None:
                raise StudyError("channels and angle_reference belong to a .csv file; leave them out.")
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
        return f"<p>{escape(str(self))}</p>"


class Happened(NamedTuple):
    """What happened to the network during a run."""

    changes: tuple[Change, ...]  # the network after every event
    off_s: np.ndarray  # (units) s   time at which a unit was disconnected; infinite if it was not
    island: np.ndarray  # (units) its island at the end, -1 if it is off

    @property
    def last_event_s(self) -> float:
        """Instant of the last event, s; 0 if there was none."""
        return next(change.at for change in reversed(self.changes) if not change.automatic)

    @property
    def cleared_s(self) -> float:
        """Instant from which on there is no fault, s: 0 if there was none, infinite if one is not cleared."""
        since = takewhile(lambda change: not change.switching.faulted, reversed(self.changes))
        return min((change.at for change in since), default=np.inf)

"""Traces of other programs beside runs of the same events.

A file of `cases/traces` has the columns of `Trajectory.table`: time_s, then angle_deg:1, v_pu:7 and so on.
"""

import csv
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stabctl.model.case import Case
from stabctl.simulation.channels import QUANTITIES
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import SwitchShunt
from stabctl.simulation.simulate import simulate

from .systems import HERE, System

if TYPE_CHECKING:
    import pandas as pd

    from stabctl.simulation.trajectory import Trajectory

FOLDER = HERE / "cases" / "traces"
KEEP_ON = Criterion(max_angle=np.inf, low_voltage_s=0.0, frequency_delay_s=0.0)
STEP = 1 / 480  # s
UNITS = {"angle_deg": "degrees", "v_angle_deg": "degrees", "p_mw": "MW"}  # else pu
_NAMES = {quantity.column: name for name, quantity in QUANTITIES.items()}


class Trace(NamedTuple):
    """A signal of another program, and ours at the same instants."""

    signal: str  # a column of `Trajectory.table`
    time: np.ndarray  # s
    theirs: np.ndarray
    ours: np.ndarray

    @property
    def unit(self) -> str:
        """Of its values."""
        return UNITS.get(self.signal.partition(":")[0], "pu")

    @property
    def worst(self) -> int:
        """Row of the largest difference."""
        return int(np.argmax(np.abs(self.theirs - self.ours)))


def read(name: str) -> Mapping[str, np.ndarray]:
    """The columns of a file of traces."""
    with (FOLDER / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        heads, *rows = csv.reader(file)
    return dict(zip(heads, np.array(rows, float).T, strict=True))


def traces(system: System, case: Case) -> Iterator[Trace]:
    """Every trace of a system."""
    theirs = dict(read(system.name))
    time = theirs.pop("time_s")
    ours, table = run(system, case, float(time[-1]))
    for column, values in theirs.items():
        yield Trace(column, time, values, np.interp(time, ours.time, table[column].to_numpy()))


def run(system: System, case: Case, until: float) -> "tuple[Trajectory, pd.DataFrame]":
    """Our run of the events of a system, and the signals of its traces."""
    columns = (column.partition(":") for column in read(system.name) if column != "time_s")
    ours = simulate(case, _events(system.run), until + STEP, step=STEP, criterion=KEEP_ON)
    return ours, ours.table([f"{_NAMES[name]}:{place}" for name, _, place in columns])


def _events(given: Mapping[str, Any]) -> Contingency:
    """The contingency, whose shunts (bus, Mvar) are switched when the fault is cleared."""
    own = dict(given)
    shunts = [SwitchShunt(bus, 0.0, b=b) for bus, b in own.pop("shunts", ())]
    return Contingency(**own, after=shunts)

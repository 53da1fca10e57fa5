"""Stability of a grid-following converter against the strength of its grid and the gain of its phase-locked loop."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl import devices
from stabctl._util.errors import EquilibriumError, PowerFlowError, StudyError, shown
from stabctl._util.tabular import Tabular
from stabctl._util.verbs import verb
from stabctl.devices.machines import gencls
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.case import Case, as_case
from stabctl.model.naming import number
from stabctl.model.powerflow import PowerFlow
from stabctl.model.powerflow import solve as power_flow
from stabctl.model.tables import Branch, Bus, Machine

from .analysis import modes

if TYPE_CHECKING:
    import pandas as pd

RATIOS = tuple(np.geomspace(1.05, 6.0, 12).round(3).tolist())
GAINS = tuple(np.geomspace(0.25, 8.0, 11).round(3).tolist())
INSIDE = 1e-3  # share of the reactance of the grid that is the infinite bus's own


@dataclass(frozen=True, eq=False, repr=False)
class WeakGrid(Tabular):
    """The least damped mode of one converter at an infinite bus, at every short-circuit ratio and loop gain.

    Attributes
    ----------
    name : str
        The converter.
    scr : ndarray (ratios)
        Short-circuit ratios.
    gain : ndarray (gains), rad/s per pu
        Proportional gains of the phase-locked loop.
    eigenvalues : ndarray (ratios, gains), complex, 1/s
        Eigenvalue of the least damped mode; NaN where there is no operating point.
    labels : ndarray (ratios, gains) of str
        Names of these modes.
    growth : ndarray (ratios, gains), 1/s
        Largest real part of all modes.

    Examples
    --------
    >>> found = st.load("two_area").with_device("regc_c", 3).weak_grid(3, scr=(1.5, 3), gain=(1, 4))
    >>> found.damping_ratio.round(3)
    array([[ 0.163, -0.101],
           [ 0.293,  0.036]])
    """

    name: str
    scr: np.ndarray
    gain: np.ndarray
    eigenvalues: np.ndarray
    labels: np.ndarray
    growth: np.ndarray

    plot = verb("stabctl.view.figures.grid_strength:plot_weak_grid")
    report = verb("stabctl.view.pages.pattern:report")

    @property
    def damping_ratio(self) -> np.ndarray:
        """Least damping ratio (ratios, gains), -Re/|eigenvalue|."""
        return -self.eigenvalues.real / np.abs(self.eigenvalues)

    @property
    def stable(self) -> np.ndarray:
        """Where an operating point exists and no mode grows (ratios, gains)."""
        return self.growth < 0

    @property
    def boundary(self) -> np.ndarray:
        """Smallest short-circuit ratio (gains) above which every ratio of the grid is stable.

        Interpolated where the largest real part crosses zero; NaN if the largest ratio is unstable, 0 if all are
        stable, and the ratio of the first operating point if every one is stable.
        """
        found = np.full(len(self.gain), np.nan)
        for j, growth in enumerate(self.growth.T):
            bad = np.flatnonzero(~(growth < 0))
            k = int(bad[-1]) if len(bad) else -1
            if k + 1 == len(growth):
                continue
            if k < 0:
                found[j] = 0.0
            elif np.isnan(growth[k]):
                found[j] = self.scr[k + 1]
            else:
                found[j] = np.interp(0.0, [growth[k + 1], growth[k]], [self.scr[k + 1], self.scr[k]])
        return found

    @property
    def df(self) -> "pd.DataFrame":
        """One row per point: ratio, gain, least damping ratio, its mode, whether stable."""
        import pandas as pd

        scr, gain = np.meshgrid(self.scr, self.gain, indexing="ij")
        columns: dict[str, Any] = {
            "scr": scr,
            "pll_gain": gain,
            "damping_ratio": self.damping_ratio,
            "frequency_hz": np.abs(self.eigenvalues.imag) / (2 * np.pi),
            "real": self.eigenvalues.real,
            "stable": self.stable,
            "mode": self.labels,
        }
        return pd.DataFrame({name: column.ravel() for name, column in columns.items()})

    def __str__(self) -> str:
        share = f"{int(self.stable.sum())} of {self.stable.size} points are stable"
        text = f"{self.name} at an infinite bus, SCR {self.scr[0]:g} to {self.scr[-1]:g}: {share}"
        if (~(self.growth < 0) & ~np.isnan(self.growth)).any():
            k = np.unravel_index(int(np.nanargmax(self.growth)), self.growth.shape)
            text += f"; fastest growing at SCR {self.scr[k[0]]:g}, gain {self.gain[k[1]]:g} rad/s: {self.labels[k]}"
        return text


def weak_grid(
    base: Any,
    converter: int | str,
    *,
    scr: Iterable[float] = RATIOS,
    gain: Iterable[float] = GAINS,
    x_over_r: float = 10.0,
    voltage: float = 1.0,
) -> WeakGrid:
    """Map the stability of a converter at an infinite bus over short-circuit ratio and gain of its phase-locked loop.

    The converter of the case, with its controls, its active power and its terminal voltage, is connected to an infinite
    bus through Z = 1/SCR on its own MVA. The reactive power follows. Its loop keeps its own damping ratio: a gain g
    times as large makes Kppll g times and Kipll g^2 times as large.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system.
    converter : int or str
        Number or name of the unit with the converter.
    scr : iterable of float
        Short-circuit ratios.
    gain : iterable of float
        Gains, relative to that of the case.
    x_over_r : float
        Reactance over resistance of the grid.
    voltage : float
        Voltage of the infinite bus, pu.

    Returns
    -------
    WeakGrid

    Raises
    ------
    StudyError
        If the unit has no converter with a phase-locked loop, or an argument makes no sense.

    Examples
    --------
    >>> case = st.load("two_area").with_device("regc_c", 3)
    >>> print(case.weak_grid(3, scr=(1.5, 3), gain=(1, 4)))
    REGC_C 3 at an infinite bus, SCR 1.5 to 3: 3 of 4 points are stable; fastest growing at SCR 1.5, ...
    """
    case, ratios, gains = as_case(base), _ascending(scr, "scr"), _ascending(gain, "gain")
    if not (np.isfinite(x_over_r) and x_over_r > 0):
        raise StudyError(f"x_over_r = {shown(x_over_r)} is not allowed; it must be more than 0.")
    unit = case.machine(converter)
    model = _with_loop(case, unit)
    flow = base.flow if isinstance(getattr(base, "flow", None), PowerFlow) else power_flow(case)
    V = float(abs(flow.V[[b.bus for b in case.buses].index(unit.bus)]))
    P = float(flow.S[case.machines.index(unit)].real) * case.base_mva
    shape = len(ratios), len(gains)
    values, labels = np.full(shape, np.nan + 0j), np.full(shape, "no operating point", object)
    growth = np.full(shape, np.nan)
    for i, ratio in enumerate(ratios):
        one = at_infinite_bus(case, unit, ratio, P=P, V=V, x_over_r=x_over_r, voltage=voltage)
        try:
            point = operating_point.solve(one)
        except (PowerFlowError, EquilibriumError):
            continue
        for j, factor in enumerate(gains.tolist()):
            found = modes(with_gain(point, model, factor))
            own = np.flatnonzero(found.eigenvalues != 0)
            k = int(own[np.argmin(found.damping_ratio[own])])
            values[i, j], labels[i, j] = found.eigenvalues[k], found.label(k)
            growth[i, j] = found.eigenvalues[own].real.max()
    device = devices.every()[model]
    k0 = getattr(case.devices[model][unit.machine], device.pll_gains[0])
    return WeakGrid(f"{device.name} {unit.called}", ratios, gains * k0, values, labels, growth)


def at_infinite_bus(
    case: Case, unit: Machine, scr: float, *, P: float, V: float, x_over_r: float, voltage: float
) -> Case:
    """One unit of a case with its devices, at an infinite bus behind Z = 1/SCR on its MVA.

    Parameters
    ----------
    case, unit
        The case and the row of the unit.
    scr
        Short-circuit ratio.
    P, V
        Active power (MW) and terminal voltage (pu) of the unit.
    x_over_r
        Reactance over resistance.
    voltage
        Voltage of the infinite bus, pu.
    """
    x = 1 / scr / np.hypot(1, 1 / x_over_r)
    far = unit.bus + 1
    own: dict[str, dict[Any, Any]] = {}
    for table, rows in case.devices.items():
        if devices.every()[table].role in devices.UNIT_ROLES:
            kept = {key: _local(par) for key, par in rows.items() if number(key) == unit.machine}
            own |= {table: kept} if kept else {}
    infinite = gencls.Par(0, 0, H=0.0, D=0.0, ra=0.0, x1d=INSIDE * x)
    other = unit.machine + 1
    return Case(
        name=f"{case.name}, unit {unit.called} alone",
        buses=(Bus(unit.bus, "pv", V), Bus(far, "swing", voltage)),
        branches=(Branch(unit.bus, far, x / x_over_r, (1 - INSIDE) * x),),
        machines=(unit._replace(p=P, q=0.0, storage_bus=unit.bus), Machine(other, far, unit.base, 0.0, far)),
        devices=own | {"gencls": {other: infinite}},
        base_mva=unit.base,
        frequency_hz=case.frequency_hz,
    )


def with_gain(point: OperatingPoint, model: str, factor: float) -> OperatingPoint:
    """The point with `factor` times the gain of its phase-locked loop, whose damping ratio and rest stay the same."""
    device, k = devices.every()[model], point.system.family(model).k.copy()
    for power, name in enumerate(device.pll_gains, 1):
        k[:, device.Par._fields.index(name)] *= factor**power
    return replace(point, system=point.system.with_constants(model, k))


def _local(par: Any) -> Any:
    """Parameters with the unit's own bus in place of a remote one."""
    return par._replace(bus=0) if "bus" in par._fields else par


def _with_loop(case: Case, unit: Machine) -> str:
    """The converter model of a unit. `StudyError` if it has no phase-locked loop."""
    model = case.model(unit.machine, "converter")
    if model is None or not devices.every()[model].pll_gains:
        what = f"{devices.every()[model].name} of machine" if model else "Machine"
        raise StudyError(
            f"{what} {unit.called} in {case.name} has no phase-locked loop; give it one: "
            f"case.with_device('regc_c', {unit.machine})."
        )
    return model


def _ascending(values: Iterable[float], name: str) -> np.ndarray:
    """The values in ascending order. `StudyError` unless they are positive numbers."""
    try:
        found = np.unique(np.array(list(values), float))
    except (TypeError, ValueError):
        found = np.zeros(0)
    if not len(found) or not np.isfinite(found).all() or found[0] <= 0:
        raise StudyError(f"{name} = {shown(values)} is not allowed; give numbers above 0, such as (1.5, 2, 3).")
    return found

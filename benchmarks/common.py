"""One system for every tool: the two-area case with the models that all of them have, and the tasks."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stabctl import io
from stabctl.devices.exciters import sexs
from stabctl.devices.governors import tgov
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.model.tables import Load

STEP = 1 / 120  # s
UNTIL = 10.0  # s
FAULT_ON, FAULT_OFF, FAULT_X = 1.0, 1.1, 1e-4  # s, s, pu
DROOP, T1, T2, T3 = 0.05, 0.5, 3.0, 10.0  # TGOV1: pu, s
KA, TE, EMAX = 200.0, 0.05, 5.0  # SEXS without lead-lag: pu, s, pu
Works = dict[str, Callable[[], Callable[[], object]]]  # name of a task -> its set-up, which returns the task


class Answer(NamedTuple):
    """What a tool found."""

    V: np.ndarray  # (buses) complex, pu
    eigenvalues: np.ndarray  # complex, 1/s
    time: np.ndarray  # s; empty if the ten seconds were not run
    speed: np.ndarray  # (time, machines) pu


def classical(case: Case | None = None) -> Case:
    """Classical machines without stator resistance, and lines without taps, which not every tool has, with TGOV1.

    Loads are admittances.
    """
    case = _without_links(case or io.load("two_area")).classical()
    case = replace(case, branches=tuple(k._replace(tap=1.0, phase=0.0) for k in case.branches))
    rows = {number: par._replace(ra=0.0) for number, par in case.devices["gencls"].items()}
    return _loads_fixed(_governed(replace(case, devices={"gencls": rows})))


def fault_bus(case: Case) -> int:
    """Bus of the fault: 7, in the middle of two_area, or else the bus with the largest load."""
    return 7 if case.name.startswith("two_area") else max(case.loads, key=lambda load: load.p).bus


def full(case: Case) -> Case:
    """GENROU with SEXS and TGOV1, loads as admittances."""
    case = _without_links(case)
    exciters: dict[int | str, Any] = {
        m.machine: sexs.Par(0.0, KA, TE, Efdmax=EMAX, Efdmin=-EMAX) for m in case.machines
    }
    kept: dict[str, Mapping[int | str, Any]] = {"genrou": case.devices["genrou"], "sexs": exciters}
    return _loads_fixed(_governed(replace(case, devices=kept)))


def constant_power(case: Case) -> Case:
    """The case with loads of constant power."""
    return _with_loads(case, 1.0)


def fault_x(case: Case) -> float:
    """Reactance of the fault, pu: with constant power one that leaves enough voltage for a load to be one."""
    return 0.4 if any(k.p_power for k in case.loads) else FAULT_X


def produced(case: Case) -> np.ndarray:
    """Power (machines) in the power flow, pu on the machine's base."""
    base = np.array([m.base for m in case.machines])
    return powerflow.solve(case).S.real * case.base_mva / base


def swings(eigenvalues: np.ndarray) -> np.ndarray:
    """Eigenvalues of 0.3 to 2.5 Hz with a damping ratio below 0.5, the slowest first, one of each pair."""
    s = eigenvalues[(eigenvalues.imag > 0.6 * np.pi) & (eigenvalues.imag < 5 * np.pi)]
    s = s[-s.real < 0.5 * np.abs(s)]
    return s[np.argsort(s.imag)]


def _governed(case: Case) -> Case:
    governors: dict[int | str, Any] = {
        m.machine: tgov.Par(1 / DROOP, T1, T3, T2, 0.0, 0.0, 1.0, 0.0) for m in case.machines
    }
    return replace(case, devices={**case.devices, "tgov": governors})


def _loads_fixed(case: Case) -> Case:
    return _with_loads(case, 0.0)


def _with_loads(case: Case, power: float) -> Case:
    """The case with a share of constant power in its loads, and the rest as admittances."""
    made = (k._replace(p_current=0.0, q_current=0.0, p_power=power, q_power=power) for k in case.loads)
    return replace(case, loads=tuple(made))


def _without_links(case: Case) -> Case:
    """The case with loads in place of HVDC terminals."""
    ends = [(k.from_bus, k.p) for k in case.links] + [(k.to_bus, k.loss - k.p) for k in case.links]
    return replace(case, loads=(*case.loads, *(Load(bus, p, 0.0) for bus, p in ends)), links=())

"""What the page is answered: curves and frames of a run, modes, searches, equal areas.

Searches take longer than a moment: what they find is told as it is found.
"""

import json
import math
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.schema import fields
from stabctl.clearing import ClearingTime, clearing_time, lines, screen
from stabctl.clearing.trial import Run
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.model.case import Case
from stabctl.model.tables import models, of_role
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import Fault
from stabctl.simulation.outcome import Kind
from stabctl.simulation.simulate import simulate
from stabctl.simulation.simulation import run
from stabctl.simulation.trajectory import Trajectory
from stabctl.smallsignal import areas
from stabctl.smallsignal.analysis import modes
from stabctl.theory.equal_area import critical_clearing
from stabctl.theory.omib import swing_curve
from stabctl.theory.phase_plane import separatrix
from stabctl.theory.two_machine import Equivalent, equivalent

from . import commands
from .state import AT, UNTIL, Points, State

BEYOND = 1.0  # s   drawn after synchronism is lost
WATCHED = Criterion(max_angle=np.inf, slowest=0.0, fastest=np.inf, low_voltage_s=0.0, frequency_delay_s=0.0)
FRAMES = 20.0  # a second, of voltages and angles for the diagram
NONE, MOST = -32768, 32000  # of the numbers sent: no value, the largest
ROLES = "stabilizer", "exciter", "governor"
SUSTAINED = 2.0  # s   that a lasting fault is watched
SEARCHED, MOST_CYCLES = 400, 30.0  # lines of a system whose worst fault is searched for; the end of the slider
FINE = "0.015625cyc"  # resolution of the second search
LONGEST = 3.0  # s   of the motion in the phase plane
Arrays = dict[str, np.ndarray]
Tell = Callable[[dict[str, Any]], None]


def run_answer(points: Points, state: State, load: commands.Source) -> bytes:
    """The run of a state, and the same without storage if the page compares them."""
    begun = time.perf_counter()
    found = {"": _runs(points.of(state), state.contingency, points.control(state))}
    if state.compare and state.equipped(points.case):
        idle = points.control(replace(state, law="idle"))
        found["bare."] = _runs(points.without(state), state.contingency, idle)
    ran = time.perf_counter()
    arrays: Arrays = {}
    for name, (_, drawn) in found.items():
        arrays |= {name + key: values for key, values in _arrays(drawn, state.signals).items()}
    head: dict[str, Any] = {
        "runs": {name: _outcome(run) for name, (run, _) in found.items()},
        "at": AT,
        "cleared": state.contingency.cleared(points.case),
        "until": UNTIL,
        "opened": list(map(str, state.contingency.placed(points.case).opened)),
        "copy": commands.lines(load, points.case, state)["run"],
        "simulated_ms": 1e3 * (ran - begun),
    }
    head["server_ms"] = 1e3 * (time.perf_counter() - begun)
    return pack(head, arrays)


def opening(points: Points) -> State:
    """The settings with which the page opens: one cycle beyond the limit of the worst fault known.

    Its bus is the one where a lasting fault ends synchronism first, its line the one there with the shortest clearing
    time. In a system of more than `SEARCHED` lines, and where nothing is lost, the fault is on the first line.
    """
    first, found = points.first, lines(points.case).screened
    point, control, soonest, worst = points.bare(first), points.control(first), SUSTAINED, ""
    for bus in dict.fromkeys(str(end) for k in found for end in (k.a, k.b)) if len(found) <= SEARCHED else ():
        end = run(point, [Fault(bus, 0.0)], soonest, control, record=False).outcome
        if not end.stable and end.time_s < soonest:
            soonest, worst = end.time_s, bus
    pairs = [p for p in screen(point, control=control, buses=worst).pairs if p.cycles] if worst else []
    if pairs:
        clear = min((pairs[0].cycles or 0.0) + 1, MOST_CYCLES)
        return replace(first, fault=pairs[0].fault, trip=str(pairs[0].trip[0]), clear=clear)
    return replace(first, fault=f"{found[0]}@0.5" if found else str(points.case.buses[0].bus))


def _runs(point: OperatingPoint, contingency: Contingency, control: Control) -> tuple[Trajectory, Trajectory]:
    """A run, and what is drawn of it: if synchronism is lost, one that is watched a little longer."""
    run = simulate(point, contingency, UNTIL, control=control)
    if run.outcome.kind is not Kind.LOST_SYNCHRONISM:
        return run, run
    until = min(run.outcome.time_s + BEYOND, UNTIL)
    return run, simulate(point, contingency, until, control=control, criterion=WATCHED)


def _outcome(run: Trajectory) -> dict[str, Any]:
    end, names = run.outcome, run.point.rotor_names
    lost = [i for i, m in enumerate(names) if m in run.unstable_machines]
    return {"stable": end.stable, "message": end.message, "lost": lost}


def _arrays(run: Trajectory, signals: tuple[str, ...]) -> Arrays:
    """Instants and curves, and the frames of the diagram."""
    a, case, angle = run.arrays, run.point.case, run.angle_from_coi_deg
    size = np.abs(a.V)
    found: Arrays = {"time": run.time}
    for name in signals:
        if name == "speed":
            found[name] = np.where(run.on, a.speed * case.frequency_hz, np.nan)
        elif name == "angle":
            found[name] = angle
        elif name == "voltage":
            found[name] = size[:, [case.row_of_bus[m.storage_bus] for m in case.machines]]
        elif name == "storage":
            owner = [[s.machine == m.machine for m in case.machines] for s in case.storage]
            found[name] = a.storage @ np.array(owner, float) if owner else a.storage
        else:
            raise StudyError(f"{shown(name)} is not a curve of the page; give speed, angle, voltage or storage.")
    frames = np.unique(np.searchsorted(run.time, np.arange(0, run.time[-1] + 1e-9, 1 / FRAMES)).clip(0, len(a.V) - 1))
    frames = np.unique(np.r_[frames, len(run.time) - 1])
    return found | {"frame": run.time[frames], "frame.angle": angle[frames], "frame.voltage": size[frames]}


def pack(head: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """Arrays as bytes: a header in JSON with their names and sizes, then the numbers, column by column.

    A vector (rows) is sent as it is. A table (rows, columns) is sent as whole numbers of 16 bits, value = middle +
    step * number; the lowest number is no value.
    """
    parts, listed = [], []
    for name, values in arrays.items():
        if values.ndim == 1:
            listed.append([name, 0, len(values), 0.0, 0.0])
            parts.append(values.astype("<f4").tobytes())
            continue
        known = np.isfinite(values)
        least, most = (float(values[known].min()), float(values[known].max())) if known.any() else (0.0, 0.0)
        middle, step = (least + most) / 2, max(most - least, 1e-9) / (2 * MOST)
        number = np.where(known, np.rint((values - middle) / step), NONE).astype("<i2")
        listed.append([name, values.shape[1], len(values), middle, step])
        data = np.ascontiguousarray(number.T).tobytes()
        parts.append(data + b"\0" * (-len(data) % 4))
    text = json.dumps(head | {"arrays": listed}).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + b"".join(parts)


def modes_answer(case: Case, gain: str, factor: float) -> dict[str, Any]:
    """Eigenvalues of the upper half plane with name, damping, participation, mode shape; one gain is multiplied."""
    found = modes(operating_point.solve(scaled(case, gain, factor)))
    upper = [int(k) for k in np.flatnonzero(found.eigenvalues.imag >= 0)]
    swings = found.swings()
    rows = {m: i for i, m in enumerate(m.called for m in case.machines)}
    shown = []
    for k in upper:
        mode = found.mode(k)
        shape = [[rows[p.machine], p.magnitude, p.angle_deg] for p in mode.shape if p.magnitude > 0.02]
        s = mode.eigenvalue
        shares = [[p.state, p.share] for p in mode.participation if p.share > 0.01]
        shown.append([s.real, s.imag / (2 * np.pi), mode.damping_ratio, k in swings, mode.label, shares, shape])
    groups = areas(found).groups if swings else ()
    return {
        "modes": shown,
        "areas": [[rows[m] for m in group] for group in groups],
        "text": str(found),
        "gain": gain,
        "factor": factor,
    }


def scaled(case: Case, gain: str, factor: float) -> Case:
    """The case with a gain of all machines multiplied."""
    if factor == 1 or not gain:
        return case
    if gain not in gains(case):
        raise StudyError(f"{case.name} has no gain {gain!r}; choose one of {', '.join(gains(case))}.")
    model, name = gain.split(".")
    rows = {k: par._replace(**{name: factor * getattr(par, name)}) for k, par in case.devices[model].items()}
    return replace(case, devices={**case.devices, model: rows})


def gains(case: Case) -> list[str]:
    """Gains of the controls of a case, as `pss.K`: parameters whose names begin with K."""
    tables = [model for model in of_role(*ROLES) if case.devices.get(model)]
    return [f"{model}.{name}" for model in tables for name in fields(models()[model].Par) if name[0] == "K"]


def critical(points: Points, state: State, load: commands.Source, tell: Tell) -> None:
    """The critical clearing time: the interval after every simulation, the answer, then a finer one."""
    point, low, high = points.of(state), 0.0, float("inf")
    copy = {"copy": commands.lines(load, points.case, state)["critical"]}

    def ran(run: Run) -> None:
        nonlocal low, high
        low, high = (max(low, run.cycles), high) if run.stable else (low, min(high, run.cycles))
        tell({"low": min(low, high), "high": high if high < float("inf") else None})

    options: dict[str, Any] = {"control": points.control(state), "progress": ran}
    found = clearing_time(point, state.contingency, **options)
    tell(_answer(found) | copy)
    if found.status == "found":
        low, high = 0.0, float("inf")
        tell(_answer(clearing_time(point, state.contingency, resolution=FINE, **options)) | copy)


def _answer(found: ClearingTime) -> dict[str, Any]:
    return {
        "status": found.status,
        "cycles": found.cycles,
        "resolution": found.search.resolution_cycles,
        "machine": found.machine,
        "text": str(found),
    }


def landscape(points: Points, state: State, load: commands.Source, tell: Tell) -> None:
    """Critical clearing times of faults at both ends of every line, those of a bus at a time."""
    tell({"copy": commands.lines(load, points.case, state)["screen"]})

    def each(pairs: Sequence[ClearingTime]) -> None:
        rows = [[p.fault, p.trip[0], p.cycles, p.status, p.machine] for p in pairs]
        tell({"pairs": rows})

    found = screen(
        points.of(state),
        control=points.control(state),
        each=each,
        progress=lambda done, of: tell({"done": done, "of": of}),
    )
    tell({"remarks": found.remarks()})


def equal_area_answer(case: Case, machine: int | None, cycles: float) -> dict[str, Any]:
    """Equal areas and phase plane of a bolted fault of so many cycles at a machine, by default the first that has them.

    The machine moves against the center of inertia of the others.
    """
    machine, pair = _first(case) if machine is None else (machine, equivalent(case, machine))
    m, edge = pair.omib, separatrix(pair.omib, 121)
    critical = critical_clearing(m)
    curve = swing_curve(m, max(cycles, 1e-6) / m.fb, until=LONGEST + cycles / m.fb)
    near = abs(curve.angle) < 4.0
    try:
        area = pair.equal_area(cycles)
        sizes, marks = str(area), (area.start, area.clearing, area.stop)
    except StudyError as error:
        sizes, marks = str(error), (m.start, m.unstable, m.unstable)
    return {
        "machine": machine,
        "name": str(case.machine(machine).called),
        "critical": critical.cycles,
        "stable": bool(curve.stable),
        "text": sizes,
        "Pm": m.Pm,
        "Pmax": m.Pmax_post,
        "Pfault": m.Pfault,
        "marks": np.rad2deg(marks).tolist(),
        "unstable": math.degrees(m.unstable),
        "separatrix": _shown(edge.angle, edge.speed),
        "curve": _shown(curve.angle[near], curve.speed[near]),
        "cleared": int((curve.t[near] <= curve.clearing).sum()) - 1,
    }


def _first(case: Case) -> tuple[int, Equivalent]:
    """The first machine with an equivalent, and this; raises `StudyError` as for the first machine if none has one."""
    for m in case.machines:
        with suppress(StudyError):
            return m.machine, equivalent(case, m.machine)
    first = case.machines[0].machine
    return first, equivalent(case, first)


def _shown(angle: np.ndarray, speed: np.ndarray) -> list[list[float]]:
    """Angles (rad) in degrees, and speed deviations (rad/s) in Hz."""
    return [np.rad2deg(angle).tolist(), (speed / (2 * np.pi)).tolist()]

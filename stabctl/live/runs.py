"""Simulations for the page: the curves of the signals shown, and frames for the diagram."""

import time
from typing import Any

import numpy as np

from stabctl.simulation.simulate import simulate
from stabctl.simulation.trajectory import Trajectory

from . import commands
from .packing import pack
from .points import Points
from .state import AT, UNTIL, State

FRAMES = 20.0  # a second, of voltages and angles for the diagram
Arrays = dict[str, np.ndarray]


def answer(points: Points, state: State, load: commands.Source) -> bytes:
    """The run of a state, and the same without storage if the page compares them."""
    begun = time.perf_counter()
    found = [
        ("", simulate(points.of(state), state.contingency, UNTIL, control=state.control(points.case.frequency_hz)))
    ]
    if state.compare and state.stored:
        found.append(("bare.", simulate(points.bare(state), state.contingency, UNTIL)))
    ran = time.perf_counter()
    arrays: Arrays = {}
    for name, run in found:
        arrays |= {name + key: values for key, values in _arrays(run, state.signals).items()}
    head: dict[str, Any] = {
        "runs": {name: _outcome(run) for name, run in found},
        "at": AT,
        "cleared": state.contingency.cleared(points.case),
        "until": UNTIL,
        "opened": state.contingency.opened(points.case),
        "copy": commands.lines(load, points.case, state),
        "simulated_ms": 1e3 * (ran - begun),
    }
    head["server_ms"] = 1e3 * (time.perf_counter() - begun)
    return pack(head, arrays)


def _outcome(run: Trajectory) -> dict[str, Any]:
    end, names = run.outcome, run.point.rotor_names
    lost = [i for i, m in enumerate(names) if m in run.unstable_machines]
    return {"stable": end.stable, "message": end.message, "lost": lost}


def _arrays(run: Trajectory, signals: tuple[str, ...]) -> Arrays:
    """Instants and curves, and the frames of the diagram."""
    a, case, H = run.arrays, run.point.case, run.point.inertia * run.on
    total = np.maximum(H.sum(axis=1), 1e-9)
    angle = np.where(run.on, np.rad2deg(a.angle - ((H * a.angle).sum(axis=1) / total)[:, None]), np.nan)
    size = np.abs(a.V)
    found: Arrays = {"time": run.time}
    for name in signals:
        if name == "speed":
            found[name] = np.where(run.on, a.speed * case.frequency_hz, np.nan)
        elif name == "angle":
            found[name] = angle
        elif name == "voltage":
            row = {b.bus: i for i, b in enumerate(case.buses)}
            found[name] = size[:, [row[m.storage_bus] for m in case.machines]]
        elif name == "storage":
            found[name] = a.storage
    frames = np.unique(np.searchsorted(run.time, np.arange(0, run.time[-1] + 1e-9, 1 / FRAMES)).clip(0, len(a.V) - 1))
    frames = np.unique(np.r_[frames, len(run.time) - 1])
    return found | {"frame": run.time[frames], "frame.angle": angle[frames], "frame.voltage": size[frames]}

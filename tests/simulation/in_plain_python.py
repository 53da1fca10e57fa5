"""Experiments with the stepper as plain Python, where its parts can be exchanged; run with NUMBA_DISABLE_JIT=1.

python in_plain_python.py EXPERIMENT OUT.npz
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import stabctl as st
from stabctl.dynamics.perform import perform
from stabctl.dynamics.program import complex_currents
from stabctl.model.network import UNSWITCHED
from stabctl.simulation import _buffers, _newton, _voltages, method, stepper
from stabctl.simulation._buffers import NOTE, buffers
from stabctl.simulation._substitution import forward
from stabctl.simulation.method import Method
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.topology import stage
from stabctl.simulation.wired import Wired, wired

HEUN = Method((1.0, 1.0), (2.0, 2.0), 1)
KEEP_ON = st.Criterion(max_angle=np.inf, frequency_delay_s=0.0, low_voltage_s=0.0, decay=0.0)
FAULT = st.Contingency("7", clear="3cyc", trip="7-8", at=0.05)
CONTROLS = {
    "bang-bang": lambda: st.BangBang(),
    "feedback": lambda: st.Feedback(1.0, 0.01),
    "sampled": lambda: st.BangBang().sampled(60, "50ms"),
    "gate": lambda: st.Controller(
        ("speed:2",), ("vs:2",), [[-5.0]], [[1.0]], [[9.0]], [[0.0]], limits=0.05, gate=st.Gate("voltage:7", low=0.8)
    ),
    "frames": lambda: st.Controller(("speed:2",), ("vs:2",), [[0.9]], [[0.1]], [[9.0]], [[0.0]], rate=60, delay="50ms"),
}


def experiment(name: str, folder: Path) -> dict[str, np.ndarray]:
    """What an experiment finds, in a process of its own."""
    out, environment = folder / f"{name}.npz", os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, __file__, name, out], check=True, env=environment)
    with np.load(out) as found:
        return dict(found)


def interrupted() -> dict[str, np.ndarray]:
    """Runs in which the loop asks for Newton's method at every stage, and is called again without it."""
    settle, asked = stepper.settle, []

    def asking(*of: object) -> int:
        asked.append(1)
        return _voltages.UNPREPARED if len(asked) % 2 else settle(*of)

    Wired.prepare_newton = lambda *_: None
    point = st.load("two_area").with_storage("50MW", energy=0.01).initialize()  # MWh: the devices fill
    found = {}
    for name, control in CONTROLS.items():
        for kind in ("whole", "interrupted"):
            stepper.settle = settle if kind == "whole" else asking
            run = point.simulate(FAULT, 0.5, control=control(), criterion=KEEP_ON)
            found[f"{name} {kind}"] = np.column_stack([run.time, run.rows])
        found[f"{name} calls"] = np.array(len(asked) // 2)
        asked.clear()
    return found


def orders() -> dict[str, np.ndarray]:
    """Angles after a load step by Kutta's method and by Heun's in its place, with steps of several lengths."""
    case = st.load("two_area").classical()
    shares = dict.fromkeys(("p_power", "q_power", "p_current", "q_current"), 0.0)
    loads = tuple(load._replace(**shares) for load in case.loads)
    point = replace(case, loads=loads).initialize()  # nothing has a kink, every voltage is exact
    found = {}
    for name, table in (("rk4", method.RK4), ("heun", HEUN)):
        for module in (_buffers, method, stepper, stepper):
            for constant, value in (("RK4", table), ("STAGES", len(table.reach_divisor))):
                if hasattr(module, constant):
                    setattr(module, constant, value)
        for step in (1 / 80, 1 / 160, 1 / 1280):
            simulation = Simulation(setup(point, step=step, criterion=KEEP_ON), "7:+200MW@0s")
            simulation.advance(0.5)
            found[f"{name} {round(1 / step)}"] = simulation.angle.copy()
    return found


def newton() -> dict[str, np.ndarray]:
    """Voltages of two_area with loads of constant power, its sources weakened: by each method, and by all of them.

    Then the sources of wscc9 rise from a tenth of theirs, each solution the start of the next one. `tried` has, for a
    rise at which the present voltages were no start from which Newton steps end, which starts were.
    """
    case, found = st.load("two_area"), {}
    shares = {"p_power": 1.0, "q_power": 1.0, "p_current": 0.0, "q_current": 0.0}
    point = replace(case, loads=tuple(load._replace(**shares) for load in case.loads)).initialize()
    for name in ("keep", "descend", "creep", "newton"):
        method = getattr(_newton, name)
        for scale in (1.0, 0.99, 0.97, 0.96, 0.955, 0.95, 0.945, 0.94, 0.93, 0.92, 0.9, 0.8, 0.6, 0.3, 0.1):
            of = _weakened(point, scale, point.V)
            ended = method(*of)
            run = of[3]
            found[f"{name} {scale}"] = np.r_[run.notes[NOTE.found] if name == "newton" else ended, run.volt]
    point, whole, ended = st.load("wscc9").initialize(), _newton.descend, []
    V = point.V

    def kept(*of: Any) -> bool:
        ended.append(whole(*of))
        return ended[-1]

    _newton.descend = kept
    for scale in np.linspace(0.1, 1.0, 181):
        of = _weakened(point, scale, V)
        ended.clear()
        _newton.newton(*of)
        V = of[3].volt
        if len(ended) > 1:
            found["tried"] = np.array(ended)
    found["risen"] = V - point.V
    return found


def _weakened(point: Any, scale: float, V: np.ndarray) -> tuple[Any, ...]:
    """What Newton's method is called with: sources weakened to `scale`, and a start."""
    system, network = wired(point, None), stage(point, UNSWITCHED)
    run, p = buffers(system.start, system.layout, system.places), system.program
    perform(p.source, p.w, p.k, run.s, run.f, network.net.island)
    run.solve.source[:] = scale * run.current
    forward(network.net.factors, run.solve.source, run.solve.work)
    run.solve.begun[:] = run.solve.work
    run.volt[:] = run.solve.before[:] = V
    calls = complex_currents(system.families)
    return p, system.places, network.net, run, _newton.space(calls, network.pattern, system.places, run)


if __name__ == "__main__":
    np.savez(sys.argv[2], **{"interrupted": interrupted, "orders": orders, "newton": newton}[sys.argv[1]]())

"""Experiments with the stepper as plain Python, where its parts can be exchanged; run with NUMBA_DISABLE_JIT=1.

python in_plain_python.py EXPERIMENT OUT.npz
"""

import sys
from dataclasses import replace

import numpy as np

import stabctl as st
from stabctl.simulation import _buffers, _newton, _voltages, method, stepper
from stabctl.simulation.method import Method
from stabctl.simulation.simulation import Simulation

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


def interrupted() -> dict[str, np.ndarray]:
    """Runs in which the loop asks for Newton's method at every stage, and gets what it would have found itself."""
    settle, calls = _voltages.settle, []

    def by_newton(wired: object, *of: object) -> bool:
        calls.append(wired)
        return settle(*of[:-1])

    _newton.of_wired = by_newton
    point = st.load("two_area").with_storage("50MW", energy=0.01).initialize()  # MWh: the devices fill
    found = {}
    for name, control in CONTROLS.items():
        for kind in ("whole", "interrupted"):
            stepper.settle = settle if kind == "whole" else lambda *_: False
            run = point.simulate(FAULT, 0.5, control=control(), criterion=KEEP_ON)
            found[f"{name} {kind}"] = np.column_stack([run.time, run.rows])
        found[f"{name} calls"] = np.array(len(calls))
        calls.clear()
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
            simulation = Simulation(point, "7:+200MW@0s", step=step, criterion=KEEP_ON)
            simulation.advance(0.5)
            found[f"{name} {round(1 / step)}"] = simulation.angle.copy()
    return found


if __name__ == "__main__":
    np.savez(sys.argv[2], **{"interrupted": interrupted, "orders": orders}[sys.argv[1]]())

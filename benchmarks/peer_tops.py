"""The common system in TOPS: RK4 on its ODE, network solved at every stage; derivatives by differences."""

from collections.abc import Callable
from typing import Any

import numpy as np
from common import DROOP, FAULT_OFF, FAULT_ON, FAULT_X, STEP, T1, T2, T3, UNTIL, Answer, Works, fault_bus, produced
from tops.dynamic import PowerSystemModel
from tops.modal_analysis import PowerSystemModelLinearization
from tops.solvers import SimpleRK4

from stabctl.model.case import Case

METHOD = "RK4"


def works(case: Case, step: float = STEP) -> tuple[Works, Callable[[], Answer]]:
    """The three works, each set up by a call, and the answer of the last of each."""
    kept: dict[str, Any] = {}

    def flow() -> Callable[[], None]:
        ps = kept["flow"] = system(case)
        return ps.power_flow

    def motion() -> Callable[[], None]:
        ps = system(case)
        ps.init_dyn_sim()
        return lambda: kept.update(run=simulated(ps, fault_bus(case), step))

    def eigenvalues() -> Callable[[], None]:
        ps = system(case)
        ps.init_dyn_sim()
        kept["modes"] = PowerSystemModelLinearization(ps)
        return kept["modes"].eigenvalue_decomposition

    def answer() -> Answer:
        V = kept["flow"].v_0 if "flow" in kept else np.zeros(0)
        return Answer(V, kept["modes"].eigs if "modes" in kept else np.zeros(0), *kept["run"])

    linear: Works = {"linearization and eigenvalues": eigenvalues, "eigenvalues": eigenvalues}
    return {"power flow": flow, "10 s": motion} | linear, answer


def simulated(ps: PowerSystemModel, bus: int, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Times and speeds under a fault at a bus."""
    place = list(ps.buses["name"]).index(f"B{bus}")
    speeds, rows = ps.gen["GEN"].state_idx_global["speed"], []
    solver = SimpleRK4(ps.ode_fun, 0, ps.x0.copy(), UNTIL, max_step=step)
    steps, on, off = (round(t / step) for t in (UNTIL, FAULT_ON, FAULT_OFF))
    for k in range(steps):
        if k in (on, off):
            ps.y_bus_red_mod[place, place] = 1 / (1j * FAULT_X) if k == on else 0
        rows.append(1 + solver.x[speeds])
        solver.step()
    return step * np.arange(steps), np.array(rows)


def system(case: Case, governed: bool = True) -> PowerSystemModel:
    """The case as a TOPS system.

    TOPS has one machine, of six states. With all reactances x'd its fluxes stand still, as those of the classical
    machine. Its torque is power over speed; D takes the damping back that comes with it.
    """
    mva, volts = case.base_mva, {b.bus: b.rated for b in case.buses}
    swing = next(b.bus for b in case.buses if b.kind == "swing")
    kinds = {b.bus: b for b in case.buses}
    constants = ["X_d", "X_q", "X_d_t", "X_q_t", "X_d_st", "X_q_st", "T_d0_t", "T_q0_t", "T_d0_st", "T_q0_st"]
    machines = []
    for m, power in zip(case.machines, produced(case), strict=True):
        par = case.devices["gencls"][m.machine]
        row = [f"G{m.machine}", f"B{m.bus}", m.base, volts[m.bus], m.p, kinds[m.bus].v, par.H, par.D - power]
        machines.append(row + [par.x1d] * 6 + [1.0] * 4)
    lines = [
        [f"L{i}", f"B{k.from_bus}", f"B{k.to_bus}", 1.0, mva, volts[k.from_bus], "p.u.", k.r, k.x, k.b]
        for i, k in enumerate(case.branches)
    ]
    columns = ["name", "gen", "R", "D_t", "V_min", "V_max", "T_1", "T_2", "T_3"]
    governors = [[f"T{m.machine}", f"G{m.machine}", DROOP, 0.0, 0.0, 1.0, T1, T2, T3] for m in case.machines]
    ps = PowerSystemModel(
        {
            "base_mva": mva,
            "f": case.frequency_hz,
            "slack_bus": f"B{swing}",
            "buses": [["name", "V_n"], *([f"B{b.bus}", b.rated] for b in case.buses)],
            "lines": [["name", "from_bus", "to_bus", "length", "S_n", "V_n", "unit", "R", "X", "B"], *lines],
            "loads": [
                ["name", "bus", "P", "Q", "model"],
                *([f"D{k.bus}", f"B{k.bus}", k.p, k.q, "Z"] for k in case.loads),
            ],
            "shunts": [
                ["name", "bus", "V_n", "Q", "model"],
                *([f"C{b.bus}", f"B{b.bus}", b.rated, b.b, "Z"] for b in case.buses if b.b),
            ],
            "generators": {"GEN": [["name", "bus", "S_n", "V_n", "P", "V", "H", "D", *constants], *machines]},
        }
        | ({"gov": {"TGOV1": [columns, *governors]}} if governed else {})
    )
    ps.setup()
    return ps

"""The common system in ANDES: implicit trapezoidal rule with Newton, sparse."""

from collections.abc import Callable

import andes
import numpy as np
from common import (
    DROOP,
    EMAX,
    FAULT_OFF,
    FAULT_ON,
    KA,
    STEP,
    T1,
    T2,
    T3,
    TE,
    UNTIL,
    Answer,
    fault_bus,
    fault_x,
)

from stabctl.model.case import Case

METHOD = "trapezoidal"


def empty(folder: str) -> andes.System:
    """A system without devices; the first one generates and compiles code into the folder."""
    andes.config_logger(stream_level=50)
    return andes.System(no_output=True, default_config=True, options={"pycode_path": folder})


def works(
    case: Case, folder: str, step: float = STEP
) -> tuple[dict[str, Callable[[], Callable[[], object]]], Callable[[], Answer]]:
    """The three works, each set up by a call, and the answer of the last of each; `folder` holds generated code."""
    kept: dict[str, andes.System] = {}

    def flow() -> Callable[[], None]:
        ss = kept["flow"] = system(case, folder)
        return ss.PFlow.run

    def motion() -> Callable[[], None]:
        ss = kept["run"] = system(case, folder, step=step)
        ss.PFlow.run()
        ss.TDS.init()
        return ss.TDS.run

    def eigenvalues() -> Callable[[], None]:
        ss = kept["modes"] = system(case, folder, fault=False)
        ss.PFlow.run()
        ss.TDS.init()
        return ss.EIG.run

    def linear() -> Callable[[], None]:
        run = eigenvalues()
        ss = kept["modes"]

        def both() -> None:
            ss.j_update(models=ss.exist.pflow_tds)
            run()

        return both

    def answer() -> Answer:
        flow, modes = kept.get("flow"), np.array(kept["modes"].EIG.mu) if "modes" in kept else np.zeros(0)
        V = flow.Bus.v.v * np.exp(1j * flow.Bus.a.v) if flow else np.zeros(0)
        if "run" not in kept:
            return Answer(V, modes, np.zeros(0), np.zeros(0))
        run = kept["run"]
        machines = run.GENCLS if run.GENCLS.n else run.GENROU
        return Answer(V, modes, run.dae.ts.t, run.dae.ts.x[:, machines.omega.a])

    return {
        "power flow": flow,
        "10 s": motion,
        "linearization and eigenvalues": linear,
        "eigenvalues": eigenvalues,
    }, answer


def system(case: Case, folder: str, fault: bool = True, step: float = STEP) -> andes.System:
    """The case as an ANDES system."""
    ss, mva, hz = empty(folder), case.base_mva, case.frequency_hz
    ss.config.mva, ss.config.freq = mva, hz
    kinds, volts = {b.bus: b for b in case.buses}, {b.bus: b.rated for b in case.buses}
    for b in case.buses:
        ss.add("Bus", {"idx": b.bus, "name": str(b.bus), "Vn": b.rated, "v0": b.v, "a0": np.deg2rad(b.angle)})
        if b.b or b.g:
            ss.add("Shunt", {"bus": b.bus, "Sn": mva, "Vn": b.rated, "fn": hz, "b": b.b / mva, "g": b.g / mva})
    for k in case.branches:
        ends = {"bus1": k.from_bus, "bus2": k.to_bus, "Vn1": volts[k.from_bus], "Vn2": volts[k.to_bus]}
        ss.add("Line", ends | {"Sn": mva, "fn": hz, "r": k.r, "x": k.x, "b": k.b, "tap": k.tap, "phi": 0.0})
    for k in case.loads:
        ss.add("PQ", {"bus": k.bus, "Vn": volts[k.bus], "p0": k.p / mva, "q0": k.q / mva})
    if case.loads[0].p_power:
        for shares in (("p2p", 1.0), ("p2z", 0.0), ("q2q", 1.0), ("q2z", 0.0)):
            setattr(ss.PQ.config, *shares)
    full = "genrou" in case.devices
    for m in case.machines:
        bus = kinds[m.bus]
        static = {"idx": m.machine, "bus": m.bus, "Vn": bus.rated, "Sn": m.base, "v0": bus.v, "p0": m.p / mva}
        if bus.kind == "swing":
            ss.add("Slack", static | {"a0": np.deg2rad(bus.angle)})
        else:
            ss.add("PV", static)
        name, par = f"G{m.machine}", case.devices["genrou" if full else "gencls"][m.machine]
        own = {"idx": name, "bus": m.bus, "gen": m.machine, "Vn": bus.rated, "Sn": m.base, "fn": hz, "M": 2 * par.H}
        if full:
            flux = {"xl": par.xl, "xd": par.xd, "xd1": par.x1d, "xd2": par.x2, "Td10": par.T1d, "Td20": par.T2d}
            flux |= {"xq": par.xq, "xq1": par.x1q, "xq2": par.x2, "Tq10": par.T1q, "Tq20": par.T2q}
            ss.add("GENROU", own | flux | {"ra": par.ra, "D": par.D, "S10": par.S10, "S12": par.S12})
            ss.add("SEXS", {"syn": name, "TATB": 1.0, "TB": 1.0, "K": KA, "TE": TE, "EMIN": -EMAX, "EMAX": EMAX})
        else:
            ss.add("GENCLS", own | {"D": par.D, "xd1": par.x1d, "ra": par.ra})
        ss.add("TGOV1", {"syn": name, "R": DROOP, "VMAX": 1.0, "VMIN": 0.0, "T1": T1, "T2": T2, "T3": T3, "Dt": 0.0})
    if fault:
        ss.add("Fault", {"bus": fault_bus(case), "tf": FAULT_ON, "tc": FAULT_OFF, "xf": fault_x(case), "rf": 0.0})
    ss.setup()
    for name, value in {"tf": UNTIL, "tstep": step, "fixt": 1, "shrinkt": 0, "criteria": 0, "no_tqdm": 1}.items():
        setattr(ss.TDS.config, name, value)
    return ss

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
    Works,
    fault_bus,
    fault_x,
)

from stabctl.model.case import Case

METHOD = "trapezoidal"


def empty(folder: str) -> andes.System:
    """A system without devices; the first one generates and compiles code into the folder."""
    andes.config_logger(stream_level=50)
    return andes.System(no_output=True, default_config=True, options={"pycode_path": folder})


def works(case: Case, folder: str, step: float = STEP) -> tuple[Works, Callable[[], Answer]]:
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


def network(case: Case, folder: str) -> andes.System:
    """An ANDES system with the buses, branches, loads and machines of the power flow."""
    ss, mva, hz = empty(folder), case.base_mva, case.frequency_hz
    ss.config.mva, ss.config.freq = mva, hz
    volts = {b.bus: b.rated for b in case.buses}
    for b in case.buses:
        ss.add("Bus", {"idx": b.bus, "name": str(b.bus), "Vn": b.rated, "v0": b.v, "a0": np.deg2rad(b.angle)})
        if b.b or b.g:
            ss.add("Shunt", {"bus": b.bus, "Sn": mva, "Vn": b.rated, "fn": hz, "b": b.b / mva, "g": b.g / mva})
    for i, branch in enumerate(case.branches):
        start, end = branch.from_bus, branch.to_bus
        ends = {"idx": f"L{i}", "bus1": start, "bus2": end, "Vn1": volts[start], "Vn2": volts[end]}
        own = {"r": branch.r, "x": branch.x, "b": branch.b, "tap": branch.tap, "phi": np.deg2rad(branch.phase)}
        ss.add("Line", ends | {"Sn": mva, "fn": hz} | own)
    for k in case.loads:
        ss.add("PQ", {"bus": k.bus, "Vn": volts[k.bus], "p0": k.p / mva, "q0": k.q / mva})
    buses = {b.bus: b for b in case.buses}
    for m in case.machines:
        bus = buses[m.bus]
        static = {"idx": m.machine, "bus": m.bus, "Vn": bus.rated, "Sn": m.base, "v0": bus.v, "p0": m.p / mva}
        if bus.kind == "swing":
            ss.add("Slack", static | {"a0": np.deg2rad(bus.angle)})
        else:
            ss.add("PV", static)
    return ss


def machine(ss: andes.System, case: Case, number: int | str) -> str:
    """The name of a classical machine or GENROU, added to the system."""
    (m,) = (m for m in case.machines if m.machine == number)
    (rated,) = (b.rated for b in case.buses if b.bus == m.bus)
    name, full = f"G{number}", number in case.devices.get("genrou", {})
    par = case.devices["genrou" if full else "gencls"][number]
    own = {"idx": name, "bus": m.bus, "gen": number, "Vn": rated, "Sn": m.base, "fn": case.frequency_hz}
    own |= {"M": 2 * par.H, "D": par.D, "ra": par.ra, "xd1": par.x1d}
    if not full:
        ss.add("GENCLS", own)
        return name
    flux = {"xl": par.xl, "xd": par.xd, "xd2": par.x2, "Td10": par.T1d, "Td20": par.T2d, "S10": par.S10}
    flux |= {"xq": par.xq, "xq1": par.x1q, "xq2": par.x2, "Tq10": par.T1q, "Tq20": par.T2q, "S12": par.S12}
    ss.add("GENROU", own | flux)
    return name


def system(case: Case, folder: str, fault: bool = True, step: float = STEP) -> andes.System:
    """The case as an ANDES system."""
    ss = network(case, folder)
    if case.loads[0].p_power:
        for shares in (("p2p", 1.0), ("p2z", 0.0), ("q2q", 1.0), ("q2z", 0.0)):
            setattr(ss.PQ.config, *shares)
    for m in case.machines:
        name = machine(ss, case, m.machine)
        if "genrou" in case.devices:
            ss.add("SEXS", {"syn": name, "TATB": 1.0, "TB": 1.0, "K": KA, "TE": TE, "EMIN": -EMAX, "EMAX": EMAX})
        ss.add("TGOV1", {"syn": name, "R": DROOP, "VMAX": 1.0, "VMIN": 0.0, "T1": T1, "T2": T2, "T3": T3, "Dt": 0.0})
    if fault:
        ss.add("Fault", {"bus": fault_bus(case), "tf": FAULT_ON, "tc": FAULT_OFF, "xf": fault_x(case), "rf": 0.0})
    ss.setup()
    for name, value in {"tf": UNTIL, "tstep": step, "fixt": 1, "shrinkt": 0, "criteria": 0, "no_tqdm": 1}.items():
        setattr(ss.TDS.config, name, value)
    return ss

"""A power flow from one MATPOWER file in stabctl, ANDES, pandapower and VeraGrid: Newton from a flat start.

Every function reads the file and returns the task and the voltages that it found; the mismatch allowed is 1e-8 pu. The
task is what a user calls for a power flow of data that has been read: from the tool's own tables to its own results.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

TOLERANCE = 1e-8  # pu
Task = tuple[Callable[[], object], Callable[[], np.ndarray]]


def stabctl(path: Path) -> Task:
    """`stabctl.model.powerflow.solve`; its own tolerance is 1e-10 pu."""
    import stabctl as st
    from stabctl.model import powerflow

    case = st.read_matpower(path)
    kept: dict[str, Any] = {}
    return lambda: kept.update(flow=powerflow.solve(case)), lambda: kept["flow"].V


def andes(path: Path) -> Task:
    """`System.PFlow.run` of a system that has been set up."""
    import andes

    andes.config_logger(stream_level=50)
    ss = andes.load(str(path), no_output=True, default_config=True)
    ss.PFlow.config.tol = TOLERANCE
    return ss.PFlow.run, lambda: ss.Bus.v.v * np.exp(1j * ss.Bus.a.v)


def pandapower(path: Path) -> Task:
    """`pandapower.runpp` with numba."""
    from pandapower import runpp
    from pandapower.converter.matpower.from_mpc import from_mpc

    net = from_mpc(str(path), f_hz=60)

    def voltages() -> np.ndarray:
        found = net.res_bus.sort_index()
        return (found.vm_pu * np.exp(1j * np.deg2rad(found.va_degree))).to_numpy()

    return lambda: runpp(net, init="flat", tolerance_mva=100 * TOLERANCE, numba=True), voltages


def veragrid(path: Path) -> Task:
    """`VeraGridEngine.api.power_flow`, Newton-Raphson."""
    import VeraGridEngine.api as vge

    grid = vge.open_file(str(path))
    kept: dict[str, Any] = {}
    options = vge.PowerFlowOptions(solver_type=vge.SolverType.NR, tolerance=TOLERANCE, verbose=0)
    return lambda: kept.update(found=vge.power_flow(grid, options)), lambda: np.asarray(kept["found"].voltage)


TOOLS = {"stabctl": stabctl, "ANDES": andes, "pandapower": pandapower, "VeraGrid": veragrid}

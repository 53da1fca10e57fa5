"""Ten seconds in RAMSES (package `stepss`, Fortran) of the Nordic test system, and of a system of its size in stabctl.

The data of the Nordic system are not part of this project: give the folder of a copy of the repository
SPS-L/stepss-IEEE-Nordic-Test-system. It has 20 machines with exciter, stabilizer, overexcitation limiter and, hydraulic
ones, governor, 74 buses, and loads of constant current (P) and constant admittance (Q). Ours is the packaged `ieee39`
twice: 20 machines with exciter, stabilizer and governor, 78 buses, the same kind of loads.
"""

import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from common import FAULT_OFF, FAULT_ON, STEP, UNTIL

import stabctl as st
from stabctl.dynamics import operating_point
from stabctl.model.replicate import replicate
from stabctl.simulation.simulation import Simulation

FILES = ("lf_A.dat", "dyn_A.dat", "settings1.dat")
EVENTS = f"""\
0.000 CONTINUE SOLVER TR {STEP:.8f} 0.001 0.0 ALL
{FAULT_ON:.3f} FAULT BUS 4032 0.0 0.0
{FAULT_OFF:.3f} CLEAR BUS 4032
{UNTIL:.3f} STOP
"""


def ramses(data: Path) -> Callable[[], float]:
    """A task that returns the processor seconds of a simulation, without reading, as RAMSES states them."""
    import stepss

    folder = Path(tempfile.mkdtemp())
    for name in FILES:
        shutil.copy(data / name, folder)
    (folder / "run.dst").write_text(EVENTS)

    def run() -> float:
        case = stepss.cfg()
        for name in FILES:
            case.addData(str(folder / name))
        case.addDst(str(folder / "run.dst"))
        case.addOut(str(folder / "output.trace"))
        stepss.sim().execSim(case)
        lines = (folder / "output.trace").read_text(errors="replace").splitlines()
        stated = [line for line in lines if line.startswith("CPU time per thread")]
        return float(stated[-1].split()[-2])

    return run


def own() -> Callable[[], float]:
    """The same of stabctl: the processor seconds of all steps, recorded."""
    case = replicate(st.load("ieee39"), 2)
    shares = {"p_current": 1.0, "p_power": 0.0, "q_current": 0.0, "q_power": 0.0}
    point = operating_point.solve(replace(case, loads=tuple(k._replace(**shares) for k in case.loads)))
    fault = st.Contingency("16", clear=FAULT_OFF - FAULT_ON, at=FAULT_ON)

    def run() -> float:
        simulation = Simulation(point, fault, record=True, step=STEP)
        before = time.process_time()
        simulation.advance(UNTIL)
        return time.process_time() - before

    return run

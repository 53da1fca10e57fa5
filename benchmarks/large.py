"""A system of 2,000 buses: reading, load flow, start, simulation, a screen of 50 faults, and memory, with the goals.

`matpower`: ten times a MATPOWER case of 200 buses, with typical machines and constant-power loads, read from an `.m`
file that this program writes. `wnaps`: seventeen times the reduced North American system, with its own dynamic data.
Processor seconds are given beside the seconds on the clock, which are longer on a machine that is not idle.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TypeVar

from machine import stated
from rich.console import Console
from rich.table import Table

import stabctl as st
from stabctl.clearing.screen_result import lines
from stabctl.dynamics import operating_point
from stabctl.model import powerflow

GIVEN = Path(__file__).parents[1] / "tests" / "reference" / "import" / "matpower" / "case_ACTIVSg200.m"
FAULTS = 50
GOALS = {"read": 2.0, "load flow": 1.0, "start": 3.0, "10 s simulated": 4.0}  # s
GOALS |= {"screen of 50 faults": 60.0, "the same, below 6 cycles": 60.0}  # s   on two cores
MEMORY = 2.0  # GB
T = TypeVar("T")


def measured(call: Callable[[], T], rounds: int = 3) -> tuple[float, float, T]:
    """The shortest seconds on the clock and of the processor, and what the call returns."""
    found = []
    for _ in range(rounds):
        clock, processor = time.perf_counter(), time.process_time()
        made = call()
        found.append((time.perf_counter() - clock, time.process_time() - processor))
    return min(row[0] for row in found), min(row[1] for row in found), made


def matpower_file(case: st.Case, folder: Path) -> Path:
    """The power-flow data of a case as a MATPOWER file."""
    demand = Counter({load.bus: complex(load.p, load.q) for load in case.loads})
    kinds = {"pq": 1, "pv": 2, "swing": 3}
    buses = (
        (b.bus, kinds[b.kind], demand[b.bus].real, demand[b.bus].imag, b.g, b.b, 1, b.v, b.angle, b.rated, 1, 1.1, 0.9)
        for b in case.buses
    )
    held = {b.bus: b.v for b in case.buses}
    machines = ((m.bus, m.p, m.q, 1e4, -1e4, held[m.bus], m.base, 1, 1e4, 0, *[0] * 11) for m in case.machines)
    branches = ((k.from_bus, k.to_bus, k.r, k.x, k.b, 0, 0, 0, k.tap, k.phase, 1, -360, 360) for k in case.branches)
    text = "function mpc = large\nmpc.version = '2';\n" + f"mpc.baseMVA = {case.base_mva!r};\n"
    for name, rows in (("bus", buses), ("gen", machines), ("branch", branches)):
        text += f"mpc.{name} = [\n" + "".join("\t" + "\t".join(map(repr, row)) + ";\n" for row in rows) + "];\n"
    path = folder / "large.m"
    path.write_text(text)
    return path


def faulted(case: st.Case, among: Iterable[int]) -> list[int]:
    """Buses with about 50 line faults at them."""
    count = Counter(bus for circuit in lines(case).screened for bus in (circuit.a, circuit.b))
    chosen: list[int] = []
    for bus in among:
        if count[bus] and sum(count[b] for b in chosen) < FAULTS:
            chosen.append(bus)
    return chosen


def rows(read: Callable[[], st.Case], fault: st.Contingency, first: int) -> list[tuple[str, float, float, str]]:
    """Work, seconds on the clock, processor seconds, and what was done."""
    clock, processor, case = measured(read)
    found = [("read", clock, processor, f"{len(case.buses)} buses, {len(case.machines)} machines")]
    clock, processor, flow = measured(lambda: powerflow.solve(case))
    found.append(("load flow", clock, processor, f"{flow.iterations} iterations"))
    operating_point.solve(case, flow)  # compiles
    clock, processor, point = measured(lambda: operating_point.solve(case, flow))
    found.append(("start", clock, processor, f"{point.layout.nx} states"))
    point.simulate(fault, 2)  # compiles

    def ten_seconds() -> st.Trajectory:
        point.stages.clear()
        return point.simulate(fault, 10)

    clock, processor, run = measured(ten_seconds)
    found.append(("10 s simulated", clock, processor, f"{run.steps} steps, recorded"))
    buses = faulted(case, [b.bus for b in case.buses[:first]])
    for work, below in (("screen of 50 faults", None), ("the same, below 6 cycles", "6cyc")):
        clock, processor, screen = measured(partial(point.screen, below, buses=buses, workers=2), 1)
        found.append((work, clock, processor, f"{screen.screened} faults, {screen.simulations} simulations"))
    return found


def main() -> None:
    """Measure and print."""
    console = Console(highlight=False, width=120)
    small, wnaps = st.read_matpower(GIVEN), st.load("wnaps")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = matpower_file(st.replicate(small, 10), folder)
        st.write(st.replicate(wnaps, 17), folder / "wnaps")
        typical = lambda: st.read_matpower(path, machines="typical").with_loads("power")  # noqa: E731
        systems = (
            ("matpower", typical, st.Contingency("189", clear="4cyc"), 200),
            ("wnaps", lambda: st.load(folder / "wnaps"), st.Contingency("83", clear="4cyc", trip="83-33"), 122),
        )
        for title, read, fault, first in systems:
            table = Table("work", "s", "processor, s", "goal, s", "done", title=f"{title}; {stated()}")
            for work, clock, processor, done in rows(read, fault, first):
                table.add_row(work, f"{clock:.3f}", f"{processor:.3f}", f"{GOALS[work]:g}", done)
            console.print(table)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    console.print(f"peak memory of this process {peak:.2f} GB (goal: {MEMORY:g} GB)")


if __name__ == "__main__":
    main()

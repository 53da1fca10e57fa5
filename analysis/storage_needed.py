"""How much storage each law needs, for one fault of two areas and for eight contingencies of the Western system."""

from bisect import bisect_left
from itertools import takewhile
from pathlib import Path

import stabctl as st
from reproduction.console import present
from reproduction.study import Study, Table
from stabctl.controllers import Law
from stabctl.design import LawLimits
from stabctl.design.duty import duty
from stabctl.design.optimum_result import Optimum
from stabctl.placement.contingencies import packaged, read
from stabctl.placement.siting import Siting
from stabctl.simulation.trajectory import Trajectory

FULL = True
WANTED = "25.5cyc"
FAULT = st.Contingency("7-8@0.4", clear=WANTED)
UNTIL = "20s"
STEP, LARGEST = 0.5, 60.0  # MW
GATE = 0.5  # pu
PAPER, LOWER = st.BangBang(), st.BangBang(min_voltage=GATE)
WESTERN = st.StorageLaw(  # as designed for fault 83, line 83-33, of wnaps_paper
    angle_gain=0.5, slope=0.02, deadband=0.05, arm_at=0.05, min_voltage=GATE, return_time=30.0
)
EACH = "law", "lowest voltage (pu)", "MW each", "kWh in all"
FLEETS = "law", "lowest voltage (pu)", "uniform (MW)", "optimized (MW)", "kWh", "sites", "bound (MW)", "runs"
TEXT = (
    "The smallest device at each of the four machines of two_area with which the fault 7-8@0.4 may last 25.5 cycles, "
    "20.375 without storage, in steps of 0.5 MW; all larger ones survive too. The law was designed for this fault "
    "with 50 MW each. The optimum is a schedule that knows the fault, found anew for every size of a bisection.",
    "The cheapest fleets found for wnaps that survive the eight packaged contingencies, each 20 % longer than without "
    "storage.",
)


def study(reports: Path) -> Study:
    """Two areas and the Western system."""
    tables = Table("Devices of two areas", EACH, _each()), Table("Fleets of the Western system", FLEETS, _fleets())
    return Study("Storage that each law needs", text=TEXT, tables=tables)


def _each() -> tuple[tuple[str, ...], ...]:
    """The smallest devices of two areas with each law, and with the optimal schedule."""
    case, limits = st.load("two_area"), LawLimits(min_voltage=GATE)
    designed = st.design.law(case, FAULT, storage="50MW", limits=limits).law
    laws = ("paper's", "0.8", PAPER), ("paper's", "0.5", LOWER), ("designed", "0.5", designed)
    sizes = [(name, gate, *_smallest(law)) for name, gate, law in laws]
    sizes.append(("optimum", "0.5", *_optimal(sizes[1][2])))
    return tuple((name, gate, f"{mw:g}", f"{duty(run).energy_kwh:.0f}") for name, gate, mw, run in sizes)


def _smallest(law: Law) -> tuple[float, Trajectory]:
    """The smallest size above which all survive, and its run."""
    case = st.load("two_area")
    sizes = (LARGEST - STEP * k for k in range(round(LARGEST / STEP)))
    runs = ((mw, case.simulate(FAULT, UNTIL, storage=f"{mw}MW", control=law)) for mw in sizes)
    return list(takewhile(lambda one: one[1].outcome.stable, runs))[-1]


def _optimal(largest: float) -> tuple[float, Trajectory]:
    """The smallest size with a schedule that survives, and its run; with the largest the law survives."""
    case, wanted = st.load("two_area"), float(WANTED.removesuffix("cyc"))
    found: dict[float, Optimum] = {}

    def survives(mw: float) -> bool:
        found[mw] = st.design.optimum(case, FAULT, storage=f"{mw}MW", law=LOWER, limit=WANTED)
        return found[mw].cycles >= wanted

    sizes = [STEP * k for k in range(1, round(largest / STEP))]
    mw = sizes[bisect_left(sizes, True, key=survives)]
    return mw, found[mw].run


def _fleets() -> tuple[tuple[str, ...], ...]:
    """The fleets of the Western system."""
    case = st.load("wnaps")
    contingencies = read(packaged("wnaps", False) or "", case)
    laws = ("paper's", "0.8", PAPER), ("paper's", "0.5", LOWER), ("designed", "0.5", WESTERN)
    return tuple((name, gate, *_row(st.place(case, contingencies, control=law))) for name, gate, law in laws)


def _row(found: Siting) -> tuple[str, ...]:
    """The numbers of a fleet."""
    mw = found.uniform_mw, found.total_mw
    numbers = *(f"{x:.0f}" for x in mw if x is not None), f"{1e3 * found.total_mwh:.0f}"
    return *numbers, str(len(found.sites)), f"{found.lower_bound_mw or 0:.0f}", str(found.simulations)


if __name__ == "__main__":
    present(study)

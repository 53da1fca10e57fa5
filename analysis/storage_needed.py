"""How much storage each law needs, for one fault of two areas and for eight contingencies of the Western system."""

from bisect import bisect_left
from functools import partial
from pathlib import Path
from typing import Any

import stabctl as st
from reproduction.study import Kept, Study, Table, Tell, present
from stabctl.controllers import Law
from stabctl.design import LawLimits
from stabctl.design.law_measurement import duty
from stabctl.io.contingencies.toml import read
from stabctl.placement.contingencies import packaged
from stabctl.placement.siting import Siting

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
FLEETS = "law", "lowest voltage (pu)", "uniform (MW)", "optimized (MW)", "kWh", "sites", "cuts allow (MW)", "runs"
TEXT = (
    "The smallest device at each of the four machines of two_area with which the fault 7-8@0.4 may last 25.5 cycles, "
    "20.375 without storage, in steps of 0.5 MW; all larger ones survive too. The law was designed for this fault "
    "with 50 MW each. The optimum is a schedule that knows the fault, found anew for every size of a bisection.",
    "The cheapest fleets found for wnaps that survive the eight packaged contingencies, each 20 % longer than without "
    "storage.",
)


def study(reports: Path) -> Study:
    """Two areas and the Western system."""
    kept = Kept(__file__, reports)
    tables = (
        Table("Devices of two areas", EACH, _each(kept)),
        Table("Fleets of the Western system", FLEETS, _fleets(kept)),
    )
    return Study("Storage that each law needs", text=TEXT, tables=tables)


def _each(kept: Kept) -> tuple[tuple[str, ...], ...]:
    """The smallest devices of two areas with each law, and with the optimal schedule."""
    case, limits = st.load("two_area"), LawLimits(min_voltage=GATE)
    designed = st.design.law(case, FAULT, storage="50MW", limits=limits, store=kept.folder).law
    laws = ("paper's", "0.8", PAPER), ("paper's", "0.5", LOWER), ("designed", "0.5", designed)
    sizes = [(name, gate, *kept(f"{name}, {gate} pu", partial(_smallest, law))) for name, gate, law in laws]
    sizes.append(("optimum", "0.5", *_optimal(sizes[1][2], kept)))
    return tuple((name, gate, f"{mw:g}", f"{kwh:.0f}") for name, gate, mw, kwh in sizes)


def _smallest(law: Law, tell: Tell) -> tuple[float, float]:
    """The smallest size above which all survive, MW, and the energy used, kWh."""
    case, found = st.load("two_area"), (LARGEST, 0.0)
    for mw in (LARGEST - STEP * k for k in range(round(LARGEST / STEP))):
        run = case.simulate(FAULT, UNTIL, storage=f"{mw}MW", control=law)
        if not run.outcome.stable:
            break
        tell(f"{mw:g} MW")
        found = mw, duty(run).energy_kwh
    return found


def _optimal(largest: float, kept: Kept) -> tuple[float, float]:
    """The smallest size with a schedule that survives, MW, and its energy, kWh; with the largest the law survives."""
    case, wanted = st.load("two_area"), float(WANTED.removesuffix("cyc"))

    def reached(mw: float, tell: Tell) -> tuple[float, float]:
        options: Any = {"law": LOWER, "limit": WANTED, "progress": lambda one: tell(f"{one.cycles:g} cycles")}
        found = st.design.optimum(case, FAULT, storage=f"{mw}MW", **options)
        return found.cycles, duty(found.run).energy_kwh

    def of(mw: float) -> list[float]:
        return kept(f"optimum, {mw:g} MW", partial(reached, mw))

    sizes = [STEP * k for k in range(1, round(largest / STEP))]
    mw = sizes[bisect_left(sizes, True, key=lambda mw: of(mw)[0] >= wanted)]
    return mw, of(mw)[1]


def _fleets(kept: Kept) -> tuple[tuple[str, ...], ...]:
    """The fleets of the Western system."""
    case = st.load("wnaps")
    contingencies = read(packaged("wnaps", False) or "", case)
    laws = ("paper's", "0.8", PAPER), ("paper's", "0.5", LOWER), ("designed", "0.5", WESTERN)

    def placed(law: Law, tell: Tell) -> tuple[str, ...]:
        return _row(
            st.place(
                case, contingencies, control=law, store=kept.folder, progress=lambda n, _: tell(f"{n} simulations")
            )
        )

    return tuple((name, gate, *kept(f"fleet, {name}, {gate} pu", partial(placed, law))) for name, gate, law in laws)


def _row(found: Siting) -> tuple[str, ...]:
    """The numbers of a fleet."""
    mw = found.uniform_mw, found.total_mw
    numbers = *(f"{x:.0f}" for x in mw if x is not None), f"{1e3 * found.total_mwh:.0f}"
    return *numbers, str(len(found.sites)), f"{found.cuts_mw or 0:.0f}", str(found.simulations)


if __name__ == "__main__":
    present(study)

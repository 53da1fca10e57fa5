"""Sections 6 and 7 with storage behind converters: clearing times of both cases and Table 4, and what limits them."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import stabctl as st
from reproduction.study import Picture, Study, Table, draw, present
from stabctl.view.figures import clearing

FULL = True
PERCENT = 5, 10, 15, 20, 25, 30
MODELS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "grid-following": {"storage_model": "regc"},
    "grid-following with PLL": {"storage_model": "regc_c", "converter": "Te=0"},
    "grid-forming": {"storage_model": "regfm", "converter": "ImaxF=1.11"},
}
CASES = {  # name -> case, fault, storage, its properties
    "Case 1, 50 MW": ("two_area", st.Contingency("7-8@0.4"), "50MW", {}),
    "Case 2, 5 % of MVA": ("wnaps", st.Contingency("83", trip="83-33"), "5%mva", {}),
    "Table 4, 15 %": ("wnaps_paper", st.Contingency("83", trip="83-33"), "15%dispatch", {"lag": "50ms"}),
}
LOGIC, LAGS = "Lvplsw=0 Lvpnt1=0.02 Lvpnt0=0.01", "Tg=0.002 Tpord=0 Trv=0.002 Tiq=0"
FOLLOWING, FORMING = {"storage_model": "regc"}, {"storage_model": "regfm", "converter": "ImaxF=1.11"}
PAPER, OPEN = st.BangBang(), st.BangBang(min_voltage=0.0)
VARIED: dict[str, tuple[dict[str, Any], Any]] = {
    "ideal": ({}, PAPER),
    "ideal, no voltage gate": ({}, OPEN),
    "grid-following": (FOLLOWING, PAPER),
    "- no current limit": (FOLLOWING | {"converter": "Imax=9"}, PAPER),
    "- no low-voltage logic": (FOLLOWING | {"converter": LOGIC}, PAPER),
    "- fast lags": (FOLLOWING | {"converter": LAGS}, PAPER),
    "- none of these limits": (FOLLOWING | {"converter": f"Imax=9 {LOGIC} {LAGS}"}, PAPER),
    "- no voltage gate": (FOLLOWING, OPEN),
    "- no voltage gate, no low-voltage logic": (FOLLOWING | {"converter": LOGIC}, OPEN),
    "- supports the voltage, Kqv = 2": (FOLLOWING | {"converter": "Kqv=2"}, PAPER),
    "- with PLL": (MODELS["grid-following with PLL"], PAPER),
    "- with PLL of a fifth of the gains": ({"storage_model": "regc_c", "converter": "Te=0 Kppll=4 Kipll=28"}, PAPER),
    "grid-forming": (FORMING, PAPER),
    "- no current limit ": (FORMING | {"converter": "ImaxF=99"}, PAPER),
    "- no voltage gate ": (FORMING, OPEN),
    "- no law, orders of zero": (FORMING, None),
}
TEXT = (
    "The same fault, the same law and the same megawatts, with the storage device as an ideal power or behind a "
    "converter of as many MVA: REGC_A with REEC_C (grid-following), REGC_C with REEC_C (with phase-locked loop), and "
    "REGFM_A1 (grid-forming) with the current limit of the others, 1.11 pu. In Table 4 the paper's device has constant "
    "conductance; here all have constant power, and all a lag of 0.05 s.",
    "In the first table one thing is changed at a time. The voltage gate is that of the paper's law, which idles "
    "below 0.8 pu.",
)


def study(reports: Path) -> Study:
    """Clearing times side by side, what limits them, and one fault in time."""
    curves = table_4()
    ratings = ["0", *(str(p) for p in PERCENT)]
    heads = ("model", *(f"{p} %" for p in ratings))
    rows = tuple((name, *(f"{c:g}" for c in curve)) for name, curve in curves.items())
    tables = _limits(), Table("Table 4: critical clearing times (cycles) against the rating", heads, rows)
    pictures = (
        draw(
            clearing.compare([0, *PERCENT], curves, xlabel="storage rating (% of dispatched power)"),
            reports / "storage_converters.png",
            "Table 4 behind converters",
            alt="Clearing times rise with the rating for every model, most with grid-forming converters.",
        ),
        _in_time(reports / "storage_converters_power.png"),
    )
    return Study("Storage behind converters", text=TEXT, tables=tables, pictures=pictures)


def cycles(case: st.Case, fault: st.Contingency, size: str, law: Any, options: dict[str, Any]) -> float:
    """The critical clearing time with a fleet."""
    return case.with_storage(size, **options).clearing_time(fault, control=law).cycles


def _limits() -> Table:
    """Clearing times of the three cases, as they are and with one limit changed."""
    rows = [("without storage", *(f"{st.load(c).clearing_time(f).cycles:g}" for c, f, *_ in CASES.values()))]
    for name, (options, law) in VARIED.items():
        found = (cycles(st.load(c), f, size, law, own | options) for c, f, size, own in CASES.values())
        rows.append((name.strip(), *(f"{x:g}" for x in found)))
    return Table("Critical clearing times (cycles), and what limits them", ("storage", *CASES), tuple(rows))


def table_4() -> dict[str, list[float]]:
    """Critical clearing times (cycles) by model and rating; the first without storage."""
    name, fault, _, own = CASES["Table 4, 15 %"]
    case = st.load(name)
    without = case.clearing_time(fault).cycles
    return {
        model: [without, *(cycles(case, fault, f"{p}%dispatch", PAPER, own | options) for p in PERCENT)]
        for model, options in MODELS.items()
    }


def _in_time(path: Path) -> Picture:
    """Power, voltage and current of the device of machine 1 in Case 1, for a fault that all survive."""
    figure = Figure(figsize=(7.5, 6.0), layout="constrained")
    power, voltage, angle = figure.subplots(3, 1, sharex=True)
    for name, options in MODELS.items():
        point = st.load("two_area").with_storage("50MW", **options).initialize()
        run = point.simulate(st.Contingency("7-8@0.4", clear="24cyc", at="0.5s"), "4s", control=PAPER)
        power.plot(run.time, run.arrays.storage[:, 0], label=name)
        voltage.plot(run.time, np.abs(run.arrays.V[:, point.net.place[point.case.storage[0].bus]]))
        moves = run.arrays.angle - run.arrays.angle[0]
        moves -= (moves @ point.inertia / point.inertia.sum())[:, None]
        angle.plot(run.time, np.degrees(moves[:, 0]))
    power.set_ylabel("power absorbed (MW)")
    power.legend(ncols=2, fontsize="small")
    voltage.set_ylabel("voltage (pu)")
    voltage.axhline(0.8, color="gray", linewidth=0.8, linestyle="--")
    angle.set_ylabel("angle from the COI (deg)")
    angle.set_xlabel("time (s)")
    alt = "The ideal device switches at once, converters follow; grid-forming ones also act in the fault."
    caption = "Device and machine 1 of two_area, fault 7-8@0.4 of 24 cycles. Dashed: the gate of the law."
    return draw(figure, path, "A fault of 24 cycles in Case 1", alt=alt, caption=caption)


if __name__ == "__main__":
    present(study)

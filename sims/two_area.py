"""Section 6.1, Case 1 (Figures 14, 15): a 21-cycle fault on a circuit 7-8 of the two-area system."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

import stabctl as st
from reproduction import paper
from reproduction.comparison import Comparison
from reproduction.study import Picture, Study, Table, draw, present
from stabctl.view.figures import clearing, trajectory

LINE, LOCATION, CYCLES = "7-8", 0.4, paper.CASE_1_CYCLES
LOCATIONS = 0.0, 0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.42, 0.45, 0.5  # fraction from bus 7
CASES = {"without storage": {}, "with 50 MW storage": {"storage": "50MW", "control": st.BangBang()}}
HEADS = "", "outcome", "largest angle change", "critical clearing time (cycles)", "same, fault at bus 7"
SIZE = "The machines have 900 MVA, of which 50 MW are 5.6 %."


def study(reports: Path) -> Study:
    """Simulations without and with storage, and the critical clearing time against the location of the fault."""
    base = st.load("two_area").initialize()
    fault = st.Contingency(f"{LINE}@{LOCATION}", clear=f"{CYCLES}cyc")
    runs = {name: base.simulate(fault, **options) for name, options in CASES.items()}
    curves = {
        name: [base.clearing_time(f"{LINE}@{x}", **options).cycles for x in LOCATIONS]
        for name, options in CASES.items()
    }
    at_bus = [base.clearing_time(st.Contingency("7", trip=LINE), **options).cycles for options in CASES.values()]
    last, first = (float(np.interp(CYCLES, curve, LOCATIONS)) for curve in curves.values())
    places = f"from {np.ceil(100 * first) / 100:.2f} to {np.floor(100 * last) / 100:.2f}"
    text = (
        f"The paper does not say where on the circuit the fault is; ours is at {LOCATION:g} of its length from bus 7. "
        f"There, {CYCLES} cycles are unstable without storage and stable with it, as at all locations {places}. "
        f"For a fault at bus 7, the critical clearing times are {at_bus[0]:g} and {at_bus[1]:g} cycles."
    )
    rows = tuple(
        (name, run.outcome.message, f"{run.max_angle_from_coi_deg:.0f} degrees", f"{curve:g}", f"{bus:g}")
        for (name, run), curve, bus in zip(
            runs.items(), (curve[LOCATIONS.index(LOCATION)] for curve in curves.values()), at_bus, strict=True
        )
    )
    return Study(
        "Four machines",
        "6.1",
        (text,),
        tuple(comparisons(*runs.values())),
        (Table(f"Fault at {LINE}@{LOCATION}, {CYCLES} cycles", HEADS, rows),),
        tuple(pictures(reports, runs, curves, (first, last))),
    )


def comparisons(without: st.Trajectory, stored: st.Trajectory) -> Iterator[Comparison]:
    """The outcomes, and the first action of each device."""
    case = stored.point.case
    yield paper.CASE_1_SIZE.compare(100 * case.storage[0].rating / case.machines[0].base, SIZE)
    yield paper.CASE_1_OUTCOMES["without"].compare("stable" if without.outcome.stable else "unstable")
    yield paper.CASE_1_OUTCOMES["with"].compare("stable" if stored.outcome.stable else "unstable")
    for printed, power in zip(paper.CASE_1_FIRST.values(), stored.storage.T, strict=True):
        first = power[np.flatnonzero(np.abs(power) > 1)[0]]  # MW
        yield printed.compare("absorbs" if first > 0 else "injects")


def pictures(
    reports: Path,
    runs: Mapping[str, st.Trajectory],
    curves: Mapping[str, list[float]],
    between: tuple[float, float],
) -> Iterator[Picture]:
    """Figures 14 and 15, and the clearing times."""
    yield draw(
        trajectory.compare(runs),
        reports / "two_area.png",
        "Speeds of the machines",
        alt="Speed against time. Left: the two areas lose synchronism at 3 s. Right: all machines settle together.",
        of="14",
    )
    yield draw(
        trajectory.storage(runs["with 50 MW storage"]),
        reports / "two_area_storage.png",
        "Power of the storage devices",
        alt="Devices 1 and 2 first absorb and then inject full power, devices 3 and 4 the other way around.",
        of="15",
    )
    ax = clearing.compare(LOCATIONS, curves, xlabel=f"location of the fault on {LINE} (fraction from bus 7)")
    ax.axhline(CYCLES, color="0.35", linestyle="--", linewidth=1)
    label = f"{CYCLES} cycles: unstable without,\nstable with storage ({between[0]:.2f} to {between[1]:.2f})"
    ax.axvspan(*between, color="#e69f00", alpha=0.25, label=label)
    ax.legend(frameon=False)
    yield draw(
        ax,
        reports / "two_area_place.png",
        "Clearing time against fault location",
        alt="Both clearing times grow with the distance from bus 7; storage adds a third.",
    )


if __name__ == "__main__":
    present(study)

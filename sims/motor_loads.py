"""Induction motors as a share of all loads of the 39-bus system: clearing time and voltage recovery, with storage."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import stabctl as st
from reproduction.study import Picture, Study, Table, draw, present
from stabctl.view.figures import style
from stabctl.view.figures.palette import COLORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CASE, FAULT = "ieee39", st.Contingency("16", trip="16-17")
SHARES = 0, 20, 40, 60  # % of every load
PAPER = st.BangBang()
STORAGE: dict[str, tuple[str | None, st.BangBang | None]] = {  # name -> model, law
    "no storage": (None, None),
    "ideal": ("ideal", PAPER),
    "ideal, no voltage gate": ("ideal", st.BangBang(min_voltage=0.0)),
    "grid-following": ("regc", PAPER),
    "grid-forming": ("regfm", PAPER),
}
MOTORS: dict[str, dict[str, Any]] = {
    "H = 0.5 s, constant torque": {},
    "H = 1.5 s": {"H": 1.5},
    "torque quadratic in speed": {"A": 1.0, "C0": 0.0},
    "25 % less MVA": {"Pmult": 1.25 * 0.75},
}
SIZE = "5%mva"
BUS, DURATION, CLEARED, RECOVERED = 20, "4cyc", 4 / 60, 0.9  # bus, duration of the fault, s, pu
TEXT = (
    f"Motors (CIM, default parameters) draw 0 to 60 % of every load of {CASE}; the rest is a constant admittance. A "
    f"fault at bus {FAULT.fault} is cleared by opening {', '.join(map(str, FAULT.trip))}. Storage is {SIZE} at every "
    "machine with the paper's law, ideal or behind converters of as many MVA.",
)
HEADS = ("storage", *(f"{share} % motors" for share in SHARES))


def study(reports: Path) -> Study:
    """Clearing times, what of the motor changes them, and the voltage of one bus."""
    found = {name: [clearing_time(share, *how) for share in SHARES] for name, how in STORAGE.items()}
    rows = tuple((name, *(f"{one.cycles:g}" for one in times)) for name, times in found.items())
    kinds = ((name, f"{clearing_time(40, **given).cycles:g}") for name, given in MOTORS.items())
    runs = {(name, share): simulated(share, *how) for name, how in STORAGE.items() for share in SHARES}
    ends = tuple((name, f"{share} %", recovery(run), run.outcome.message) for (name, share), run in runs.items())
    tables = (
        Table("Critical clearing time, cycles", HEADS, rows),
        Table("With 40 % motors of other parameters, no storage", ("motor", "cycles"), tuple(kinds)),
        Table(f"Cleared after {DURATION}", ("storage", "motors", f"above {RECOVERED} pu after", "outcome"), ends),
    )
    return Study("Motor loads", text=TEXT, tables=tables, pictures=(picture(found, runs, reports),))


def base(share: float, model: str | None, **motor: Any) -> st.OperatingPoint:
    """The operating point with motors (%) and storage of a model."""
    case = st.load(CASE).with_motors(share / 100, **motor)
    return (case.with_storage(SIZE, storage_model=model) if model else case).initialize()


def clearing_time(
    share: float, model: str | None = None, law: st.BangBang | None = None, **motor: Any
) -> st.ClearingTime:
    """The critical clearing time."""
    return base(share, model, **motor).clearing_time(FAULT, control=law)


def simulated(share: float, model: str | None, law: st.BangBang | None) -> st.Trajectory:
    """The run with a fault of fixed duration."""
    contingency = st.Contingency(FAULT.fault, clear=DURATION, trip=FAULT.trip, at=0.0)
    return base(share, model).simulate(contingency, until="6s", control=law)


def recovery(run: st.Trajectory) -> str:
    """When, after clearing, the voltage of the bus stays above `RECOVERED`."""
    low = run.time[run.voltage.sel(bus=BUS).values < RECOVERED]
    return f"{low[-1] - CLEARED:.2f} s" if run.outcome.stable else "never"


def picture(
    found: dict[str, list[st.ClearingTime]], runs: dict[tuple[str, int], st.Trajectory], reports: Path
) -> Picture:
    """Clearing times over the share of motors, and voltages of one bus."""
    return draw(
        figure(found, runs),
        reports / "motor_loads.png",
        "Clearing time and voltage recovery with motor loads",
        alt="Left: clearing times fall with the share of motors. Right: the voltage recovers later; with 60 % never.",
        caption=f"Right: voltage of bus {BUS} without storage, fault cleared after 4 cycles.",
    )


def figure(found: dict[str, list[st.ClearingTime]], runs: dict[tuple[str, int], st.Trajectory]) -> "Figure":
    """Two panels."""
    drawn, ((left, right),) = style.subplots(9.0, 3.8, columns=2)
    for (name, times), color, marker in zip(found.items(), COLORS, style.MARKERS, strict=False):
        left.plot(SHARES, [one.cycles for one in times], color=color, marker=marker, label=name)
    left.set_xlabel("motors (% of every load)")
    left.set_ylabel("critical clearing time (cycles)")
    left.legend(loc="upper right")
    for share, color in zip(SHARES, COLORS, strict=False):
        run = runs["no storage", share]
        right.plot(run.time, run.voltage.sel(bus=BUS), color=color, label=f"{share} % motors")
    right.set_xlim(0, 3)
    right.set_xlabel("time (s)")
    right.set_ylabel(f"voltage of bus {BUS} (pu)")
    right.legend(loc="lower right")
    return drawn


if __name__ == "__main__":
    present(study)

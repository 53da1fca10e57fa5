"""Machines of the 39-bus system replaced by converters, one after the other, without and with grid-forming ones."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import stabctl as st
from reproduction.study import Picture, Study, Table, draw, present
from stabctl._util.errors import EquilibriumError
from stabctl.smallsignal import Modes
from stabctl.view.figures import style
from stabctl.view.figures.palette import COLORS, GRAY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CASE = "ieee39"
PULSE = st.LoadStep(16, "0.1s", p=0.1), st.LoadStep(16, "0.3s", p=-0.1)  # MW
BEGIN, SECONDS = 0.4, 10.0  # s
LOOP = 20.0, 700.0  # Kppll in rad/s, Kipll in rad/s2
HEADS = "replaced", "share (%)", "grid-forming (%)", "least damped mode", "Hz", "damping ratio"
HEADS += "real part (1/s)", "simulated (1/s)", "10 s simulation"
WHY = "case", "share (%)", "as it is", "no stabilizers", "loop at half gain", "at a quarter", "voltage control"
TEXT = (
    f"The machines of {CASE} are replaced by converters of the same MVA, power and voltage, the smallest first: at "
    "each step one more, until none is left. A grid-following converter has REEC_B with constant power and reactive "
    "power; a grid-forming one is REGFM_A1. Imax of REEC_B is 1.5 pu; all other parameters are the defaults.",
    "A load of 100 kW is connected at bus 16 for 0.2 s. The deviation of all states, projected on the left "
    "eigenvector of the least damped mode, gives the simulated rate: the slope of the logarithm of its magnitude over "
    "three time constants, at most until 10 s.",
)
VARIANTS = "Unstable steps with one change: largest real part (1/s) of an oscillation"


class Series(NamedTuple):
    """A way to replace machines."""

    name: str
    follow: str  # model of grid-following converters
    share: float  # of the MVA replaced that is grid-forming


class Mixed(NamedTuple):
    """A case with converters."""

    case: st.Case
    forming: tuple[int, ...]
    following: tuple[int, ...]
    percent: float  # MVA of converters over all MVA
    forming_percent: float  # MVA of grid-forming converters over those of all converters


class Step(NamedTuple):
    """What was found in a case with converters."""

    mixed: Mixed
    modes: Modes | None  # None: refused
    mode: int  # the least damped
    rate: complex  # the same from a simulation, 1/s
    outcome: str  # of the simulation, or why there is none


SERIES = (
    Series("Grid-following, ideal angle", "regc_a", 0.0),
    Series("Grid-following, phase-locked loop", "regc_c", 0.0),
    Series("30 % grid-forming", "regc_c", 0.3),
    Series("Grid-forming", "regc_c", 1.0),
)


def study(reports: Path) -> Study:
    """All steps of all series, and the unstable ones with one change each."""
    counts = range(len(st.load(CASE).machines) + 1)
    found = {series: [step(mix(series, count)) for count in counts] for series in SERIES}
    tables = [Table(series.name, HEADS, tuple(map(row, steps))) for series, steps in found.items()]
    unstable = [(s, one) for s, steps in found.items() for one in steps if one.modes and not one.modes.stable]
    tables.append(Table(VARIANTS, WHY, tuple(why(series, one.mixed) for series, one in unstable)))
    pictures = (picture(found, reports),)
    return Study("Converters in place of machines", text=TEXT, tables=tuple(tables), pictures=pictures)


def mix(series: Series, count: int) -> Mixed:
    """The case with its smallest machines replaced; each is grid-forming where this brings their share nearer."""
    case = st.load(CASE)
    mva = {m.machine: m.base for m in case.machines}
    replaced = sorted(mva, key=lambda unit: mva[unit])[:count]
    forming: list[int] = []
    total = formed = 0.0
    for unit in replaced:
        total += mva[unit]
        if formed + mva[unit] / 2 < series.share * total:
            forming.append(unit)
            formed += mva[unit]
    following = [unit for unit in replaced if unit not in forming]
    if forming:
        case = case.with_device("regfm_a1", forming)
    if following:
        case = case.with_device(series.follow, following).with_device("reec_b", following, Imax=1.5)
    return Mixed(
        case, tuple(forming), tuple(following), 100 * total / sum(mva.values()), 100 * formed / max(total, 1.0)
    )


def step(mixed: Mixed) -> Step:
    """The modes of a case with converters, and its simulation."""
    try:
        base = mixed.case.initialize()
    except EquilibriumError as refused:
        return Step(mixed, None, 0, 0j, f"refused: {refused}")
    modes = base.modes()
    k = least_damped(modes)
    rate, outcome = simulated(base, modes, k)
    return Step(mixed, modes, k, rate, outcome)


def least_damped(modes: Modes) -> int:
    """The mode with the smallest damping ratio."""
    upper = np.flatnonzero(modes.eigenvalues.imag >= 0)
    return int(upper[modes.damping_ratio[upper].argmin()])


def simulated(base: st.OperatingPoint, modes: Modes, k: int) -> tuple[complex, str]:
    """The eigenvalue (1/s) in a simulation, and its outcome: after the pulse, w^H (x - x0) is exp(s t)."""
    run = base.simulate(PULSE, SECONDS)
    labels = [place.label for place in run.point.layout.states]
    x = run.rows[:, [labels.index(name) for name in modes.linear.states]]
    z = (x - x[0]) @ modes.left[:, k].conj()
    window = (run.time >= BEGIN) & (run.time <= BEGIN + 3 / abs(modes.eigenvalues[k].real))
    phase = np.log(np.abs(z[window])) + 1j * np.unwrap(np.angle(z[window]))
    return complex(np.polyfit(run.time[window], phase, 1)[0]), str(run.outcome)


def row(one: Step) -> tuple[str, ...]:
    """One step in the table."""
    mixed, modes, k = one.mixed, one.modes, one.mode
    shares = f"{mixed.percent:.0f}", f"{mixed.forming_percent:.0f}"
    head = str(len(mixed.forming + mixed.following)), *shares
    if modes is None:
        return *head, *("",) * 5, one.outcome
    numbers = f"{modes.frequency_hz[k]:.2f}", f"{modes.damping_ratio[k]:.4f}"
    rates = f"{modes.eigenvalues[k].real:.4f}", f"{one.rate.real:.4f}"
    return *head, modes.label(k), *numbers, *rates, one.outcome


def why(series: Series, mixed: Mixed) -> tuple[str, ...]:
    """The rates of an unstable case with one change each."""
    numbers = (f"{rate(case):.3f}" if case else "" for case in variants(series, mixed))
    return series.name, f"{mixed.percent:.0f}", *numbers


def variants(series: Series, mixed: Mixed) -> Iterator[st.Case | None]:
    """The case as it is, without stabilizers, with slower phase-locked loops, and with voltage control."""
    case, following = mixed.case, mixed.following
    yield case
    stabilizers = {f"pss.{unit}.K": 0 for unit in case.devices.get("pss", ())}
    yield case.set(stabilizers) if stabilizers else None
    for gain in (0.5, 0.25):
        kp, ki = gain * LOOP[0], gain**2 * LOOP[1]
        slow = {f"regc_c.{unit}.{name}": v for unit in following for name, v in (("Kppll", kp), ("Kipll", ki))}
        yield case.set(slow) if series.follow == "regc_c" else None
    yield case.with_device("reec_b", following, Imax=1.5, QFlag=1, VFlag=1, Kvp=1.0, Kvi=10.0)


def rate(case: st.Case) -> float:
    """The largest real part (1/s) of an oscillation."""
    s = case.initialize().modes().eigenvalues
    return float(s[s.imag > 0].real.max())


def picture(found: dict[Series, list[Step]], reports: Path) -> Picture:
    """The least damping ratio over the share of converters."""
    return draw(
        figure(found.items()),
        reports / "converter_share.png",
        "Least damping ratio over the share of converters",
        alt="One line for each way to replace machines; a line below zero is an unstable operating point.",
        caption="Below the line the operating point is unstable. A cross at 100 %: refused.",
    )


def figure(found: Iterable[tuple[Series, list[Step]]]) -> "Figure":
    """A line for each series."""
    drawn, ((ax,),) = style.subplots(7.0, 4.0)
    for (series, steps), color, marker in zip(found, COLORS, style.MARKERS, strict=False):
        points = [(s.mixed.percent, s.modes.damping_ratio[s.mode]) for s in steps if s.modes]
        ax.plot(*zip(*points, strict=True), color=color, marker=marker, label=series.name)
        refused = [s.mixed.percent for s in steps if not s.modes]
        ax.plot(refused, [0.0] * len(refused), "x", color=color, markersize=9)
    ax.axhline(0.0, color=GRAY, linewidth=1)
    ax.set_xlabel("converters (% of MVA)")
    ax.set_ylabel("least damping ratio")
    ax.legend(loc="upper left")
    return drawn


if __name__ == "__main__":
    present(study)

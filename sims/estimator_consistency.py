"""Do the estimators know how good they are? NEES and NIS by window, beside a filter from the literature."""

from itertools import pairwise
from pathlib import Path

import numpy as np

import stabctl as st
from reproduction.study import Study, Table, present
from reproduction.unknown_input import UnknownInputFilter
from stabctl.devices.machines import genrou
from stabctl.estimation.estimators import Filtered, estimator
from stabctl.estimation.pmu import Instrument
from stabctl.estimation.rotor_units import Terminals, rotor_units
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

SEEDS, UKF_SEEDS, UNTIL, RATE = 20, 5, 3.0, 60
SYSTEMS = {
    "two_area": ("7", "7-8", "50MW", (11, 11.37)),
    "ieee39": ("16", "16-17", "5%mva", (6, 6.37)),
    "wnaps": ("83", "83-33", "5%mva", (5, 5.37)),
}
WRONG = {"exact data": {}, "reactance x 0.8": {"reactance_factor": 0.8}, "inertia x 1.2": {"inertia_factor": 1.2}}
WINDOWS = "before", "in the fault", "0-0.2 s after", "later"
TEXT = (
    "The normalized error squared (NEES) of angle and speed should be 2 on average, the normalized innovation squared "
    "(NIS) 1. Means over all machines and 20 seeds, with storage under bang-bang control of the estimated speeds, for "
    "faults cleared on and off the frame grid, and PMUs without a filter and with those of P and M class. The 95 % "
    "bands of 20 runs are 1.22 to 2.97 and 0.48 to 1.71."
)
LITERATURE = (
    "On the same frames: the Kalman filter of the package, and a decentralized unscented Kalman filter with unknown "
    "field voltage and mechanical power, which knows the d axis too but neither exciter nor governor."
)
DATA = "With wrong machine data the filter claims more than it knows; the speed suffers from a wrong inertia."


def study(reports: Path) -> Study:
    """Three tables."""
    rows = [row for name in SYSTEMS for row in closed_loop(name)]
    heads = ("system", "filter", "cleared (cycles)", *(f"NEES {w}" for w in WINDOWS), *(f"NIS {w}" for w in WINDOWS))
    loop = Table("NEES and NIS in the closed loop", heads, tuple(rows))
    heads = "filter", *(f"NEES {w}" for w in WINDOWS), *(f"speed error {w} (mHz)" for w in WINDOWS)
    beside = Table("two_area, cleared after 8.37 cycles, without storage", heads, tuple(literature()))
    heads = "system", "data", *(f"NEES {w}" for w in WINDOWS), *(f"speed error {w} (mHz)" for w in WINDOWS)
    wrong = Table("Wrong machine data", heads, tuple(row for name in ("two_area", "ieee39") for row in data(name)))
    return Study("Consistency of the estimators", text=(TEXT, LITERATURE, DATA), tables=(loop, beside, wrong))


def windows(time: np.ndarray, cleared: float, late: float = 0.0) -> list[np.ndarray]:
    """Masks of the frames in each window; `late` (s) is the age of the reports."""
    edges = np.array([0.0, 1.0, cleared, cleared + 0.2, np.inf]) + late - 1e-9
    return [(time >= a) & (time < b) for a, b in pairwise(edges)]


def means(found: st.Estimates, cycles: float, late: float = 0.0) -> tuple[list[float], list[float], list[float]]:
    """NEES, NIS and root mean square error of the speed (mHz) in each window."""
    masks = windows(found.time, 1 + cycles / 60, late)
    nees, nis = ([float(np.nanmean(part[m][found.on[m]])) for m in masks] for part in (found.nees, found.nis))
    error = 1e3 * found.point.case.frequency_hz * (found.estimated - found.slip)
    return nees, nis, [float(np.sqrt(np.mean(error[m][found.on[m]] ** 2))) for m in masks]


def closed_loop(name: str) -> list[tuple[str, ...]]:
    """The rows of a system: every filter class, both clearings."""
    fault, trip, storage, clearings = SYSTEMS[name]
    base, rows = st.load(name).initialize(storage), []
    for kind in ("none", "P", "M"):
        pmu = st.Pmu(filter_class=kind)
        control = st.EstimatorControl(pmu=pmu)
        for cycles in clearings:
            contingency = st.Contingency(fault, clear=f"{cycles}cyc", trip=trip)
            found = base.estimate(contingency, UNTIL, control=control, seeds=range(1, SEEDS + 1), record=False)
            nees, nis, _ = means(found, cycles, pmu.own_frames(60) / pmu.rate)
            rows.append((name, kind, f"{cycles:g}", *(f"{n:.2f}" for n in (*nees, *nis))))
    return rows


def data(name: str) -> list[tuple[str, ...]]:
    """The rows of a system with wrong data."""
    fault, trip, storage, (_, cycles) = SYSTEMS[name]
    base, rows = st.load(name).initialize(storage), []
    contingency = st.Contingency(fault, clear=f"{cycles}cyc", trip=trip)
    for label, factors in WRONG.items():
        control = st.EstimatorControl(**factors)
        found = base.estimate(contingency, UNTIL, control=control, seeds=range(1, UKF_SEEDS + 1), record=False)
        nees, _, error = means(found, cycles)
        rows.append((name, label, *(f"{n:.1f}" for n in (*nees, *error))))
    return rows


def literature(cycles: float = 8.37) -> list[tuple[str, ...]]:
    """The package's filter and that with unknown inputs on the same frames of two_area."""
    point, pmu = st.load("two_area").initialize(), st.Pmu(loss=0.0, clock=0.0)
    simulation = Simulation(setup(point), st.Contingency("7", clear=f"{cycles}cyc", trip="7-8"), record=False)
    terminals, machines = Terminals(simulation), len(point.case.machines)
    instrument = Instrument(pmu, range(UKF_SEEDS), machines, point.case.frequency_hz)
    kalman = estimator("kalman", rotor_units(point), pmu)
    assert isinstance(kalman, Filtered)
    _, par = point.constants("genrou")
    rest = np.array([point.s[at : at + 6] for at in point.rotors.angle])
    V, I = terminals.phasors(point.V)
    first = [genrou.Par(**{k: v[i] for k, v in par.items()}) for i in range(machines)]
    made = [[unknown(first[i], rest[i], V[i], pmu) for i in range(machines)] for _ in range(UKF_SEEDS)]
    found, time = {"Kalman filter of the package": [], "unscented, unknown inputs": []}, []
    for k in range(round((UNTIL + 1) * RATE)):
        at = k / RATE - 1
        if at > 1e-9:
            simulation.advance(at)
        V, I = terminals.phasors(simulation.V if at > 1e-9 else point.V)
        slip, delta = simulation.speed - 1, simulation.angle
        frame = instrument.report(at, *(np.tile(part, (UKF_SEEDS, 1)) for part in (V, I, slip)))
        speed = kalman.step(frame).slip - slip
        each = np.array([[one.step(frame.V[s, i], frame.I[s, i]) or one.error(delta[i], slip[i])
                          for i, one in enumerate(row)] for s, row in enumerate(made)])  # fmt: skip
        time.append(at)
        for label, pair in zip(found, ((kalman.error(delta, slip), speed), (each[..., 0], each[..., 1])), strict=True):
            found[label].append(pair)
    masks, rows = windows(np.array(time), 1 + cycles / 60), []
    for label, frames in found.items():
        nees, error = (np.array([pair[j] for pair in frames]) for j in (0, 1))
        numbers = [nees[m].mean() for m in masks], [6e4 * np.sqrt(np.mean(error[m] ** 2)) for m in masks]
        rows.append((label, *(f"{n:.1f}" for n in (*numbers[0], *numbers[1]))))
    return rows


def unknown(par: genrou.Par, rest: np.ndarray, V: complex, pmu: st.Pmu) -> UnknownInputFilter:
    """The filter of one machine, started at rest."""
    state = genrou.State(*rest)
    y = genrou.output(state, genrou.internal(state, par), (V.real, V.imag), par)
    start = np.r_[rest, y.Te, y.Ifd]
    return UnknownInputFilter(par, start, angle=pmu.angle, magnitude=pmu.magnitude, T=1 / RATE)


if __name__ == "__main__":
    present(study)

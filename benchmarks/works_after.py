"""The tasks of `before.py` with the names of this version."""

import statistics
from collections.abc import Callable
from functools import partial

from machine import cpu, timed

from stabctl import io
from stabctl.clearing import screen
from stabctl.dynamics import operating_point
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.estimation.estimators import Engine, estimator
from stabctl.estimation.pmu import Instrument, Pmu
from stabctl.estimation.rotor_units import Terminals, rotor_units
from stabctl.io.contingencies.toml import read
from stabctl.model import powerflow
from stabctl.model.replicate import replicate
from stabctl.placement.contingencies import packaged
from stabctl.placement.place import place
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation
from stabctl.smallsignal import analyze, descriptor
from stabctl.smallsignal.model import eliminated

CASES = {name: io.load(name) for name in ("two_area", "ieee39", "wnaps")}
FLOWS = {name: powerflow.solve(case) for name, case in CASES.items()}
POINTS = {name: operating_point.solve(case, FLOWS[name]) for name, case in CASES.items()}
CLASSICAL = operating_point.solve(CASES["ieee39"].classical())
FAULTS = {
    "two_area": Contingency("7-8@0.4", clear="20cyc"),
    "wnaps": Contingency("83", clear="4cyc", trip="83-33"),
}


def ten_seconds(name: str, record: bool) -> float:
    """Processor seconds of a run without its set-up."""
    simulation = Simulation(setup(POINTS[name]), FAULTS[name], record=record)
    return cpu(partial(simulation.advance, 10.0))


def frame(engine: Engine = "batched") -> float:
    """Median processor seconds of the Kalman filters of 34 machines per frame of one seed, over two seconds."""
    simulation, pmu = Simulation(setup(POINTS["wnaps"]), FAULTS["wnaps"], record=False), Pmu()
    known, terminals = rotor_units(simulation.point), Terminals(simulation)
    made = estimator("kalman", known, pmu, engine=engine)
    instrument = Instrument(pmu, range(1), len(simulation.point.case.machines), known.frequency_hz)
    times = []
    for k in range(120):
        simulation.advance(k / pmu.rate)
        V, I = terminals.phasors(simulation.V)
        seen = instrument.report(simulation.time, V[None], I[None], simulation.speed[None] - 1)
        times.append(cpu(partial(made.step, seen)))
    return statistics.median(times[1:])


def sited(classical: bool) -> float:
    """Processor seconds of the siting for the packaged contingencies of ieee39, after a run that compiles."""
    case = CASES["ieee39"]
    listed = read(packaged("ieee39", classical) or "", case)
    base = case.classical() if classical else case
    Simulation(setup(operating_point.solve(base)), listed[0], record=False).advance(0.1)
    return cpu(partial(place, base, listed, workers=1))


def linearized(point: OperatingPoint) -> object:
    """The state matrix, with the algebraic variables eliminated."""
    return eliminated(descriptor(point))


def banded(clock: Callable[[Callable[[], object]], float]) -> float:
    """Seconds of the modes from 0.1 to 2.5 Hz of ten times wnaps, 4,370 states, by a clock (`cpu` or `timed`)."""
    form = descriptor(operating_point.solve(replicate(CASES["wnaps"], 10, spread=0.05)))
    return clock(partial(analyze, form, (0.1, 2.5)))


WORKS = {
    **{f"10 s of {k}": partial(ten_seconds, k, False) for k in FAULTS},
    **{f"10 s of {k}, recorded": partial(ten_seconds, k, True) for k in FAULTS},
    **{f"start of {k}": partial(cpu, partial(operating_point.solve, CASES[k], FLOWS[k])) for k in CASES},
    **{f"linearization of {k}": partial(cpu, partial(linearized, p)) for k, p in POINTS.items()},
    "screen of ieee39, classical, below 5 cycles": partial(cpu, partial(screen, CLASSICAL, below="5cyc", workers=1)),
    "Kalman filter, 34 machines, per frame: default engine": frame,
    "Kalman filter, 34 machines, per frame: batched engine": partial(frame, "batched"),
}
LONG = {
    "screen of the 190 faults of wnaps": lambda: cpu(partial(screen, POINTS["wnaps"], workers=1)),
    "`place ieee39`, full order": partial(sited, False),
    "`place ieee39`, classical": partial(sited, True),
    "modes from 0.1 to 2.5 Hz, 4,370 states": partial(banded, cpu),
    "modes from 0.1 to 2.5 Hz, 4,370 states, wall": partial(banded, timed),
}

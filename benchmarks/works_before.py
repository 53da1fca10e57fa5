"""The tasks of `before.py` with the names of version 0.1."""

import statistics
from collections.abc import Callable
from functools import partial

from machine import cpu, timed
from stabctl.estimate.estimators import estimator
from stabctl.estimate.machines import Terminals, machines
from stabctl.estimate.pmu import Instrument, Pmu
from stabctl.linear import descriptor
from stabctl.linear.model import eliminated
from stabctl.modes import analyse
from stabctl.placement.contingency import load, packaged
from stabctl.replicate import replicate
from stabctl.screen import screen
from stabctl.simulate.events import contingency
from stabctl.simulate.simulation import Simulation

from stabctl import equilibrium, powerflow, read
from stabctl.placement.place import place

CASES = {name: read.load(name) for name in ("two_area", "ieee39", "wnaps")}
FLOWS = {name: powerflow.solve(case) for name, case in CASES.items()}
POINTS = {name: equilibrium.solve(case, FLOWS[name]) for name, case in CASES.items()}
CLASSICAL = equilibrium.solve(CASES["ieee39"].classical())
FAULTS = {"two_area": contingency("7-8@0.4", 20 / 60, []), "wnaps": contingency("83", 4 / 60, ["83-33"])}


def ten_seconds(name: str, record: bool) -> float:
    """Processor seconds of a run without its set-up."""
    simulation = Simulation(POINTS[name], FAULTS[name], record=record)
    return cpu(partial(simulation.advance, 10.0))


def frame(engine: str | None) -> float:
    """Median processor seconds of the Kalman filters of 34 machines per frame of one seed, over two seconds."""
    simulation, pmu = Simulation(POINTS["wnaps"], FAULTS["wnaps"], record=False), Pmu()
    known, terminals = machines(simulation.point), Terminals(simulation)
    made = estimator("kalman", known, pmu, **({"engine": engine} if engine else {}))
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
    listed = load(packaged("ieee39", classical), case)
    base = case.classical() if classical else case
    fault = contingency(str(listed[0].fault), listed[0].clear, list(map(str, listed[0].trip)))
    Simulation(equilibrium.solve(base), fault, record=False).advance(0.1)
    return cpu(partial(place, base, listed, workers=1))


def banded(clock: Callable[[Callable[[], object]], float]) -> float:
    """Seconds of the modes from 0.1 to 2.5 Hz of ten times wnaps, 4,370 states, by a clock (`cpu` or `timed`)."""
    form = descriptor(equilibrium.solve(replicate(CASES["wnaps"], 10, spread=0.05)))
    return clock(partial(analyse, form, (0.1, 2.5)))


WORKS = {
    **{f"10 s of {k}": partial(ten_seconds, k, False) for k in FAULTS},
    **{f"10 s of {k}, recorded": partial(ten_seconds, k, True) for k in FAULTS},
    **{f"start of {k}": partial(cpu, partial(equilibrium.solve, CASES[k], FLOWS[k])) for k in CASES},
    **{f"linearization of {k}": partial(cpu, lambda p=p: eliminated(descriptor(p))) for k, p in POINTS.items()},
    "screen of ieee39, classical, below 5 cycles": partial(cpu, partial(screen, CLASSICAL, below=5.0, workers=1)),
    "Kalman filter, 34 machines, per frame: default engine": partial(frame, None),
    "Kalman filter, 34 machines, per frame: batched engine": partial(frame, "batched"),
}
LONG = {
    "screen of the 190 faults of wnaps": lambda: cpu(partial(screen, POINTS["wnaps"], workers=1)),
    "`place ieee39`, full order": partial(sited, False),
    "`place ieee39`, classical": partial(sited, True),
    "modes from 0.1 to 2.5 Hz, 4,370 states": partial(banded, cpu),
    "modes from 0.1 to 2.5 Hz, 4,370 states, wall": partial(banded, timed),
}

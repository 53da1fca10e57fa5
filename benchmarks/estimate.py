"""Time of the estimators per frame of the 34 machines of wnaps (a frame at 60 per second is 16.7 ms): medians."""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.estimation._signals import CoiReference
from stabctl.estimation.estimators import Engine, estimator
from stabctl.estimation.pmu import Frame, Instrument, Pmu
from stabctl.estimation.rotor_units import Terminals, rotor_units
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

FRAMES = 240


def frames(case: str, seeds: int) -> tuple[Simulation, list[Frame]]:
    """The reports of a fault at bus 83 of the case, cleared after four cycles."""
    point = operating_point.solve(io.load(case))
    simulation = Simulation(setup(point), Contingency("83", 4 / 60, ["83-33"]), record=False)
    pmu, terminals, seen = Pmu(), Terminals(simulation), []
    instrument = Instrument(pmu, range(seeds), len(point.case.machines), point.case.frequency_hz)
    for k in range(FRAMES):
        simulation.advance(k / pmu.rate)
        V, I = terminals.phasors(simulation.V)
        truth = (np.tile(part, (seeds, 1)) for part in (V, I, simulation.speed - 1))
        seen.append(instrument.report(simulation.time, *truth))
    return simulation, seen


def per_frame(simulation: Simulation, seen: list[Frame], engine: Engine) -> tuple[float, float]:
    """Median seconds of a frame: of the estimates, and with the deviations from the COI of the rest."""
    pmu, known = Pmu(), rotor_units(simulation.point)
    made = estimator("kalman", known, pmu, engine=engine)
    hz = known.frequency_hz
    coi = CoiReference(known.inertia, pmu.rate, pmu.own_frames(hz), pmu.remote_frames(hz))
    island, walls = np.zeros(seen[0].V.shape, int), []
    for frame in seen:
        before = time.perf_counter()
        estimate = made.step(frame)
        between = time.perf_counter()
        coi.step(estimate, island)
        walls.append((between - before, time.perf_counter() - before))
    return tuple(statistics.median(column) for column in zip(*walls[1:], strict=True))


def main() -> None:
    """Measure and print."""
    table = Table("engine", "seeds", "estimates, ms", "with COI, ms", "of one seed, ms", "target, ms")
    works: tuple[tuple[Engine, int, float], ...] = (("filterpy", 1, 4.0), ("batched", 1, 0.15), ("batched", 20, 0.15))
    for engine, seeds, wanted in works:
        simulation, seen = frames("wnaps", seeds)
        alone, whole = (1e3 * s for s in per_frame(simulation, seen, engine))
        cells = (f"{alone:.3f}", f"{whole:.3f}", f"{whole / seeds:.3f}", f"{wanted:g}")
        table.add_row(engine, str(seeds), *cells)
    Console(highlight=False).print(table)


if __name__ == "__main__":
    main()

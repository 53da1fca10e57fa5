"""The tasks of `before.py` with the names of version 0.1."""

from functools import partial

from machine import cpu
from stabctl.linear import descriptor
from stabctl.linear.model import eliminated
from stabctl.screen import screen
from stabctl.simulate.events import contingency
from stabctl.simulate.simulation import Simulation

from stabctl import equilibrium, powerflow, read

CASES = {name: read.load(name) for name in ("two_area", "ieee39", "wnaps")}
FLOWS = {name: powerflow.solve(case) for name, case in CASES.items()}
POINTS = {name: equilibrium.solve(case, FLOWS[name]) for name, case in CASES.items()}
CLASSICAL = equilibrium.solve(CASES["ieee39"].classical())
FAULTS = {"two_area": contingency("7-8@0.4", 20 / 60, []), "wnaps": contingency("83", 4 / 60, ["83-33"])}


def ten_seconds(name: str, record: bool) -> float:
    """Processor seconds of a run without its set-up."""
    simulation = Simulation(POINTS[name], FAULTS[name], record=record)
    return cpu(partial(simulation.advance, 10.0))


WORKS = {
    **{f"10 s of {k}": partial(ten_seconds, k, False) for k in FAULTS},
    **{f"10 s of {k}, recorded": partial(ten_seconds, k, True) for k in FAULTS},
    **{f"start of {k}": partial(cpu, partial(equilibrium.solve, CASES[k], FLOWS[k])) for k in CASES},
    **{f"linearization of {k}": partial(cpu, lambda p=p: eliminated(descriptor(p))) for k, p in POINTS.items()},
    "screen of ieee39, classical, below 5 cycles": partial(cpu, partial(screen, CLASSICAL, below=5.0, workers=1)),
}

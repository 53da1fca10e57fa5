"""The tasks of `before.py` with the names of this version."""

from functools import partial

from machine import cpu

from stabctl import io
from stabctl.clearing import screen
from stabctl.dynamics import operating_point
from stabctl.model import powerflow
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import Simulation
from stabctl.smallsignal import descriptor
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
    simulation = Simulation(POINTS[name], FAULTS[name], record=record)
    return cpu(partial(simulation.advance, 10.0))


WORKS = {
    **{f"10 s of {k}": partial(ten_seconds, k, False) for k in FAULTS},
    **{f"10 s of {k}, recorded": partial(ten_seconds, k, True) for k in FAULTS},
    **{f"start of {k}": partial(cpu, partial(operating_point.solve, CASES[k], FLOWS[k])) for k in CASES},
    **{f"linearization of {k}": partial(cpu, lambda p=p: eliminated(descriptor(p))) for k, p in POINTS.items()},
    "screen of ieee39, classical, below 5 cycles": partial(cpu, partial(screen, CLASSICAL, below="5cyc", workers=1)),
}

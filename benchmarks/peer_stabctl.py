"""The common system in stabctl: compiled RK4, network solved at every stage; exact derivatives."""

from collections.abc import Callable
from typing import Any

import numpy as np
from common import FAULT_OFF, FAULT_ON, STEP, UNTIL, Answer, Works, fault_bus, fault_x

from stabctl.dynamics import operating_point
from stabctl.model import powerflow
from stabctl.model.case import Case
from stabctl.simulation.events import Clear, Event, Fault
from stabctl.simulation.simulation import run
from stabctl.smallsignal import analyze, linearize

METHOD = "RK4"


def works(case: Case, step: float = STEP) -> tuple[Works, Callable[[], Answer]]:
    """The three works, each set up by a call, and the answer of the last of each."""
    flow = powerflow.solve(case)
    kept: dict[str, Any] = {}
    bus = str(fault_bus(case))
    events: list[Event | str] = [Fault(bus, FAULT_ON, 1j * fault_x(case)), Clear(bus, FAULT_OFF)]

    def motion() -> Callable[[], None]:
        point = operating_point.solve(case, flow)
        return lambda: kept.update(run=run(point, events, UNTIL, step=step))

    def eigenvalues() -> Callable[[], None]:
        point = operating_point.solve(case, flow)
        return lambda: kept.update(modes=analyze(linearize(point)))

    def answer() -> Answer:
        run = (kept["run"].time, kept["run"].arrays.speed) if "run" in kept else (np.zeros(0), np.zeros(0))
        return Answer(flow.V, kept["modes"].eigenvalues if "modes" in kept else np.zeros(0), *run)

    made: Works = {"power flow": lambda: lambda: powerflow.solve(case), "10 s": motion}
    return made | {"linearization and eigenvalues": eigenvalues, "eigenvalues": eigenvalues}, answer

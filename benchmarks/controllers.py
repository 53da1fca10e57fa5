"""Cost of controllers in a simulation: runs with and without them in turns, medians of the differences."""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics
import time
from collections.abc import Sequence

import numpy as np
from machine import stated
from rich.console import Console
from rich.table import Table

import stabctl as st

UNTIL = 10.0  # s
TURNS = 41


def spent(base: st.OperatingPoint, fault: st.Contingency, control: Sequence[st.Controller]) -> float:
    """Seconds of processor time of a run."""
    began = time.thread_time()
    base.simulate(fault, UNTIL, control=control)
    return time.thread_time() - began


def beside(base: st.OperatingPoint, fault: st.Contingency, one: st.Controller) -> tuple[float, float]:
    """Median seconds of a run without a controller, and of what a controller adds to the run next to it."""
    for control in ([], [one]):
        spent(base, fault, control)
    turns = [(spent(base, fault, []), spent(base, fault, [one])) for _ in range(TURNS)]
    return statistics.median(a for a, _ in turns), statistics.median(b - a for a, b in turns)


def ten_states(reads: str, drives: str, rate: int | None = None) -> st.Controller:
    """Ten states that all act on each other, as those of an observer do; stable, of little effect."""
    random = np.random.default_rng(0)
    A = random.normal(size=(10, 10)) / 3 - 3 * np.eye(10)
    B, C = random.normal(size=(10, 1)), 1e-3 * random.normal(size=(1, 10))
    one = st.Controller((reads,), (drives,), A, B, C, np.zeros((1, 1)), name="ten states")
    return one.sampled(rate) if rate else one


def main() -> None:
    """Measure and print."""
    table = Table("controller", "case", "without, ms", "more", "target", title=stated())
    wnaps = st.load("wnaps").initialize()
    fault = st.Contingency("83", clear=4 / 60, trip="83-33")
    for what, one, target in (
        ("10 states, continuous", ten_states("speed:14", "vref:14"), "6 %"),
        ("10 states, 60 frames/s", ten_states("speed:14", "vref:14", 60), ""),
    ):
        alone, more = beside(wnaps, fault, one)
        table.add_row(what, "wnaps", f"{1e3 * alone:.1f}", f"{100 * more / alone:.1f} %", target)
    two_area = st.load("two_area").initialize(storage="50MW")
    fault = st.Contingency("7-8@0.4", clear="6cyc")
    for what, reads, drives in (
        ("Python function, 60 frames/s", "deviation:1", "order:1@5"),
        ("Python function, 60 frames/s, all machines", "deviation", "order"),
    ):
        one = st.Controller.from_function(lambda seen: 100 * seen[reads], reads, drives, rate=60)  # noqa: B023
        alone, more = beside(two_area, fault, one)
        table.add_row(what, "two_area", f"{1e3 * alone:.1f}", f"{1e3 * more / UNTIL:.2f} ms per simulated s", "3 ms")
    Console(highlight=False).print(table)


if __name__ == "__main__":
    main()

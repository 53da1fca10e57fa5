"""The same tasks with the same data in stabctl, ANDES and TOPS: medians of one run, and how well the results agree.

A tool that is not installed is named and left out. The tasks are a power flow, ten seconds with a fault at 1/120 s, and
a linearization with all its eigenvalues; they do not include building the tool's own model (set-up) or generating code.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import importlib
import statistics
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO

import common
import numpy as np
from common import Answer
from machine import stated
from rich.console import Console
from rich.table import Table

from stabctl.model.replicate import replicate

ROUNDS = 5
COPIES = 182  # of two_area, 2,002 buses
WORKS = ("power flow", "10 s", "eigenvalues")
Tool = tuple[dict[str, Callable[[], Callable[[], object]]], Callable[[], Answer], str]


def peer(name: str) -> object | None:
    """The module for a tool; None, with a message, if the tool is not installed."""
    try:
        return importlib.import_module(f"peer_{name}")
    except ImportError as error:
        print(f"{name} is left out: {error}; install it with pip install 'stabctl[bench]'.")
        return None


def measured(
    tools: dict[str, Tool], tasks: tuple[str, ...] = WORKS, rounds: int = ROUNDS
) -> dict[tuple[str, str], tuple[float, float]]:
    """Medians (s) of set-up and tasks of every tool; the tools take turns, so that the load is the same for all."""
    times: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for _ in range(rounds):
        for name, (works, _, _) in tools.items():
            for work in tasks:
                before = time.perf_counter()
                ready = works[work]()
                between = time.perf_counter()
                ready()
                taken = between - before, time.perf_counter() - between
                times.setdefault((name, work), []).append(taken)
    return {key: tuple(statistics.median(column) for column in zip(*rows, strict=True)) for key, rows in times.items()}


def agreement(own: Answer, other: Answer) -> dict[str, str]:
    """Largest difference of another tool's result from ours, for every task."""
    mine, theirs = common.swings(own.eigenvalues), common.swings(other.eigenvalues)
    common_time = np.arange(0, common.UNTIL - 0.1, 0.05)
    traces = [np.column_stack([np.interp(common_time, a.time, column) for column in a.speed.T]) for a in (own, other)]
    largest, hertz = np.abs(traces[0] - 1).max(), 60e3
    off = np.abs(traces[0] - traces[1]).max()
    swings = f"{np.abs(mine - theirs).max():.1e} 1/s" if len(mine) == len(theirs) else "not the same swings"
    V = [a.V * np.exp(-1j * np.angle(a.V[0])) for a in (own, other)]
    return {
        "power flow": f"{np.abs(V[0] - V[1]).max():.1e} pu",
        "10 s": f"{off * hertz:.2g} mHz of {largest * hertz:.0f}",
        "eigenvalues": swings,
    }


def compared(title: str, tools: dict[str, Tool], console: Console) -> None:
    """Measure and print one system."""
    with redirect_stdout(StringIO()):
        medians = measured(tools)
    answers = {name: answer() for name, (_, answer, _) in tools.items()}
    table = Table("work", "tool", "method", "set-up, s", "seconds", "over stabctl", "largest difference", title=title)
    for work in WORKS:
        for name, (_, _, method) in tools.items():
            setup, seconds = medians[name, work]
            ratio = seconds / medians["stabctl", work][1]
            same = "" if name == "stabctl" else agreement(answers["stabctl"], answers[name])[work]
            how = method if work == "10 s" else ""
            table.add_row(work, name, how, f"{setup:.3f}", f"{seconds:.4f}", f"{ratio:.1f}", same)
    console.print(table)


def large(tools: dict[str, Tool], title: str, console: Console) -> None:
    """Measure and print the power flow of a large system, once."""
    with redirect_stdout(StringIO()):
        medians = measured(tools, ("power flow",), 1)
    table = Table("work", "tool", "set-up, s", "seconds", title=title)
    for name in tools:
        setup, seconds = medians[name, "power flow"]
        table.add_row("power flow", name, f"{setup:.3f}", f"{seconds:.4f}")
    console.print(table)


def main() -> None:
    """Measure and print."""
    warnings.filterwarnings("ignore")
    console = Console(highlight=False, width=120)
    own, andes, tops = (peer(name) for name in ("stabctl", "andes", "tops"))
    with tempfile.TemporaryDirectory() as folder:
        if andes:
            before = time.perf_counter()
            with redirect_stdout(StringIO()):
                andes.empty(folder)
            print(f"ANDES generated its code in {time.perf_counter() - before:.0f} s, once for all systems.")
        for title, case in (
            ("two_area, classical machines, TGOV1", common.classical()),
            ("two_area, GENROU, SEXS, TGOV1", common.full()),
        ):
            tools: dict[str, Tool] = {"stabctl": (*own.works(case), own.METHOD)}
            if andes:
                tools["ANDES"] = (*andes.works(case, folder), andes.METHOD)
            if tops and "gencls" in case.devices:
                tools["TOPS"] = (*tops.works(case), tops.METHOD)
            compared(f"{title}; medians of {ROUNDS}; {stated()}", tools, console)
        case = replicate(common.classical(), COPIES)
        tools = {"stabctl": (*own.works(case), own.METHOD)}
        if andes:
            tools["ANDES"] = (*andes.works(case, folder), andes.METHOD)
        if tops:
            tools["TOPS"] = (*tops.works(case), tops.METHOD)
        large(tools, f"two_area {COPIES} times, {len(case.buses)} buses; {stated()}", console)
    print("With GENROU the stator voltage of stabctl is in proportion to the speed, that of ANDES is not; TOPS has no")
    print("GENROU (its machine lacks the leakage reactance and the stator resistance).")


if __name__ == "__main__":
    main()

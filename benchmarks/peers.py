"""The same tasks with the same data in stabctl and other programs: medians of one run, and how well the results agree.

A tool that is not installed is named and left out. The tasks are a power flow, ten seconds with a fault at 1/120 s, and
a linearization with all its eigenvalues; they do not include building the tool's own model (set-up) or generating code.
ANDES evaluates its derivatives during initialization: `eigenvalues` leaves them out in ANDES, but not in stabctl and
TOPS; `linearization and eigenvalues` evaluates them in all three. Processor seconds.

Run: python benchmarks/peers.py [--only two_area wnaps flow]
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import argparse
import importlib
import statistics
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import common
import numpy as np
import peer_flow
from common import Answer
from large import GIVEN, matpower_file
from machine import cpu, stated
from rich.console import Console
from rich.table import Table

from stabctl import load, read_matpower
from stabctl.model.replicate import replicate

ROUNDS = 9
COPIES = 10  # of a case of 200 buses
LINEAR = ("linearization and eigenvalues", "eigenvalues")
WORKS = ("power flow", "10 s", *LINEAR)
GROUPS = ("two_area", "wnaps", "flow")
Tool = tuple[common.Works, Callable[[], Answer], str]


def peer(name: str) -> Any:
    """The module for a tool; None, with a message, if the tool is not installed."""
    try:
        return importlib.import_module(f"peer_{name}")
    except ImportError as error:
        print(f"{name} is left out: {error}; install it with pip install 'stabctl[bench]'.")
        return None


def measured(tools: dict[str, Tool], tasks: tuple[str, ...] = WORKS) -> dict[tuple[str, str], tuple[float, float]]:
    """Medians (s) of set-up and tasks of every tool; the tools take turns, so that the load is the same for all."""
    times: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for _ in range(ROUNDS):
        for name, (works, _, _) in tools.items():
            for work in tasks:
                before = time.process_time()
                ready = works[work]()
                between = time.process_time()
                ready()
                taken = between - before, time.process_time() - between
                times.setdefault((name, work), []).append(taken)
    return {key: tuple(statistics.median(column) for column in zip(*rows, strict=True)) for key, rows in times.items()}


def agreement(own: Answer, other: Answer) -> dict[str, str]:
    """Largest difference of another tool's result from ours, for every task."""
    mine, theirs = common.swings(own.eigenvalues), common.swings(other.eigenvalues)
    swings = f"{np.abs(mine[:, None] - theirs).min(axis=1).max():.1e} 1/s"
    found = {"power flow": apart(own.V, other.V)} | dict.fromkeys(LINEAR, swings)
    if len(own.time):
        instants = np.arange(0, common.UNTIL - 0.1, 0.05)
        traces = [np.column_stack([np.interp(instants, a.time, column) for column in a.speed.T]) for a in (own, other)]
        largest, off = np.abs(traces[0] - 1).max(), np.abs(traces[0] - traces[1]).max()
        found["10 s"] = f"{off * 60e3:.2g} mHz of {largest * 60e3:.0f}"
    return found


def apart(one: np.ndarray, other: np.ndarray) -> str:
    """Largest difference of voltages, that of the first bus at angle 0."""
    one, other = (V * np.exp(-1j * np.angle(V[0])) for V in (one, other))
    return f"{np.abs(one - other).max():.1e} pu"


def compared(title: str, tools: dict[str, Tool], console: Console, tasks: tuple[str, ...] = WORKS) -> None:
    """Measure and print one system."""
    with redirect_stdout(StringIO()):
        medians = measured(tools, tasks)
    answers = {name: answer() for name, (_, answer, _) in tools.items()}
    table = Table("work", "tool", "method", "set-up, s", "ms", "over stabctl", "largest difference", title=title)
    for work in tasks:
        for name, (_, _, method) in tools.items():
            setup, seconds = medians[name, work]
            ratio = seconds / medians["stabctl", work][1]
            same = "" if name == "stabctl" else agreement(answers["stabctl"], answers[name])[work]
            how = method if work == "10 s" else ""
            table.add_row(work, name, how, f"{setup:.3f}", f"{1e3 * seconds:.4g}", f"{ratio:.3g}", same)
    console.print(table)


def systems(chosen: set[str], console: Console) -> None:
    """The two-area system with two sets of models, and the reduced Western system, in the tools that have them."""
    own, andes, tops = (peer(name) for name in ("stabctl", "andes", "tops"))
    with tempfile.TemporaryDirectory() as folder:
        if andes:
            before = time.perf_counter()
            with redirect_stdout(StringIO()):
                andes.empty(folder)
            print(f"ANDES generated its code in {time.perf_counter() - before:.0f} s, once for all systems.")
        for name, title, case, tasks in (
            ("two_area", "two_area, classical machines, TGOV1", common.classical(), WORKS),
            ("two_area", "two_area, GENROU, SEXS, TGOV1", common.full(load("two_area")), WORKS),
            ("wnaps", "wnaps (34 machines), GENROU, SEXS, TGOV1", common.full(load("wnaps")), WORKS),
        ):
            if name not in chosen:
                continue
            tools: dict[str, Tool] = {"stabctl": (*own.works(case), own.METHOD)}
            if andes:
                tools["ANDES"] = (*andes.works(case, folder), andes.METHOD)
            if tops and "gencls" in case.devices:
                tools["TOPS"] = (*tops.works(case), tops.METHOD)
            compared(f"{title}; medians of {ROUNDS}; {stated()}", tools, console, tasks)
    print("With GENROU the stator voltage of stabctl is in proportion to the speed, that of ANDES is not; TOPS has no")
    print("GENROU (its machine lacks the leakage reactance and the stator resistance).")


def flows(console: Console) -> None:
    """The power flow of a system of 2,000 buses, from one file; every machine holds its voltage, in every tool."""
    case = replicate(read_matpower(GIVEN), COPIES)
    held = {m.bus for m in case.machines}
    kinds = {b.bus: "pv" if b.kind == "pq" and b.bus in held else b.kind for b in case.buses}
    flat = (b._replace(angle=0.0, kind=kinds[b.bus], v=b.v if b.bus in held else 1.0) for b in case.buses)
    with tempfile.TemporaryDirectory() as folder:
        path, tools = matpower_file(replace(case, buses=tuple(flat)), Path(folder)), {}
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            for name, read in peer_flow.TOOLS.items():
                try:
                    tools[name] = read(path)
                except ImportError as error:
                    console.print(
                        f"{name} is left out: {error}; install it with pip install 'stabctl[bench]'.", markup=False
                    )
            times: dict[str, list[float]] = {}
            for _ in range(ROUNDS + 1):
                for name, (run, _) in tools.items():
                    times.setdefault(name, []).append(cpu(run))
    table = Table("tool", "ms", "over stabctl", "largest difference", title=f"power flow, 2,000 buses; {stated()}")
    medians = {name: statistics.median(column[1:]) for name, column in times.items()}  # the first one compiles
    for name, (_, voltages) in tools.items():
        same = "" if name == "stabctl" else apart(tools["stabctl"][1](), voltages())
        ratio = medians[name] / medians["stabctl"]
        table.add_row(name, f"{1e3 * medians[name]:.4g}", f"{ratio:.3g}", same)
    console.print(table)


def main() -> None:
    """Measure and print."""
    warnings.filterwarnings("ignore")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=GROUPS, help="what to measure")
    options = parser.parse_args()
    console = Console(file=sys.stdout, highlight=False, width=120)  # also while the output of others is hidden
    if "flow" in options.only:  # before ANDES generates code into a folder that is removed afterwards
        flows(console)
    if {"two_area", "wnaps"} & set(options.only):
        systems(set(options.only), console)


if __name__ == "__main__":
    main()

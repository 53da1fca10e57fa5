"""Ten seconds with a fault at equal accuracy in stabctl, ANDES and TOPS; a table, and docs/figures/peers.png.

Every program has a solution with fine steps of its own, from which the speeds with longer steps differ by some error.
stabctl takes the longest of its steps with which its error is not larger than that of the other program. ANDES solves
systems with GENROU, SEXS and TGOV1, TOPS the same ones with classical machines, TGOV1 and no taps. Processor seconds
of one thread, without set-up.

Run: python benchmarks/equal_accuracy.py [--only two_area wnaps ...]
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import argparse
import statistics
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import common
import matplotlib.pyplot as plt
import numpy as np
from large import GIVEN
from machine import cpu, stated
from peers import peer
from rich.console import Console
from rich.table import Table

from stabctl import load, read_matpower
from stabctl._util.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.replicate import replicate

COPIES = 10  # of a case of 200 buses
ROUNDS = 3
LARGE = 100  # machines, from which on the other program runs once
OWN = tuple(1 / n for n in (20, 30, 40, 60, 80, 120, 160, 240, 480))  # s   steps of stabctl that are tried
FINE = 1 / 960  # s   step of its solution that errors are measured against
INSTANTS = np.arange(0, common.UNTIL - 0.05, 0.1)  # s   on the grid of every step
FIGURE = Path(__file__).parents[1] / "docs" / "figures" / "peers.png"
Stepped = Callable[[float], tuple[common.Works, Callable[[], common.Answer]]]


class Other(NamedTuple):
    """How another program is measured."""

    models: Callable[[Case], Case]
    steps: tuple[float, ...]  # s
    fine: float  # s


class Row(NamedTuple):
    """One line of the table: two programs, each with step (s), error (mHz) and processor time (s)."""

    system: str
    machines: int
    other: str
    theirs: tuple[float, float, float]
    own: tuple[float, float, float]
    apart: float  # mHz   between the fine solutions


OTHERS = {
    "ANDES": Other(common.full, (1 / 120, 1 / 30), 1 / 960),
    "TOPS": Other(common.classical, (1 / 120,), 1 / 240),  # with finer steps it would take an hour
}
SYSTEMS: dict[str, tuple[Callable[[], Case], Sequence[str]]] = {
    "two_area": (lambda: load("two_area"), ("ANDES", "TOPS")),
    "two_area, constant power": (lambda: load("two_area"), ("ANDES",)),
    "wnaps": (lambda: load("wnaps"), ("ANDES", "TOPS")),
    "ACTIVSg200, ten times": (
        lambda: replicate(read_matpower(GIVEN), COPIES).with_typical_machines(),
        ("ANDES", "TOPS"),
    ),
}


def measured(name: str, other: str, folder: str) -> list[Row]:
    """A system in stabctl and another program."""
    given, (models, steps, fine) = SYSTEMS[name][0](), OTHERS[other]
    case = common.constant_power(models(given)) if "constant power" in name else models(given)
    program, own = peer(other.lower()), peer("stabctl")
    more = {"folder": folder} if other == "ANDES" else {}
    theirs = partial(stepped, lambda step: program.works(case, step=step, **more))
    mine = partial(stepped, lambda step: own.works(case, step=step))
    fine_theirs, fine_mine = theirs(fine)[0], mine(FINE)[0]
    found, rounds = [], ROUNDS if len(case.machines) < LARGE else 1
    for step in steps:
        speed, seconds = theirs(step, rounds)
        off = error(speed, fine_theirs)
        own_step = next((h for h in OWN if missed(mine, h, fine_mine) <= off), OWN[-1])
        speed, taken = mine(own_step, ROUNDS)
        rows = (step, off, seconds), (own_step, error(speed, fine_mine), taken)
        found.append(Row(name, len(case.machines), other, *rows, error(fine_theirs, fine_mine)))
    return found


def stepped(works: Stepped, step: float, rounds: int = 1) -> tuple[np.ndarray, float]:
    """Speeds (instants, machines) with a step, and the median of the processor seconds of a run, without set-up."""
    tasks, answer = works(step)
    times = []
    for _ in range(rounds):
        ready = tasks["10 s"]()
        times.append(cpu(ready))
    found = answer()
    speed = np.column_stack([np.interp(INSTANTS, found.time, column) for column in found.speed.T])
    return speed, statistics.median(times)


def missed(run: Callable[[float], tuple[np.ndarray, float]], step: float, fine: np.ndarray) -> float:
    """Largest error with a step, mHz; infinite if the step is refused as too long."""
    try:
        return error(run(step)[0], fine)
    except StudyError:
        return np.inf


def error(speed: np.ndarray, fine: np.ndarray) -> float:
    """Largest difference of two solutions, mHz; infinite if one is not finite."""
    off = np.abs(speed - fine).max() * 60e3
    return float(off) if np.isfinite(off) else np.inf


def drawn(rows: Sequence[Row]) -> Any:
    """Processor time of every program over the number of machines, at equal accuracy."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
    for ax, (other, color) in zip(axes, (("ANDES", "C1"), ("TOPS", "C2")), strict=True):
        for step, marker in ((1 / 120, "o"), (1 / 30, "s")):
            mine = [r for r in rows if r.other == other and np.isclose(r.theirs[0], step)]
            for name, shade, which in ((other, color, "theirs"), ("stabctl", "C0", "own")):
                easy = [(r.machines, getattr(r, which)[2]) for r in mine if "constant power" not in r.system]
                hard = [(r.machines, getattr(r, which)[2]) for r in mine if "constant power" in r.system]
                if easy:
                    label = f"{name}, as exact as {other} with 1/{1 / step:.0f} s" if which == "own" else None
                    label = label or f"{name}, 1/{1 / step:.0f} s"
                    ax.plot(*zip(*easy, strict=True), marker, ls="-", color=shade, label=label, fillstyle="full")
                if hard:
                    ax.plot(*zip(*hard, strict=True), marker, color=shade, fillstyle="none")
        ax.set(
            xscale="log",
            yscale="log",
            xlabel="machines",
            title=f"stabctl and {other}" + ("; open: constant power" if other == "ANDES" else ""),
        )
        ax.set_xticks([4, 10, 34, 100, 380], labels=["4", "10", "34", "100", "380"])
        ax.minorticks_off()
        ax.grid(alpha=0.3)
        ax.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False)
    axes[0].set_ylabel("processor time of 10 s (s)")
    return figure


def main() -> None:
    """Measure, print and draw."""
    warnings.filterwarnings("ignore")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=SYSTEMS, default=tuple(SYSTEMS), help="systems; without a figure")
    chosen = parser.parse_args().only
    there = [name for name in OTHERS if peer(name.lower())]
    rows: list[Row] = []
    table = Table("system", "machines", "program", "step", "mHz", "s", "step", "mHz", "s", "ratio", "apart, mHz")
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen:
            for other in (one for one in SYSTEMS[name][1] if one in there):
                with redirect_stdout(StringIO()):
                    if other == "ANDES" and not rows:
                        peer("andes").empty(folder)
                    rows += measured(name, other, folder)
    for r in rows:
        cells = [cell for h, off, s in (r.theirs, r.own) for cell in (f"1/{1 / h:.0f}", f"{off:.2g}", f"{s:.3g}")]
        table.add_row(r.system, str(r.machines), r.other, *cells, f"{r.theirs[2] / r.own[2]:.3g}", f"{r.apart:.2g}")
    console = Console(width=140)
    console.print(f"10 s at equal accuracy: another program, then stabctl; {stated()}")
    console.print(table)
    if set(chosen) == set(SYSTEMS) and set(there) == set(OTHERS):
        drawn(rows).savefig(FIGURE, dpi=150)


if __name__ == "__main__":
    main()

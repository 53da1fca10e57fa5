"""Cost of converters of storage: runs of 34 ideal devices and of 34 devices behind converters in turns."""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import statistics
import time

from machine import stated
from rich.console import Console
from rich.table import Table

import stabctl as st

UNTIL = 10.0  # s
STEP = 1 / 120  # s
TURNS = 31
FAULT = st.Contingency("83", clear="6cyc", trip="83-33")
MODELS = {"grid-following, REGC_A": "regc", "the same with PLL, REGC_C": "regc_c", "grid-forming, REGFM_A1": "regfm"}


def spent(base: st.OperatingPoint) -> float:
    """Seconds of processor time of a run."""
    began = time.thread_time()
    base.simulate(FAULT, UNTIL, control=st.BangBang(), step=STEP)
    return time.thread_time() - began


def main() -> None:
    """Measure and print."""
    case = st.load("wnaps")
    table = Table(
        "34 devices of wnaps", "time step", "processor time over that of ideal ones", "target", title=stated()
    )
    for name, model in MODELS.items():
        options = {"converter": "Te=0"} if model == "regc_c" else {}
        ideal, behind = (
            case.with_storage("5%mva", **given).initialize() for given in ({}, {"storage_model": model, **options})
        )
        spent(ideal), spent(behind)
        ratios = [spent(behind) / spent(ideal) for _ in range(TURNS)]
        more = 100 * (statistics.median(ratios) - 1)
        target = "40 %" if model == "regc" else ""
        table.add_row(name, "1/120 s", f"{more:+.0f} %", target)
    Console(highlight=False).print(table)


if __name__ == "__main__":
    main()

"""Speed of the linear analysis on one core: all eigenvalues of wnaps with both sets of vectors, and modes of a band.

Run: python benchmarks/linear.py. The aims are 0.12 s for linearization and eigenvalues of wnaps; for certified modes
from 0.1 to 2.5 Hz, 1 s at 224 states and 20 s at 4370 states.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numpy as np
import scipy.linalg as sl

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.model.case import Case
from stabctl.model.replicate import replicate
from stabctl.smallsignal import Selected, analyze, descriptor, linearize
from stabctl.smallsignal._linearization_checks import limited
from stabctl.smallsignal.eigen import eigen
from stabctl.smallsignal.model import eliminated

RUNS = 15
BAND = (0.1, 2.5)  # Hz


def best(call: Callable[[], object]) -> float:
    """Shortest of some calls, ms."""
    times = []
    for _ in range(RUNS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def main() -> None:
    """Measure and print, part by part."""
    point = operating_point.solve(io.load("wnaps"))
    model, form = linearize(point), descriptor(point)
    A, angles = model.A, model.angles()
    square = np.random.default_rng(0).normal(size=A.shape)
    whole = best(lambda: analyze(linearize(point)))
    parts = {
        "linearize": best(lambda: linearize(point)),
        "  blocks of the devices, put together": best(lambda: point.equations.at(point.s.copy())),
        "  is a limit reached?": best(lambda: limited(point)),
        "  elimination of the voltages": best(lambda: eliminated(form)),
        "eigenvalues and both sets of vectors": best(lambda: eigen(A, angles)),
        "  LAPACK alone": best(lambda: sl.eig(A[1:, 1:], left=True, right=True, check_finite=False)),
        "for scale: a product of two such matrices": best(lambda: square @ square),
    }
    print(f"{model}; best of {RUNS}, one core, ms")
    for name, value in ({"both together": whole} | parts).items():
        print(f"{value:9.2f}  {name}")
    in_a_band(replicate(io.load("two_area"), 4))
    in_a_band(io.load("wnaps"))
    in_a_band(replicate(io.load("wnaps"), 10, spread=0.05))


def in_a_band(case: Case) -> None:
    """Measure and print the certified modes of the default band."""
    form = descriptor(operating_point.solve(case))
    start, used = time.perf_counter(), time.process_time()
    found = analyze(form, BAND)
    wall, used = time.perf_counter() - start, time.process_time() - used
    assert isinstance(found, Selected)
    print(f"{wall:9.2f} s ({used:.2f} s of processor time)  {len(found)} modes of {len(form.rows)} states")
    print(f"{'':11}{found.proof()}")


if __name__ == "__main__":
    main()

"""Speed of the linear analysis of wnaps on one core: linearize, then all eigenvalues with both sets of vectors.

Run: python benchmarks/linear.py. The aim is 0.12 s for both together.
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
from stabctl.smallsignal import analyze, descriptor, linearize
from stabctl.smallsignal.eigen import eigen
from stabctl.smallsignal.model import eliminated
from stabctl.smallsignal.refuse import limited

RUNS = 15


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


if __name__ == "__main__":
    main()

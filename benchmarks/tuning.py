"""Tuning of all stabilizers over all outages, on one core: processor time, and the damping reached.

Run: python benchmarks/tuning.py. The aim is 60 s for ieee39, 36 networks and five starts, with gains no larger than
those with which phase compensation reaches 5 %.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from functools import partial

import stabctl as st

K = 4.8711  # pu   of phase compensation with 5 %, and its gains at high frequencies, pu
FAST = (436.0, 431.0, 448.9, 603.2, 523.6, 390.6, 546.7, 409.9, 402.4, 644.5)


def main() -> None:
    """Measure and print."""
    base = st.load("ieee39").initialize()
    st.design.outages(base)
    devices = [st.design.stabilizers([n], stages=3, gain=K, fast=fast) for n, fast in enumerate(FAST, 1)]
    for checks in (0, 3):
        start = time.process_time()
        levels = (0.9,) if checks else ()
        tune = partial(st.design.tune, base, devices, levels=(1.0,), gains=(), workers=1)
        found = tune(check_levels=levels, checks=checks)
        text = "with its evidence" if checks else "alone"
        print(f"tuned together, {text}: {time.process_time() - start:.0f} s, worst damping {found.damping:.4f}")


if __name__ == "__main__":
    main()

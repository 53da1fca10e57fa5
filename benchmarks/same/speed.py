"""Least processor seconds of a run and of its compiled loop: python speed.py OUT.json [REPEATS]."""

import sys
import time

from scenarios import RUNS, TIMED, write


def least(name: str, repeats: int) -> tuple[float, float]:
    """Of the whole run (processor) and of the loop (wall, which on an idle core is the same)."""
    whole = loop = float("inf")
    RUNS[name]()
    for _ in range(repeats):
        before = time.thread_time()
        run = RUNS[name]()
        whole, loop = min(whole, time.thread_time() - before), min(loop, run.wall_s)
    return whole, loop


if __name__ == "__main__":
    repeats = int(sys.argv[2]) if len(sys.argv) > 2 else 15
    write((name, least(name, repeats)) for name in TIMED)

"""Least processor seconds of a run and of its compiled loop: python speed.py OUT.json [REPEATS]."""

import json
import sys
import time
from pathlib import Path

from scenarios import RUNS, TIMED


def least(name: str, repeats: int) -> tuple[float, float]:
    """Of the whole run (processor) and of the loop (wall, which on an idle core is the same)."""
    whole = loop = float("inf")
    RUNS[name]()
    for _ in range(repeats):
        before = time.thread_time()
        run = RUNS[name]()
        whole, loop = min(whole, time.thread_time() - before), min(loop, run.wall_s)
    return whole, loop


def main() -> None:
    """Measure and write."""
    repeats = int(sys.argv[2]) if len(sys.argv) > 2 else 15
    Path(sys.argv[1]).write_text(json.dumps({name: least(name, repeats) for name in TIMED}, indent=1))


if __name__ == "__main__":
    main()

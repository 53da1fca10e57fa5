"""A process that runs tasks of `before.py`: reads the name of a task per line and answers with its time in seconds.

It first names its short tasks, then its long ones.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import sys
from importlib import import_module


def main() -> None:
    """Answer until the input ends."""
    tasks = import_module(sys.argv[1])
    for works in (tasks.WORKS, tasks.LONG):
        print(*works, sep="\t", flush=True)
    works = tasks.WORKS | tasks.LONG
    for line in sys.stdin:
        print(works[line.strip()](), flush=True)


if __name__ == "__main__":
    main()

"""How long commands take from start to end, relative to a process that imports numpy and scipy.sparse.linalg.

Run: python benchmarks/start.py [RUNS] [FOLDER ...]: the least of so many runs (12). The package is that of this
repository, or those in the folders, such as an earlier commit and an installed wheel, which take turns.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

from machine import stated

COMMANDS = {
    "stabctl --help": "--help",
    "stabctl simulate": "simulate two_area --fault 7-8@0.4 --clear 21cyc --storage 50MW",
    "stabctl modes": "modes two_area",
}


def main(runs: int, folders: list[str]) -> None:
    """Measure, and print a line for each command and folder."""
    base = ("-c", "import numpy, scipy.sparse.linalg")
    works: dict[tuple[str, str], tuple[tuple[str, ...], str]] = {("numpy, scipy", ""): (base, "")}
    works |= {
        (name, folder): (("-m", "stabctl", *words.split()), folder)
        for name, words in COMMANDS.items()
        for folder in folders
    }
    found: dict[tuple[str, str], list[tuple[float, float, float]]] = {key: [] for key in works}
    for _ in range(runs + 1):
        for key, (words, folder) in works.items():
            found[key].append(whole((sys.executable, *words), folder))
    print(stated())
    least = {key: [min(column) for column in zip(*rows[1:], strict=True)] for key, rows in found.items()}
    for (name, folder), (wall, cpu, memory) in least.items():
        ratio = wall / least["numpy, scipy", ""][0]
        print(f"{name:18} {wall:.3f} s ({ratio:.2f}), processor {cpu:.3f} s, {memory:.0f} MB  {folder}")


def whole(command: tuple[str, ...], folder: str) -> tuple[float, float, float]:
    """Wall and processor time (s) of a process, and the most memory that it has (MB)."""
    began, nowhere = time.perf_counter(), subprocess.DEVNULL
    environment = os.environ | {"PYTHONPATH": folder}
    process = subprocess.Popen(command, stdout=nowhere, stderr=nowhere, env=environment)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed.")
    return time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 12, sys.argv[2:] or [str(Path(__file__).parents[1])])

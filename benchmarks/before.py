"""This version against an earlier one in one run, the two taking turns: medians, and their ratio.

Run: python benchmarks/before.py --before FOLDER, where FOLDER holds version 0.1 (git worktree add FOLDER 1deeace).
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from machine import cpu_of_children, stated, timed

COMMAND = ("-m", "stabctl", "simulate", "two_area", "--fault", "7-8@0.4", "--clear", "21cyc")
BASE = "import numpy, scipy.sparse.linalg, numba"
HERE = Path(__file__).parent


class Version:
    """One version of the package: a worker process, and whole processes of its command."""

    def __init__(self, root: Path, works: str) -> None:
        self.root, self.environment = root, os.environ | {"PYTHONPATH": str(root)}
        self.worker = subprocess.Popen(
            [sys.executable, str(HERE / "worker.py"), works],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=self.environment,
        )
        self.works = self._answer().split("\t")

    def _answer(self) -> str:
        if not (line := self.worker.stdout.readline()):
            raise SystemExit("A worker ended; see the message above.")
        return line.rstrip("\n")

    def seconds(self, work: str) -> float:
        """Time (s) of one task."""
        self.worker.stdin.write(f"{work}\n")
        self.worker.stdin.flush()
        return float(self._answer())

    def process(self, cold: bool) -> tuple[float, float]:
        """Wall and processor seconds of the command, with or without machine code on disk."""
        with tempfile.TemporaryDirectory() as folder:
            environment = self.environment | ({"XDG_CACHE_HOME": folder} if cold else {})
            return whole((sys.executable, *COMMAND), environment, self.root)

    def close(self) -> None:
        """End the worker."""
        self.worker.communicate()


def whole(command: tuple[str, ...], environment: dict[str, str], folder: Path = HERE) -> tuple[float, float]:
    """Wall and processor seconds of a process."""
    before = cpu_of_children()
    wall = timed(lambda: subprocess.run(command, check=True, capture_output=True, env=environment, cwd=folder))
    return wall, cpu_of_children() - before


def measured(versions: tuple[Version, Version], repeat: int, cold: int) -> dict[str, list[tuple[float, ...]]]:
    """Work -> seconds of both versions, again and again."""
    found: dict[str, list[tuple[float, ...]]] = {}
    for _ in range(repeat):
        for work in versions[0].works:
            found.setdefault(work, []).append(tuple(v.seconds(work) for v in versions))
    for kind, count in (("warm", repeat // 2), ("cold", cold)):
        for _ in range(count):
            walls, cpus = zip(*(v.process(kind == "cold") for v in versions), strict=True)
            found.setdefault(f"{kind} `simulate two_area`, wall", []).append(walls)
            found.setdefault(f"{kind} `simulate two_area`, processor", []).append(cpus)
            if kind == "warm":
                imports, _ = whole((sys.executable, "-c", BASE), dict(os.environ))
                found.setdefault("the same against importing numpy, scipy.sparse.linalg, numba", []).append(
                    (imports, walls[1])
                )
    return found


def table(found: dict[str, list[tuple[float, ...]]]) -> str:
    """Markdown rows of the medians."""
    rows = ["| work | 0.1, ms | 0.2, ms | ratio |", "|---|---|---|---|"]
    for work, times in found.items():
        before, after = (1e3 * statistics.median(column) for column in zip(*times, strict=True))
        ratio = statistics.median(b / a for a, b in times)
        rows.append(f"| {work} | {before:.4g} | {after:.4g} | {ratio:.2f} |")
    return "\n".join(rows)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, required=True, metavar="FOLDER", help="folder that holds version 0.1")
    parser.add_argument("--repeat", type=int, default=21, help="repetitions of each work")
    parser.add_argument("--cold", type=int, default=3, help="repetitions of the cold start")
    options = parser.parse_args()
    versions = Version(options.before.resolve(), "works_before"), Version(HERE.parent, "works_after")
    found = measured(versions, options.repeat, options.cold)
    for version in versions:
        version.close()
    print(f"{stated()}\n\n{table(found)}")


if __name__ == "__main__":
    main()

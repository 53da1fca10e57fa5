"""This version against version 0.1 in one run, the two taking turns: medians, and their ratio.

Run: python benchmarks/before.py [--only WORD ...]. Version 0.1 is taken from this repository, unless a folder holds it.
Rows appear as soon as they are measured, and an interrupted run keeps what it printed. All take some 15 minutes.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext
from itertools import chain
from pathlib import Path

from machine import archived, cpu_of_children, stated, timed

COMMAND = ("-m", "stabctl", "simulate", "two_area", "--fault", "7-8@0.4", "--clear", "21cyc")
COMMIT = "1deeace"  # version 0.1
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
        assert self.worker.stdin
        assert self.worker.stdout
        self.input, self.output = self.worker.stdin, self.worker.stdout
        self.short, self.long = (self._answer().split("\t") for _ in range(2))

    def _answer(self) -> str:
        if not (line := self.output.readline()):
            raise SystemExit("A worker ended; see the message above.")
        return line.rstrip("\n")

    def seconds(self, work: str) -> float:
        """Time (s) of one task."""
        self.input.write(f"{work}\n")
        self.input.flush()
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


def row(work: str, times: list[tuple[float, float]]) -> str:
    """The medians as a row in Markdown."""
    before, after = (1e3 * statistics.median(column) for column in zip(*times, strict=True))
    return f"| {work} | {before:.4g} | {after:.4g} | {statistics.median(b / a for a, b in times):.2f} |"


def turns(versions: tuple[Version, Version], works: list[str], repeat: int) -> Iterator[str]:
    """Rows of works that the workers do, again and again; what comes first compiles, if there are several."""
    for work in works:
        times = [(versions[0].seconds(work), versions[1].seconds(work)) for _ in range(repeat + (repeat > 1))]
        yield row(work, times[repeat > 1 :])


def starts(versions: tuple[Version, Version], kind: str, repeat: int) -> Iterator[str]:
    """Rows of the command as a whole."""
    walls, cpus = [], []
    for _ in range(repeat):
        pairs = [v.process(kind == "cold") for v in versions]
        walls.append((pairs[0][0], pairs[1][0]))
        cpus.append((pairs[0][1], pairs[1][1]))
    yield row(f"{kind} `simulate two_area`, wall", walls)
    yield row(f"{kind} `simulate two_area`, processor", cpus)
    if kind == "warm":
        imports = [whole((sys.executable, "-c", BASE), dict(os.environ))[0] for _ in range(repeat)]
        wall = statistics.median(pair[1] for pair in walls)
        yield f"\nThe warm command takes {wall / statistics.median(imports):.2f} times as long as its largest imports."


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, metavar="FOLDER", help="folder that holds version 0.1")
    parser.add_argument("--only", nargs="+", metavar="WORD", default=[""], help="only rows that contain one of these")
    parser.add_argument("--repeat", type=int, default=15, help="repetitions of each short work")
    parser.add_argument("--long", type=int, default=1, help="repetitions of each long work")
    parser.add_argument("--cold", type=int, default=1, help="repetitions of the cold start")
    options = parser.parse_args()

    def chosen(works: list[str]) -> list[str]:
        return [work for work in works if any(word in work for word in options.only)]

    with nullcontext(options.before.resolve()) if options.before else archived(COMMIT) as folder:
        versions = Version(folder, "works_before"), Version(HERE.parent, "works_after")
        print(f"{stated()}\n\n| work | 0.1, ms | now, ms | ratio |\n|---|---|---|---|", flush=True)
        rows = [
            turns(versions, chosen(versions[0].short), options.repeat),
            turns(versions, chosen(versions[0].long), options.long),
            *(starts(versions, kind, options.cold if kind == "cold" else 7) for kind in chosen(["cold", "warm"])),
        ]
        for line in chain(*rows):
            print(line, flush=True)
        for version in versions:
            version.close()


if __name__ == "__main__":
    main()

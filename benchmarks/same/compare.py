"""What a change of the stepper or of a device changes: results to the last bit, clearing times, speed, compilation.

Run: python benchmarks/same/compare.py COMMIT [bits] [clearings] [speed] [compile]

The same scripts run on the files of this folder and on those of a commit, each with a cache of machine code of its own.
Equal bits can be expected on one machine with one version of numba only, so this is a script and not a test.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from machine import archived, cpu_of_children, stated

TURNS = 3  # of the two versions, as the speed of a shared machine drifts
FIRST = "import stabctl as st; st.load('two_area').initialize(storage='50MW').simulate(control=st.BangBang())"
Answers = dict[str, object]


class Version:
    """The package in a folder, and its own machine code."""

    def __init__(self, root: Path, cache: Path) -> None:
        self.environment = os.environ | {"PYTHONPATH": str(root), "XDG_CACHE_HOME": str(cache)}
        self.cache = cache

    def answers(self, script: str, *arguments: str) -> Answers:
        """What a script of this folder writes."""
        out = self.cache / "out.json"
        command = (sys.executable, str(HERE / f"{script}.py"), str(out), *arguments)
        subprocess.run(command, check=True, env=self.environment, cwd=self.cache, stdout=subprocess.DEVNULL)
        return json.loads(out.read_text())

    def compile(self) -> float:
        """Processor seconds of a first simulation, without machine code."""
        with tempfile.TemporaryDirectory() as folder:
            before = cpu_of_children()
            environment = self.environment | {"XDG_CACHE_HOME": folder}
            subprocess.run((sys.executable, "-c", FIRST), check=True, env=environment, cwd=folder)
            return cpu_of_children() - before


def differences(script: str, before: Version, after: Version) -> int:
    """Print what differs; returns how many answers do."""
    old, new = before.answers(script), after.answers(script)
    different = [name for name in {**old, **new} if old.get(name) != new.get(name)]
    for name in different:
        print(f"{name}\n    before: {old.get(name)}\n    now:    {new.get(name)}")
    print(f"{script}: {len(new) - len(different)} of {len(new)} equal", flush=True)
    return len(different)


def speed(before: Version, after: Version, repeats: str) -> None:
    """Print the least times of both versions, which take turns."""
    both = [(before.answers("speed", repeats), after.answers("speed", repeats)) for _ in range(TURNS)]
    print("| run | run before, ms | now | ratio | loop before, ms | now | ratio |\n|---|---|---|---|---|---|---|")
    for name in both[0][0]:
        cells = []
        for k in range(2):
            old, new = (1e3 * min(turn[which][name][k] for turn in both) for which in range(2))
            cells += [f"{old:.2f}", f"{new:.2f}", f"{new / old:.3f}"]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def main() -> int:
    """Compare; returns 1 if a result differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", help="the version to compare with")
    parser.add_argument("what", nargs="*", metavar="WHAT", help="bits, clearings, speed, compile; by default all")
    parser.add_argument("--repeats", default="15", help="runs of each scenario for the speed")
    options = parser.parse_args()
    what = options.what or ["bits", "clearings", "speed", "compile"]
    if wrong := set(what) - {"bits", "clearings", "speed", "compile"}:
        parser.error(f"{min(wrong)!r} is not one of bits, clearings, speed, compile")
    different = 0
    with archived(options.commit) as folder, tempfile.TemporaryDirectory() as kept:
        caches = [Path(kept) / name for name in ("before", "now")]
        for cache in caches:
            cache.mkdir()
        before, after = Version(folder, caches[0]), Version(HERE.parents[1], caches[1])
        print(f"{stated()}, {options.commit} and now")
        for script in ("bits", "clearings"):
            different += differences(script, before, after) if script in what else 0
        if "speed" in what:
            speed(before, after, options.repeats)
        if "compile" in what:
            pairs = [(before.compile(), after.compile()) for _ in range(TURNS)]
            old, new = (min(pair[k] for pair in pairs) for k in range(2))
            print(f"compilation, processor: {old:.1f} s, now {new:.1f} s, ratio {new / old:.3f}")
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())

"""Long runs: python -m fuzz --minutes 60. An input that fails is kept in the corpus; a run continues where it ended."""

import argparse
import gc
import json
import subprocess
import sys
import time
from pathlib import Path

from .attempt import CORPUS, corpus, read
from .judge import LIMIT, judge
from .targets import attempt

BATCH = 150  # inputs of one process


def main() -> int:
    """Run, and return 1 if an input failed."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=1, help="with another seed, other inputs")
    parser.add_argument("--state", type=Path, default=Path(".fuzz"), help="folder that keeps how far a run is")
    parser.add_argument("--batch", type=int, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    given.state.mkdir(parents=True, exist_ok=True)
    if given.batch:
        _batch(given.seed, range(*given.batch), given.state / "current.json")
        return 0
    failed = sum(_told(path.name, judge(read(path))) for path in corpus())
    progress = given.state / f"seed-{given.seed}.json"
    begin = first = json.loads(progress.read_text())["next"] if progress.exists() else 0
    print(f"seed {given.seed}, from input {first}, {given.minutes:g} min", flush=True)
    end = time.monotonic() + 60 * given.minutes
    while time.monotonic() < end:
        first = _next_batch(given.seed, first, given.state)
        progress.write_text(json.dumps({"next": first}))
        found = list(CORPUS.glob("new-*.json"))
        print(f"{first - begin} inputs, {len(found)} failed", flush=True)
    return int(failed > 0 or any(CORPUS.glob("new-*.json")))


def _next_batch(seed: int, first: int, state: Path) -> int:
    """Run a batch in a process of its own, and return the number of the next input."""
    last, current = first + BATCH, state / "current.json"
    current.unlink(missing_ok=True)
    words = ["-m", "fuzz", "--seed", str(seed), "--state", str(state), "--batch", str(first), str(last)]
    process = subprocess.Popen([sys.executable, *words])
    while process.poll() is None:
        time.sleep(0.2)
        if current.exists() and time.time() - current.stat().st_mtime > 12 * LIMIT:
            process.kill()  # it hangs where no signal is heard
    if process.returncode == 0:
        return last
    number, text = current.read_text().split("\n", 1)
    current.write_text(text)
    kept = read(current).save(CORPUS, "new-")
    _told(kept.name, f"the process ended with {process.returncode}")
    return int(number) + 1


def _batch(seed: int, numbers: range, current: Path) -> None:
    for number in numbers:
        one = attempt(seed, number)
        current.write_text(f"{number}\n{one.text()}")
        wrong = judge(one)
        if wrong:
            _told(one.save(CORPUS, "new-").name, f"{' '.join(one.words)}\n{wrong}")
        if number % 50 == 0:
            gc.collect()  # the command line turns it off


def _told(name: str, wrong: str | None) -> bool:
    """Print what is wrong, and return whether something is."""
    if wrong:
        print(f"{name}: {wrong[-3000:]}", flush=True)
    return bool(wrong)


sys.exit(main())

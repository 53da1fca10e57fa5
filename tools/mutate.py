"""Put one-place faults into a copy of the tree, one after the other, and count how many the tests notice.

    python tools/mutate.py --sample 100 --seed 7 model io     # 100 faults in these packages or files
    python tools/mutate.py --seed 7 --again                   # those that survived, once more

The first run measures which functions every test executes. For a fault, the tests that execute its function run first,
then the others of the files that use its module, until one fails or the budget is used up. An interrupted run continues
where it was. Faults that no test can notice are listed with the reason in tools/mutation/equivalent.txt.
"""

import argparse
import json
import random
import sys
import textwrap
import time
from pathlib import Path

from mutation import mutants
from mutation.mutants import Scratch
from mutation.related import Related
from mutation.runner import Runner

ROOT = Path(__file__).resolve().parents[1]
EQUIVALENT = Path(__file__).parent / "mutation" / "equivalent.txt"
LEAST = 60  # s of processor time that any run may take, e.g. to compile


def main() -> int:
    """Print every survivor, and the score; 1 if it is below the one wanted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("where", nargs="*", default=["stabctl"], help="packages, or files, of stabctl")
    parser.add_argument("--sample", type=int, default=100, help="number of faults")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--budget", type=float, default=40, help="seconds of tests for one fault")
    parser.add_argument("--again", action="store_true", help="run the survivors of the sample once more")
    parser.add_argument("--least", type=float, default=0, help="score wanted, in percent")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "mutate", help="copy, measurements, results")
    options = parser.parse_args()
    scratch = Scratch(ROOT, options.folder.resolve())
    scratch.update()
    runner = Runner(scratch.tree, scratch.cache, scratch.folder / "log")
    related = Related(scratch)
    for name in related.measure(runner):
        print(f"measuring {name}", flush=True)
    where = "-".join(options.where).replace("/", ".")
    record = scratch.folder / f"{where}-{options.sample}-{options.seed}.jsonl"
    done = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    results = {row["key"]: row for row in done if not (options.again and row["survived"])}
    with record.open("a") as file:
        for fault in sample(scratch.tree, options.where, options.sample, options.seed):
            if fault.key not in results:
                results[fault.key] = row = examine(fault, scratch, runner, related, options.budget)
                file.write(json.dumps(row) + "\n")
                file.flush()
                tell(row)
    return summary(list(results.values()), options.least)


def sample(tree: Path, where: list[str], size: int, seed: int) -> list[mutants.Mutant]:
    """Faults of these packages or files, drawn at random but from each package as many as its share of all.

    Never two alike, and none that is known as equivalent.
    """
    paths = [tree / "stabctl" / w if w != "stabctl" else tree / w for w in where]
    files = sorted({f for p in paths for f in ([p] if p.suffix else p.rglob("*.py"))})
    names = [str(f.relative_to(tree)) for f in files]
    places = [(name, i) for name in names for i in range(mutants.count(tree, name))]
    random.Random(seed).shuffle(places)
    places.sort(key=lambda place: place[0].split("/")[1])  # within a package still at random
    stride = -(-len(places) // size)
    equivalent = known()
    chosen: dict[str, mutants.Mutant] = {}
    for name, i in (place for first in range(stride) for place in places[first::stride]):
        if len(chosen) == size:
            break
        fault = mutants.mutant(tree, name, i)
        if fault.key not in equivalent and fault.before != fault.after:
            chosen.setdefault(fault.key, fault)
    return list(chosen.values())


def known() -> set[str]:
    """Keys of the faults that no test can notice."""
    lines = EQUIVALENT.read_text(encoding="utf-8").splitlines()
    return {line.partition("  # ")[0] for line in lines if line and not line.startswith("#")}


def examine(fault: mutants.Mutant, scratch: Scratch, runner: Runner, related: Related, budget: float) -> dict:
    """Run the related tests of a fault; what noticed it."""
    began, left, failed = time.perf_counter(), budget, ""
    with scratch.fault(fault):
        for tests in related.tests(fault):
            chosen = related.within(tests, left)
            if not chosen:
                continue
            needed = related.seconds(chosen)
            left -= needed
            files = list(dict.fromkeys(name.split("::")[0] for name in chosen))
            outcome = runner.run(files, chosen, LEAST + 4 * needed, None)
            if not outcome.passed:
                failed = outcome.failed
                break
    return {
        "key": fault.key,
        "line": fault.line,
        "survived": not failed,
        "by": failed,
        "seconds": round(time.perf_counter() - began, 1),
    }


def tell(row: dict) -> None:
    """Print one result."""
    path, _, change = row["key"].partition(": ")
    if not row["survived"]:
        print(f"caught    {row['seconds']:6.1f} s  {path}:{row['line']} by {row['by']}", flush=True)
        return
    before, _, after = change.partition(" => ")
    print(f"SURVIVED  {row['seconds']:6.1f} s  {path}:{row['line']}")
    for sign, text in ("-", before), ("+", after):
        print(textwrap.indent(text, f"    {sign} "), flush=True)


def summary(rows: list[dict], least: float) -> int:
    """Print the survivors and the score."""
    survivors = [row for row in rows if row["survived"]]
    print("\n".join(["", *(f"survived: {row['key']}" for row in survivors)]))
    score = 100 * (1 - len(survivors) / len(rows)) if rows else 0.0
    print(f"{len(rows) - len(survivors)} of {len(rows)} faults caught: {score:.1f} %")
    return int(score < least)


if __name__ == "__main__":
    sys.exit(main())

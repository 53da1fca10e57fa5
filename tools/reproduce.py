"""Run every study of analysis/ and sims/ and write reports/index.html, which compares them with the paper.

A study is a script that ends with `reproduction.study.present`. Each runs in its own process, so that a failure is a
sentence on the page and the other studies go on. A study with a line `FULL = True` runs with --full only; such a study
says how far it is, and continues where it ended if it was interrupted.
"""

import argparse
import os
import platform
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from pathlib import Path

from reproduction import study
from reproduction.page import About, Ran, page
from stabctl._util import files
from stabctl._util.errors import StabctlError

TOOLS = Path(__file__).resolve().parent
ROOT = TOOLS.parent
FOLDERS = "analysis", "sims"


def main() -> int:
    """Run the studies and write the page; 1 if a study failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="run the long studies too")
    parser.add_argument("--out", type=Path, default=ROOT / "reports", help="folder of the reports")
    parser.add_argument("--workers", type=int, default=2, help="number of studies that run at a time")
    parser.add_argument("folders", nargs="*", type=Path, default=[ROOT / name for name in FOLDERS])
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    scripts = [path for folder in options.folders for path in sorted(folder.glob("*.py"))]
    left_out = [path for path in scripts if needs_full(path) and not options.full]
    began = time.perf_counter()
    pool = ThreadPoolExecutor(max(1, options.workers))
    try:
        ran = list(pool.map(lambda s: run(s, options.out), [s for s in scripts if s not in left_out]))
    finally:
        pool.shutdown(cancel_futures=True)
    seconds = time.perf_counter() - began
    about = About(date.today().isoformat(), machine(), seconds, tuple(map(shown, left_out)))
    index = options.out / "index.html"
    files.replace(index, page(ran, options.out, about))
    if not any(r.failure for r in ran):
        study.clear(options.out)
    print(f"wrote {index}: {sum(len(r.studies) for r in ran)} studies in {seconds:.0f} s")
    return int(any(r.failure for r in ran))


def needs_full(script: Path) -> bool:
    """Does the script run with --full only?"""
    return "FULL = True" in script.read_text(encoding="utf-8").splitlines()


def run(script: Path, out: Path) -> Ran:
    """Run one script and read its records."""
    began, file = time.perf_counter(), study.path_for(script, out)
    file.unlink(missing_ok=True)
    path = os.pathsep.join(filter(None, (str(ROOT), str(TOOLS), os.environ.get("PYTHONPATH"))))
    process = subprocess.Popen(
        [sys.executable, script, out],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env=os.environ | {"PYTHONPATH": path},
    )
    errors = said(process)
    done = subprocess.CompletedProcess(process.args, process.wait(), "", errors)
    seconds, name = time.perf_counter() - began, shown(script)
    try:
        if done.returncode:
            raise StabctlError(why(done))
        ran = Ran(name, seconds, study.read(file))
    except StabctlError as error:
        ran = Ran(name, seconds, failure=str(error))
    print(f"{name}: {ran.failure or 'done'} ({seconds:.0f} s)", flush=True)
    return ran


def said(process: subprocess.Popen[str]) -> str:
    """What a process writes to stderr until it ends; lines on its progress are shown at once instead."""
    errors = []
    assert process.stderr
    for line in process.stderr:
        if line.startswith(study.PROGRESS):
            print(line.removeprefix(study.PROGRESS), end="", flush=True)
        else:
            errors.append(line)
    return "".join(errors)


def why(done: subprocess.CompletedProcess[str]) -> str:
    """Why a script failed, in one sentence."""
    if done.returncode < 0:
        return f"It was killed by signal {-done.returncode}."
    lines = done.stderr.strip().splitlines()
    return lines[-1].removeprefix("stabctl: ") if lines else f"It ended with exit code {done.returncode}."


def shown(script: Path) -> str:
    """Name of the script for readers: sims/omib.py."""
    return f"{script.parent.name}/{script.name}"


def machine() -> str:
    """Description of this machine."""
    return f"{os.cpu_count()} processors, {platform.system()} {platform.machine()}, Python {platform.python_version()}"


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)

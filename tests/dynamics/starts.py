"""Starts of a command while its machine code on disk is damaged, or something stands in the way of it.

    python tests/dynamics/starts.py 500 --seed 1

Each start must give the answer of an undamaged one, or end with one sentence.
"""

import argparse
import contextlib
import fcntl
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMMAND = ["simulate", "wscc9", "--classical", "--fault", "7", "--clear", "6cyc", "--json"]
DAMAGE = {
    "empty": lambda data, _: b"",
    "cut": lambda data, rng: data[: rng.randrange(len(data))],
    "a flipped bit": lambda data, rng: flipped(data, rng.randrange(len(data)), 1 << rng.randrange(8)),
    "zeros": lambda data, _: bytes(len(data)),
    "text": lambda data, _: b"<html>disk quota exceeded</html>",
    "noise": lambda data, rng: rng.randbytes(len(data)),
    "longer": lambda data, rng: data + rng.randbytes(7),
}
OF_FILES = *DAMAGE, "exchanged", "gone", "a folder", "a link to nothing"
OF_ALL = "locked", "written to", "full disk", "no cache", "two at once", "other version"
KINDS = OF_FILES + OF_ALL
LONG = "stepper", "_newton"  # files that take long to compile
HEAVY = 0.1  # how often one of them may be damaged
READS = """
import sys
sys.addaudithook(lambda what, of: what == "open" and str(of[0]).endswith(".obj") and print(of[0], file=sys.stderr))
from stabctl.__main__ import main
main()
"""
TIMEOUT = 600  # s   everything is compiled in it, on a busy machine


def flipped(data, k, bit):
    """Data with one bit changed."""
    return data[:k] + bytes([data[k] ^ bit]) + data[k + 1 :]


class Starts:
    """Starts of the command with copies of one cache.

    Parameters
    ----------
    folder
        Where the copies are.
    seed
        Of what is damaged.
    """

    def __init__(self, folder, seed):
        self.folder, self.rng, self.left = Path(folder), random.Random(seed), []
        self.whole = self.folder / "whole"
        self.start(None).communicate()
        self.copy_what_is_read()
        self.wanted = self.answer(self.start(self.whole))
        assert isinstance(self.wanted, dict), self.wanted
        self.other = self.folder / "other"  # a version whose machine of Chapter 2 has other source text
        shutil.copytree(ROOT / "stabctl", self.other / "stabctl", ignore=shutil.ignore_patterns("__pycache__"))
        (source,) = self.other.rglob("devices/**/gencls.py")
        source.write_text(source.read_text(encoding="utf-8") + "\n# another version\n", encoding="utf-8")

    def start(self, cache, package=ROOT, **more):
        """A process that runs the command."""
        where = os.environ | {"PYTHONPATH": str(package)} | more.pop("env", {})
        where |= {"XDG_CACHE_HOME": str(cache)} if cache else {}
        words = [sys.executable, *more.pop("program", ("-m", "stabctl")), *COMMAND]
        return subprocess.Popen(words, env=where, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)

    def copy_what_is_read(self):
        """Copy the files that the command reads of the cache of the user, and make their locks."""
        _, err = self.start(None, program=("-c", READS)).communicate()
        for file in map(Path, filter(lambda line: line.endswith(".obj"), err.splitlines())):
            where = self.whole / file.parent.name
            where.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, where)
            (where / file.name).with_suffix(".lock").touch()

    def answer(self, process):
        """The answer without the time that it took; a text if it is not one."""
        try:
            out, err = process.communicate(timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            return f"no answer in {TIMEOUT} s"
        if process.returncode == 2 and "Traceback" not in err and len(err.strip().splitlines()) == 1:
            return self.wanted  # a sentence
        if process.returncode not in (0, 1) or "Traceback" in err:
            return f"exit {process.returncode}: {err[-800:]}"
        found = json.loads(out)
        del found["wall_s"]
        return found

    def damaged(self, number):
        """The kind of damage of a start and what it answered instead; None if it is as wanted."""
        self.left = self.left or self.rng.sample(KINDS, len(KINDS))  # each of them before any comes again
        kind, cache = self.left.pop(), self.folder / f"start{number}"
        shutil.copytree(self.whole, cache)
        files = sorted(file for file in cache.rglob("*.obj"))
        light = [file for file in files if not file.name.startswith(LONG)] or files
        chosen = self.rng.sample(files if self.rng.random() < HEAVY else light, self.rng.randint(1, 3))
        if kind in OF_FILES:
            for file in chosen:
                self.damage(file, kind, files)
            found = [self.answer(self.start(cache))]
        else:
            found = self.disturbed(cache, kind, chosen)
        found.append(self.answer(self.start(cache)))  # and again, with what the first one left
        shutil.rmtree(cache)
        wrong = [one for one in found if one != self.wanted]
        return kind, wrong[0] if wrong else None

    def damage(self, file, kind, files):
        """Damage one file."""
        data = file.read_bytes()
        if kind in DAMAGE:
            file.write_bytes(DAMAGE[kind](data, self.rng))
        elif kind == "exchanged":
            file.write_bytes(self.rng.choice([other for other in files if other != file]).read_bytes())
        else:
            file.unlink()
            if kind == "a folder":
                file.mkdir()
            elif kind == "a link to nothing":
                file.symlink_to(file.parent / "nothing")

    def disturbed(self, cache, kind, chosen):
        """Answers while something stands in the way of the whole cache."""
        if kind == "no cache":  # a file is in its place, and the temporary folder has another one
            spare = cache.with_name(f"{cache.name}-tmp")
            shutil.copytree(cache / "stabctl", spare / f"stabctl-{os.getuid()}")
            os.chmod(spare / f"stabctl-{os.getuid()}", 0o700)
            shutil.rmtree(cache / "stabctl")
            (cache / "stabctl").write_bytes(b"")
            found = [self.answer(self.start(cache, env={"TMPDIR": str(spare)}))]
            shutil.rmtree(spare)
            (cache / "stabctl").unlink()
            shutil.copytree(self.whole / "stabctl", cache / "stabctl")
            return found
        if kind == "locked":
            with contextlib.ExitStack() as held:
                for path in cache.rglob("*lock"):
                    fcntl.flock(held.enter_context(path.open("w")), fcntl.LOCK_EX)
                return [self.answer(self.start(cache))]
        if kind == "other version":
            return [self.answer(self.start(cache, self.other)), self.answer(self.start(cache))]
        for file in chosen:
            file.unlink()
        if kind == "full disk":
            return [self.answer(self.start(cache, preexec_fn=full))]
        if kind == "two at once":
            return [self.answer(one) for one in [self.start(cache), self.start(cache)]]
        ended = threading.Event()
        writer = threading.Thread(target=self.write, args=(cache, ended), daemon=True)
        writer.start()
        found = [self.answer(self.start(cache))]
        ended.set()
        writer.join()
        return found

    def write(self, cache, ended):
        """Write parts of the files, not all at once, until the end."""
        rng = random.Random(self.rng.random())
        while not ended.wait(0.01):
            file = rng.choice(sorted(cache.rglob("*.obj")) or [None])
            if file is not None and not file.name.startswith(LONG):
                data = file.read_bytes()
                file.write_bytes(data[: rng.randrange(len(data) + 1)])
                ended.wait(0.005)
                file.write_bytes(data)


def full():
    """No file may grow, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))


def main():
    """Run, and return 1 if a start failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("number", type=int)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        starts, kinds, failed = Starts(folder, given.seed), Counter(), 0
        for k in range(given.number):
            kind, wrong = starts.damaged(k)
            kinds[kind] += 1
            failed += wrong is not None
            if wrong is not None:
                print(f"start {k}, {kind}: {wrong}", flush=True)
    print(f"{given.number} starts, {failed} failed: " + ", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items())))
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())

"""Which tests are related to a place in the code: those that execute it, then the others of its modules."""

import json
from collections.abc import Iterator

from .mutants import Mutant, Scratch, digest
from .runner import Runner, function_at

KERNELS = ("devices", "dynamics", "simulation", "reference", "smallsignal", "clearing")  # test folders of compiled code
LEFT_OUT = "tests/project/", "tests/reproduction/"  # about the repository, and about the studies


class Related:
    """For every test file, the times of its tests and the functions that each executes."""

    def __init__(self, scratch: Scratch) -> None:
        self.scratch, self.folder = scratch, scratch.folder / "map"
        self.files: dict[str, dict] = {}

    def measure(self, runner: Runner) -> Iterator[str]:
        """Run every test file that has changed since it was measured last; yields its name before."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for path in sorted((self.scratch.tree / "tests").rglob("test_*.py")):
            name = str(path.relative_to(self.scratch.tree))
            if name.startswith(LEFT_OUT):
                continue
            target = self.folder / f"{name.replace('/', '-')}-{digest(path)}.json"
            if not target.exists():
                yield name
                for old in self.folder.glob(f"{name.replace('/', '-')}-*.json"):
                    old.unlink()
                runner.run([name], None, 3600, target)
            if target.exists():
                self.files[name] = json.loads(target.read_text())

    def tests(self, mutant: Mutant) -> tuple[list[str], list[str]]:
        """Tests that execute the function of a mutant, and all others of the files that use its module."""
        where = f"{mutant.path}:{function_at(self.scratch.tree, mutant.path, mutant.line)}"
        package = mutant.path.split("/")[1]
        text = (self.scratch.tree / mutant.path).read_text(encoding="utf-8")
        compiled = "jit import" in text or package == "devices"
        first, second = {}, {}
        for file, found in self.files.items():
            folder = file.split("/")[1]
            own = folder == package or (compiled and folder in KERNELS)
            executing = set() if where.endswith(":") else set(found["executed"].get(where, ()))
            using = any(place.startswith(f"{mutant.path}:") for place in found["executed"]) or (compiled and own)
            if (not executing or compiled) and own and using:
                executing = set(found["seconds"])
            first[file] = executing
            second[file] = set(found["seconds"]) - executing if using else set()
        return self._ordered(first, package), self._ordered(second, package)

    def seconds(self, tests: list[str]) -> float:
        """How long these tests take."""
        return sum(self.files[name.split("::")[0]]["seconds"][name] for name in tests)

    def within(self, tests: list[str], budget: float) -> list[str]:
        """As many of these tests as take no longer than the budget (s)."""
        kept: list[str] = []
        for name in tests:
            needed = self.seconds([name])
            if needed <= budget:
                kept.append(name)
                budget -= needed
        return kept

    def _ordered(self, chosen: dict[str, set[str]], package: str) -> list[str]:
        """File by file, those of the package first, the quick ones first."""
        lists = {f: sorted(tests, key=lambda t: self.files[f]["seconds"][t]) for f, tests in chosen.items() if tests}
        order = sorted(lists, key=lambda f: (f.split("/")[1] != package, self.seconds(lists[f])))
        return [test for file in order for test in lists[file]]

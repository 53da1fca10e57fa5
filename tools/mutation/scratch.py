"""A copy of the tree, in which one file at a time has a fault."""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .mutants import Mutant


class Scratch:
    """The copy, in `folder/tree`, and its machine code, in `folder/cache`."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.root, self.folder, self.tree, self.cache = root, folder, folder / "tree", folder / "cache"
        self._stamp = 0

    def update(self) -> None:
        """Make the copy equal to the tree, without touching the files that are equal already."""
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=self.root,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.split("\0")
        names = {name for name in listed if name and (self.root / name).is_file()}
        for name in names:
            source, target = self.root / name, self.tree / name
            if not target.exists() or digest(source) != digest(target):
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, target)
        for path in [*self.tree.rglob("*")]:
            known = "__pycache__" in path.parts or str(path.relative_to(self.tree)) in names
            if path.is_file() and not known:
                path.unlink()
        (self.cache / "stabctl").mkdir(parents=True, exist_ok=True)

    @contextmanager
    def fault(self, mutant: Mutant) -> Iterator[None]:
        """The copy with the fault; the machine code compiled meanwhile is removed afterwards."""
        path, compiled = self.tree / mutant.path, self._compiled()
        before, stat = path.read_bytes(), path.stat()
        self._stamp += 1
        try:
            path.write_text(mutant.text, encoding="utf-8")
            os.utime(path, (self._stamp, self._stamp))  # never that of other bytecode or machine code
            yield
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            for new in self._compiled() - compiled:
                shutil.rmtree(new) if new.is_dir() else new.unlink()

    def _compiled(self) -> set[Path]:
        return {*(self.cache / "stabctl").iterdir()}


def digest(path: Path) -> str:
    """Hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]

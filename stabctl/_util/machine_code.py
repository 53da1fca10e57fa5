"""Machine code on disk: a file for each function and the types of its arguments, made again if it is damaged.

It takes the place of numba's own cache, which trusts its files. Only what compiles imports this module.
"""

import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import ccallback, serialize, sigutils
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult

from . import files


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Lock on `path`, so that one process compiles a function and the next one finds its machine code on disk."""
    try:
        import fcntl

        file = path.open("w")
    except (ImportError, OSError):  # Windows, or a file that cannot be opened: two may compile the same function
        yield
        return
    with file:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


class Kept(NullCache):  # type: ignore[misc]
    """The machine code of a function, in files `stem`-*.nbc. A lock is held only while it is compiled."""

    def __init__(self, stem: Path, compiler: Any) -> None:
        self._stem, self._compile = stem, compiler.compile
        self._context = compiler.targetdescr.target_context
        compiler.compile = self._compiled

    def load_overload(self, signature: Any, context: Any) -> Any:
        """The machine code for arguments of a signature; None if there is none that is whole."""
        context.refresh()
        content = files.kept(self._path(sigutils.normalize_signature(signature)[0]))
        return None if content is None else CompileResult._rebuild(context, *pickle.loads(content))

    def _compiled(self, arguments: Any, returned: Any) -> Any:
        path = self._path(arguments)
        with alone(path.with_suffix(".lock")):
            found = self.load_overload(arguments, self._context)  # compiled by another process meanwhile
            if found is None:
                found = self._compile(arguments, returned)
                if not found.library.has_dynamic_globals:
                    files.keep(path, serialize.dumps(found._reduce()))
        return found

    def _path(self, arguments: Any) -> Path:
        about = sys.implementation.cache_tag, self._context.codegen().magic_tuple(), tuple(map(str, arguments))
        return self._stem.with_name(f"{self._stem.name}-{hashlib.sha256(repr(about).encode()).hexdigest()[:16]}.nbc")


def function(python: Callable[..., Any], stem: Path, allocates: bool) -> Any:
    """A compiled function without the interpreter lock, whose machine code is kept."""
    njit: Any = numba.njit
    found = njit(error_model="numpy", nogil=True, _nrt=allocates)(python)
    found._cache = Kept(stem, found._compiler)
    return found


def callback(python: Callable[..., None], signature: Any, stem: Path) -> Any:
    """A compiled function with an address, whose machine code is kept."""
    options = {"error_model": "numpy", "_nrt": False}
    found: Any = ccallback.CFunc(python, (signature.args, signature.return_type), locals={}, options=options)
    found._cache = Kept(stem, found._compiler)
    found.compile()
    return found

"""The decorators of compiled code, and the cache that follows the sources.

`inline` is a device or a part of one: plain Python when called from Python, melted into the entry point when called
from there, never stored. `noinline` is the same for what is called seldom, compiled once and not at every call. `entry`
is an entry point: the only thing kept on disk. numba does not notice an edit in a called file, so the cache folder is
keyed by a hash of every source that holds a kernel; it lies in the user's cache folder, so that the package may be
read-only.
"""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import platformdirs
from numba.extending import register_jitable

_PACKAGE = Path(__file__).parent.parent


def _source_hash() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(_PACKAGE.rglob("*.py")):
        text = path.read_bytes()
        if (
            b"@inline" in text
            or b"@noinline" in text
            or b"@entry" in text
            or "devices" in path.parts
            or path.parent.name == "controllers"
        ):
            digest.update(text)
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    wanted = Path(platformdirs.user_cache_dir("stabctl")) / _source_hash()
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError:
        own = Path(tempfile.gettempdir()) / f"stabctl-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
        own.mkdir(mode=0o700, exist_ok=True)
        if own.stat().st_mode & 0o077 or own.is_symlink():  # somebody else could plant machine code there
            own = Path(tempfile.mkdtemp(prefix="stabctl-"))
        return own / wanted.name


FOLDER = _cache_folder()
_entries: list[Any] = []
_announced: list[bool] = []

_BARE = {"error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": True}
inline = register_jitable(forceinline=True, **_BARE)
noinline = register_jitable(**_BARE)


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile `function` as an entry point, free of the interpreter lock, whose machine code is kept in `FOLDER`."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(FOLDER)
    try:
        _entries.append(numba.njit(error_model="numpy", cache=True, nogil=True)(function))
        return _entries[-1]
    finally:
        numba.config.CACHE_DIR = before


def announce() -> None:
    """Say on stderr, once, that the next call compiles, where an entry point met so far has no machine code on disk.

    With NUMBA_DISABLE_JIT=1 the equations run as the plain Python they are written in, and nothing is compiled.
    """
    if _announced or numba.config.DISABLE_JIT:
        return
    if not all(any(Path(e._cache.cache_path).glob(f"*.{e.__name__}-*.nbc")) for e in _entries):
        _announced.append(True)
        print("stabctl: compiling the equations once, some 20 to 60 seconds ...", file=sys.stderr, flush=True)

"""Object code on disk, a file for each function: loaded by llvmlite alone, without numba.

In the cache a file holds a hash of the rest, a line about the code, and the object code for this processor. The package
has a shared library for each level of processors instead, which needs no LLVM, and whose pages processes share.
"""

import atexit
import ctypes
import json
import os
import platform
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from re import sub
from typing import Any, NamedTuple

from . import files
from .words import Loaded

PACKAGED = Path(__file__).parent.parent / "_machine_code"
BUILD = os.environ.get("STABCTL_BUILD")  # folder of a level of the package that is being made
LEVELS = {  # of a machine, the best first, with the features that Linux must tell of its processor
    "x86_64": {
        "x86-64-v3": "abm avx2 bmi1 bmi2 f16c fma movbe xsave",
        "x86-64-v2": "cx16 lahf_lm pni popcnt sse4_1 sse4_2 ssse3",
    },
    "aarch64": {"generic": ""},  # ARMv8.0, which all of them run
}


class Code(NamedTuple):
    """Object code of a function."""

    symbol: str
    returns: str  # see `words.Loaded`
    numba: str  # version that made it
    helpers: list[str]  # functions of numba that it calls; complex powers do
    machine: bytes


@cache
def processor() -> tuple[str, str, str]:
    """Triple, name and features of this processor, or of the one that NUMBA_CPU_NAME asks for."""
    llvm = _llvm()
    name, features = (os.environ.get(f"NUMBA_CPU_{what}") for what in ("NAME", "FEATURES"))
    own = llvm.get_host_cpu_features().flatten() if name is None else ""
    return llvm.get_process_triple(), name or llvm.get_host_cpu_name(), own if features is None else features


def symbol(stem: str, kinds: str) -> str:
    """Name of a function in object code."""
    return f"stabctl_{sub('[^0-9A-Za-z]', '_', stem)}_{sha256(kinds.encode()).hexdigest()[:16]}"


@cache
def level() -> str:
    """The best packaged level that this processor runs; "" if there is none, or another one is asked for."""
    levels = LEVELS.get(platform.machine(), {})
    packaged = [name for name in levels if (PACKAGED / f"{name}.json").is_file()]
    if not packaged or BUILD or "NUMBA_CPU_NAME" in os.environ:
        return ""
    try:
        with open("/proc/cpuinfo") as file:
            first = file.read(8192).partition("\n\n")[0]
    except OSError:
        return ""
    has = set(next((line for line in first.splitlines() if line.startswith("flags")), "").split())
    return next((name for name in packaged if has >= set(levels[name].split())), "")


@cache
def _packaged() -> dict[str, str]:
    """Functions in the package for this processor, with what they return."""
    try:
        about = json.loads((PACKAGED / f"{level()}.json").read_text())
        whole = sha256((PACKAGED / f"{level()}.so").read_bytes()).hexdigest() == about["sha256"]  # 1 ms
    except (OSError, ValueError, KeyError):
        return {}
    return about["functions"] if whole else {}


@cache
def _library() -> Any:
    return ctypes.CDLL(str(PACKAGED / f"{level()}.so"))


def here(stem: str) -> bool:
    """Whether there is object code of this name."""
    begin = symbol(stem, "")[:-16]
    return any(name.startswith(begin) for name in _packaged()) or any(
        name.startswith(f"{stem}-") and name.endswith(".obj") for name in os.listdir(BUILD or folder())
    )


def found(stem: str, kinds: str, compiled: Callable[[str], Code], version: Callable[[], str]) -> Loaded:
    """A function from the package, the cache or the compiler. A lock is held only while it is compiled."""
    name = symbol(stem, kinds)
    if name in _packaged():
        with suppress(OSError, AttributeError):  # damaged
            function = getattr(_library(), name)
            return Loaded(ctypes.cast(function, ctypes.c_void_p).value or 0, _packaged()[name], function)
    about = sha256(repr((processor(), version(), kinds)).encode()).hexdigest()[:16]
    path = Path(BUILD or folder()) / f"{stem}-{about}.obj"
    code = read(path, name)
    if code is None:
        with alone(path.with_suffix(".lock")):
            code = read(path, name)  # compiled by another process meanwhile
            if code is None:
                code = compiled(name)
                files.keep(path, json.dumps(code[:-1]).encode() + b"\n" + code.machine)
    return load(code)


def read(path: Path, wanted: str = "") -> Code | None:
    """The code in a file; None if there is none that is whole, or not that of the function wanted."""
    content = files.kept(path)
    if content is None:
        return None
    head, _, machine = content.partition(b"\n")
    try:
        symbol, returns, version, helpers = json.loads(head)
    except (TypeError, ValueError):
        return None
    return Code(symbol, returns, version, helpers, machine) if wanted in ("", symbol) else None


@cache
def _llvm() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def load(code: Code) -> Loaded:
    """Load object code. It has an engine of its own, so that names of inner functions cannot be confused."""
    llvm = _llvm()
    for name in code.helpers:
        from numba import _helperlib

        helpers: Any = _helperlib
        llvm.add_symbol(name, helpers.c_helpers[name.removeprefix("numba_")])
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code.machine))
    engine.finalize_object()
    return Loaded(engine.get_function_address(code.symbol), code.returns, engine)


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Lock on `path`, so that one process compiles a function and the next one finds its object code on disk."""
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


@cache
def folder() -> Path:
    """Folder of the object code: in the user's cache, or the temporary folder, or a folder for this run only."""
    import platformdirs

    user = os.getuid() if hasattr(os, "getuid") else "user"
    for path in (Path(platformdirs.user_cache_dir("stabctl")), Path(tempfile.gettempdir()) / f"stabctl-{user}"):
        if _made(path) and _ours(path):
            return path
    path = Path(tempfile.mkdtemp(prefix="stabctl-"))
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


def _made(path: Path) -> bool:
    """Whether the folder exists, or can be created, and is writable."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=0o700, exist_ok=True)
        return os.access(path, os.W_OK | os.X_OK)
    except OSError:
        return False


def _ours(path: Path) -> bool:
    """Whether nobody else can write there; another user could plant object code."""
    found = path.lstat()
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    return mine and stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o022

"""Decorators of compiled code, and the folder that keeps the machine code.

`inline` marks a device equation or a part of one: plain Python when called from Python, inlined when called from
compiled code. `noinline` does the same for code that is called rarely: it is compiled once per caller. `entry` marks an
entry point, compiled at its first call; `start` compiles one in a second process, while this one compiles other
functions. Numba is imported only when something is compiled, so that data can be read without it. With
NUMBA_DISABLE_JIT=1 everything runs as plain Python.
"""

import atexit
import hashlib
import inspect
import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from threading import RLock, get_ident, main_thread
from types import FrameType, ModuleType
from typing import Any

from .process import available

_PACKAGE = Path(__file__).parent.parent
_pending: list[tuple[Callable[..., Any], bool]] = []
lock = RLock()  # one thread compiles at a time
awaited: dict[str, Callable[[], object]] = {}  # module of an entry that another process compiles -> waits for it
_told: list[bool] = []
_running: dict[str, subprocess.Popen[bytes]] = {}


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark `function` to be inlined into compiled callers."""
    vars(function)["inlined"] = True
    _pending.append((function, True))
    return function


def noinline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark `function` to be compiled once per caller, not inlined."""
    _pending.append((function, False))
    return function


class Entry:
    """An entry point: compiled, or loaded from disk, at its first call."""

    def __init__(self, function: Callable[..., Any], allocates: bool) -> None:
        self.function, self.name, self.allocates = function, function.__name__, allocates
        self._compiled: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        if self._compiled is not None:
            return _uninterrupted(self._compiled, arguments)
        with lock, compiling([] if self.on_disk() else [self.name]) as done:
            awaited.pop(self.function.__module__, bool)()
            found = self._compiled or self._compile(arguments)
            done()
        self._compiled = found
        return _uninterrupted(found, arguments)

    def signatures(self) -> list[Any]:
        """Types that it has been compiled for."""
        return list(getattr(self._compiled, "signatures", ()))

    def _stem(self) -> str:
        module = self.function.__module__
        return f"{module.rpartition('.')[2]}.{self.name}-{digest(sources(sys.modules[module]))}"

    def on_disk(self) -> bool:
        """Whether its machine code is on disk, or not needed."""
        return disabled() or self._compiled is not None or kept(self._stem())

    def _compile(self, arguments: Sequence[Any]) -> Callable[..., Any]:
        """The function, compiled for the types of the arguments."""
        if disabled():
            return self.function
        from . import machine_code

        ready()
        found = machine_code.function(self.function, folder() / self._stem(), self.allocates)
        found.compile(tuple(map(found.typeof_pyval, arguments)))
        return found  # type: ignore[no-any-return]


def _uninterrupted(compiled: Callable[..., Any], arguments: Sequence[Any]) -> Any:
    """Call compiled code. Ctrl-C acts once it has returned: numba crashes if it is raised while a result is boxed."""
    act = signal.getsignal(signal.SIGINT)
    if not callable(act) or get_ident() != main_thread().ident:
        return compiled(*arguments)
    came: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append((number, frame)))
    try:
        return compiled(*arguments)
    finally:
        signal.signal(signal.SIGINT, act)
        if came:
            act(*came[0])


def entry(function: Callable[..., Any]) -> Entry:
    """Make `function` an entry point, which runs without the interpreter lock; its machine code is kept on disk.

    It must not allocate memory; this makes calls faster.
    """
    return Entry(function, allocates=False)


def allocating_entry(function: Callable[..., Any]) -> Entry:
    """The same for a function that allocates memory."""
    return Entry(function, allocates=True)


def kept(stem: str) -> bool:
    """Whether machine code of this name is on disk."""
    return any(name.startswith(f"{stem}-") and name.endswith(".nbc") for name in os.listdir(folder()))


def disabled() -> bool:
    """Whether the equations run as plain Python."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


def ready() -> None:
    """Register every function marked so far with numba."""
    from numba.extending import register_jitable

    with lock:
        while _pending:
            function, inlined = _pending.pop()
            register_jitable(
                forceinline=inlined, error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True, _nrt=False
            )(function)


@contextmanager
def compiling(labels: Sequence[str]) -> Iterator[Callable[[], None]]:
    """Report on stderr what is being compiled: a progress bar on a terminal, otherwise one line the first time.

    Parameters
    ----------
    labels
        What is going to be compiled; if empty, nothing is printed.

    Yields
    ------
    Callable
        To be called after each of them.
    """
    if not labels:
        yield lambda: None
        return
    bar = None
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.errors import LiveError
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        bar = Progress(*columns, console=Console(stderr=True), transient=True)
        try:
            bar.start()
        except LiveError:  # another bar is on the screen
            bar = None
    elif not _told:
        with suppress(OSError):  # nobody reads it
            print("stabctl: compiling the equations (once for each set of models) ...", file=sys.stderr, flush=True)
    _told.append(True)
    if bar is None:
        yield lambda: None
        return
    task, left = bar.add_task(f"compiling {labels[0]}", total=len(labels)), iter(labels[1:])
    try:
        yield lambda: bar.update(task, advance=1, description=f"compiling {next(left, labels[-1])}")
    finally:
        bar.stop()


def digest(*texts: str) -> str:
    """Name of machine code: a hash of the numba version and the source texts it is made from."""
    found = hashlib.sha256(_numba().encode())
    for text in texts:
        found.update(text.encode())
    return found.hexdigest()[:16]


@cache
def _numba() -> str:
    """Version of numba, found without importing it."""
    return version("numba")


@cache
def sources(module: ModuleType) -> str:
    """Source text and constants of a module and of all modules that it takes functions from."""
    seen: dict[str, str] = {}
    todo, beside = [module], Path(module.__file__ or "").parent
    while todo:
        found = todo.pop()
        file = getattr(found, "__file__", None) or ""
        inside = Path(file).is_relative_to(_PACKAGE) or Path(file).parent == beside
        if not file or found.__name__ in seen or not inside:
            continue
        constants = {k: v for k, v in vars(found).items() if isinstance(v, int | float | complex)}
        seen[found.__name__] = f"{Path(file).read_text(encoding='utf-8')}{constants}"
        for value in vars(found).values():
            if inspect.ismodule(value) and hasattr(found, "__path__"):
                continue  # a submodule, which is present only if something has imported it
            owner = value if inspect.ismodule(value) else sys.modules.get(getattr(value, "__module__", None) or "")
            if owner is not None:
                todo.append(owner)
    return "".join(seen[name] for name in sorted(seen))


@cache
def folder() -> Path:
    """Folder of the machine code: in the user's cache, or the temporary folder, or a folder for this run only."""
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
    """Whether nobody else can write there; another user could plant machine code."""
    found = path.lstat()
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    return mine and stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o022


def start(where: str, script: str) -> None:
    """Compile an entry point in a separate process, unless it is on disk already or there is only one core.

    Parameters
    ----------
    where
        The entry point, "module:name". It is named rather than imported, because it may be in a higher package.
    script
        Module that calls it once, so that its machine code is written to disk.
    """
    module, _, name = where.partition(":")
    if module in _running or available() < 2 or not sys.executable or getattr(import_module(module), name).on_disk():
        return
    paths = str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "PYTHONSAFEPATH": "1"}
    nothing = subprocess.DEVNULL
    command = [sys.executable, "-m", script]
    _running[module] = subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing, env=environment)
    atexit.register(_stop, _running[module])
    awaited[module] = _running[module].wait


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.terminate()
        process.wait()

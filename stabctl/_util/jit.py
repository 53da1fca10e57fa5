"""Decorators of compiled code, and its entry points.

`inline` marks a device equation or a part of one: plain Python when called from Python, inlined when called from
compiled code. `noinline` does the same for code that is called rarely: it is compiled once per caller. `entry` marks an
entry point, loaded or compiled at its first call; `start` compiles one in a second process, while this one compiles
other functions. Numba is imported only when something is compiled. With NUMBA_DISABLE_JIT=1 everything runs as plain
Python.
"""

import atexit
import hashlib
import inspect
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any

from . import object_code
from .errors import StudyError
from .process import available
from .words import Bound, Function, taken

_PACKAGE = Path(__file__).parent.parent
_pending: list[tuple[Callable[..., Any], bool]] = []  # functions that numba does not know yet; whether they are inlined
_definitions: list[Callable[[], None]] = []  # what tells numba how to compile something, before it compiles anything
lock = RLock()  # one thread compiles at a time
meanwhile: list[Callable[[], object]] = []  # compile what is likely to be used next, while another process compiles
_told: list[bool] = []
plain: list[Callable[[], Any]] = []  # the bound calls of plain Python; their addresses are the places from 1 on
_running: dict[str, subprocess.Popen[bytes]] = {}


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark `function` to be inlined into compiled callers."""
    vars(function)["inlined"] = True
    _pending.append((function, True))
    return function


def noinline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark `function` to be compiled once per caller, not inlined."""
    vars(function)["inlined"] = False
    _pending.append((function, False))
    return function


def lowered(define: Callable[[], None]) -> Callable[[], None]:
    """Mark a function that tells numba how to compile something."""
    _definitions.append(define)
    return define


def ready() -> None:
    """Tell numba of every function marked so far."""
    from numba.extending import register_jitable

    with lock:
        while _definitions:
            _definitions.pop()()
        while _pending:
            function, inlined = _pending.pop()
            register_jitable(
                forceinline=inlined, error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True, _nrt=False
            )(function)


def compiler() -> ModuleType:
    """The module that compiles, with every function marked so far. Raises `StudyError` without numba."""
    try:
        module = import_module("stabctl._util.compiler")
    except ImportError as error:
        raise StudyError(
            f"The equations must be compiled for this computer, which needs numba ({error}): pip install numba."
        ) from None
    ready()
    return module


def disabled() -> bool:
    """Whether the equations run as plain Python."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


_DISABLED = disabled()


class Entry:
    """An entry point: loaded, or compiled, at its first call with arguments of some kinds."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function, self.name = function, function.__name__
        self._functions: dict[tuple[Any, ...], Function] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        if _DISABLED:
            return self.function(*arguments)
        words, kinds, _held = taken(arguments)
        return self._of(kinds)(words)

    def bound(self, *arguments: Any) -> Bound:
        """The compiled function with these arguments, for `call_bound`; the records among them must live on."""
        if _DISABLED:
            plain.append(lambda: self.function(*arguments))
            return Bound(len(plain), 0, None)
        words, kinds, held = taken(arguments)
        return self._of(kinds).bound(words, (arguments, held))

    def _of(self, kinds: tuple[Any, ...]) -> Function:
        found = self._functions.get(kinds)
        if found is None:
            with lock, compiling([] if self.on_disk() else [self.name]) as done:
                _wait(self.function.__module__)
                found = self._functions.get(kinds) or self._load(kinds)
                self._functions[kinds] = found
                done()
        return found

    def signatures(self) -> list[Any]:
        """Kinds of arguments that it has been called with."""
        return list(self._functions)

    def _stem(self) -> str:
        module = self.function.__module__
        return f"{module.rpartition('.')[2]}.{self.name}-{digest(sources(sys.modules[module]))}"

    def on_disk(self) -> bool:
        """Whether its object code is on disk, or not needed."""
        return _DISABLED or bool(self._functions) or object_code.here(self._stem())

    def _load(self, kinds: tuple[Any, ...]) -> Function:
        """The function for arguments of these kinds."""

        def compiled(symbol: str) -> object_code.Code:
            return compiler().function(self.function, kinds, symbol)

        found = object_code.found(self._stem(), ", ".join(map(str, kinds)), compiled, numba_version)
        return Function(found, kinds)


def entry(function: Callable[..., Any]) -> Entry:
    """Make `function` an entry point, which runs without the interpreter lock; its object code is kept on disk.

    It must not allocate memory. Records among its arguments should be of classes marked with `words.record`.
    """
    return Entry(function)


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
    """Name of object code: a hash of the source texts it is made from."""
    found = hashlib.sha256(_makers().encode())
    for text in texts:
        found.update(text.encode())
    return found.hexdigest()[:16]


@cache
def _makers() -> str:
    """Source texts of what makes object code."""
    return "".join(Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("compiler.py", "words.py"))


@cache
def numba_version() -> str:
    """What tells the version of numba, found without importing it."""
    found = find_spec("numba")
    return Path(found.origin).with_name("_version.py").read_text() if found and found.origin else ""


@cache
def sources(module: ModuleType) -> str:
    """Source text and constants of a module, and of all modules of the package that it takes functions from.

    Those of `_util` are left out.
    """
    seen: dict[str, str] = {}
    todo = [module]
    while todo:
        found = todo.pop()
        file = getattr(found, "__file__", None) or ""
        inside = file.startswith(f"{_PACKAGE}{os.sep}") and not file.startswith(f"{_PACKAGE / '_util'}{os.sep}")
        if found.__name__ not in seen and (inside or found is module):
            seen[found.__name__], used = _source(found)
            todo += used
    return "".join(seen[name] for name in sorted(seen))


def own(file: str) -> bool:
    """Whether a file is Python code of the user's: not of this package, of Python, or installed."""
    elsewhere = (f"{_PACKAGE}{os.sep}", os.path.dirname(os.__file__) + os.sep)
    return file.endswith(".py") and not file.startswith(elsewhere) and "site-packages" not in Path(file).parts


@cache
def _source(module: ModuleType) -> tuple[str, list[ModuleType]]:
    """Source text and constants of a module, and the modules that it takes functions from."""
    constants = {k: v for k, v in vars(module).items() if isinstance(v, int | float | complex)}
    used = {}
    for value in vars(module).values():
        if inspect.ismodule(value) and hasattr(module, "__path__"):
            continue  # a submodule, which is present only if something has imported it
        owner = value if inspect.ismodule(value) else sys.modules.get(getattr(value, "__module__", None) or "")
        if owner is not None:
            used[owner.__name__] = owner
    return f"{Path(module.__file__ or '').read_text(encoding='utf-8')}{constants}", list(used.values())


def start(where: str, script: str) -> bool:
    """Compile an entry point in a separate process, unless it is on disk already or there is only one core.

    Parameters
    ----------
    where
        The entry point, "module:name". It is named rather than imported, because it may be in a higher package.
    script
        Module that calls it once, so that its machine code is written to disk.

    Returns
    -------
    bool
        Whether a process was started.
    """
    module, _, name = where.partition(":")
    if module in _running or available() < 2 or not sys.executable or getattr(import_module(module), name).on_disk():
        return False
    paths = str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "PYTHONSAFEPATH": "1"}
    nothing = subprocess.DEVNULL
    command = [sys.executable, "-m", script]
    _running[module] = subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing, env=environment)
    atexit.register(_stop, _running[module])
    return True


def _wait(module: str) -> None:
    """Wait for the process that compiles the entry point of a module, if there is one."""
    if (process := _running.get(module)) is not None:
        while meanwhile and process.poll() is None:
            meanwhile.pop(0)()
        process.wait()


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.terminate()
        process.wait()

"""The compiled loop of every model: its source, stored next to its machine code, and its address in this process."""

import importlib.util
import inspect
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import get_ident
from types import ModuleType
from typing import Any

from stabctl._util import jit

from .loop_text import write


@cache
def _module(name: str, device: ModuleType, scalar: type) -> Callable[..., None]:
    """The loop as a Python function, whose source is stored next to its machine code."""
    kind = scalar.__name__
    text = f"import {device.__name__} as device\n" if device.__package__ else "import sys\n"
    if not device.__package__:
        text += f"device = sys.modules[{device.__name__!r}]\n"
    text += f"\n\n{write(device, name, scalar)}"
    if jit.disabled():
        space: dict[str, Any] = {}
        exec(compile(text, f"<{name} {kind}>", "exec"), space)  # text generated above
        return space[name]
    path = (
        jit.folder()
        / "families"
        / f"{name}_{kind}_{jit.digest(text, inspect.getsource(_compile), jit.sources(device))}.py"
    )
    if not path.exists():
        path.parent.mkdir(mode=0o700, exist_ok=True)
        own = path.with_suffix(f".{os.getpid()}-{get_ident()}")  # other threads may write it too
        own.write_text(text, encoding="utf-8")
        os.utime(own, (0, 0))  # numba identifies a source by its time and size; the name contains the hash
        own.replace(path)
    spec: Any = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return getattr(module, name)


def on_disk(name: str, device: ModuleType, scalar: type) -> bool:
    """Whether the machine code of a family is on disk, loaded, or not needed."""
    if jit.disabled() or (device, scalar) in _compiled:
        return True
    function = _module(name, device, scalar)
    place = os.path.dirname(inspect.getfile(function))
    return os.path.isdir(f"{place}/__pycache__") and any(
        file.startswith(f"{function.__module__}.") and file.endswith(".nbc")
        for file in os.listdir(f"{place}/__pycache__")
    )


_compiled: dict[tuple[ModuleType, type], Any] = {}
plain: list[Any] = []  # with NUMBA_DISABLE_JIT=1 an "address" is a row of this list


def address(name: str, device: ModuleType, scalar: type) -> int:
    """Address of the compiled loop in this process."""
    key = device, scalar
    with jit.lock:
        if key not in _compiled:
            function = _module(name, device, scalar)
            if jit.disabled():
                plain.append(function)
                _compiled[key] = len(plain) - 1
            else:
                _compiled[key] = _compile(function, scalar)
    found = _compiled[key]
    return found if isinstance(found, int) else found.address


def _compile(function: Callable[..., None], scalar: type) -> Any:
    import numba
    from numba import types

    jit.ready()
    number = types.complex128 if scalar is complex else types.float64
    pointer = types.CPointer
    signature = types.void(
        types.int64, types.int64, pointer(types.int64), pointer(types.float64), pointer(number), pointer(number),
        pointer(types.int64),
    )  # fmt: skip
    compiled = numba.cfunc(signature, cache=True, error_model="numpy", _nrt=False)  # type: ignore[call-arg]
    with jit.alone(Path(inspect.getfile(function)).with_suffix(".lock")):
        return compiled(function)

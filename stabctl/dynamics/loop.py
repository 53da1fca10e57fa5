"""The compiled loop of every model: a function made from its source text, and its address in this process."""

import inspect
import sys
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

from stabctl._util import jit
from stabctl.devices.device import Device

from .loop_text import write


@cache
def _module(name: str, device: Device, scalar: type) -> Callable[..., None]:
    """The loop as a Python function of a module that is named after its source text."""
    kind = scalar.__name__
    inside = device.module.__package__
    text = f"import {device.module.__name__} as device\n" if inside else "import sys\n"
    if not inside:
        text += f"device = sys.modules[{device.module.__name__!r}]\n"
    text += f"\n\n{write(device, name, scalar)}"
    stem = f"{name}_{kind}_{jit.digest(text, inspect.getsource(_compile), jit.sources(device.module))}"
    module = sys.modules[stem] = ModuleType(stem)
    exec(compile(text, f"<{stem}>", "exec"), vars(module))  # text generated above
    return getattr(module, name)  # type: ignore[no-any-return]


def on_disk(name: str, device: Device, scalar: type) -> bool:
    """Whether the machine code of a family is on disk, loaded, or not needed."""
    if jit.disabled() or (device, scalar) in _compiled:
        return True
    return jit.kept(_module(name, device, scalar).__module__)


_compiled: dict[tuple[Device, type], Any] = {}
plain: list[Any] = []  # with NUMBA_DISABLE_JIT=1 an "address" is a row of this list


def address(name: str, device: Device, scalar: type) -> int:
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
    from numba import types

    from stabctl._util import machine_code

    jit.ready()
    number = types.complex128 if scalar is complex else types.float64
    pointer = types.CPointer
    signature = types.void(
        types.int64, types.int64, pointer(types.int64), pointer(types.float64), pointer(number), pointer(number),
        pointer(types.int64),
    )  # fmt: skip
    return machine_code.callback(function, signature, jit.folder() / function.__module__)

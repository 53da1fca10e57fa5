"""The devices of one model in a system, as flat tables."""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from stabctl import devices


class Family(NamedTuple):
    """The devices of one model in a system."""

    name: str
    device: ModuleType
    w: np.ndarray  # (devices, width) i64   places, see `family`
    k: np.ndarray  # (devices, constants)
    keys: tuple[str, ...]  # name of each, such as "machine 3"

    def __reduce__(self) -> tuple[Any, ...]:
        where = self.device.__name__, self.device.__file__
        return _family, (self.name, *where, self.w, self.k, self.keys)


def _family(name: str, module: str, file: str, *rest: Any) -> Family:
    """A family received from another process; a device registered there is registered here too."""
    if module not in sys.modules and not module.startswith("stabctl."):
        devices.register(file)
    return Family(name, import_module(module), *rest)

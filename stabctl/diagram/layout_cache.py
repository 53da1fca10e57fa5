"""Layouts of diagrams, stored in the user's cache folder under a hash of the data they depend on."""

import hashlib
import sys

import numpy as np

from stabctl._util import files, jit
from stabctl.model.case import Case

from .layout import layout


def cached_layout(case: Case) -> np.ndarray:
    """The layout of a case (buses and machines, 2), calculated once."""
    path, shape = jit.folder() / f"diagram-{_name(case)}", (len(case.buses) + len(case.machines), 2)
    content = files.kept(path)
    if content is not None:
        return np.frombuffer(content).reshape(shape)
    found = layout(case)
    files.keep(path, np.asarray(found, float).tobytes())
    return found


def _name(case: Case) -> str:
    """A hash of the network, the coordinates given, and the code."""
    parts = hashlib.sha256(jit.sources(sys.modules[layout.__module__]).encode())
    parts.update(repr([(b.bus, b.x, b.y) for b in case.buses]).encode())
    parts.update(repr([(k.from_bus, k.to_bus, k.r, k.x) for k in case.branches]).encode())
    parts.update(repr([(m.machine, m.bus) for m in case.machines]).encode())
    return parts.hexdigest()[:24]

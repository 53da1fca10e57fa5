"""Parameters that depend on the starting point, which devices compute in `automatic`."""

from types import SimpleNamespace

import numpy as np

from . import family
from .assembly import System
from .tables import Family


def completed(system: System, s: np.ndarray) -> System:
    """The system with the parameters that depend on its starting point; the same object if there are none.

    Parameters
    ----------
    system
        The devices.
    s
        All signals (layout.size) of an equilibrium with the parameters as given.
    """
    for f in system.families:
        if f.device.automatic is None:
            continue
        k = np.array([_row(f, j, s) for j in range(len(f.w))])
        if not np.array_equal(k, f.k):
            system = system.with_constants(f.name, k)
    return system


def _row(f: Family, j: int, s: np.ndarray) -> list[float]:
    """Parameters of one device: its own computed from its inputs and output at the start."""
    w, device = f.w[j], f.device
    inputs, outputs = device.Input._fields, device.Output._fields
    known = {
        "p": device.Par(*f.k[j]),
        "u": SimpleNamespace(**dict(zip(inputs, s[w[family.INPUTS : family.INPUTS + len(inputs)]], strict=True))),
        "y": SimpleNamespace(**dict(zip(outputs, s[w[-1] : w[-1] + len(outputs)], strict=True))),
    }
    return list(device.evaluate("automatic", known))

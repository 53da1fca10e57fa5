"""Compile the stepper alone, whose types are the same for every system; a second process does so at a cold start."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from stabctl.dynamics.layout import Layout
from stabctl.dynamics.program import Program

from .criterion import DEFAULT, numbers
from .plant import Frame, Net, space
from .stepper import advance
from .substitution import factor


def prepare() -> None:
    """Call the stepper for zero steps of a system of one bus without devices."""
    places, none, calls = np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 5), np.int64)
    layout = Layout((), (), 1, 0, 0, {}, places)
    kinds = {
        "places": np.zeros(3, np.int64),
        "first": np.zeros(1, np.int64),
        "inertia": none,
        "weight": none,
        "low": none,
        "high": none,
        "watch_low": none,
    }
    flags: dict[str, Any] = dict.fromkeys(("gated", "relay", "follows"), False)
    arrays: dict[str, Any] = {name: kinds.get(name, places) for name in Frame._fields if name not in flags}
    frame = Frame(**arrays, **flags)
    net = Net(factor(sp.identity(1, complex, "csc")), places, places, np.ones(1, bool), False)
    program = Program(places, none, calls, calls, calls, calls, calls, calls, places)
    q = space(np.zeros(layout.size), layout, frame)
    advance(program, frame, net, q, numbers(DEFAULT), none, places, False, False, np.empty((0, 0)))


if __name__ == "__main__":
    prepare()

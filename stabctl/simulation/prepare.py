"""Compile the stepper alone, whose types are the same for every system; a second process does so at a cold start."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from stabctl.dynamics.layout import Layout
from stabctl.dynamics.program import Program

from ._buffers import buffers
from ._places import Net, Places, Relative
from ._substitution import factor
from .criterion import DEFAULT, numbers
from .stepper import NOTHING, START, advance


def prepare() -> None:
    """Call the stepper for zero steps of a system of one bus without devices."""
    places, none, calls = np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 5), np.int64)
    layout = Layout((), (), 1, 0, 0, {}, places)
    kinds = {
        "first": np.zeros(1, np.int64),
        "inertia": none,
        "weight": none,
        "judged": np.zeros(0, bool),
        "other_weight": none,
        "other_low": none,
        "other_high": none,
        "low": none,
        "high": none,
        "watch_low": none,
    }
    flags: dict[str, Any] = dict.fromkeys(("gated", "relay", "follows", "inertial", "abrupt"), False)
    numbers_: dict[str, Any] = {"voltages": 0, "elapsed": 0, "begun": 0, "seen": Relative(0, 0, 0, 0, 0)} | flags
    arrays: dict[str, Any] = {name: kinds.get(name, places) for name in Places._fields if name not in numbers_}
    read = Places(**arrays, **numbers_)
    net = Net(factor(sp.identity(1, complex, "csc")), places, places, 1, np.ones(1, bool), False, True)
    program = Program(places, none, calls, calls, calls, calls, calls, calls, places)
    run = buffers(np.zeros(max(layout.size, 2)), layout, read)
    advance(program, read, net, run, numbers(DEFAULT), NOTHING, START, np.empty((0, 0)))


if __name__ == "__main__":
    prepare()

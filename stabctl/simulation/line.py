"""A sampled law in the simulation: its orders are read once per frame and act later.

    k: frames of delay d, bit of the rate
    w: -, -, -, unit, order wanted, bits of the frames that are due, memory, order that acts

The memory is [delay line (d), oldest first].
"""

import numpy as np

from stabctl._util.jit import inline
from stabctl.dynamics.family import STEP

NAME = "delay line"
ROLE = "controller"


@inline
def family(op, count, w, k, s, f, on):
    """The calls of the stepper; see `stabctl.dynamics._codegen`."""
    for j in range(count):
        wanted, due, line, out = w[8 * j + 4], w[8 * j + 5], w[8 * j + 6], w[8 * j + 7]
        d, bit = int(k[2 * j]), int(k[2 * j + 1])
        if op == STEP and int(s[due].real) & (1 << bit):
            if d == 0:
                s[out] = s[wanted]
            else:
                s[out] = s[line]
                for i in range(d - 1):
                    s[line + i] = s[line + i + 1]
                s[line + d - 1] = s[wanted]


def sizes(k: np.ndarray) -> tuple[int, int, int, int]:
    """Numbers of states, inputs (with the memory), outputs and buses."""
    return 0, 3, 1, 0


def operations(k: np.ndarray) -> dict[int, tuple[str, ...]]:
    """Operations, each with its equations."""
    return {STEP: ("family",)}


def read(op: int, w: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Places that an operation reads."""
    return w[4:6]

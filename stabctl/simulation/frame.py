"""A sampled controller in the simulation: once per frame x+ = A x + B y, u = shape(C x + D y), which acts later.

    k, w: as in `lti`; after L: frames of delay, largest change of an output per frame (0: unlimited), bit of the rate
    w: before the first output, the place of the memory

The memory is [x (n) | delay line, oldest first | u held (p) | next x (n) | new u (p)]. The frames of a Python function
are made outside, which then sets the u held.
"""

import numpy as np

from stabctl._util.jit import inline
from stabctl.dynamics.family import FRAME, OUTPUT, TINY

from .lti import HEAD, active, moved, shape, wanted

NAME = "sampled controller"
ROLE = "controller"
SINGLE = True


@inline
def family(op, count, w, k, s, f, on):
    """The calls of the stepper; see `stabctl.dynamics._codegen`."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    levels = HEAD + n * n + n * m + p * n + p * m + 2 * m
    tail = levels + 4 + n * p
    d, reach = int(k[tail]), k[tail + 1]
    x, out = w[6 + m + p], w[7 + m + p]
    line = x + n
    held = line + d * p
    following, new = held + p, held + p + n
    acts = active(w, k, s, on)
    if op == OUTPUT:
        for i in range(p):
            s[out + i] = s[w[4 + m + i]] + (s[held + i] if acts else 0 * s[held + i])
    if op == FRAME:
        for i in range(p):
            s[new + i] = wanted(i, x, w, k, s, on) if acts else 0 * s[held + i]
        for i in range(n):
            s[following + i] = moved(i, x, w, k, s, on) if acts else 0 * s[held]
        for i in range(p):
            u = s[line + i] if d > 0 else s[new + i]
            y = shape(u, k[levels], k[levels + 1], k[levels + 2], k[levels + 3])
            if reach > 0:
                before = s[held + i]
                y = (
                    before - reach
                    if y.real < before.real - reach
                    else before + reach
                    if y.real > before.real + reach
                    else y
                )
            s[held + i] = y
            for j in range(n):
                s[following + j] += k[levels + 4 + j * p + i] * (y - u)
        for i in range(n):
            s[x + i] = s[following + i]
        for i in range(max(d - 1, 0) * p):
            s[line + i] = s[line + p + i]
        if d > 0:
            for i in range(p):
                s[held - p + i] = s[new + i]


@inline
def differentiated(count, w, k, s, f, on):
    """Outputs with each variable changed in turn: they move with what they are added to (`_codegen`)."""
    m, p = int(k[1]), int(k[2])
    for c in range(m + p + 4):
        for i in range(p):
            f[p * c + i] = s[w[7 + m + p] + i] + (1j * TINY if c == m + i else 0)


def sizes(k: np.ndarray) -> tuple[int, int, int, int]:
    """Numbers of states, inputs (with those added to, gate, window and memory), outputs and buses."""
    m, p = int(k[1]), int(k[2])
    return 0, m + p + 3, p, 0


def operations(k: np.ndarray) -> dict[int, tuple[str, ...]]:
    """Operations, each with its equations; frames of a Python function are made outside."""
    return {OUTPUT: ("family",), FRAME: ("family",)} if k[-1] >= 0 else {OUTPUT: ("family",)}


def read(op: int, w: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Places that an operation reads."""
    m, p = int(k[1]), int(k[2])
    return w[4 + m : 6 + m + p] if op == OUTPUT else w[4 : 6 + m + p]

"""Means of the angles or speeds of rotors, weighted with their inertia, in the island of one of them.

    y = a (mean of a group) + b (mean of all, or of the others)

    k: rotors m, a, b, 1 if the mean is of the others, value at rest, group (m, 0 or 1), inertia (m), unit (m)
    w: -, -, -, unit whose island is meant (-1: all that are on), signals (m), output

While that unit is off, the island of the first of the group that is on is meant. If all of it
are off, the value is that at rest. Where there are no others, their mean is that of the group.
"""

import numpy as np

from stabctl._util.jit import inline
from stabctl.dynamics.family import OUTPUT, TINY

NAME = "center of inertia"
ROLE = "sensor"
HEAD = 5


@inline
def mean(w, k, s, on, r, c):
    """What one device gives, whose places begin at r and constants at c."""
    m = int(k[c])
    mine = on[w[r + 3]] if w[r + 3] >= 0 else 0
    for i in range(m):  # the island of another one of the group, if the first is off
        if mine < 0 and k[c + HEAD + i] > 0:
            mine = on[int(k[c + HEAD + 2 * m + i])]
    inside, outside = 0.0, 0.0
    own, rest = 0 * s[w[r + 4]], 0 * s[w[r + 4]]
    for i in range(m):
        group, H, island = k[c + HEAD + i], k[c + HEAD + m + i], on[int(k[c + HEAD + 2 * m + i])]
        if island < 0 or (w[r + 3] >= 0 and island != mine):
            continue
        y = s[w[r + 4 + i]]
        if group > 0:
            inside += H
            own += H * y
        if group == 0 or k[c + 3] == 0:
            outside += H
            rest += H * y
    if inside == 0 and (k[c + 1] != 0 or w[r + 3] >= 0):
        return own + k[c + 4]
    own = own / inside if inside > 0 else own
    rest = rest / outside if outside > 0 else own
    return k[c + 1] * own + k[c + 2] * rest


@inline
def family(op, count, w, k, s, f, on):
    """The calls of the stepper; see `stabctl.dynamics._codegen`."""
    m = int(k[0])
    if op == OUTPUT:
        for j in range(count):
            s[w[(m + 5) * j + 4 + m]] = mean(w, k, s, on, (m + 5) * j, (HEAD + 3 * m) * j)


@inline
def differentiated(count, w, k, s, f, on):
    """The output with each signal changed in turn; see `stabctl.dynamics._codegen`."""
    m = int(k[0])
    for j in range(count):
        r, c = (m + 5) * j, (HEAD + 3 * m) * j
        for i in range(m + 1):
            kept = s[w[r + 4 + i]]
            if i < m:
                s[w[r + 4 + i]] = kept + 1j * TINY
            f[(m + 1) * j + i] = mean(w, k, s, on, r, c)
            s[w[r + 4 + i]] = kept


def sizes(k: np.ndarray) -> tuple[int, int, int, int]:
    """Numbers of states, inputs, outputs and buses."""
    return 0, int(k[0]), 1, 0


def operations(k: np.ndarray) -> dict[int, tuple[str, ...]]:
    """Operations, each with its equations."""
    return {OUTPUT: ("family",)}


def read(op: int, w: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Places that an operation reads."""
    return w[4:-1]

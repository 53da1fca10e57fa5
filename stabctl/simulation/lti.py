"""A continuous controller in the simulation: x' = A x + B y, u = shape(C x + D y), of any size.

The sizes are in the table of constants, not in the type, so a controller of a new size needs no compilation.

    k: n m p, A B C D, y at rest (m), unit of each input (m), low high deadband relay, L (n p)
    w: state, -, -, unit, inputs (m), what each output is added to (p), gate and window (1 while open), first output

While its gate is closed or its unit is off, the outputs are zero and the states return to rest.
"""

import numpy as np

from stabctl._util.jit import inline
from stabctl.dynamics.family import OUTPUT, RATES, TINY

NAME = "controller"
ROLE = "controller"
SINGLE = True
HEAD = 3
RESET = 0.05  # s   time constant with which the states return to rest


@inline
def shape(u, low, high, dead, relay):
    """Deadband and limits, or a relay with the levels low, 0, high."""
    if relay > 0:
        return 0 * u + (high if u.real > dead else low if u.real < -dead else 0.0)
    if dead > 0:
        u = u - dead if u.real > dead else u + dead if u.real < -dead else 0 * u
    return 0 * u + low if u.real < low else 0 * u + high if u.real > high else u


@inline
def deviation(i, w, k, s, on, ins, rest, units):
    """Deviation of input i from its value at rest; 0 if its machine is off."""
    unit = int(k[units + i])
    if unit >= 0 and on[unit] < 0:
        return 0 * s[w[ins + i]]
    return s[w[ins + i]] - k[rest + i]


@inline
def wanted(i, x, w, k, s, on):
    """Output i before deadband and limits, for the states at the place x."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    C = HEAD + n * n + n * m
    D = C + p * n
    rest = D + p * m
    u = 0 * s[w[4 + m + i]]
    for q in range(n):
        u += k[C + i * n + q] * s[x + q]
    for q in range(m):
        if k[D + i * m + q] != 0:
            u += k[D + i * m + q] * deviation(q, w, k, s, on, 4, rest, rest + m)
    return u


@inline
def moved(i, x, w, k, s, on):
    """A x + B y of state i, for the states at the place x."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    B = HEAD + n * n
    rest = B + n * m + p * n + p * m
    f = 0 * s[w[4 + m]]
    for q in range(n):
        f += k[HEAD + i * n + q] * s[x + q]
    for q in range(m):
        if k[B + i * m + q] != 0:
            f += k[B + i * m + q] * deviation(q, w, k, s, on, 4, rest, rest + m)
    return f


@inline
def active(w, k, s, on):
    """Whether the gate is open and the unit is on."""
    m, p = int(k[1]), int(k[2])
    if w[3] >= 0 and on[w[3]] < 0:
        return False
    return s[w[4 + m + p]].real > 0 and s[w[5 + m + p]].real > 0


@inline
def given(i, w, k, s, on):
    """Output i, with what it is added to."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    levels = HEAD + n * n + n * m + p * n + p * m + 2 * m
    y = s[w[4 + m + i]]
    if active(w, k, s, on):
        u = wanted(i, w[0], w, k, s, on)
        y += shape(u, k[levels], k[levels + 1], k[levels + 2], k[levels + 3])
    return y


@inline
def rate(i, w, k, s, on):
    """Rate of state i, which a limit that acts changes."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    levels = HEAD + n * n + n * m + p * n + p * m + 2 * m
    if not active(w, k, s, on):
        return -s[w[0] + i] / RESET
    f = moved(i, w[0], w, k, s, on)
    for j in range(p):
        L = k[levels + 4 + i * p + j]
        if L != 0:
            u = wanted(j, w[0], w, k, s, on)
            f += L * (shape(u, k[levels], k[levels + 1], k[levels + 2], k[levels + 3]) - u)
    return f


@inline
def family(op, count, w, k, s, f, on):
    """The calls of the stepper; see `stabctl.dynamics._codegen`."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    if op == OUTPUT:
        for i in range(p):
            s[w[6 + m + p] + i] = given(i, w, k, s, on)
    if op == RATES:
        for i in range(n):
            f[w[0] + i] = rate(i, w, k, s, on)


@inline
def differentiated(count, w, k, s, f, on):
    """Rates and outputs with each variable changed in turn; see `stabctl.dynamics._codegen`."""
    n, m, p = int(k[0]), int(k[1]), int(k[2])
    last = n + m + p + 2
    for c in range(last + 1):
        at = w[0] + c if c < n else w[4 + c - n]
        kept, again = s[at], c == last
        for q in range(4, 4 + min(c, last) - n):
            again = again or w[q] == at
        if not again:
            s[at] = kept + 1j * TINY
        for i in range(n):
            f[(n + p) * c + i] = rate(i, w, k, s, on)
        for i in range(p):
            f[(n + p) * c + n + i] = given(i, w, k, s, on)
        s[at] = kept


def levels(k: np.ndarray) -> int:
    """Place of the limits, the deadband and the relay in the constants of a controller."""
    n, m, p = map(int, k[:3])
    return HEAD + n * n + n * m + p * n + p * m + 2 * m


def fastest(k: np.ndarray) -> float:
    """Largest magnitude of the eigenvalues, also at a limit (1/s)."""
    n, m, p = map(int, k[:3])
    A, C = k[HEAD : HEAD + n * n].reshape(n, n), k[HEAD + n * n + n * m :][: p * n].reshape(p, n)
    L = k[len(k) - n * p :].reshape(n, p)
    return float(max((np.abs(np.linalg.eigvals(M)).max(initial=0.0) for M in (A, A - L @ C)), default=0.0))


def sizes(k: np.ndarray) -> tuple[int, int, int, int]:
    """Numbers of states, inputs (with those added to, gate and window), outputs and buses."""
    n, m, p = map(int, k[:3])
    return n, m + p + 2, p, 0


def operations(k: np.ndarray) -> dict[int, tuple[str, ...]]:
    """Operations, each with its equations."""
    return {OUTPUT: ("family",), RATES: ("family",)} if k[0] else {OUTPUT: ("family",)}


def read(op: int, w: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Places that an operation reads: inputs without feedthrough are not read by the outputs."""
    n, m, p = map(int, k[:3])
    ins, others = w[4 : 4 + m], w[4 + m : 6 + m + p]
    if op == RATES:
        return np.r_[ins, others[p:]]
    D = k[HEAD + n * n + n * m + p * n :][: p * m].reshape(p, m)
    return np.r_[ins[D.any(axis=0)], others]

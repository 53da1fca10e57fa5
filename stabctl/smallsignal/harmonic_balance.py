"""Harmonic balance: swings of one frequency that a loop with nonlinear outputs sustains.

u = G(jw) N(|u|) u for what the outputs are asked for, u (outputs), complex. One output: G(jw) is real and positive, and
N(A) = 1/G gives its amplitude. Several: with equal gains, a characteristic locus of G(jw) crosses the positive real
axis; from there Newton's method (MINPACK) finds the amplitude and phase of each.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, fsolve, linear_sum_assignment

from .opened_loop import OpenedLoop, alone
from .response import grid

EXACT = 1e-8  # residual of a solution, relative to the largest amplitude
SAME = 1e-4  # relative difference in frequency and amplitudes of one solution found twice
NONE = 1e-9  # size of a characteristic value, relative to the largest entry of G, below which it is zero
FAR = 20.0  # bound of the unknowns, logarithms and ratios
CALLS = 300  # of the loop gain, in the search for one solution
NUDGE = 1e-4  # relative change of the amplitude that shows whether the swing returns


@dataclass(frozen=True, eq=False)
class Balance:
    """A swing that the loop sustains."""

    hz: float
    wanted: np.ndarray  # (outputs) complex; the largest is real
    gains: np.ndarray  # (outputs) N(|u|)

    @property
    def largest(self) -> int:
        """The output that is asked for most."""
        return int(np.abs(self.wanted).argmax())


def sampled(loop: OpenedLoop, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) between two, and G there (frequencies, outputs, outputs)."""
    hz = grid(loop.poles, low, high)
    return hz, np.array([loop(2j * np.pi * f)[0] for f in hz])


def balances(loop: OpenedLoop, hz: np.ndarray, G: np.ndarray) -> list[Balance]:
    """All that were found between frequencies (Hz) at which G is given, the slowest first."""
    found = _single(loop, hz, G[:, 0, 0]) if len(loop.parts) == 1 else _several(loop, hz, G)
    return sorted(found, key=lambda b: (b.hz, abs(b.wanted[b.largest])))


def _single(loop: OpenedLoop, hz: np.ndarray, G: np.ndarray) -> list[Balance]:
    def imaginary(f: float) -> float:
        return float(loop(2j * np.pi * f)[0][0, 0].imag)

    found = []
    for k in np.flatnonzero(G.imag[:-1] * G.imag[1:] < 0):
        f = float(brentq(imaginary, hz[k], hz[k + 1], rtol=1e-12))
        gain = 1 / loop(2j * np.pi * f)[0][0, 0].real
        if gain > 0:
            found += [Balance(f, np.array([A + 0j]), np.array([gain])) for A in loop.parts[0].amplitudes(gain)]
    return found


def _several(loop: OpenedLoop, hz: np.ndarray, G: np.ndarray) -> list[Balance]:
    found: list[Balance] = []
    for f, gain, shape in _crossings(hz, G):
        r = int(np.abs(shape).argmax())
        for A in loop.parts[r].amplitudes(gain):
            one = _solved(loop, f, A * shape / shape[r])
            if one and hz[0] <= one.hz <= hz[-1] and not any(_same(one, b) for b in found):
                found.append(one)
    return found


def _crossings(hz: np.ndarray, G: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """Frequency (Hz), gain and shape where a characteristic locus of G(jw) crosses the positive real axis."""
    values, vectors = np.linalg.eig(G)
    least = NONE * np.abs(G).max(axis=(1, 2))
    found = []
    for k in range(1, len(hz)):
        order = linear_sum_assignment(np.abs(values[k - 1][:, None] - values[k]))[1]
        values[k], vectors[k] = values[k][order], vectors[k][:, order]
        a, b = values[k - 1], values[k]
        for j in np.flatnonzero((a.imag * b.imag < 0) & (a.real > least[k]) & (b.real > least[k])):
            part = a.imag[j] / (a.imag[j] - b.imag[j])
            gain = 1 / (a.real[j] + part * (b.real[j] - a.real[j]))
            found.append((hz[k - 1] + part * (hz[k] - hz[k - 1]), gain, vectors[k][:, j]))
    return found


def gains(loop: OpenedLoop, u: np.ndarray) -> np.ndarray:
    """N(|u|) of every output."""
    size = np.maximum(np.abs(u), 1e-12 * np.abs(u).max())
    return np.array([float(part.gain(A)) for part, A in zip(loop.parts, size, strict=True)])


def _solved(loop: OpenedLoop, hz: float, u: np.ndarray) -> Balance | None:
    """Newton's method from a frequency and a swing; the largest output keeps its phase."""
    r = int(np.abs(u).argmax())
    rest = np.delete(np.arange(len(u)), r)

    def swing(x: np.ndarray) -> np.ndarray:
        out = np.empty(len(u), complex)
        out[r], out[rest] = 1.0, x[2 : 2 + len(rest)] + 1j * x[2 + len(rest) :]
        return np.abs(u[r]) * np.exp(x[1]) * out

    def missing(x: np.ndarray) -> np.ndarray:
        v = swing(np.clip(x, -FAR, FAR))
        left = (loop(2j * np.pi * hz * np.exp(x[0]))[0] @ (gains(loop, v) * v) - v) / np.abs(v[r])
        return np.r_[left.real, left.imag]

    start = u[rest] / u[r]
    x = _zero(missing, np.r_[0.0, 0.0, start.real, start.imag])
    return None if x is None else Balance(hz * float(np.exp(x[0])), swing(x), gains(loop, swing(x)))


def _same(a: Balance, b: Balance) -> bool:
    far = np.abs(np.abs(a.wanted) - np.abs(b.wanted)).max() / np.abs(a.wanted).max()
    return bool(abs(a.hz / b.hz - 1) < SAME and far < SAME)


def returns(loop: OpenedLoop, one: Balance) -> bool:
    """Loeb's criterion: a swing that is a little larger decays.

    With the largest amplitude raised, the balance holds at s with Re(s) < 0. For one output, ds/dA = -N'/N^2 / G'(s).
    """
    s, r = 2j * np.pi * one.hz, one.largest
    if len(one.wanted) == 1:
        h = 1e-6 * s
        slope = (loop(s + h)[0][0, 0] - loop(s - h)[0][0, 0]) / (2 * h)
        return bool((loop.parts[0].slope(abs(one.wanted[0])) / slope).real > 0)
    rest = np.delete(np.arange(len(one.wanted)), r)
    raised = (1 + NUDGE) * one.wanted

    def missing(x: np.ndarray) -> np.ndarray:
        u = raised.copy()
        u[rest] = u[rest] * (1 + x[2 : 2 + len(rest)] + 1j * x[2 + len(rest) :])
        left = (loop(s + abs(s) * (x[0] + 1j * x[1]))[0] @ (gains(loop, u) * u) - u) / np.abs(one.wanted)
        return np.r_[left.real, left.imag]

    x = _zero(missing, np.zeros(2 * len(one.wanted)))
    return x is not None and bool(x[0] < 0)


def _zero(missing: Callable[[np.ndarray], np.ndarray], start: np.ndarray) -> np.ndarray | None:
    """A zero near a start; None if none was found."""
    x, information, *_ = fsolve(missing, start, full_output=True, xtol=1e-12, maxfev=CALLS)
    return x if np.abs(information["fvec"]).max() < EXACT else None


def curves(found: Sequence[Balance], G: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """An output and its loop gain -G(jw) at the frequencies of G: of one output, or for each balance.

    Of several outputs, it is that of the largest, the others replaced by their gains N.
    """
    if G.shape[1] == 1:
        return [(0, -G[:, 0, 0])]
    return [(one.largest, -alone(G, one.gains, one.largest)) for one in found]

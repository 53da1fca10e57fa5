"""Minimum time as a boundary-value problem with free durations, solved by `scipy.integrate.solve_bvp`."""

import math

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp

from stabctl.errors import StudyError

from .minimum_time import (
    TIGHT,
    Arcs,
    Array,
    MinimumTime,
    MinimumTimeProblem,
    hamiltonian,
    infeasible,
    rates,
    solution,
    stop_angle,
)
from .stops import stops

TOL = 1e-8  # relative residual of the collocation


def by_collocation(p: MinimumTimeProblem, guess: tuple[float, float] | None = None) -> MinimumTime:
    """Minimum time by collocation.

    Starts from a device that absorbs throughout. If that solution has lambda2 < 0 somewhere, an injecting arc is added
    at the beginning, and its power is changed from Pc_max to Pc_min in steps. If there are several extremals, the
    result is one of them, not necessarily the shortest.

    Parameters
    ----------
    p : MinimumTimeProblem
        The problem.
    guess : (lambda1, lambda2), optional
        Co-states at clearing to start from; by default those of the absorbing device.

    Raises
    ------
    StudyError
        If the collocation does not converge.
    """
    if math.isnan(stop_angle(p)):
        return infeasible(p)
    if p.x2 < 0:
        return by_collocation(p.mirrored(), guess and (-guess[0], -guess[1])).mirrored()
    t, y = _absorbing(p)
    if guess is not None:
        y[2:] = guess[0] * (1 - t / t[-1]), np.full(t.size, guess[1])
    arcs = _collocate(p, (p.Pc_max,), [(t, y)])
    t, y, _ = arcs[0]
    if (y[3] < 0).any():
        rise = int(np.flatnonzero(y[3] < 0)[-1]) + 1
        arcs = [(t[: rise + 1], y[:, : rise + 1], p.Pc_max), (t[rise:], y[:, rise:], p.Pc_max)]
        for part in np.linspace(0, 1, 9):  # with equal powers the guess is a solution
            first = p.Pc_max + part * (p.Pc_min - p.Pc_max)
            arcs = _collocate(p, (first, p.Pc_max), [(t, y) for t, y, _ in arcs], tol=TOL if part == 1 else 1e-3)
        if arcs[-1][1][0, -1] > p.limit:
            arcs = _collocate(p, (p.Pc_min, p.Pc_max), [(t, y) for t, y, _ in arcs], at_limit=True)
    return solution(p, arcs)


def _absorbing(p: MinimumTimeProblem) -> tuple[Array, Array]:
    """Times (n,) from clearing to rest and (4, n) states and co-states while the device absorbs Pc_max throughout."""

    def rest(_t: float, y: Array) -> float:
        return y[1]

    stops(rest, -1)
    span, start = (0, 100 * math.sqrt(p.M / p.Pmax)), (p.x1, p.x2, 0.0, 0.0)
    T = solve_ivp(lambda _, y: rates(p, y, p.Pc_max), span, start, events=rest, **TIGHT).t[-1]
    end = np.array([stop_angle(p), 0.0, 0.0, 1.0])
    run = solve_ivp(lambda _, y: rates(p, y, p.Pc_max), (T, 0), end, max_step=T / 40, **TIGHT)
    y = run.y[:, ::-1].copy()
    y[2:] /= 1 - hamiltonian(p, y[:, -1], p.Pc_max)
    return run.t[::-1], y


def _collocate(
    p: MinimumTimeProblem,
    powers: tuple[float, ...],
    guess: list[tuple[Array, Array]],
    *,
    tol: float = TOL,
    at_limit: bool = False,
) -> Arcs:
    """Solve the arcs of given powers together, each over tau in [0, 1] with its duration unknown."""

    def field(_tau: Array, y: Array, T: Array) -> Array:
        return np.vstack([T[k] * rates(p, y[4 * k : 4 * k + 4], Pc) for k, Pc in enumerate(powers)])

    def ends(a: Array, b: Array, _T: Array) -> Array:
        last = b[-4:]
        joints = [a[4:] - b[:-4], b[3:-4:4]]
        edge = last[0] - p.limit if at_limit else last[2]
        return np.concatenate([[a[0] - p.x1, a[1] - p.x2], *joints, [last[1], edge, hamiltonian(p, last, powers[-1])]])

    tau = np.linspace(0, 1, 41)
    lengths = np.array([t[-1] - t[0] for t, _ in guess])
    y = np.vstack([[np.interp(t[0] + tau * (t[-1] - t[0]), t, row) for row in y] for t, y in guess])
    found = solve_bvp(field, ends, tau, y, p=lengths, tol=tol, max_nodes=20000)
    lengths = np.asarray(found.p)
    if not found.success or lengths.min() <= 0 or found.y[1::4].min() < -1e-6 * p.x2:
        raise StudyError(f"The collocation did not converge ({found.message.rstrip('.')}); use shooting.")
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    return [(begins[k] + lengths[k] * found.x, found.y[4 * k : 4 * k + 4], Pc) for k, Pc in enumerate(powers)]

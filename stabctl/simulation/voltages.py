"""Network voltages at the present states: substitution with factors, Newton where that does not contract.

Newton first lowers the residual at every step; where that ends at a kink, it follows v' = inv(Y) i(v) - v to its rest
in long implicit steps (pseudo-transient continuation), and in the end does the same from zero voltage: a load that
breaks down has a solution below its threshold.
"""

import numpy as np

from stabctl._util.jit import inline, noinline
from stabctl.devices.blocks import copy
from stabctl.devices.loads import zip_load
from stabctl.devices.storage import esd
from stabctl.dynamics import system

from .substitution import solve, solve_apart

TOLERANCE = 1e-7  # pu   error of a voltage at which the iteration ends
LIMIT = 30  # -    substitutions before Newton is called
NEWTON = 40  # -    Newton steps
FAILED = 1000  # -    answer of `settle` where no solution was found
TINY = 1e-30  # complex step


@inline
def settle(b, plant, net, q):
    """Bring b.s.v to the solution of Y v = i(v); the number of substitutions, or FAILED (bus in q.bus[0])."""
    system.sources(b.s, plant, net.island, b.r.g)
    copy(q.current, q.source)
    d, before = plant.draw_bus, 0.0
    for iteration in range(1, LIMIT):
        if iteration > 1:
            copy(q.source, q.current)
        for i in range(len(d)):
            q.seen[i] = q.volt[d[i]]
        system.draws(b.s, plant, b.r.g)
        solve(net.factors, q.current, q.work, q.volt)
        change = 0.0
        for i in range(len(d)):
            miss = q.volt[d[i]] - q.seen[i]
            size = miss.real * miss.real + miss.imag * miss.imag
            if not size <= change:
                change = size
        # the changes fall like a geometric series, whose rest is the error left
        change = np.sqrt(change)
        if change < TOLERANCE or change * change < TOLERANCE * (before - change):
            return iteration
        before = change
    copy(q.kept, q.volt)
    for attempt in range(3):
        if newton(
            net.factors, q.source, q.volt, q.current, q.work, q.new, d, q.bus, attempt > 0,
            plant.load, plant.load_slot, plant.storage, plant.storage_slot, b.s.storage, b.s.order,
        ):  # fmt: skip
            return LIMIT
        for i in range(len(q.volt) if attempt == 1 else 0):
            q.volt[i] = 0
    copy(q.kept, q.volt)
    return FAILED


@noinline
def newton(
    factors, source, volt, current, work, new, bus, blame, slow, loads, load_slot, stores, store_slot, states, order
):
    """Voltages by Newton on the buses that draw, v - a - Z i(v) = 0, steps halved until the residual falls; found?

    With `slow`, the steps are those of an implicit Euler method, of a length that grows as the residual falls.

    a and Z are the voltages without draws and the impedances between the buses; `volt` starts as the guess and ends
    as the solution, or `blame[0]` is the bus with the largest residual.
    """
    n = len(bus)
    a, Z = np.zeros(n, np.complex128), np.zeros((n, n), np.complex128)
    solve_apart(factors, source, work, new)
    for i in range(n):
        a[i] = new[bus[i]]
    for j in range(n):
        for i in range(len(current)):
            current[i] = 0
        current[bus[j]] = 1
        solve_apart(factors, current, work, new)
        for i in range(n):
            Z[i, j] = new[bus[i]]
    v, tried, i_v = np.zeros((n, 2), np.complex128), np.zeros((n, 2), np.complex128), np.zeros((3, n, 2), np.complex128)
    F, J, before, worst = np.zeros(2 * n), np.zeros((2 * n, 2 * n)), np.inf, 0
    for i in range(n):
        v[i, 0], v[i, 1] = volt[bus[i]].real, volt[bus[i]].imag
    pace = 0.3
    for _ in range(3 * NEWTON if slow else NEWTON):
        scale = 1.0
        for _halving in range(12):
            for i in range(n):
                for k in range(2):
                    tried[i, k] = v[i, k].real - scale * F[2 * i + k]
            drawn(tried, loads, load_slot, stores, store_slot, states, order, i_v[0])
            now, worst = residual(tried, a, Z, i_v[0], J[0])
            if now < before or slow:
                break
            scale *= 0.5
        if not now < (np.inf if slow else before):
            break
        if before < np.inf:
            pace = min(max(pace * before / now, 0.05), 1e6)
        before = now
        if now < TOLERANCE:
            copy(source, current)
            for i in range(n):
                current[bus[i]] += i_v[0, i, 0].real + 1j * i_v[0, i, 1].real
            solve_apart(factors, current, work, volt)
            return True
        for i in range(2 * n):
            F[i] = J[0, i]
        for i in range(n):
            v[i, 0], v[i, 1] = tried[i, 0], tried[i, 1]
        for k in range(2):
            for i in range(n):
                tried[i, k] = v[i, k] + 1j * TINY
                tried[i, 1 - k] = v[i, 1 - k]
            drawn(tried, loads, load_slot, stores, store_slot, states, order, i_v[1 + k])
        slopes(Z, i_v, J)
        for i in range(2 * n if slow else 0):
            J[i, i] += 1 / pace
        eliminate(J, F)
    blame[0] = bus[worst]
    return False


@noinline
def drawn(v, loads, load_slot, stores, store_slot, states, order, out):
    """Currents (pairs) that loads and storage inject at voltages v (pairs) of the buses that draw."""
    for i in range(len(v)):
        out[i, 0] = out[i, 1] = 0
    for j in range(len(loads)):
        re, im = zip_load.output(v[load_slot[j]], loads[j])
        out[load_slot[j], 0] += re
        out[load_slot[j], 1] += im
    for j in range(len(stores)):
        y = esd.output(states[j], order[j], v[store_slot[j]], stores[j])
        out[store_slot[j], 0] += y.re
        out[store_slot[j], 1] += y.im


@noinline
def residual(v, a, Z, drawn, F):
    """Fill F with v - a - Z i (pairs); its largest magnitude, and where."""
    highest, worst = 0.0, 0
    for i in range(len(a)):
        miss = v[i, 0].real + 1j * v[i, 1].real - a[i]
        for j in range(len(a)):
            miss -= Z[i, j] * (drawn[j, 0].real + 1j * drawn[j, 1].real)
        F[2 * i], F[2 * i + 1] = miss.real, miss.imag
        size = miss.real * miss.real + miss.imag * miss.imag
        if not size <= highest:
            highest, worst = size, i
    return np.sqrt(highest), worst


@noinline
def slopes(Z, bent, J):
    """Jacobian of the residual, 1 - Z di/dv in pairs; `bent[1 + k]` are the currents at component k + j TINY."""
    n = len(Z)
    for i in range(n):
        for j in range(n):
            for k in range(2):
                here = 1.0 if i == j else 0.0
                g, h = bent[1 + k, j, 0].imag / TINY, bent[1 + k, j, 1].imag / TINY
                J[2 * i, 2 * j + k] = here * (1 - k) - Z[i, j].real * g + Z[i, j].imag * h
                J[2 * i + 1, 2 * j + k] = here * k - Z[i, j].imag * g - Z[i, j].real * h


@noinline
def eliminate(A, x):
    """x = inv(A) x by Gaussian elimination with row pivoting; A is spent."""
    n = len(x)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        for j in range(k, n):
            A[k, j], A[best, j] = A[best, j], A[k, j]
        x[k], x[best] = x[best], x[k]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k, n):
                    A[i, j] -= factor * A[k, j]
                x[i] -= factor * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= A[k, j] * x[j]
        x[k] /= A[k, k]

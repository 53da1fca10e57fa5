"""Network voltages at the present states: fixed-point iteration with factors, Newton's method if that fails.

Newton's method first reduces the residual at every step. If that stalls at a kink, it follows v' = inv(Y) i(v) - v to
its equilibrium in long implicit steps (pseudo-transient continuation), and finally does the same from zero voltage: a
load whose voltage collapses has a solution below its threshold.
"""

import numpy as np

from stabctl._util.jit import allocating_entry, entry, inline, noinline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import perform

from .substitution import backward, forward, middle, solve_apart

TOLERANCE = 1e-7  # pu   voltage error at which the iteration ends
LIMIT = 30  # -    fixed-point iterations before Newton is called
STEPS = 40  # -    Newton steps
HALVINGS = 12  # -    of a Newton step
FAILED, NEEDS_NEWTON = 1000, 1001  # -    special results of `settle`
TINY = 1e-30  # complex step


@inline
def settle(p, a, net, q):
    """Solve Y v = i(v) by fixed-point iteration; returns the number of iterations, or NEEDS_NEWTON."""
    for i in range(len(q.current)):
        q.current[i] = 0
    perform(p.source, p.w, p.k, q.s, q.f, net.island)
    copy(q.current, q.source)
    factors, d, b, before = net.factors, a.draw_bus, a.near_bus, 0.0
    forward(factors, q.source, q.work)
    for i in range(factors.again[0], factors.all[0]):
        q.begun[i] = q.work[i]
    for iteration in range(1, LIMIT):
        for i in range(len(d)):
            q.current[d[i]] = 0
        perform(p.current, p.w, p.k, q.s, q.f, net.island)
        if iteration > 1:
            for i in range(factors.again[0], factors.all[0]):
                q.work[i] = q.begun[i]
        for i in range(len(d)):
            q.work[factors.back[d[i]]] += q.current[d[i]]
        middle(factors, q.work)
        change = 0.0
        for i in range(len(b)):
            v = q.work[factors.cols[b[i]]]
            miss = v - q.volt[b[i]]
            size = miss.real * miss.real + miss.imag * miss.imag
            if not size <= change:
                change = size
            q.volt[b[i]] = v
        # the changes fall like a geometric series; its remainder is the error
        change = np.sqrt(change)
        if change < TOLERANCE or change * change < TOLERANCE * (before - change):
            backward(factors, q.work, q.volt)
            return iteration
        before = change
    for i in range(len(b)):
        q.volt[b[i]] = q.kept[b[i]]
    return NEEDS_NEWTON


@allocating_entry
def newton_from(calls, p, a, net, q, z, slow):
    """Solve v - a - Z i(v) = 0 at the buses with voltage-dependent currents; returns whether a solution was found.

    a are the voltages without these currents, Z the impedances between the buses. Steps are halved until the residual
    falls. With `slow`, they are implicit Euler steps, whose length grows as the residual falls.
    """
    bus, factors, source, volt, current, work, new = a.draw_bus, net.factors, q.source, q.volt, q.current, q.work, z.new
    n = len(bus)
    open_, Z = np.zeros(n, np.complex128), np.zeros((n, n), np.complex128)
    solve_apart(factors, source, work, new)
    for i in range(n):
        open_[i] = new[bus[i]]
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
    for _ in range(3 * STEPS if slow else STEPS):
        scale = 1.0
        now = np.inf
        for _halving in range(HALVINGS):
            for i in range(n):
                for k in range(2):
                    tried[i, k] = v[i, k].real - scale * F[2 * i + k]
            drawn(calls, p, a, net, z, tried, i_v[0])
            now, worst = residual(tried, open_, Z, i_v[0], J[0])
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
            drawn(calls, p, a, net, z, tried, i_v[1 + k])
        slopes(Z, i_v, J)
        for i in range(2 * n if slow else 0):
            J[i, i] += 1 / pace
        F = np.linalg.solve(J, F)
    q.marks[0] = bus[worst]
    return False


@noinline
def drawn(calls, p, a, net, z, v, out):
    """Voltage-dependent currents (pairs) at bus voltages v (pairs)."""
    for i in range(len(v)):
        at = a.places[0] + 2 * a.draw_bus[i]
        z.s[at], z.s[at + 1] = v[i, 0], v[i, 1]
        z.f[at] = z.f[at + 1] = 0
    perform(calls, p.w, p.k, z.s, z.f, net.island)
    for i in range(len(v)):
        at = a.places[0] + 2 * a.draw_bus[i]
        out[i, 0], out[i, 1] = z.f[at], z.f[at + 1]


@entry
def currents(calls, p, a, net, z, v, out):
    """The same, as an entry point."""
    drawn(calls, p, a, net, z, v, out)


@entry
def solved(F, current, work, v):
    """Solve v = inv(Y) current."""
    solve_apart(F, current, work, v)


@noinline
def residual(v, a, Z, drawn, F):
    """Fill F with v - a - Z i (pairs); returns its largest magnitude and the bus."""
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
    """Jacobian 1 - Z di/dv of the residual, in pairs; `bent[1 + k]` are the currents with component k + j TINY."""
    n = len(Z)
    for i in range(n):
        for j in range(n):
            for k in range(2):
                here = 1.0 if i == j else 0.0
                g, h = bent[1 + k, j, 0].imag / TINY, bent[1 + k, j, 1].imag / TINY
                J[2 * i, 2 * j + k] = here * (1 - k) - Z[i, j].real * g + Z[i, j].imag * h
                J[2 * i + 1, 2 * j + k] = here * k - Z[i, j].imag * g - Z[i, j].real * h

"""Network voltages at the present states: fixed-point iteration with factors, Newton's method if that fails.

Newton's method first reduces the residual at every step. If that stalls at a kink, it follows v' = inv(Y) i(v) - v to
its equilibrium in long implicit steps (pseudo-transient continuation), and finally does the same from zero voltage: a
load whose voltage collapses has a solution below its threshold.
"""

import numpy as np

from stabctl._util.jit import entry, inline, noinline
from stabctl.devices.blocks import copy
from stabctl.dynamics.lapack import solve
from stabctl.dynamics.perform import perform

from ._buffers import NOTE
from ._substitution import backward, forward, middle, solve_apart

TOLERANCE = 1e-7  # pu   voltage error at which the iteration ends
LIMIT = 30  # -    in place of this fixed-point iteration Newton's method is called
STEPS = 40  # -    Newton steps
HALVINGS = 12  # -    of a Newton step
TINY = 1e-30  # complex step


@inline
def settle(program, places, net, run):
    """Solve Y v = i(v) by fixed-point iteration; returns whether it ended. If not, Newton's method is needed."""
    for i in range(len(run.current)):
        run.current[i] = 0
    perform(program.source, program.w, program.k, run.s, run.f, net.island)
    copy(run.current, run.solve.source)
    factors, d, b, before = net.factors, places.draw_bus, places.near_bus, 0.0
    forward(factors, run.solve.source, run.solve.work)
    for i in range(factors.again[0], factors.all[0]):
        run.solve.begun[i] = run.solve.work[i]
    for iteration in range(1, LIMIT):
        for i in range(len(d)):
            run.current[d[i]] = 0
        perform(program.current, program.w, program.k, run.s, run.f, net.island)
        if iteration > 1:
            for i in range(factors.again[0], factors.all[0]):
                run.solve.work[i] = run.solve.begun[i]
        for i in range(len(d)):
            run.solve.work[factors.back[d[i]]] += run.current[d[i]]
        middle(factors, run.solve.work)
        change = 0.0
        for i in range(len(b)):
            v = run.solve.work[factors.cols[b[i]]]
            miss = v - run.volt[b[i]]
            size = miss.real * miss.real + miss.imag * miss.imag
            if not size <= change:
                change = size
            run.volt[b[i]] = v
        # the changes fall like a geometric series; its remainder is the error
        change = np.sqrt(change)
        if change < TOLERANCE or change * change < TOLERANCE * (before - change):
            backward(factors, run.solve.work, run.volt)
            return True
        before = change
    for i in range(len(b)):
        run.volt[b[i]] = run.solve.before[b[i]]
    return False


@entry
def newton_from(calls, program, places, net, run, z, dense, slow):
    """Solve v - a - Z i(v) = 0 at the buses with voltage-dependent currents; returns whether a solution was found.

    a (`open_`) are the voltages without these currents, Z the impedances between the buses. Steps are halved until the
    residual falls. With `slow`, they are implicit Euler steps, whose length grows as the residual falls.
    """
    bus, factors, new = places.draw_bus, net.factors, z.new
    source, work, volt, current = run.solve.source, run.solve.work, run.volt, run.current
    n = len(bus)
    open_, Z, v, tried, i_v, F, J = dense.open, dense.Z, dense.v, dense.tried, dense.drawn, dense.F, dense.J
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
    before, worst = np.inf, 0
    for i in range(n):
        F[2 * i] = F[2 * i + 1] = 0
        v[i, 0], v[i, 1] = volt[bus[i]].real, volt[bus[i]].imag
    pace = 0.3
    for _ in range(3 * STEPS if slow else STEPS):
        scale = 1.0
        now = np.inf
        for _halving in range(HALVINGS):
            for i in range(n):
                for k in range(2):
                    tried[i, k] = v[i, k].real - scale * F[2 * i + k]
            drawn(calls, program, places, net, z, tried, i_v[0])
            now, worst = residual(tried, open_, Z, i_v[0], J[0])
            if now < before or slow:
                break
            scale *= 0.5
        run.notes[NOTE.bus] = bus[worst]
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
            drawn(calls, program, places, net, z, tried, i_v[1 + k])
        slopes(Z, i_v, J)
        for i in range(2 * n if slow else 0):
            J[i, i] += 1 / pace
        if not solve(J, F, dense.places, dense.solver):
            break
    return False


@noinline
def drawn(calls, program, places, net, z, v, out):
    """Voltage-dependent currents (pairs) at bus voltages v (pairs)."""
    for i in range(len(v)):
        at = places.voltages + 2 * places.draw_bus[i]
        z.s[at], z.s[at + 1] = v[i, 0], v[i, 1]
        z.f[at] = z.f[at + 1] = 0
    perform(calls, program.w, program.k, z.s, z.f, net.island)
    for i in range(len(v)):
        at = places.voltages + 2 * places.draw_bus[i]
        out[i, 0], out[i, 1] = z.f[at], z.f[at + 1]


@entry
def currents(calls, program, places, net, z, v, out):
    """The same, as an entry point."""
    drawn(calls, program, places, net, z, v, out)


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
    """Jacobian 1 - Z di/dv of the residual, in pairs; `bent[1 + k]` are the currents with component k + j TINY.

    Its columns are the rows of J, as LAPACK has it.
    """
    n = len(Z)
    for i in range(n):
        for j in range(n):
            for k in range(2):
                here = 1.0 if i == j else 0.0
                g, h = bent[1 + k, j, 0].imag / TINY, bent[1 + k, j, 1].imag / TINY
                J[2 * j + k, 2 * i] = here * (1 - k) - Z[i, j].real * g + Z[i, j].imag * h
                J[2 * j + k, 2 * i + 1] = here * k - Z[i, j].imag * g - Z[i, j].real * h

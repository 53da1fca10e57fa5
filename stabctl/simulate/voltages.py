"""Network voltages at the present states: substitution with the factors at hand, Newton where that does not contract."""

import numpy as np

from stabctl import system
from stabctl.compiled import kernel
from stabctl.models import load, storage
from stabctl.models.blocks import copy

from .substitution import solve

TOLERANCE = 1e-7  # pu   change of a voltage at which the iteration ends
LIMIT = 30  # -    substitutions before Newton is called
NEWTON = 40  # -    Newton steps
FAILED = 1000  # -    answer of `settle` where no solution was found
TINY = 1e-30  # complex step


@kernel
def settle(b, plant, net, q):  # noqa: ANN001, ANN201
    """Bring b.s.v to the solution of Y v = i(v); the number of substitutions, or FAILED (bus in q.bus[0])."""
    system.sources(b.s, plant, net.island, b.r.g)
    copy(q.current, q.source)
    for iteration in range(1, LIMIT):
        copy(q.source, q.current)
        system.draws(b.s, plant, b.r.g)
        solve(net.factors, q.current, q.work, q.new)
        change = 0.0
        for i in range(len(q.new)):
            d = q.new[i] - q.volt[i]
            change = max(change, d.real * d.real + d.imag * d.imag)
            q.volt[i] = q.new[i]
        if change < TOLERANCE * TOLERANCE:
            return iteration
    for i in range(len(q.volt)):
        q.volt[i] = q.kept[i]
    return newton(b, plant, net, q)


@kernel
def newton(b, plant, net, q):  # noqa: ANN001, ANN201
    """The same by Newton on the buses that draw, v_d - a_d - Z i(v_d) = 0, steps halved until the residual falls."""
    d = plant.draw_bus
    n = len(d)
    copy(q.source, q.current)
    solve(net.factors, q.current, q.work, q.new)
    a, Z = np.zeros(n, np.complex128), np.zeros((n, n), np.complex128)
    for i in range(n):
        a[i] = q.new[d[i]]
    for j in range(n):
        for i in range(len(q.current)):
            q.current[i] = 0
        q.current[d[j]] = 1
        solve(net.factors, q.current, q.work, q.new)
        for i in range(n):
            Z[i, j] = q.new[d[i]]
    F, trial = np.zeros(2 * n), np.zeros(2 * n)
    worst = residual(b, plant, q, a, Z, F)
    for _ in range(NEWTON):
        if worst < TOLERANCE:
            copy(q.source, q.current)
            system.draws(b.s, plant, b.r.g)
            solve(net.factors, q.current, q.work, q.new)
            copy(q.new, q.volt)
            return LIMIT
        J = slopes(b, plant, Z)
        eliminate(J, F)
        scale, better = 1.0, False
        for i in range(n):
            trial[2 * i], trial[2 * i + 1] = q.volt[d[i]].real, q.volt[d[i]].imag
        for _halving in range(12):
            for i in range(n):
                q.volt[d[i]] = trial[2 * i] - scale * F[2 * i] + 1j * (trial[2 * i + 1] - scale * F[2 * i + 1])
            now = residual(b, plant, q, a, Z, J[0])
            if now < worst:
                better = True
                break
            scale *= 0.5
        if not better:
            break
        worst = residual(b, plant, q, a, Z, F)
    highest = 0.0
    for i in range(n):
        size = F[2 * i] * F[2 * i] + F[2 * i + 1] * F[2 * i + 1]
        if size >= highest:
            highest, q.bus[0] = size, d[i]
    return FAILED


@kernel
def residual(b, plant, q, a, Z, F):  # noqa: ANN001, ANN201, N803
    """Fill F with v_d - a - Z i(v_d) (pairs) and give its largest magnitude."""
    d = plant.draw_bus
    for i in range(len(d)):
        b.r.g[d[i], 0] = b.r.g[d[i], 1] = 0
    system.draws(b.s, plant, b.r.g)
    worst = 0.0
    for i in range(len(d)):
        miss = q.volt[d[i]] - a[i]
        for j in range(len(d)):
            miss -= Z[i, j] * q.current[d[j]]
        F[2 * i], F[2 * i + 1] = miss.real, miss.imag
        worst = max(worst, abs(miss))
    return worst


@kernel
def slopes(b, plant, Z):  # noqa: ANN001, ANN201, N803
    """Jacobian of the residual: 1 - Z di/dv in pairs, di/dv by complex step of loads and storage."""
    n = len(plant.draw_bus)
    D, J = np.zeros((n, 2, 2)), np.zeros((2 * n, 2 * n))
    step = 1j * TINY
    for k in range(2):
        for j in range(len(plant.load)):
            v, i = b.s.v[plant.load_bus[j]], plant.load_slot[j]
            re, im = load.output((v[0] + step * (1 - k), v[1] + step * k), plant.load[j])
            D[i, 0, k] += re.imag / TINY
            D[i, 1, k] += im.imag / TINY
        for j in range(len(plant.storage)):
            v, i = b.s.v[plant.storage_bus[j]], plant.storage_slot[j]
            bent = (v[0] + step * (1 - k), v[1] + step * k)
            y = storage.output(b.s.storage[j], b.s.order[j], bent, plant.storage[j])
            D[i, 0, k] += y.re.imag / TINY
            D[i, 1, k] += y.im.imag / TINY
    for i in range(n):
        J[2 * i, 2 * i] = J[2 * i + 1, 2 * i + 1] = 1.0
        for j in range(n):
            r, x = Z[i, j].real, Z[i, j].imag
            for k in range(2):
                J[2 * i, 2 * j + k] -= r * D[j, 0, k] - x * D[j, 1, k]
                J[2 * i + 1, 2 * j + k] -= x * D[j, 0, k] + r * D[j, 1, k]
    return J


@kernel
def eliminate(A, x):  # noqa: ANN001, ANN201, N803
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

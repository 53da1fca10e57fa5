"""Newton's method for the bus voltages where the fixed-point iteration fails: for few buses dense, for many sparse.

Both make the same steps. With Z, the impedances between the buses with voltage-dependent currents, and D, the slopes of
these currents, the step x of their voltages, whose residual is F, is that of the whole network:

    (1 + s - Z D) x = F    <=>    ((1 + s) Y - D) x = Y F,    F = 0 at the other buses
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from . import voltages
from .substitution import OPTIONS, matrix
from .voltages import HALVINGS, STEPS, TINY, TOLERANCE, currents, solved

MANY = 200  # buses with voltage-dependent currents, from which on the sparse method is faster


def newton(calls: Any, p: Any, a: Any, net: Any, q: Any, z: Any) -> bool:
    """Solve for the voltages by Newton's method; returns whether a solution was found.

    Starts from the present voltages, then tries long implicit steps, and finally these from zero voltage.

    Parameters
    ----------
    calls
        Calls of the devices with voltage-dependent currents, for complex numbers.
    p
        The program for complex numbers.
    a, net, q
        Frame, network and buffers of the run. On success `q.volt` is the solution; otherwise it is unchanged, and the
        bus with the largest residual is in `q.marks[0]`.
    z
        Work space (`newton_space`).
    """
    before, method = q.volt.copy(), sparse if len(a.draw_bus) > MANY else voltages.newton_from
    for attempt in range(3):
        if method(calls, p, a, net, q, z, attempt > 0):
            return True
        if attempt == 1:
            q.volt[:] = 0
    q.volt[:] = before
    return False


def sparse(calls: Any, p: Any, a: Any, net: Any, q: Any, z: Any, slow: bool) -> bool:
    """The same as `voltages.newton_from`, by factors of the whole network."""
    bus, n, Y = a.draw_bus, len(a.draw_bus), matrix(net.factors)
    R = (sp.kron(Y.real, sp.identity(2)) + sp.kron(Y.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))).tocsc()
    solved(net.factors, q.source, q.work, z.new)
    open_ = z.new[bus]
    v, out = q.volt[bus].view(float).reshape(n, 2).astype(complex), np.zeros((n, 2), complex)
    step, before, pace = np.zeros((n, 2)), np.inf, 0.3
    pairs = (2 * bus[:, None] + np.arange(2)).ravel()
    rows, columns = np.repeat(pairs, 2), np.repeat(pairs.reshape(n, 2), 2, axis=0).ravel()
    now, miss = np.inf, np.zeros(n)
    for _ in range(3 * STEPS if slow else STEPS):
        for halving in range(HALVINGS):
            tried = (v.real - 0.5**halving * step).astype(complex)
            currents(calls, p, a, net, z, tried, out)
            q.current[:] = 0
            q.current[bus] = out[:, 0].real + 1j * out[:, 1].real
            solved(net.factors, q.current, q.work, z.new)
            F = tried[:, 0].real + 1j * tried[:, 1].real - open_ - z.new[bus]
            miss = np.abs(F)
            now = miss.max()
            if now < before or slow:
                break
        if not now < (np.inf if slow else before):
            break
        if before < np.inf:
            pace = min(max(pace * before / now, 0.05), 1e6)
        before, v = now, tried
        if now < TOLERANCE:
            q.current[:] += q.source
            solved(net.factors, q.current, q.work, q.volt)
            return True
        bent = []
        for k in range(2):
            tried = v.copy()
            tried[:, k] += 1j * TINY
            currents(calls, p, a, net, z, tried, out)
            bent.append(out.imag / TINY)
        D = sp.csc_matrix((np.stack(bent, axis=2).ravel(), (rows, columns)), shape=R.shape)
        residual = np.zeros(len(q.volt), complex)
        residual[bus] = F
        try:
            factors = spl.splu((1 + 1 / pace if slow else 1.0) * R - D, **OPTIONS)
        except RuntimeError:
            break
        step = factors.solve(R @ residual.view(float)).reshape(-1, 2)[bus]
    q.marks[0] = bus[int(np.argmax(miss))]
    return False

"""The compiled loop over recorded Runge-Kutta steps, which makes their stages once more."""

from stabctl._util.jit import entry
from stabctl.devices.blocks import copy

from .orders import run
from .stepper import confine, freeze, hold
from .voltages import FAILED, settle


@entry
def replay(p, a, net, q, sizes, rows, resume, signals, held, clipped):
    """Make the stages of steps of the given sizes (s) that begin at recorded rows.

    Returns the number of steps made; if they are not all, it asks for the voltages at the stage reached (`q.marks`).
    """
    nx = len(q.x0)
    whole = True
    for i in range(len(net.island)):
        whole &= net.island[i] >= 0
    step, first = 0, 0
    if resume:
        step, first = q.marks[2], q.marks[3]
    while step < len(sizes):
        h = sizes[step]
        for at in range(first, 4):
            if not resume:
                if at == 0:
                    for k in range(rows.shape[1]):
                        q.s[k] = rows[step, k]
                    copy(q.s, q.x0)
                copy(q.volt, q.kept)
                if settle(p, a, net, q) >= FAILED:
                    q.marks[2], q.marks[3] = step, at
                    return step
            resume = False
            run(p.sweep, p, q.s, q.f, net.island)
            copy(q.s, signals[step, at])
            for k in range(len(a.limited)):
                held[step, at, k] = q.f[a.limited[k]]
            hold(q, a)
            for k in range(len(a.limited)):
                held[step, at, k] = 1.0 if held[step, at, k] != 0 and q.f[a.limited[k]] == 0 else 0.0
            if not whole:
                freeze(a, net, q)
            weight = h / 6 if at == 0 or at == 3 else h / 3
            reach = h if at == 2 else h / 2
            for k in range(nx):
                total = weight * q.f[k] + (q.sum[k] if at else q.x0[k])
                q.sum[k] = total
                q.s[k] = total if at == 3 else q.x0[k] + reach * q.f[k]
            for k in range(len(a.limited)):
                clipped[step, at, k] = q.s[a.limited[k]]
            confine(q.s, a)
            for k in range(len(a.limited)):
                free, kept = clipped[step, at, k], q.s[a.limited[k]]
                clipped[step, at, k] = 1.0 if free > kept else -1.0 if free < kept else 0.0
        first = 0
        step += 1
    return step

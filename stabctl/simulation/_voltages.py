"""Network voltages at the present states: fixed-point iteration with factors of Y, or else Newton's method."""

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import call_bound, perform

from ._buffers import NOTE
from ._substitution import backward, forward, middle

TOLERANCE = 1e-7  # pu   voltage error at which the iteration ends
LIMIT = 30  # -    iterations
FEW = 6  # -    more than these are slow
ROW = 10  # -    solutions in a row that were slow; then Newton's method takes over
FOUND, LOST, UNPREPARED = range(3)


@inline
def settle(program, places, net, run):
    """Solve Y v = i(v); returns FOUND, LOST, or UNPREPARED if Newton's method has to be prepared.

    Once the fixed-point iteration is slow or fails, Newton's method is used until the end of the run.
    """
    for i in range(len(run.current)):
        run.current[i] = 0
    perform(program.source, program.w, program.k, run.s, run.f, net.island)
    copy(run.current, run.solve.source)
    factors = net.factors
    forward(factors, run.solve.source, run.solve.work)
    for i in range(factors.again[0], factors.all[0]):
        run.solve.begun[i] = run.solve.work[i]
    if run.newton[0] != 0:
        call_bound(run.newton)
        return FOUND if run.notes[NOTE.found] else LOST
    if run.notes[NOTE.hard]:
        return UNPREPARED
    count = iterate(program, places, net, run)
    run.notes[NOTE.slow] = run.notes[NOTE.slow] + 1 if count > FEW else 0
    if run.notes[NOTE.slow] == ROW or count == LIMIT:
        run.notes[NOTE.hard] = 1
    if count < LIMIT:
        return FOUND
    for b in places.near_bus:
        run.volt[b] = run.solve.before[b]
    return UNPREPARED


@inline
def iterate(program, places, net, run):
    """Fixed-point iteration v = inv(Y) i(v); returns the number of iterations, `LIMIT` if it does not end."""
    factors, d, b, before = net.factors, places.draw_bus, places.near_bus, 0.0
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
            return iteration
        before = change
    return LIMIT

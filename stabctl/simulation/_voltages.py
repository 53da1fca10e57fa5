"""Network voltages at the present states: fixed-point iteration with factors of Y, or else Newton's method."""

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import call_bound, perform

from ._buffers import NOTE
from ._substitution import backward, forward, middle

TOLERANCE = 1e-7  # pu   voltage error at which the iteration ends
CLOSE = 1e-9  # pu   the same where Newton's method is prepared
LIMIT = 30  # -    iterations
FEW = 10  # -    iterations where Newton's method is prepared, which costs about as much
SLOW = 15  # -    iterations, of so many solutions
ROW = 10  # -    in a row, after which Newton's method is prepared
WAIT = 8  # -    solutions by Newton's method before the iteration is tried again; twice as many each time, up to
LONGEST = 256
FOUND, LOST, UNPREPARED = range(3)


@inline
def settle(program, places, net, run):
    """Solve Y v = i(v); returns FOUND, LOST, or UNPREPARED if Newton's method has to be prepared.

    Where the fixed-point iteration fails, or is slow again and again, Newton's method is used, and from time to time
    the iteration is tried again.
    """
    for i in range(len(run.current)):
        run.current[i] = 0
    perform(program.source, program.w, program.k, run.s, run.f, net.island)
    copy(run.current, run.solve.source)
    factors = net.factors
    forward(factors, run.solve.source, run.solve.work)
    for i in range(factors.again[0], factors.all[0]):
        run.solve.begun[i] = run.solve.work[i]
    prepared = run.newton[0] != 0
    if prepared and run.notes[NOTE.wait] > 0:
        run.notes[NOTE.wait] -= 1
    elif not prepared and run.notes[NOTE.slow] == ROW:
        return UNPREPARED
    else:
        count = iterate(FEW if prepared else LIMIT, CLOSE if prepared else TOLERANCE, program, places, net, run)
        run.notes[NOTE.slow] = run.notes[NOTE.slow] + 1 if count > SLOW else 0
        if count < (FEW if prepared else LIMIT):
            run.notes[NOTE.next] = 0
            return FOUND
        restart(places, net, run)
        run.notes[NOTE.wait] = max(run.notes[NOTE.next], WAIT)
        run.notes[NOTE.next] = min(2 * run.notes[NOTE.wait], LONGEST)
        if not prepared:
            return UNPREPARED
    call_bound(run.newton)
    return FOUND if run.notes[NOTE.found] else LOST


@inline
def restart(places, net, run):
    """Set the iterated voltages to those of the stage before, and what is substituted for them to the sources."""
    for b in places.near_bus:
        run.volt[b] = run.solve.before[b]
    for i in range(net.factors.again[0], net.factors.all[0]):
        run.solve.work[i] = run.solve.begun[i]


@inline
def iterate(limit, tolerance, program, places, net, run):
    """Fixed-point iteration v = inv(Y) i(v); returns the number of iterations, `limit` if it does not end before."""
    factors, d, b, before = net.factors, places.draw_bus, places.near_bus, 0.0
    for iteration in range(1, limit):
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
        if change < tolerance or change * change < tolerance * (before - change):
            backward(factors, run.solve.work, run.volt)
            return iteration
        before = change
    return limit

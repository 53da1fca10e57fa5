"""Network voltages at the present states: fixed-point iteration with factors of Y, or else Newton's method."""

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import call_bound, perform

from ._buffers import NOTE
from ._substitution import backward, forward, middle

TOLERANCE = 1e-7  # pu   voltage error at which the iteration ends
QUIET = 2e-8  # pu   the same where Newton's method is prepared, and the iteration converges quickly again
CLOSE = 1e-9  # pu   the same where it does not
LIMIT = 30  # -    iterations
FEW = 10  # -    iterations that cost about as much as Newton's method
SLOW = 15  # -    iterations, of so many solutions
ROW = 10  # -    in a row, after which Newton's method is prepared, or no longer preferred
WAIT = 8  # -    solutions by Newton's method before the iteration is tried again; twice as many each time, up to
MOST = 256
FOUND, LOST, UNPREPARED = range(3)
NEAR, AWAY, FAILED = range(3)  # of `NOTE.begun`


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
        tolerance = CLOSE if run.notes[NOTE.next] > 0 else QUIET if prepared else TOLERANCE
        count = iterate(tolerance, program, places, net, run)
        run.notes[NOTE.slow] = run.notes[NOTE.slow] + 1 if count > SLOW else 0
        if count == LIMIT or (prepared and count > FEW):
            run.notes[NOTE.wait] = max(run.notes[NOTE.next], WAIT)
            run.notes[NOTE.next], run.notes[NOTE.quick] = min(2 * run.notes[NOTE.wait], MOST), 0
        else:
            run.notes[NOTE.quick] += 1
            if run.notes[NOTE.quick] == ROW:
                run.notes[NOTE.next] = 0
        if count < LIMIT:
            run.notes[NOTE.begun] = NEAR
            return FOUND
        for b in places.near_bus:
            run.volt[b] = run.solve.before[b]
        run.notes[NOTE.begun] = FAILED
        if not prepared:
            return UNPREPARED
    call_bound(run.newton)
    run.notes[NOTE.begun] = NEAR
    return FOUND if run.notes[NOTE.found] else LOST


@inline
def iterate(tolerance, program, places, net, run):
    """Fixed-point iteration v = inv(Y) i(v); returns the number of iterations, `LIMIT` if it does not end before."""
    factors, work, before = net.factors, run.solve.work, 0.0
    for iteration in range(1, LIMIT):
        draw(program, places, net, run)
        middle(factors, work)
        change = 0.0
        for b in places.near_bus:
            v = work[factors.cols[b]]
            size = square(v - run.volt[b])
            if not size <= change:
                change = size
            run.volt[b] = v
        # the changes fall like a geometric series; its remainder is the error
        change = np.sqrt(change)
        if change < tolerance or change * change < tolerance * (before - change):
            backward(factors, work, run.volt)
            return iteration
        before = change
    return LIMIT


@inline
def draw(program, places, net, run):
    """Voltage-dependent currents at the present voltages, added to the sources in the iterated rows."""
    F, work = net.factors, run.solve.work
    run.notes[NOTE.draws] += 1
    for d in places.draw_bus:
        run.current[d] = 0
    perform(program.current, program.w, program.k, run.s, run.f, net.island)
    for i in range(F.again[0], F.all[0]):
        work[i] = run.solve.begun[i]
    for d in places.draw_bus:
        work[F.back[d]] += run.current[d]


@inline
def square(z):
    """The square of a magnitude."""
    return z.real * z.real + z.imag * z.imag

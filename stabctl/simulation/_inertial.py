"""Orders that follow the accelerations they cause: both are solved for at once, at every stage of a step.

    u = w(a),    a = a(u)          w the law with its limits, a the accelerations seen, through the network and machines

In the one-machine theory the loop is linear, u = Ka a and a = (P - u) / 2H, and closed by u = Ka P / (2H + Ka). Here it
is solved by Newton's method,

    (1 - S R) du = w(a(u)) - u,    S = dw/da of each device, 0 at a limit,    R = da/du

with the response R of the accelerations found once for each network, by changing one order after the other.
"""

from stabctl._util.jit import inline, noinline
from stabctl.dynamics.perform import perform

from ._switching import decide, see
from ._voltages import settle
from .method import freeze_disconnected, hold_at_limits

MOST = 12  # steps of Newton's method
NEAR = 1e-8  # of the rating: orders that agree
CHANGE = 1e-3  # of an order, for the response
SLIGHT = 1e-6  # pu/s   change of an acceleration, for the slope of a law


@inline
def rates(program, places, net, run):
    """Outputs and rates of all devices; states held at a limit and units that are off have rate 0."""
    perform(program.sweep, program.w, program.k, run.s, run.f, net.island)
    hold_at_limits(run, places)
    if not net.whole:
        freeze_disconnected(places, net, run)


@noinline
def close(program, places, net, run):
    """Solve for orders and accelerations; returns whether they agree. Voltages and orders belong to each other."""
    n, tried, held = len(places.order), run.loop.order, places.held
    for iteration in range(MOST):
        for j in range(n):
            tried[0, j] = run.s[held[j]]
        rates(program, places, net, run)
        decide(program, places, net, run, 0)
        miss = 0.0
        for j in range(n):
            run.loop.matrix[j, n] = run.s[held[j]] - tried[0, j]
            miss = max(miss, abs(run.loop.matrix[j, n]))
        if miss < NEAR:
            restore(places, run)
            return True
        slopes(program, places, net, run)
        if run.loop.known[0] == 0:
            restore(places, run)
            respond(program, places, net, run)
            run.loop.known[0] = 1
        for i in range(n):
            for j in range(n):
                run.loop.matrix[i, j] = (1.0 if i == j else 0.0) - run.loop.matrix[i, j] * run.loop.response[i, j]
        eliminate(run.loop.matrix)
        for j in range(n):
            run.s[held[j]] = min(max(tried[0, j] + run.loop.matrix[j, n], -1.0), 1.0)
        if not settled(program, places, net, run):
            break
    restore(places, run)
    settled(program, places, net, run)
    return False


@noinline
def settled(program, places, net, run):
    """Solve for the voltages; returns whether they were found."""
    return settle(program, places, net, run)


@inline
def restore(places, run):
    """Set the orders to those tried."""
    for j in range(len(places.order)):
        run.s[places.held[j]] = run.loop.order[0, j]


@inline
def slopes(program, places, net, run):
    """Slopes of the orders by the accelerations, in all columns of the matrix of equations."""
    n, seen = len(places.order), places.seen.acceleration
    for j in range(n):
        run.loop.matrix[j, 0] = run.s[places.held[j]]
    for i in range(len(places.rotor)):
        run.s[seen + i] += SLIGHT
    perform(program.step, program.w, program.k, run.s, run.f, net.island)
    for j in range(n):
        slope = (run.s[places.held[j]] - run.loop.matrix[j, 0]) / SLIGHT
        for i in range(n):
            run.loop.matrix[j, i] = slope


@inline
def respond(program, places, net, run):
    """The accelerations that each device sees per order of each, at the voltages settled."""
    n, tried, seen = len(places.order), run.loop.order, places.seen.acceleration
    for j in range(n):
        tried[1, j] = run.s[seen + places.own[j]] - SLIGHT
    for i in range(n):
        change = -CHANGE if tried[0, i] > 0 else CHANGE
        run.s[places.held[i]] = tried[0, i] + change
        found = settled(program, places, net, run)
        rates(program, places, net, run)
        see(places, net, run, 0)
        for j in range(n):
            moved = run.s[seen + places.own[j]] - tried[1, j]
            run.loop.response[j, i] = moved / change if found else 0.0
        run.s[places.held[i]] = tried[0, i]


@noinline
def eliminate(M):
    """Solve the equations with the matrix M[:, :-1] and the right-hand side M[:, -1], which becomes the solution."""
    n = len(M)
    for c in range(n):
        best = c
        for i in range(c + 1, n):
            best = i if abs(M[i, c]) > abs(M[best, c]) else best
        for j in range(n + 1):
            M[c, j], M[best, j] = M[best, j], M[c, j]
        if M[c, c] == 0:
            continue
        for i in range(n):
            if i != c:
                part = M[i, c] / M[c, c]
                for j in range(c, n + 1):
                    M[i, j] -= part * M[c, j]
    for i in range(n):
        M[i, n] = M[i, n] / M[i, i] if M[i, i] != 0 else 0.0

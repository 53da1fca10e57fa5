"""What gates, laws and sampled controllers decide, and the instants within a step at which the power of storage jumps.

Laws read speeds, accelerations and angles against the center of inertia of the other machines in the island. Power
jumps when an order switches between fixed values, and when a device is full or empty. The instant of a switching is
found by bisection, with states and voltages interpolated over the step.

Orders may follow the accelerations they cause, u = w(a) of a law w with its limits, and a = a(u) through network and
machines. In the one-machine theory this loop is linear, u = Ka a and a = (P - u) / 2H, and closed by u = Ka P / (2H +
Ka). Here it is solved at every stage of a step by Newton's method,

    (1 - S R) du = w(a(u)) - u,    S = dw/da of each device, 0 at a limit,    R = da/du

with the response R of the accelerations found once for each network, by changing one order after the other.
"""

from stabctl._util.jit import inline, noinline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import perform, perform_due

from ._voltages import FOUND, settle
from .method import freeze_disconnected, hold_at_limits

FINE = 1e-6  # of a step; a jump nearer to one of its ends does not divide it
TRIALS = 12  # steps of Newton's method
AGREED = 1e-6  # of the rating: change of the orders with which they agree
CHANGE = 1e-3  # of an order, for the response
SLIGHT = 1e-6  # pu/s   change of an acceleration, for the slope of a law
JUMP = 0.02  # of the rating; change of an order through or to zero
NEAR = 0.02  # of a step; nearer to its ends the interpolated voltages are exact enough


@noinline
def decide(program, places, net, run, due):
    """Let gates, laws, and the controllers whose frame is due act; returns whether outputs may have changed.

    `due` has a bit for every frame rate. The signals that laws see are those of `Relative`.
    """
    if due or places.gated:
        perform(program.sense, program.w, program.k, run.s, run.f, net.island)
    changed = due != 0
    if len(places.held):
        changed |= act(program, places, net, run, due)
    if due:
        perform_due(program.frame, program.bits, due, program.w, program.k, run.s, run.f, net.island)
    return changed


@noinline
def act(program, places, net, run, due):
    """Let gates and laws act, with their signals; returns whether a gate or an order has changed."""
    see(places, net, run, due)
    store_orders(0, places, run)
    perform(program.step, program.w, program.k, run.s, run.f, net.island)
    changed = False
    for j in places.acting:
        changed |= run.orders[0, j] != run.s[places.held[j]]
    return changed


@noinline
def see(places, net, run, due):
    """Set the signals that laws see."""
    coi(places.inertia, places, net, run)
    accelerate(places, net, run)
    s, sums, island, seen = run.s, run.watch.coi, net.island, places.seen
    for i in range(len(island)):
        s[seen.online + i] = 1.0 if island[i] >= 0 else 0.0
    s[seen.time + 1] = due  # the place `Relative.due`; compiled code does not know properties
    for i in range(len(places.rotor)):
        k = island[places.unit[i]]
        s[seen.speed + i] = s[seen.acceleration + i] = s[seen.angle + i] = 0.0
        own, speed, rate, angle = group(i, k, places, run, s, island)
        if k >= 0 and sums[0, k] > own:
            rest = sums[0, k] - own
            s[seen.speed + i] = speed - (sums[1, k] - own * speed) / rest
            s[seen.acceleration + i] = rate - (sums[3, k] - own * rate) / rest
            s[seen.angle + i] = angle - (sums[2, k] - own * angle) / rest


@noinline
def coi(weight, places, net, run):
    """Sum the weights of the rotors, and weight times speed and angle change, per island (`Watch.coi`).

    Those of an island without rotors are of its grid-forming storage.
    """
    s, sums, island = run.s, run.watch.coi, net.island
    for k in range(net.islands):
        for j in range(3):
            sums[j, k] = 0.0
    for i in range(len(places.rotor)):
        k, h = island[places.unit[i]], weight[i]
        if k >= 0:
            sums[0, k] += h
            sums[1, k] += h * s[places.speed[i]]
            sums[2, k] += h * (s[places.rotor[i]] - run.watch.angles[0, i])
    for i in range(len(places.other)):
        k, h = net.island_at[places.other_bus[i]], places.other_weight[i]
        if h > 0:
            sums[0, k] += h
            sums[1, k] += h * s[places.other_speed[i]]
            sums[2, k] += h * (s[places.other[i]] - run.watch.others[i])


@noinline
def accelerate(places, net, run):
    """Sum inertia times acceleration, per island."""
    for k in range(net.islands):
        run.watch.coi[3, k] = 0.0
    for i in range(len(places.rotor)):
        k = net.island[places.unit[i]]
        if k >= 0:
            run.watch.coi[3, k] += places.inertia[i] * acceleration(i, places, run)


@inline
def acceleration(i, places, run):
    """Acceleration of a rotor: the rate of a state as last evaluated, or that of an output in the last step."""
    return run.f[places.speed[i]] if places.speed[i] < len(run.part.x) else run.watch.turned[1, i]


@inline
def group(i, island_of, places, run, s, island):
    """Inertia, and mean speed, acceleration and change of angle, of a group in one island."""
    if places.first[i + 1] == places.first[i] + 1:
        angle = s[places.rotor[i]] - run.watch.angles[0, i]
        return places.inertia[i], s[places.speed[i]], acceleration(i, places, run), angle
    H, speed, rate, angle = 0.0, 0.0, 0.0, 0.0
    for c in range(places.first[i], places.first[i + 1]):
        j = places.member[c]
        if island[places.unit[j]] == island_of:
            h = places.inertia[j]
            H += h
            share = h / H
            speed += share * (s[places.speed[j]] - speed)
            rate += share * (acceleration(j, places, run) - rate)
            angle += share * (s[places.rotor[j]] - run.watch.angles[0, j] - angle)
    return H, speed, rate, angle


@noinline
def first_jump(h, program, places, net, run):
    """Fraction of the last h seconds at which a power jumps, 1 if none, and the row of `limited` if a device stops.

    The orders from then on are in orders[1].
    """
    t, row = first_stop(h, places, run)
    first = first_switch(h, program, places, net, run) if places.relay else 1.0
    if first <= t:
        t, row = first, -1
    else:
        store_orders(1, places, run)
    return t if FINE < t < 1 - FINE else 1.0, row


@noinline
def jumped(places, run):
    """Whether the order that a continuous law wants of a device has jumped in the last part of a step."""
    n = len(places.order)
    for j in range(n):
        before, now = run.s[places.begun + n + j], run.s[places.wanted[j]]
        if before * now <= 0 and abs(now - before) > JUMP:
            return True
    return False


@noinline
def first_stop(h, places, run):
    """Fraction of the last h seconds just before a device reached a limit that stops it, 1 if none; and its row."""
    first, row = 1.0, -1
    for k in range(len(places.stops)):
        j = places.stops[k]
        i, per = places.limited[j], run.s[places.scale[j]]
        if run.s[i] == run.part.x[i] or not (run.s[i] == places.low[j] * per or run.s[i] == places.high[j] * per):
            continue
        t = (run.s[i] - run.part.x[i]) / (h * run.part.rate[i]) - FINE
        if 0 <= t < first:
            first, row = t, j
    return first, row


@noinline
def first_switch(h, program, places, net, run):
    """Fraction of the last h seconds at which an order first switched, 1 if none; stores the orders from then on.

    The voltages are solved for at the instant found, which is then confirmed, or found again if they move it.
    """
    if not decide(program, places, net, run, 0):
        return 1.0
    copy(run.s, run.part.end)
    copy(run.volt, run.part.volts[2])
    store_orders(1, places, run)
    low, high = bisect(0.5, h, program, places, net, run)
    set_orders(0, places, run)
    if NEAR < high < 1 - NEAR:
        interpolate(high, 0.5, h, run)
        if settle(program, places, net, run) == FOUND:
            copy(run.volt, run.part.volts[1])
            m = high
            if switched(low, m, h, program, places, net, run) or not switched(high, m, h, program, places, net, run):
                low, high = bisect(m, h, program, places, net, run)
            set_orders(0, places, run)
    for k in range(len(run.part.x)):
        run.s[k] = run.part.end[k]
    copy(run.part.volts[2], run.volt)
    return high


@noinline
def bisect(m, h, program, places, net, run):
    """Fractions of the last h seconds between which an order first switched; stores the orders from then on."""
    low, high = 0.0, 1.0
    while high - low > FINE:
        t = (low + high) / 2
        if switched(t, m, h, program, places, net, run):
            high = t
        else:
            low = t
    return low, high


@noinline
def switched(t, m, h, program, places, net, run):
    """Whether an order has switched at the fraction t of the last h seconds; if so, stores the orders then."""
    set_orders(0, places, run)
    interpolate(t, m, h, run)
    if not decide(program, places, net, run, 0):
        return False
    store_orders(1, places, run)
    return True


@inline
def store_orders(row, places, run):
    """Store the orders in a row."""
    for j in range(len(places.held)):
        run.orders[row, j] = run.s[places.held[j]]


@inline
def set_orders(row, places, run):
    """Set the orders to those of a row."""
    for j in range(len(places.held)):
        run.s[places.held[j]] = run.orders[row, j]


@noinline
def interpolate(t, m, h, run):
    """Set states and voltages to those at the fraction t of the last h seconds.

    A cubic of the states and rates at both ends, a parabola of the voltages at the ends and at the fraction m.
    """
    for k in range(len(run.part.x)):
        change = run.part.end[k] - run.part.x[k]
        bend = (1 - t) * (h * run.part.rate[k] - change) - t * (h * run.f[k] - change)
        run.s[k] = run.part.x[k] + t * (change + (1 - t) * bend)
    volts = run.part.volts
    first, middle, last = (1 - t) * (m - t) / m, t * (1 - t) / (m * (1 - m)), t * (t - m) / (1 - m)
    for i in range(len(run.volt)):
        run.volt[i] = first * volts[0, i] + middle * volts[1, i] + last * volts[2, i]


@noinline
def jump(row, h, places, run):
    """Switch the orders at the instant found; devices that fill or empty there are exactly at their limits."""
    if not places.follows:
        set_orders(1, places, run)
    for k in range(len(places.stops)):
        j = places.stops[k]
        i, per = places.limited[j], run.s[places.scale[j]]
        low, high = places.low[j] * per, places.high[j] * per
        edge = high if abs(run.s[i] - high) < abs(run.s[i] - low) else low
        if j == row or abs(run.s[i] - edge) < 10 * FINE * h * abs(run.part.rate[i]):
            run.s[i] = edge


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
    for _iteration in range(TRIALS):
        for j in range(n):
            tried[0, j] = run.s[held[j]]
        rates(program, places, net, run)
        decide(program, places, net, run, 0)
        for j in range(n):
            run.loop.matrix[j, n] = run.s[held[j]] - tried[0, j]
        slopes(program, places, net, run)
        if run.loop.known[0] == 0:
            restore(places, run)
            respond(program, places, net, run)
            run.loop.known[0] = 1
        for i in range(n):
            for j in range(n):
                run.loop.matrix[i, j] = (1.0 if i == j else 0.0) - run.loop.matrix[i, j] * run.loop.response[i, j]
        eliminate(run.loop.matrix)
        change = 0.0
        for j in range(n):
            run.s[held[j]] = min(max(tried[0, j] + run.loop.matrix[j, n], -1.0), 1.0)
            change = max(change, abs(run.s[held[j]] - tried[0, j]))
        if not settled(program, places, net, run):
            break
        if change < AGREED:
            return True
    restore(places, run)
    settled(program, places, net, run)
    return False


@noinline
def settled(program, places, net, run):
    """Solve for the voltages; returns whether they were found."""
    return settle(program, places, net, run) == FOUND


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

"""The orders of sampled devices, and the signals that they read: speeds and accelerations against the others' COI."""

from stabctl._util.jit import inline, noinline
from stabctl.dynamics.perform import perform, perform_due


@inline
def run(calls, p, s, f, on):
    """Call the device families."""
    perform(calls, p.w, p.k, s, f, on)


@inline
def acceleration(i, a, q):
    """Acceleration of a rotor: the rate of a state as last evaluated, or that of an output in the last step."""
    return q.f[a.speed[i]] if a.speed[i] < len(q.x0) else q.turned[1, i]


@noinline
def coi(weight, a, net, q):
    """Sum the weights of the rotors, and weight times speed and angle change, per island."""
    s, sums, island = q.s, q.coi, net.island
    for i in range(len(island)):
        for j in range(3):
            sums[j, max(island[i], 0)] = 0.0
    for i in range(len(a.rotor)):
        k, h = island[a.unit[i]], weight[i]
        if k >= 0:
            sums[0, k] += h
            sums[1, k] += h * s[a.speed[i]]
            sums[2, k] += h * (s[a.rotor[i]] - q.angles[0, i])


@noinline
def accelerate(a, net, q):
    """Sum inertia times acceleration, per island."""
    for i in range(len(net.island)):
        q.coi[3, max(net.island[i], 0)] = 0.0
    for i in range(len(a.rotor)):
        k = net.island[a.unit[i]]
        if k >= 0:
            q.coi[3, k] += a.inertia[i] * acceleration(i, a, q)


@noinline
def due_frames(calls, bits, due, p, s, f, on):
    """Call the sampled controllers whose frame it is."""
    perform_due(calls, bits, due, p.w, p.k, s, f, on)


@inline
def group(i, island_of, a, q, s, island):
    """Inertia, and mean speed, acceleration and change of angle, of a group in one island."""
    if a.first[i + 1] == a.first[i] + 1:
        return a.inertia[i], s[a.speed[i]], acceleration(i, a, q), s[a.rotor[i]] - q.angles[0, i]
    H, speed, rate, angle = 0.0, 0.0, 0.0, 0.0
    for c in range(a.first[i], a.first[i + 1]):
        j = a.member[c]
        if island[a.unit[j]] == island_of:
            h = a.inertia[j]
            H += h
            share = h / H
            speed += share * (s[a.speed[j]] - speed)
            rate += share * (acceleration(j, a, q) - rate)
            angle += share * (s[a.rotor[j]] - q.angles[0, j] - angle)
    return H, speed, rate, angle


@noinline
def step(p, a, net, q, due):
    """Let gates and laws act, with their signals; returns whether a gate or an order has changed."""
    coi(a.inertia, a, net, q)
    accelerate(a, net, q)
    s, sums, island, first, m = q.s, q.coi, net.island, a.places[2], len(a.rotor)
    for i in range(len(island)):
        s[first + 3 * m + i] = 1.0 if island[i] >= 0 else 0.0
    s[first + 3 * m + len(island) + 1] = due
    for i in range(m):
        k = island[a.unit[i]]
        s[first + i] = s[first + m + i] = s[first + 2 * m + i] = 0.0
        own, speed, rate, angle = group(i, k, a, q, s, island)
        if k >= 0 and sums[0, k] > own:
            rest = sums[0, k] - own
            s[first + i] = speed - (sums[1, k] - own * speed) / rest
            s[first + m + i] = rate - (sums[3, k] - own * rate) / rest
            s[first + 2 * m + i] = angle - (sums[2, k] - own * angle) / rest
    for j in range(len(a.held)):
        q.orders[0, j] = q.s[a.held[j]]
    run(p.step, p, q.s, q.f, net.island)
    changed = False
    for j in range(len(a.held)):
        changed |= q.orders[0, j] != q.s[a.held[j]]
    return changed


@noinline
def decide(p, a, net, q, due):
    """Let the devices that act at every step, and controllers whose frame is due, act; returns whether one has changed.

    `due` has a bit for every frame rate. The signals are those of `Relative`.
    """
    if due or a.gated:
        run(p.sense, p, q.s, q.f, net.island)
    changed = due != 0
    if len(a.held):
        changed |= step(p, a, net, q, due)
    if due:
        due_frames(p.frame, p.bits, due, p, q.s, q.f, net.island)
    return changed

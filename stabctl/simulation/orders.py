"""The orders of sampled devices, and the signals that they read: speeds and accelerations against the others' COI."""

from stabctl._util.jit import inline, noinline
from stabctl.dynamics.perform import perform, perform_due


@inline
def acceleration(i, places, run):
    """Acceleration of a rotor: the rate of a state as last evaluated, or that of an output in the last step."""
    return run.f[places.speed[i]] if places.speed[i] < len(run.part.x) else run.watch.turned[1, i]


@noinline
def coi(weight, places, net, run):
    """Sum the weights of the rotors, and weight times speed and angle change, per island (`Watch.coi`)."""
    s, sums, island = run.s, run.watch.coi, net.island
    for i in range(len(island)):
        for j in range(3):
            sums[j, max(island[i], 0)] = 0.0
    for i in range(len(places.rotor)):
        k, h = island[places.unit[i]], weight[i]
        if k >= 0:
            sums[0, k] += h
            sums[1, k] += h * s[places.speed[i]]
            sums[2, k] += h * (s[places.rotor[i]] - run.watch.angles[0, i])


@noinline
def accelerate(places, net, run):
    """Sum inertia times acceleration, per island."""
    for i in range(len(net.island)):
        run.watch.coi[3, max(net.island[i], 0)] = 0.0
    for i in range(len(places.rotor)):
        k = net.island[places.unit[i]]
        if k >= 0:
            run.watch.coi[3, k] += places.inertia[i] * acceleration(i, places, run)


@noinline
def due_frames(calls, bits, due, program, s, f, on):
    """Call the sampled controllers whose frame is due."""
    perform_due(calls, bits, due, program.w, program.k, s, f, on)


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
def act(program, places, net, run, due):
    """Let gates and laws act, with their signals; returns whether a gate or an order has changed."""
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
    for j in range(len(places.held)):
        run.orders[0, j] = run.s[places.held[j]]
    perform(program.step, program.w, program.k, run.s, run.f, net.island)
    changed = False
    for j in range(len(places.held)):
        changed |= run.orders[0, j] != run.s[places.held[j]]
    return changed


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
        due_frames(program.frame, program.bits, due, program, run.s, run.f, net.island)
    return changed

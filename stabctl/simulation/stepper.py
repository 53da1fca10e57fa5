"""The compiled loop: RK4 at a fixed step, network voltages by substitution, sampled devices once a step."""

from stabctl._util.jit import entry, inline, noinline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import perform

from .substitution import solve_apart
from .voltages import FAILED, NEEDS_NEWTON, settle

DONE, SLIPPED, NO_VOLTAGE, LOW_VOLTAGE, RUNAWAY, FREQUENCY, NEWTON = range(7)


@inline
def guess(stage, q):
    """Predict the voltages of the next stage by extrapolating their changes from the same stage of the last steps."""
    copy(q.volt, q.kept)
    for i in range(len(q.volt)):
        q.volt[i] += 2 * q.moves[0, stage, i] - q.moves[1, stage, i]


@inline
def note(stage, q):
    """Store the change of the voltages since the previous stage."""
    for i in range(len(q.volt)):
        q.moves[1, stage, i] = q.moves[0, stage, i]
        q.moves[0, stage, i] = q.volt[i] - q.kept[i]


@noinline
def run(calls, p, s, f, on):
    """Call the device families, compiled once in the stepper."""
    perform(calls, p.w, p.k, s, f, on)


@noinline
def hold(s, f, a):
    """Set the derivatives of states at a non-windup limit to zero if they point beyond it."""
    for k in range(len(a.limited)):
        i, per = a.limited[k], s[a.scale[k]]
        if (s[i] >= a.high[k] * per and f[i] > 0) or (s[i] <= a.low[k] * per and f[i] < 0):
            f[i] = 0


@inline
def confine(s, a):
    """Clip the states with non-windup limits."""
    for k in range(len(a.limited)):
        i, per = a.limited[k], s[a.scale[k]]
        s[i] = min(max(s[i], a.low[k] * per), a.high[k] * per)


@noinline
def coi(a, net, q):
    """Sum inertia, and inertia times speed, acceleration and angle change, per island."""
    s, sums, island = q.s, q.coi, net.island
    for i in range(len(island)):
        for j in range(4):
            sums[j, max(island[i], 0)] = 0.0
    for i in range(len(a.rotor)):
        k, h, at = island[a.unit[i]], a.inertia[i], a.rotor[i]
        if k >= 0:
            sums[0, k] += h
            sums[1, k] += h * s[at + 1]
            sums[2, k] += h * q.f[at + 1]
            sums[3, k] += h * (s[at] - q.angles[0, i])


@noinline
def decide(p, a, net, q):
    """Let the sampled devices act on the present signals; returns whether an order has changed."""
    coi(a, net, q)
    s, sums, island, first, m = q.s, q.coi, net.island, a.places[2], len(a.rotor)
    for i in range(len(island)):
        s[first + 2 * m + i] = 1.0 if island[i] >= 0 else 0.0
    for i in range(m):
        k, own, at = island[a.unit[i]], a.inertia[i], a.rotor[i]
        s[first + i] = s[first + m + i] = 0.0
        if k >= 0 and sums[0, k] > own:
            rest = sums[0, k] - own
            s[first + i] = s[at + 1] - (sums[1, k] - own * s[at + 1]) / rest
            s[first + m + i] = q.f[at + 1] - (sums[2, k] - own * q.f[at + 1]) / rest
    for j in range(len(a.held)):
        q.orders[j] = q.s[a.held[j]]
    run(p.step, p, q.s, q.f, net.island)
    changed = False
    for j in range(len(a.held)):
        changed |= q.orders[j] != q.s[a.held[j]]
    return changed


@noinline
def judge(a, net, q, rules, h):
    """Check synchronism, speeds, frequencies and load voltages by the criterion, and update the peak values."""
    verdict, worst = DONE, 0.0
    coi(a, net, q)
    for i in range(len(a.rotor)):
        k, at = net.island[a.unit[i]], a.rotor[i]
        if k < 0:
            continue
        move = abs(q.s[at] - q.angles[0, i] - q.coi[3, k] / q.coi[0, k])
        if move > q.angles[1, i]:
            q.angles[1, i] = move
        if not move < rules.max_angle and not move <= worst:
            verdict, worst, q.marks[1] = SLIPPED, move, i
        if verdict == DONE and not rules.slowest < q.s[at + 1] < rules.fastest:
            verdict, q.marks[1] = RUNAWAY, i
        inside = rules.min_frequency * q.coi[0, k] <= q.coi[1, k] <= rules.max_frequency * q.coi[0, k]
        q.off[0, i] = 0.0 if inside else q.off[0, i] + h
        q.off[1, i] = max(q.off[1, i], q.off[0, i])
        if verdict == DONE and 0 < rules.frequency_delay_s < q.off[0, i]:
            verdict, q.marks[1] = FREQUENCY, i
    if verdict == DONE and rules.low_voltage_s > 0 and not net.faulted:
        for j in range(len(a.watch_bus)):
            b = a.watch_bus[j]
            v = q.volt[b]
            low = v.real * v.real + v.imag * v.imag < a.watch_low[j] * a.watch_low[j]
            q.low[j] = q.low[j] + h if low and net.alive[b] else 0.0
            if q.low[j] > rules.low_voltage_s:
                verdict, q.marks[0] = LOW_VOLTAGE, b
    return verdict


@noinline
def record(a, net, q, whole, row):
    """Record every signal; set-points and outputs of disconnected units are 0."""
    for k in range(len(row)):
        row[k] = q.s[k]
    if not whole:
        for k in range(len(q.f), len(row)):
            if a.owner[k] >= 0 and net.island[a.owner[k]] < 0:
                row[k] = 0.0


@noinline
def freeze(a, net, q):
    """Set the derivatives of disconnected units to zero."""
    for k in range(len(q.x0)):
        if a.owner[k] >= 0 and net.island[a.owner[k]] < 0:
            q.f[k] = 0


@noinline
def from_above(p, net, q):
    """Start the iteration from the voltages without load: of several solutions, the highest is the operable one."""
    for i in range(len(q.current)):
        q.current[i] = 0
    run(p.source, p, q.s, q.f, net.island)
    solve_apart(net.factors, q.current, q.work, q.volt)
    for i in range(len(q.volt)):
        if not net.alive[i]:
            q.volt[i] = 0


@noinline
def load_voltage_low(a, net, q):
    """Whether a load is near or below its voltage threshold while no fault is on."""
    if net.faulted:
        return False
    for j in range(len(a.watch_bus)):
        v, edge = q.volt[a.watch_bus[j]], 1.1 * a.watch_low[j]
        if v.real * v.real + v.imag * v.imag < edge * edge and net.alive[a.watch_bus[j]]:
            return True
    return False


@entry
def advance(p, a, net, q, rules, h, steps, last, resume, history):
    """Make `steps` steps of h seconds on one network; returns the verdict and the number of steps made.

    Row k of `history` (if it has rows) is the record at the start of step k; with `last`, one more row is recorded at
    the end. The verdict NEWTON asks the caller to solve for the voltages and to call again with `resume`.
    """
    nx = len(q.x0)
    whole = True
    for i in range(len(net.island)):
        whole &= net.island[i] >= 0
    first, stage0, decided = 0, 0, False
    q.s[a.places[1]] = h
    if resume:
        first, stage0, decided = q.marks[2], q.marks[3], q.marks[4] > 0
    else:
        for i in range(len(q.volt)):
            if not net.alive[i]:
                q.volt[i] = 0
        for stage in range(4):
            for i in range(len(q.volt)):
                q.moves[0, stage, i] = q.moves[1, stage, i] = 0
    for step in range(first, steps + last):
        if not resume and load_voltage_low(a, net, q):
            from_above(p, net, q)
        for stage in range(stage0, 4):
            if not resume:
                guess(stage, q)
                decided = stage > 0
            while True:
                n = 0 if resume else settle(p, a, net, q)
                resume = False
                if n == NEEDS_NEWTON:
                    q.marks[2], q.marks[3], q.marks[4] = step, stage, 1 if decided else 0
                    return NEWTON, step
                if n == FAILED:
                    return NO_VOLTAGE, step
                if decided:
                    break
                decided = True
                copy(q.s, q.x0)
                if len(a.held) == 0 or not decide(p, a, net, q):
                    break
            note(stage, q)
            run(p.sweep, p, q.s, q.f, net.island)
            hold(q.s, q.f, a)
            if not whole:
                freeze(a, net, q)
            if stage == 0 and step < len(history):
                record(a, net, q, whole, history[step])
            if stage == 0 and step == steps:
                return DONE, steps
            weight = h / 6 if stage == 0 or stage == 3 else h / 3
            reach = h if stage == 2 else h / 2
            for k in range(nx):
                total = weight * q.f[k] + (q.sum[k] if stage else q.x0[k])
                q.sum[k] = total
                q.s[k] = total if stage == 3 else q.x0[k] + reach * q.f[k]
            confine(q.s, a)
        stage0 = 0
        verdict = judge(a, net, q, rules, h)
        if verdict != DONE:
            return verdict, step + 1
    return DONE, steps

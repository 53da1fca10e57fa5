"""The compiled loop: RK4 at a fixed step, network voltages by substitution, sampled devices once a step."""

from stabctl._util.jit import entry, inline, noinline
from stabctl.devices.blocks import copy, magnitude

from .orders import coi, decide, run
from .substitution import solve_apart
from .switching import CHATTER, MOST, instant, jump
from .voltages import FAILED, NEEDS_NEWTON, settle

FULL = 0.9  # of the rating: orders beyond it count as full
NOTHING, SETTLED, DECIDED = range(3)  # known at a stage: nothing, the voltages, also the orders
DONE, SLIPPED, NO_VOLTAGE, LOW_VOLTAGE, RUNAWAY, FREQUENCY, UNLOCKED, NEWTON = range(8)


@inline
def guess(stage, entire, a, q):
    """Predict the iterated voltages of the next stage from their changes at the same stage of the last two steps.

    The voltages are kept as they are in a part of a step.
    """
    for i in range(len(a.near_bus)):
        b = a.near_bus[i]
        q.kept[b] = q.volt[b]
        if entire:
            q.volt[b] += 2 * q.moves[0, stage, i] - q.moves[1, stage, i]


@inline
def note(stage, a, q):
    """Store the change of the iterated voltages since the previous stage."""
    for i in range(len(a.near_bus)):
        b = a.near_bus[i]
        q.moves[1, stage, i] = q.moves[0, stage, i]
        q.moves[0, stage, i] = q.volt[b] - q.kept[b]


@noinline
def begin(weight, reach, x0, f, total, s):
    """The states of the second stage, s = x0 + reach f, and the weighted rates, summed from x0 on."""
    for k in range(len(x0)):
        total[k] = x0[k] + weight * f[k]
        s[k] = x0[k] + reach * f[k]


@noinline
def move(weight, reach, x0, f, total, s):
    """The same for the next stages; the rates are added to the sum so far. Apart, both loops work on several states."""
    for k in range(len(x0)):
        total[k] += weight * f[k]
        s[k] = x0[k] + reach * f[k]


@noinline
def end(weight, total, f, s):
    """The states at the end of the step."""
    for k in range(len(total)):
        s[k] = total[k] + weight * f[k]


@inline
def hold(q, a):
    """Set the derivatives of states to zero that begin the step at a non-windup limit and point beyond it.

    A state that reaches its limit within the step is only clipped: without its derivative it would fall short.
    """
    for k in range(len(a.limited)):
        i, per = a.limited[k], q.s[a.scale[k]]
        low, high = a.low[k] * per, a.high[k] * per
        if (q.x0[i] >= high and q.s[i] >= high and q.f[i] > 0) or (q.x0[i] <= low and q.s[i] <= low and q.f[i] < 0):
            q.f[i] = 0


@inline
def confine(s, a):
    """Clip the states with non-windup limits."""
    for k in range(len(a.limited)):
        i, per = a.limited[k], s[a.scale[k]]
        s[i] = min(max(s[i], a.low[k] * per), a.high[k] * per)


@inline
def timed(seconds, before, now, h):
    """The time beyond a limit at the end of a step, and the longest without interruption within it.

    `before` and `now` are the distances beyond the limit at the start and end of the step (negative: not beyond), which
    vary linearly in between.
    """
    if before > 0 and now > 0:
        return seconds + h, seconds + h
    if now > 0:
        return h * now / (now - before), h * now / (now - before)
    return 0.0, seconds + h * before / (before - now) if before > 0 else 0.0


@noinline
def begun(a, net, q, rules):
    """Store how far the islands' frequencies and the loads' voltages are beyond their limits at the start of a step."""
    coi(a.weight, a, net, q)
    for i in range(len(a.rotor)):
        q.off[2, i] = off_range(net.island[a.unit[i]], q, rules)
    for j in range(len(a.watch_bus)):
        v = q.volt[a.watch_bus[j]]
        q.low[1, j] = a.watch_low[j] - magnitude(v.real, v.imag)
    q.over[0] = 0.0


@inline
def off_range(k, q, rules):
    """How far the frequency of an island is beyond its range, pu; negative if it is inside."""
    if k < 0:
        return -1.0
    speed = q.coi[1, k] / q.coi[0, k]
    return max(rules.min_frequency - speed, speed - rules.max_frequency)


@noinline
def reverse(a, q, h):
    """Count how often orders change between full charging and discharging: per second, over about the last one."""
    for j in range(len(a.order)):
        order = q.s[a.order[j]]
        side = 1.0 if order > FULL else -1.0 if order < -FULL else 0.0
        q.turns[1, j] *= 1 - h
        if side * q.turns[0, j] < 0:
            q.turns[1, j] += 1
        if side != 0:
            q.turns[0, j] = side


@noinline
def judge(a, net, q, rules, h):
    """Check synchronism, speeds, frequencies and load voltages by the criterion, and update the peak values.

    Frequencies and voltages are timed from the instants at which they cross their limits within a step; `q.over` is the
    time by which the end of the step is later than a verdict on them.
    """
    verdict, worst = DONE, 0.0
    coi(a.weight, a, net, q)
    for i in range(len(a.rotor)):
        k, speed = net.island[a.unit[i]], q.s[a.speed[i]]
        if a.speed[i] >= len(q.x0):
            q.turned[1, i], q.turned[0, i] = (speed - q.turned[0, i]) / h, speed
        if k < 0:
            continue
        move = abs(q.s[a.rotor[i]] - q.angles[0, i] - q.coi[2, k] / q.coi[0, k])
        if move > q.angles[1, i]:
            q.angles[1, i] = move
        if not move < rules.max_angle and not move <= worst:
            verdict, worst, q.marks[1] = SLIPPED, move, i
        if verdict == DONE and not rules.slowest < speed < rules.fastest:
            verdict, q.marks[1] = RUNAWAY, i
        now = off_range(k, q, rules)
        q.off[0, i], longest = timed(q.off[0, i], q.off[2, i], now, h)
        q.off[1, i], q.off[2, i] = max(q.off[1, i], longest), now
        if verdict == DONE and 0 < rules.frequency_delay_s < longest:
            verdict, q.marks[1], q.over[0] = FREQUENCY, i, longest - rules.frequency_delay_s
    for i in range(len(a.other)):
        k = net.island[a.other_unit[i]] if a.other_unit[i] >= 0 else net.island_at[a.other_bus[i]]
        if verdict == DONE and k >= 0 and q.coi[0, k] > 0:
            move = abs(q.s[a.other[i]] - q.others[i] - q.coi[2, k] / q.coi[0, k])
            if not move < rules.max_angle:
                verdict, q.marks[1] = UNLOCKED, i
    if verdict == DONE and rules.low_voltage_s > 0 and not net.faulted:
        for j in range(len(a.watch_bus)):
            b = a.watch_bus[j]
            v = q.volt[b]
            now = a.watch_low[j] - magnitude(v.real, v.imag) if net.alive[b] else -1.0
            q.low[0, j], longest = timed(q.low[0, j], q.low[1, j], now, h)
            q.low[1, j] = now
            if longest - rules.low_voltage_s > q.over[0]:
                verdict, q.marks[0], q.over[0] = LOW_VOLTAGE, b, longest - rules.low_voltage_s
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
def advance(p, a, net, q, rules, sizes, due, last, resume, history):
    """Make steps of the given sizes (s) on one network; returns the verdict and the number of steps made.

    `due` has the bits of the frame rates that are due at the start of each step; it is empty without sampled
    controllers.

    Row k of `history` (if it has rows) is the record at the start of step k; with `last`, one more row is recorded at
    the end. A step in which the power of storage jumps is made in parts that end at the jumps, unless the orders
    chatter. The verdict NEWTON asks the caller to solve for the voltages and to call again with `resume`.
    """
    nx, steps = len(q.x0), len(sizes)
    whole, jumps = True, a.relay or len(a.stops) > 0
    for i in range(len(net.island)):
        whole &= net.island[i] >= 0
    step, stage0, known, parts = 0, 0, NOTHING, 1
    if resume:
        step, stage0, known, parts = q.marks[2], q.marks[3], q.marks[4], q.marks[5]
    else:
        q.part[0], q.part[1] = 0.0, 1.0
        for i in range(len(q.volt)):
            if not net.alive[i]:
                q.volt[i] = 0
    while step < steps + last:
        h = sizes[step] if step < steps else 0.0
        entire, span = q.part[1] - q.part[0] == 1, (q.part[1] - q.part[0]) * h
        q.s[a.places[1]] = span
        for stage in range(stage0, 5 if a.relay and q.part[1] == 1 else 4):
            if not resume and not (stage == 0 and known == SETTLED):
                if stage % 4 == 0 and load_voltage_low(a, net, q):
                    from_above(p, net, q)
                guess(stage % 4, entire, a, q)
                known = DECIDED if 0 < stage < 4 else known
                if a.follows and 0 < stage < 4:
                    decide(p, a, net, q, 0)
            while True:
                n = 0 if resume or known == SETTLED else settle(p, a, net, q)
                resume = False
                if n == NEEDS_NEWTON:
                    q.marks[2], q.marks[3], q.marks[4], q.marks[5] = step, stage, known, parts
                    return NEWTON, step
                if n == FAILED:
                    return NO_VOLTAGE, step
                if known == DECIDED:
                    break
                known = DECIDED
                copy(q.s, q.x0)
                frames = due[step] if stage == 0 and step < len(due) and q.part[0] == 0 else 0
                if (len(a.held) == 0 and frames == 0) or not decide(p, a, net, q, frames):
                    q.marks[7] = 0 if q.marks[7] == CHATTER else q.marks[7]
                    break
            if stage == 4:
                break
            if entire:
                note(stage, a, q)
            run(p.sweep, p, q.s, q.f, net.island)
            hold(q, a)
            if not whole:
                freeze(a, net, q)
            if stage == 0:
                if q.over[0] < 0:
                    begun(a, net, q, rules)
                if step < len(history) and q.part[0] == 0:
                    record(a, net, q, whole, history[step])
                if step == steps:
                    return DONE, steps
                if jumps:
                    copy(q.f, q.rate)
                    copy(q.volt, q.volts[0])
            if stage == 2 and jumps:
                copy(q.volt, q.volts[1])
            weight = span / 6 if stage == 0 or stage == 3 else span / 3
            reach = span if stage == 2 else span / 2
            if stage == 0:
                begin(weight, reach, q.x0, q.f, q.sum, q.s)
            elif stage < 3:
                move(weight, reach, q.x0, q.f, q.sum, q.s)
            else:
                end(weight, q.sum, q.f, q.s)
            confine(q.s, a)
        stage0, known = 0, SETTLED if a.relay else NOTHING
        if q.part[1] < 1:
            jump(h, a, q)
            copy(q.s, q.x0)
            q.part[0], q.part[1], known = q.part[1], 1.0, DECIDED
            continue
        if parts <= MOST and q.marks[7] < CHATTER and jumps:
            t = instant(span, p, a, net, q)
            if t < 1:
                for k in range(nx):
                    q.s[k] = q.x0[k]
                copy(q.volts[0], q.volt)
                q.part[1], known, parts = q.part[0] + t * (q.part[1] - q.part[0]), DECIDED, parts + 1
                continue
        if q.marks[7] < CHATTER:
            q.marks[7] = q.marks[7] + 1 if parts > 1 else 0
        q.part[0], parts = 0.0, 1
        verdict = judge(a, net, q, rules, h)
        reverse(a, q, h)
        q.s[a.places[2] + 3 * len(a.rotor) + len(net.island)] += h
        step += 1
        if verdict != DONE:
            return verdict, step
    return DONE, steps

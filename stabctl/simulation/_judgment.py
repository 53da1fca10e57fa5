"""The criterion at the end of a step: synchronism, speeds, frequencies, load voltages; and reversing orders."""

from stabctl._util.jit import inline, noinline
from stabctl.devices.blocks import magnitude

from ._buffers import NOTE
from ._switching import coi

FULL = 0.9  # of the rating: orders beyond it count as full
MEMORY = 2.0  # s   over which reversals are counted
BEHIND = 0.01  # of the rating: orders further from what is wanted are held back by a ramp limit
HELD = 0.5  # s   in which a grid-forming device gives up its power when its store is empty or full
IDLE = 0.01  # pu   current of the device that counts as power
DONE, SLIPPED, NO_VOLTAGE, LOW_VOLTAGE, RUNAWAY, FREQUENCY, UNLOCKED, EMPTY, FULL_STORE, NEWTON = range(10)


@inline
def time_beyond(seconds, before, now, h):
    """The time beyond a limit at the end of a step, and the longest without interruption within it.

    `before` and `now` are the distances beyond the limit at the start and end of the step (negative: not beyond), which
    vary linearly in between.
    """
    if before > 0 and now > 0:
        return seconds + h, seconds + h
    if now > 0:
        return h * now / (now - before), h * now / (now - before)
    return 0.0, seconds + h * before / (before - now) if before > 0 else 0.0


@inline
def beyond_range(k, run, rules):
    """How far the frequency of an island is beyond its range, pu; negative if it is inside."""
    if k < 0:
        return -1.0
    speed = run.watch.coi[1, k] / run.watch.coi[0, k]
    return max(rules.min_frequency - speed, speed - rules.max_frequency)


@inline
def after_speed(verdict, j, speed, k, run, rules, h):
    """The verdict after the speed of angle j, rotors first, and the frequency of island k, -1: it is not judged."""
    off, now = run.watch.off, beyond_range(k, run, rules)
    if verdict == DONE and not rules.slowest < speed < rules.fastest:
        verdict, run.notes[NOTE.rotor] = RUNAWAY, j
    off[0, j], longest = time_beyond(off[0, j], off[2, j], now, h)
    off[1, j], off[2, j] = max(off[1, j], longest), now
    if verdict == DONE and 0 < rules.frequency_delay_s < longest:
        verdict, run.notes[NOTE.rotor], run.late[0] = FREQUENCY, j, longest - rules.frequency_delay_s
    return verdict


@inline
def island_alone(i, places, net):
    """The island that an angle without weight among rotors turns; -1 if rotors do."""
    return net.island_at[places.other_bus[i]] if places.other_weight[i] > 0 else -1


@noinline
def measure_excess(places, net, run, rules):
    """Store how far frequencies and voltages are beyond their limits at the first step after an event."""
    coi(places.weight, places, net, run)
    for i in range(len(places.rotor)):
        run.watch.off[2, i] = beyond_range(net.island[places.unit[i]] if places.judged[i] else -1, run, rules)
    for i in range(len(places.other)):
        run.watch.off[2, len(places.rotor) + i] = beyond_range(island_alone(i, places, net), run, rules)
    for j in range(len(places.watch_bus)):
        v = run.volt[places.watch_bus[j]]
        run.watch.low[1, j] = places.watch_low[j] - magnitude(v.real, v.imag)
    run.late[0] = 0.0


@noinline
def count_reversals(places, run, h):
    """Count how often orders change between full charging and discharging: per second, over about the last two.

    An order that a continuous law wants and that a ramp limit holds back counts by the direction in which it moves.
    """
    turns = run.watch.turns
    for j in range(len(places.order)):
        order = run.s[places.order[j]]
        side = 1.0 if order > FULL else -1.0 if order < -FULL else 0.0
        if places.follows:
            behind = min(max(run.s[places.wanted[j]], -1.0), 1.0) - order
            side = side if abs(behind) < BEHIND else 1.0 if behind > 0 else -1.0
        turns[1, j] *= 1 - h / MEMORY
        if side * turns[0, j] < 0:
            turns[1, j] += 1 / MEMORY
        if side != 0:
            turns[0, j] = side


@noinline
def judge(places, net, run, rules, h):
    """Check synchronism, speeds, frequencies, stores and load voltages by the criterion, and update the peak values.

    Frequencies and voltages are timed from the instants at which they cross their limits within a step; `late` is the
    time by which the end of the step is later than a verdict on them.
    """
    watch, notes, late = run.watch, run.notes, run.late
    verdict, worst = DONE, 0.0
    coi(places.weight, places, net, run)
    for i in range(len(places.rotor)):
        k, speed = net.island[places.unit[i]], run.s[places.speed[i]]
        if places.speed[i] >= len(run.part.x):  # a virtual rotor, whose speed is an output
            watch.turned[1, i], watch.turned[0, i] = (speed - watch.turned[0, i]) / h, speed
        if k < 0:
            continue
        move = abs(run.s[places.rotor[i]] - watch.angles[0, i] - watch.coi[2, k] / watch.coi[0, k])
        if move > watch.angles[1, i]:
            watch.angles[1, i] = move
        if not move < rules.max_angle and not move <= worst:
            verdict, worst, notes[NOTE.rotor] = SLIPPED, move, i
        verdict = after_speed(verdict, i, speed, k if places.judged[i] else -1, run, rules, h)
    for i in range(len(places.other)):
        k, j = net.island_at[places.other_bus[i]], len(places.rotor) + i
        if places.other_unit[i] >= 0:
            k = net.island[places.other_unit[i]]
        if verdict == DONE and k >= 0 and watch.coi[0, k] > 0:
            move = abs(run.s[places.other[i]] - watch.others[i] - watch.coi[2, k] / watch.coi[0, k])
            if not move < rules.max_angle:
                verdict, notes[NOTE.rotor] = UNLOCKED, j
        k = island_alone(i, places, net)
        speed = run.s[places.other_speed[i]] if k >= 0 else 1.0
        verdict = after_speed(verdict, j, speed, k, run, rules, h)
        energy, ip = run.s[places.other_energy[i]], run.s[places.other_ip[i]]
        spent = (energy <= places.other_low[i] and ip > IDLE) or (energy >= places.other_high[i] and ip < -IDLE)
        watch.spent[i] = watch.spent[i] + h if spent and k >= 0 else 0.0
        if verdict == DONE and watch.spent[i] > HELD:
            verdict, notes[NOTE.rotor], notes[NOTE.bus] = EMPTY if ip > 0 else FULL_STORE, j, places.other_bus[i]
            late[0] = watch.spent[i]
    if verdict == DONE and rules.low_voltage_s > 0 and not net.faulted:
        for j in range(len(places.watch_bus)):
            b = places.watch_bus[j]
            v = run.volt[b]
            now = places.watch_low[j] - magnitude(v.real, v.imag) if net.alive[b] else -1.0
            watch.low[0, j], longest = time_beyond(watch.low[0, j], watch.low[1, j], now, h)
            watch.low[1, j] = now
            if longest - rules.low_voltage_s > late[0]:
                verdict, notes[NOTE.bus], late[0] = LOW_VOLTAGE, b, longest - rules.low_voltage_s
    return verdict

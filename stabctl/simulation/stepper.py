"""The compiled loop over the steps on one network, from one event to the next; and the same over recorded steps.

A step, or a part of one, goes from left to right:

    start    voltages; frames, gates and laws that are due act; voltages again if an order has changed
    stages   rates of all devices, states of the next stage, its voltages (`method`, `voltages`)
    divide   if the power of storage jumps within it, it is made again in parts that end at the jumps (`switching`)
    judge    synchronism, speeds, frequencies, load voltages (`judgment`)

The types of its arguments are the same for every system, so the loop is compiled once and kept on disk:

    program  `Program`    calls of the devices, their places and constants
    places   `Places`     where the stepper itself reads and writes in the signals s
    net      `Net`        factorized network, islands
    run      `Run`        signals, rates, voltages, work space
    rules    `Criterion`  as numbers
    plan     `Plan`       the steps
    at       `Cursor`     where to begin
"""

from typing import NamedTuple

import numpy as np

from stabctl._util.jit import entry, inline, noinline
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import perform

from ._buffers import NOTE
from ._judgment import DONE, NEWTON, NO_VOLTAGE, count_reversals, judge, measure_excess
from ._substitution import solve_apart
from ._switching import close, decide, first_jump, jump, jumped, rates
from ._voltages import AWAY, FOUND, LOST, UNPREPARED, settle
from .method import RK4, STAGES, advance_states, clip_at_limits, freeze_disconnected, hold_at_limits

MOST = 4  # jumps found in one step; what switches later in it does so at its end
CHATTER = 8  # divided steps in a row; the next ones are not divided, until one has nothing to switch at its start
SHORTEST = 1 / 64  # of a step; a part that is halved because an order of a continuous law jumps in it


class Plan(NamedTuple):
    """Steps to be made on one network."""

    sizes: np.ndarray  # (steps), s
    due: np.ndarray  # (steps)   bits of the frame rates that are due at the start of each; empty without any
    last: bool  # evaluate all signals at the end too, and record them if `history` has a row for them


class Cursor(NamedTuple):
    """Where the loop is in its plan, and what is known there. A call that returned NEWTON is repeated from it."""

    step: int  # of the plan
    stage: int  # of the method; `STAGES` is the end of the step
    begin: float  # of the part of the step that is being made, as a fraction of the step
    end: float  # of this part; 1 unless it ends at a jump of storage power
    row: int  # of `Places.limited`: the device that fills or empties at the end of this part, -1: none
    parts: int  # into which the step is divided so far
    decided: bool  # frames, gates and laws that are due at the start have acted
    volts: int  # those at this stage: UNKNOWN, PREDICTED, SOLVED


NO_ROWS = np.empty((0, 0))
NOTHING = Plan(np.empty(0), np.empty(0, np.int64), False)
UNKNOWN, PREDICTED, SOLVED = range(3)
START = Cursor(0, 0, 0.0, 1.0, -1, 1, False, UNKNOWN)


@entry
def advance(program, places, net, run, rules, plan, at, history):
    """Make the steps of a plan from a cursor on; returns a verdict and the cursor where it was reached.

    Row k of `history` (steps, or one more; signals) is the record at the start of step k; it has no rows if nothing is
    kept. The verdict NEWTON asks the caller to prepare Newton's method and to call again with the cursor.
    """
    steps, may_jump = len(plan.sizes), places.relay or places.abrupt or len(places.stops) > 0
    if at.volts != SOLVED:
        clear_dead_buses(net, run)
    while at.step < steps + plan.last:
        h = plan.sizes[at.step] if at.step < steps else 0.0
        span = (at.end - at.begin) * h
        undivided = at.begin == 0 and at.end == 1
        due = plan.due[at.step] if at.step < len(plan.due) and at.begin == 0 else 0
        # With relays, the voltages at the end of a whole step are solved for too: they tell whether one has switched.
        stages = STAGES + 1 if places.relay and at.end == 1 else STAGES
        for stage in range(at.stage, stages):
            if at.volts == UNKNOWN:
                predict(stage, undivided, span, program, places, net, run)
            while True:
                found = FOUND if at.volts == SOLVED else settle(program, places, net, run)
                if found != FOUND:
                    return NO_VOLTAGE if found == LOST else NEWTON, at_stage(stage, at.decided, PREDICTED, at)
                changed = not at.decided and start(due, span, program, places, net, run)
                at = at_stage(stage, True, PREDICTED if changed else SOLVED, at)
                if not changed:
                    break
            if stage == STAGES:
                break
            if places.inertial:
                if not close(program, places, net, run):
                    run.notes[NOTE.open] += 1
                if stage == 0:
                    begin(0.0, places, run)
            evaluate(stage, undivided, may_jump, program, places, net, run)
            if stage == 0:
                if run.late[0] < 0:  # the first step after an event
                    measure_excess(places, net, run, rules)
                if at.step < len(history) and at.begin == 0:
                    record(places, net, run, history[at.step])
                if at.step == steps:
                    return DONE, at
            advance_states(stage, span, run)
            clip_at_limits(run.s, places)
            at = at_stage(stage + 1, at.decided, UNKNOWN, at)
        # A part that ends at a jump: orders switch, or a device stops. The rest of the step is the next part.
        if at.end < 1:
            jump(at.row, h, places, run)
            copy(run.s, run.part.x)
            begin(0.0, places, run)
            at = Cursor(at.step, 0, at.end, end=1.0, row=-1, parts=at.parts, decided=not places.follows, volts=UNKNOWN)
            continue
        # Where does the first jump within this part lie? If there is one, make the part again, up to it. Orders that
        # chatter jump in every step, without end: after `CHATTER` such steps they act at the ends of steps only.
        abrupt = places.abrupt and jumped(places, run)
        halved = abrupt and at.end - at.begin > SHORTEST
        if may_jump and (halved or at.parts <= MOST) and run.notes[NOTE.divided] < CHATTER:
            t, row = (0.5, -1) if halved else first_jump(span, program, places, net, run)
            if t < 1:
                for k in range(len(run.part.x)):
                    run.s[k] = run.part.x[k]
                copy(run.part.volts[0], run.volt)
                if places.follows:
                    again(places, run)
                cut = at.begin + t * (at.end - at.begin)
                at = Cursor(at.step, 0, at.begin, cut, row, at.parts + 1, decided=True, volts=UNKNOWN)
                continue
        if run.notes[NOTE.divided] < CHATTER:
            run.notes[NOTE.divided] = run.notes[NOTE.divided] + 1 if at.parts > 1 else 0
        elif abrupt:
            run.notes[NOTE.chatter] += 1
        elif places.abrupt:
            run.notes[NOTE.divided] = 0
        verdict = judge(places, net, run, rules, h)
        count_reversals(places, run, h)
        run.s[places.seen.time] += h
        # With relays, the voltages at the start of the next step are known: they are those at this end.
        volts = SOLVED if places.relay else UNKNOWN
        at = Cursor(at.step + 1, 0, begin=0.0, end=1.0, row=-1, parts=1, decided=False, volts=volts)
        if verdict != DONE:
            return verdict, at
    return DONE, at


@inline
def clear_dead_buses(net, run):
    """Set the voltages of islands without a source to zero."""
    for i in range(len(run.volt)):
        if not net.alive[i]:
            run.volt[i] = 0


@inline
def predict(stage, undivided, span, program, places, net, run):
    """Predict the iterated voltages of a stage: those of the stage before and, in an undivided step, a change.

    The change is extrapolated from the changes at the same stage of the last two steps, 2 d1 - d2. The end of a step
    (stage `STAGES`) is the start of the next one, so it is predicted as stage 0. Orders that follow the signals do so
    with these voltages.
    """
    as_stage = stage % STAGES
    if as_stage == 0 and load_voltage_low(places, net, run):
        start_from_no_load(program, places, net, run)
    for i in range(len(places.near_bus)):
        b = places.near_bus[i]
        run.solve.before[b] = run.volt[b]
        if undivided:
            run.volt[b] += 2 * run.solve.moves[0, as_stage, i] - run.solve.moves[1, as_stage, i]
    if places.follows and stage > 0:
        run.s[places.elapsed] = span / RK4.reach_divisor[stage - 1]
        decide(program, places, net, run, 0)


@noinline
def load_voltage_low(places, net, run):
    """Whether a load is near or below its voltage threshold while no fault is on."""
    if net.faulted:
        return False
    for j in range(len(places.watch_bus)):
        v, edge = run.volt[places.watch_bus[j]], 1.1 * places.watch_low[j]
        if v.real * v.real + v.imag * v.imag < edge * edge and net.alive[places.watch_bus[j]]:
            return True
    return False


@noinline
def start_from_no_load(program, places, net, run):
    """Start the iteration from the voltages without load: of several solutions, the highest is the operable one."""
    for i in range(len(run.current)):
        run.current[i] = 0
    perform(program.source, program.w, program.k, run.s, run.f, net.island)
    solve_apart(net.factors, run.current, run.solve.work, run.volt)
    clear_dead_buses(net, run)
    run.notes[NOTE.begun] = AWAY


@inline
def start(due, span, program, places, net, run):
    """Let the frames, gates and laws act that are due at the start of a step; returns whether outputs have changed."""
    copy(run.s, run.part.x)  # only the states, with which s begins
    if not places.follows:  # orders move now by what they may until the end
        begin(span, places, run)
    changed = (len(places.held) > 0 or due != 0) and decide(program, places, net, run, due)
    if places.follows:  # they have moved over the step before
        begin(0.0, places, run)
    if changed:
        return True
    if run.notes[NOTE.divided] == CHATTER:
        run.notes[NOTE.divided] = 0  # the chatter is over
    return False


@inline
def begin(elapsed, places, run):
    """Let orders move from what they are now, over a time (s)."""
    for j in range(len(places.order)):
        run.s[places.begun + j] = run.s[places.held[j]]
        if places.follows:
            run.s[places.begun + len(places.order) + j] = run.s[places.wanted[j]]
    run.s[places.elapsed] = elapsed


@inline
def again(places, run):
    """Set the orders to those at the beginning of the part."""
    for j in range(len(places.order)):
        run.s[places.held[j]] = run.s[places.begun + j]
    run.s[places.elapsed] = 0.0


@inline
def evaluate(stage, undivided, may_jump, program, places, net, run):
    """Outputs and rates of all devices; states held at a limit and units that are off have rate 0.

    Keeps the change of the iterated voltages, for their prediction, and what instants within this part are interpolated
    from: the first rates, the first and the middle voltages.
    """
    if undivided:
        moves = run.solve.moves
        for i in range(len(places.near_bus)):
            b = places.near_bus[i]
            moves[1, stage, i] = moves[0, stage, i]
            moves[0, stage, i] = run.volt[b] - run.solve.before[b]
    rates(program, places, net, run)
    if stage == 0:
        copy(run.f, run.part.rate)
    if may_jump and stage == 0:
        copy(run.volt, run.part.volts[0])
    if may_jump and stage == RK4.middle:
        copy(run.volt, run.part.volts[1])


@noinline
def record(places, net, run, row):
    """Record every signal; set-points and outputs of disconnected units are 0."""
    for k in range(len(row)):
        row[k] = run.s[k]
    if not net.whole:
        for k in range(len(run.f), len(row)):
            if places.owner[k] >= 0 and net.island[places.owner[k]] < 0:
                row[k] = 0.0


@inline
def at_stage(stage, decided, volts, at):
    """The cursor at another stage of the same part of a step."""
    return Cursor(at.step, stage, at.begin, at.end, at.row, at.parts, decided, volts)


@entry
def replay(program, places, net, run, sizes, rows, at, signals, held, clipped):
    """Make the stages of recorded steps once more: of the given sizes (s), each beginning at its row.

    Returns whether Newton's method has to be prepared, to be called again, and where it is: at a step that is left
    where voltages were not found.
    """
    while at.step < len(sizes):
        h, step = sizes[at.step], at.step
        for stage in range(at.stage, STAGES):
            if at.volts == UNKNOWN:
                if stage == 0:
                    for k in range(rows.shape[1]):
                        run.s[k] = rows[step, k]
                    copy(run.s, run.part.x)
                copy(run.volt, run.solve.before)
            found = settle(program, places, net, run)
            if found != FOUND:
                return found == UNPREPARED, at_stage(stage, True, PREDICTED, at)
            perform(program.sweep, program.w, program.k, run.s, run.f, net.island)
            copy(run.s, signals[step, stage])
            for k in range(len(places.limited)):
                held[step, stage, k] = run.f[places.limited[k]]
            hold_at_limits(run, places)
            for k in range(len(places.limited)):
                held[step, stage, k] = 1.0 if held[step, stage, k] != 0 and run.f[places.limited[k]] == 0 else 0.0
            if not net.whole:
                freeze_disconnected(places, net, run)
            advance_states(stage, h, run)
            for k in range(len(places.limited)):
                clipped[step, stage, k] = run.s[places.limited[k]]
            clip_at_limits(run.s, places)
            for k in range(len(places.limited)):
                free, kept = clipped[step, stage, k], run.s[places.limited[k]]
                clipped[step, stage, k] = 1.0 if free > kept else -1.0 if free < kept else 0.0
            at = at_stage(stage + 1, True, UNKNOWN, at)
        at = Cursor(at.step + 1, 0, begin=0.0, end=1.0, row=-1, parts=1, decided=True, volts=UNKNOWN)
    return False, at

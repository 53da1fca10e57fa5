"""The compiled loop over the steps on one network, from one event to the next.

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

from .buffers import NOTE
from .judgment import DONE, NEWTON, count_reversals, judge, measure_excess
from .method import RK4, STAGES, advance_states, clip_at_limits, freeze_disconnected, hold_at_limits
from .orders import call, decide
from .substitution import solve_apart
from .switching import CHATTER, MOST, first_jump, jump
from .voltages import settle


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
    solved: bool  # the voltages at this stage are known


NOTHING = Plan(np.empty(0), np.empty(0, np.int64), False)
START = Cursor(0, 0, 0.0, 1.0, -1, 1, False, False)


@entry
def advance(program, places, net, run, rules, plan, at, history):
    """Make the steps of a plan from a cursor on; returns a verdict and the cursor where it was reached.

    Row k of `history` (steps, or one more; signals) is the record at the start of step k; it has no rows if nothing is
    kept. The verdict NEWTON asks the caller to solve for the voltages at the cursor and to call again with it.
    """
    steps, connected = len(plan.sizes), all_connected(net)
    may_jump = places.relay or len(places.stops) > 0
    if not at.solved:
        clear_dead_buses(net, run)
    while at.step < steps + plan.last:
        h = plan.sizes[at.step] if at.step < steps else 0.0
        span = (at.end - at.begin) * h
        run.s[places.span] = span
        due = plan.due[at.step] if at.step < len(plan.due) else 0
        # With relays, the voltages at the end of a whole step are solved for too: they tell whether one has switched.
        stages = STAGES + 1 if places.relay and at.end == 1 else STAGES
        for stage in range(at.stage, stages):
            solved, decided = solve_voltages(stage, due, at, program, places, net, run)
            at = at_stage(stage, decided, True, at)
            if not solved:
                return NEWTON, at  # the caller solves for them, so when it calls again they are known
            if stage == STAGES:
                break
            evaluate(stage, at, connected, program, places, net, run)
            if stage == 0:
                if run.late[0] < 0:  # the first step after an event
                    measure_excess(places, net, run, rules)
                if at.step < len(history) and at.begin == 0:
                    record(places, net, run, connected, history[at.step])
                if at.step == steps:
                    return DONE, at
            if may_jump:
                remember(stage, run)
            advance_states(stage, span, run)
            clip_at_limits(run.s, places)
            at = at_stage(stage + 1, at.decided, False, at)
        # A part that ends at a jump: orders switch, or a device stops. The rest of the step is the next part.
        if at.end < 1:
            jump(at.row, h, places, run)
            copy(run.s, run.part.x)  # only the states, with which s begins
            at = part(at.end, 1.0, -1, at.parts, at)
            continue
        # Where does the first jump within this part lie? If there is one, make the part again, up to it. Orders that
        # chatter jump in every step, without end: after `CHATTER` such steps they act at the ends of steps only.
        if may_jump and at.parts <= MOST and run.notes[NOTE.divided] < CHATTER:
            t, row = first_jump(span, program, places, net, run)
            if t < 1:
                return_to_begin(run)
                at = part(at.begin, at.begin + t * (at.end - at.begin), row, at.parts + 1, at)
                continue
        if run.notes[NOTE.divided] < CHATTER:
            run.notes[NOTE.divided] = run.notes[NOTE.divided] + 1 if at.parts > 1 else 0
        verdict = judge(places, net, run, rules, h)
        count_reversals(places, run, h)
        run.s[places.seen.time] += h
        at = next_step(places.relay, at)  # with relays the voltages there are known, see above
        if verdict != DONE:
            return verdict, at
    return DONE, at


@inline
def at_stage(stage, decided, solved, at):
    """The cursor at another stage of the same part."""
    return Cursor(at.step, stage, at.begin, at.end, at.row, at.parts, decided, solved)


@inline
def part(begin, end, row, parts, at):
    """The cursor at the start of another part of the same step; what was due in this step has acted."""
    return Cursor(at.step, 0, begin, end, row, parts, True, False)


@inline
def undivided(at):
    """Whether the part that is being made is the whole step."""
    return at.begin == 0 and at.end == 1


@inline
def next_step(solved, at):
    """The cursor at the start of the next step."""
    return Cursor(at.step + 1, 0, 0.0, 1.0, -1, 1, False, solved)


@inline
def solve_voltages(stage, due, at, program, places, net, run):
    """Solve for the voltages of a stage; at the start of a step let what is due act, and solve again if it has changed.

    Returns whether they are known, and whether what is due has acted. The end of a step (stage `STAGES`) is the start
    of the next one, so the voltages there are predicted as those of stage 0.
    """
    solved, decided = at.solved, at.decided
    if not solved:
        if stage % STAGES == 0 and load_voltage_low(places, net, run):
            start_from_no_load(program, places, net, run)
        predict(stage % STAGES, undivided(at), places, run)
        if places.follows and stage > 0:
            decide(program, places, net, run, 0)
    while solved or settle(program, places, net, run):
        if decided:
            return True, True
        decided, solved = True, False
        copy(run.s, run.part.x)
        if (len(places.held) == 0 and due == 0) or not decide(program, places, net, run, due):
            if run.notes[NOTE.divided] == CHATTER:
                run.notes[NOTE.divided] = 0  # the chatter is over
            return True, True
    return False, decided


@inline
def evaluate(stage, at, connected, program, places, net, run):
    """Outputs and rates of all devices; states held at a limit and units that are off have rate 0."""
    if undivided(at):
        note_change(stage, places, run)
    call(program.sweep, program, run.s, run.f, net.island)
    hold_at_limits(run, places)
    if not connected:
        freeze_disconnected(places, net, run)


@inline
def remember(stage, run):
    """Keep what instants within this part are interpolated from: the first rates, the first and the middle voltages."""
    if stage == 0:
        copy(run.f, run.part.rate)
        copy(run.volt, run.part.volts[0])
    if stage == RK4.middle:
        copy(run.volt, run.part.volts[1])


@inline
def return_to_begin(run):
    """Set states and voltages back to those at the beginning of this part; outputs follow when they are evaluated."""
    for k in range(len(run.part.x)):
        run.s[k] = run.part.x[k]
    copy(run.part.volts[0], run.volt)


@inline
def all_connected(net):
    """Whether no unit is disconnected."""
    connected = True
    for i in range(len(net.island)):
        connected &= net.island[i] >= 0
    return connected


@inline
def clear_dead_buses(net, run):
    """Set the voltages of islands without a source to zero."""
    for i in range(len(run.volt)):
        if not net.alive[i]:
            run.volt[i] = 0


@inline
def predict(stage, undivided, places, run):
    """Predict the iterated voltages of a stage: those of the stage before and, in an undivided step, a change.

    The change is extrapolated from the changes at the same stage of the last two steps, 2 d1 - d2.
    """
    for i in range(len(places.near_bus)):
        b = places.near_bus[i]
        run.solve.before[b] = run.volt[b]
        if undivided:
            run.volt[b] += 2 * run.solve.moves[0, stage, i] - run.solve.moves[1, stage, i]


@inline
def note_change(stage, places, run):
    """Store the change of the iterated voltages since the previous stage, for the prediction."""
    moves = run.solve.moves
    for i in range(len(places.near_bus)):
        b = places.near_bus[i]
        moves[1, stage, i] = moves[0, stage, i]
        moves[0, stage, i] = run.volt[b] - run.solve.before[b]


@noinline
def start_from_no_load(program, places, net, run):
    """Start the iteration from the voltages without load: of several solutions, the highest is the operable one."""
    for i in range(len(run.current)):
        run.current[i] = 0
    call(program.source, program, run.s, run.f, net.island)
    solve_apart(net.factors, run.current, run.solve.work, run.volt)
    clear_dead_buses(net, run)


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
def record(places, net, run, connected, row):
    """Record every signal; set-points and outputs of disconnected units are 0."""
    for k in range(len(row)):
        row[k] = run.s[k]
    if not connected:
        for k in range(len(run.f), len(row)):
            if places.owner[k] >= 0 and net.island[places.owner[k]] < 0:
                row[k] = 0.0

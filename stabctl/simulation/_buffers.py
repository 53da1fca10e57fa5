"""What a run remembers: signals, work space, and what the criterion has seen. The arrays are made once and reused.

nx states, nb buses, m rotor units; the iterated buses are those in `Places.near_bus`.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl._util.words import record

from .method import STAGES

if TYPE_CHECKING:
    from stabctl.dynamics.layout import Layout

    from ._places import Places


class Note(NamedTuple):
    """Places in `Run.notes`."""

    bus: int = 0  # row of the bus that a verdict names
    rotor: int = 1  # row of the rotor unit that it names; those of angles without weight follow
    divided: int = 2  # how many steps in a row were divided, at most `CHATTER`
    open: int = 3  # stages at which orders and the accelerations they cause did not agree
    chatter: int = 4  # steps not divided because an order of a continuous law jumps in step after step
    newton: int = 5  # stages at which Newton's method was called
    draws: int = 6  # evaluations of the voltage-dependent currents
    slow: int = 7  # solutions in a row for which the fixed-point iteration was slow
    wait: int = 8  # solutions by Newton's method until it is tried again
    next: int = 9  # how many these will be at the next time, 0: `WAIT`
    found: int = 10  # whether Newton's method found them
    kept: int = 11  # whether its factors are those of an earlier instant, to be used again
    quick: int = 12  # solutions in a row for which it was not slow
    begun: int = 13  # whether the voltages begin near the solution, see `_voltages`


NOTE = Note()  # a record: its file is then part of the key of machine code on disk; that of a mere number is not


class Iteration(NamedTuple):
    """Work space of the bus voltages."""

    work: np.ndarray  # (nb), complex   of the substitution
    source: np.ndarray  # (nb), complex, pu   currents of the voltage sources
    begun: np.ndarray  # (nb), complex   forward substitution of these currents, from the rows on that iterations repeat
    before: np.ndarray  # (nb), complex, pu   voltages at the previous stage
    moves: np.ndarray  # (2, stages, iterated buses), complex, pu   changes to each stage of the last two steps


class Part(NamedTuple):
    """The part of a step that is being made, usually all of it, and what instants within it are found by."""

    x: np.ndarray  # (nx)   states at its beginning
    rate: np.ndarray  # (nx), of the states per s   rates at its beginning
    total: np.ndarray  # (nx)   x and the weighted rates so far; at last the states at its end
    end: np.ndarray  # (nx)   states at its end, while instants within it are tried
    volts: np.ndarray  # (3, nb), complex, pu   voltages at its beginning, between (see `interpolate`), and at its end


class Watch(NamedTuple):
    """What the criterion has seen."""

    angles: np.ndarray  # (2, m), rad   before the first event, and the largest change since, relative to the COI
    turned: np.ndarray  # (2, m), pu and pu/s   speed after the last step, and its mean rate in it; of virtual rotors
    others: np.ndarray  # (angles without weight), rad   before the first event
    spent: np.ndarray  # (angles without weight), s   time over which an island takes the power of a store that ends it
    off: np.ndarray  # (3, m + angles without weight), s, s and pu   time outside the frequency range, longest, how far
    low: np.ndarray  # (2, loads), s and pu   time below the threshold of the load, and how far below
    turns: np.ndarray  # (2, storage devices), -1, 0, 1, and 1/s   side of the last full order, recent changes of it
    coi: np.ndarray  # (4, nb)   sums of H, H speed, H angle and, in laws, H acceleration, over each island


class Loop(NamedTuple):
    """Work space of orders that follow the accelerations they cause; n storage devices, none without such orders."""

    response: np.ndarray  # (n, n), pu/s   accelerations that each sees, per order of each
    matrix: np.ndarray  # (n, n + 1)   equations of a change of the orders
    order: np.ndarray  # (2, n)   orders tried, and accelerations seen with them
    known: np.ndarray  # (1), int   whether `response` is that of the present network


@record
class Run(NamedTuple):
    """Everything that changes in a run. The same for every system, so that compiled code has one signature."""

    s: np.ndarray  # (signals)   states, voltages, set-points, outputs, memory
    f: np.ndarray  # (nx + 2 nb), of the states per s, and pu   rates; currents, at the places of the voltages
    volt: np.ndarray  # (nb), complex, pu   the voltages in s
    current: np.ndarray  # (nb), complex, pu   the currents in f
    solve: Iteration
    part: Part
    watch: Watch
    loop: Loop
    newton: np.ndarray  # (2), int   addresses of Newton's method and its arguments, 0: not prepared
    orders: np.ndarray  # (2, held)   values of `Places.held` before a decision, and from the next jump on
    late: np.ndarray  # (1), s   from a timed verdict to the end of its step; -1 until the first step after an event
    notes: np.ndarray  # (14), int   see `Note`


def buffers(s: np.ndarray, layout: "Layout", places: "Places") -> Run:
    """Buffers of a run that starts at s."""
    nx, nb, m, zeros = layout.nx, layout.buses, len(places.rotor), np.zeros
    s, f = s.copy(), zeros(layout.first_setpoint)
    near = zeros((2, STAGES, len(places.near_bus)), complex)
    solve = Iteration(zeros(nb, complex), zeros(nb, complex), zeros(nb, complex), zeros(nb, complex), near)
    part = Part(zeros(nx), zeros(nx), zeros(nx), zeros(nx), zeros((3, nb), complex))
    angles, turned = zeros((2, m)), zeros((2, m))
    angles[0], turned[0] = s[places.rotor], s[places.speed]
    low, turns = zeros((2, len(places.watch_bus))), zeros((2, len(places.order)))
    spent, off = zeros(len(places.other)), zeros((3, m + len(places.other)))
    watch = Watch(angles, turned, s[places.other], spent, off, low, turns, zeros((4, nb)))
    n = len(places.order) if places.inertial else 0
    loop = Loop(zeros((n, n)), zeros((n, n + 1)), zeros((2, n)), np.zeros(1, np.int64))
    late, notes = np.full(1, -1.0), zeros(len(NOTE), np.int64)
    volt, current = s[layout.voltages].view(complex), f[layout.voltages].view(complex)
    orders = zeros((2, len(places.held)))
    return Run(s, f, volt, current, solve, part, watch, loop, zeros(2, np.int64), orders, late, notes)

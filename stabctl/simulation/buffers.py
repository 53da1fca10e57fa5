"""What a run remembers: signals, work space, and what the criterion has seen. The arrays are made once and reused.

nx states, nb buses, m rotor units; the iterated buses are those in `Places.near_bus`.
"""

from typing import NamedTuple

import numpy as np

from stabctl.dynamics.layout import Layout

from .method import STAGES
from .places import Places


class Note(NamedTuple):
    """Places in `Run.notes`."""

    bus: int = 0  # row of the bus that a verdict names
    rotor: int = 1  # row of the rotor unit, or of the angle without weight, that it names
    divided: int = 2  # how many steps in a row were divided, at most `CHATTER`


NOTE = Note()  # a record, because machine code is found again by functions and records, not by single numbers


class Iteration(NamedTuple):
    """Work space of the bus voltages."""

    work: np.ndarray  # (nb), complex   of the substitution
    source: np.ndarray  # (nb), complex, pu   currents of the voltage sources
    begun: np.ndarray  # (nb), complex   forward substitution of these currents, where each iteration starts
    before: np.ndarray  # (nb), complex, pu   voltages at the previous stage
    moves: (
        np.ndarray
    )  # (2, stages, iterated buses), complex, pu   their changes from stage to stage in the last two steps


class Step(NamedTuple):
    """One part of a step: what the stages start from, and what the instants within it are interpolated from."""

    x: np.ndarray  # (nx)   states at its beginning
    rate: np.ndarray  # (nx), 1/s   rates at its beginning
    total: np.ndarray  # (nx)   x and the weighted rates so far; at last the states at its end
    end: np.ndarray  # (nx)   states at its end, while instants within it are tried
    volts: np.ndarray  # (3, nb), complex, pu   voltages at its beginning, in the middle, and at its end


class Watch(NamedTuple):
    """What the criterion has seen."""

    angles: np.ndarray  # (2, m), rad   before the first event, and the largest change since, relative to the COI
    turned: np.ndarray  # (2, m), pu and pu/s   speed after the last step, and its mean rate in it; of virtual rotors
    others: np.ndarray  # (angles without weight), rad   before the first event
    off: np.ndarray  # (3, m), s, s and pu   time outside the frequency range, its maximum, and how far outside now
    low: np.ndarray  # (2, loads), s and pu   time below the threshold of the load, and how far below now
    turns: np.ndarray  # (2, storage devices), 1 or -1, and 1/s   side of the last full order, and recent changes of it
    coi: np.ndarray  # (4, nb)   of each island sums of H, H speed, H angle, H acceleration; s times 1, pu, rad, pu/s


class Run(NamedTuple):
    """Everything that changes in a run. The same for every system, so that compiled code has one signature."""

    s: np.ndarray  # (signals)   states, voltages, set-points, outputs, memory
    f: np.ndarray  # (nx + 2 nb), 1/s and pu   rates of the states; currents, at the places of the voltages
    volt: np.ndarray  # (nb), complex, pu   the voltages in s
    current: np.ndarray  # (nb), complex, pu   the currents in f
    solve: Iteration
    step: Step
    watch: Watch
    orders: np.ndarray  # (2, held)   before a decision, and from the next instant of switching on
    late: np.ndarray  # (1), s   by which the end of a step is later than its verdict; -1: no step since the last event
    notes: np.ndarray  # (3), int   see `Note`


class NewtonSpace(NamedTuple):
    """Work space of Newton's method."""

    s: np.ndarray  # (signals), complex   a copy of `Run.s`
    f: np.ndarray  # (nx + 2 nb), complex   a copy of `Run.f`
    new: np.ndarray  # (nb), complex, pu   voltages


def buffers(s: np.ndarray, layout: Layout, places: Places) -> Run:
    """Buffers of a run that starts at s."""
    nx, nb, m, zeros = layout.nx, layout.buses, len(places.rotor), np.zeros
    s, f = s.copy(), zeros(layout.first_setpoint)
    near = zeros((2, STAGES, len(places.near_bus)), complex)
    solve = Iteration(zeros(nb, complex), zeros(nb, complex), zeros(nb, complex), zeros(nb, complex), near)
    step = Step(zeros(nx), zeros(nx), zeros(nx), zeros(nx), zeros((3, nb), complex))
    angles, turned = zeros((2, m)), zeros((2, m))
    angles[0], turned[0] = s[places.rotor], s[places.speed]
    low, turns = zeros((2, len(places.watch_bus))), zeros((2, len(places.order)))
    watch = Watch(angles, turned, s[places.other], zeros((3, m)), low, turns, zeros((4, nb)))
    late, notes = np.full(1, -1.0), zeros(3, np.int64)
    volt, current = s[layout.voltages].view(complex), f[layout.voltages].view(complex)
    return Run(s, f, volt, current, solve, step, watch, zeros((2, len(places.held))), late, notes)


def newton_space(run: Run) -> NewtonSpace:
    """Work space of Newton's method for the buffers of a run."""
    return NewtonSpace(run.s.astype(complex), run.f.astype(complex), np.zeros_like(run.volt))

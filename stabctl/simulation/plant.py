"""What the stepper itself reads, as places in the signal vector s, and the buffers of one run.

The stepper works on places only; it knows no device and no control law.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stabctl.dynamics.assembly import System
from stabctl.dynamics.layout import Layout

from .substitution import Factors


class Net(NamedTuple):
    """The network between two events."""

    factors: Factors
    island: np.ndarray  # (units) island of each unit, -1 if it is tripped or blacked out
    island_at: np.ndarray  # (buses) island of each bus, -1 if it has no unit or is blacked out
    alive: np.ndarray  # (buses) whether its island has a voltage source
    faulted: bool  # a fault is on, so low voltages are ignored


class Relative(NamedTuple):
    """Places of the signals that laws read: of every rotor unit against the COI of the others in its island."""

    speed: int  # pu   of its group
    acceleration: int  # pu/s
    angle: int  # rad   less the initial value
    online: int  # of every unit, 1 if it is on
    time: int  # s   at the start of the step; then the bits of the frames that are due

    @property
    def due(self) -> int:
        """Place of the bits of the frames that are due."""
        return self.time + 1

    @property
    def end(self) -> int:
        """Place after the last."""
        return self.time + 2


class Frame(NamedTuple):
    """Places and constants that the stepper itself reads. The type is the same for every system."""

    places: np.ndarray  # (3) of the voltages, of the time step, of the signals in `Relative`
    rotor: np.ndarray  # (rotor units) places of the angles
    speed: np.ndarray  # (rotor units) places of the speeds; a state, or an output of a virtual rotor
    unit: np.ndarray  # (rotor units) rows of their units
    inertia: np.ndarray  # (rotor units) s
    weight: np.ndarray  # (rotor units) s   in the center of inertia that the criterion judges against
    other: np.ndarray  # places of the angles without weight: of phase-locked loops, and of grid-forming storage
    other_unit: np.ndarray  # rows of their units, -1: storage
    other_bus: np.ndarray  # rows of their buses
    first: np.ndarray  # (rotor units + 1) where the group of each begins in `member`
    member: np.ndarray  # rotor units of the groups, one group after the other
    owner: np.ndarray  # (size of s) row of the unit that owns the signal, -1: none
    limited: np.ndarray  # places of the states with non-windup limits
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray  # places of the signals that multiply the limits
    draw_bus: np.ndarray  # rows of the buses with voltage-dependent currents
    near_bus: np.ndarray  # the same, and the remote buses whose voltages these currents depend on
    watch_bus: np.ndarray  # rows of the buses with loads
    watch_low: np.ndarray  # pu   voltages below which a load counts as lost
    held: np.ndarray  # places that sampled devices write: the orders
    order: np.ndarray  # (storage devices) places that they read their orders from, in the order of the case's table
    stops: np.ndarray  # rows of `limited` at whose limits a power jumps
    gated: bool  # some of these are gates, which read outputs
    relay: bool  # the orders switch between fixed values, at instants to be found within a step
    follows: bool  # the orders follow the signals at every stage of a step; otherwise they are held over a step


class Space(NamedTuple):
    """Buffers and work space of one run. `volt` and `current` are complex views of the voltages in s and f."""

    s: np.ndarray
    f: np.ndarray
    volt: np.ndarray
    current: np.ndarray
    work: np.ndarray
    source: np.ndarray
    begun: np.ndarray  # (buses) the part of the forward substitution that is not iterated
    kept: np.ndarray  # (buses) iterated voltages at the previous stage
    moves: np.ndarray  # (2, 4, near buses) their changes at each stage of the two previous steps
    x0: np.ndarray
    sum: np.ndarray
    rate: np.ndarray  # (states) 1/s   at the start of the step
    end: np.ndarray  # states at the end of the step
    volts: np.ndarray  # (3, buses) at the start, middle and end of the step
    part: np.ndarray  # (3) where the present part of a step begins and ends; where volts[1] are in it (fractions)
    angles: (
        np.ndarray
    )  # (2, rotor units) rad   before the first event, and the largest change relative to the COI so far
    turned: np.ndarray  # (2, rotor units) pu, pu/s   speed after the last step, and its mean rate in that step
    others: np.ndarray  # (angles without weight) rad   before the first event
    off: np.ndarray  # (3, rotor units) s, s, pu   time that their island has been outside the frequency range, its
    # maximum, and how far it is outside
    low: np.ndarray  # (2, loads) s, pu   time below the threshold, and how far below it is
    over: np.ndarray  # (1) s   time from a timed verdict to the end of its step; -1 after an event
    turns: np.ndarray  # (2, storage devices) side of the last full order, 1 or -1; 1/s   recent changes of it
    orders: np.ndarray  # (2, held) before a decision, and after the next instant of switching
    coi: np.ndarray  # (4, buses) inertia, speed, angle and acceleration of the islands
    marks: np.ndarray  # critical bus and rotor unit, or angle without weight; step, stage, what is known and parts when
    # Newton was requested; row of `limited` at which a device stopped, -1 if none; steps in a row with switching


class NewtonSpace(NamedTuple):
    """Work space of Newton's method: complex copies of s and f, and voltages."""

    s: np.ndarray
    f: np.ndarray
    new: np.ndarray


def frame(
    system: System,
    layout: Layout,
    relative: Relative,
    held: np.ndarray,
    order: np.ndarray,
    *,
    groups: Sequence[np.ndarray],
    gated: bool,
    relay: bool,
    follows: bool,
) -> Frame:
    """The places that the stepper reads in a system.

    Parameters
    ----------
    system
        Devices.
    layout
        Layout of the signal vector; it begins with the states and voltages of the system.
    relative
        Places of the signals that laws read.
    held
        Places that sampled devices write.
    order
        Places that the storage devices read their orders from.
    groups
        Rotor units of the group of each rotor unit.
    gated
        Whether some of `held` are gates.
    relay
        Whether they switch between fixed values.
    follows
        Whether they follow the signals at every stage of a step.
    """
    rotors, limits, others = system.rotors, system.limits, system.unweighted
    places = np.array([layout.nx, layout.step, relative.speed], np.int64)
    first = np.cumsum([0, *(len(group) for group in groups)], dtype=np.int64)
    member = np.concatenate([np.zeros(0, np.int64), *groups]).astype(np.int64)
    owner = np.full(layout.size, -1, np.int64)
    owner[: len(layout.owner)] = layout.owner
    return Frame(
        places, rotors.angle, rotors.speed, rotors.unit, rotors.inertia, rotors.inertia,
        others.column("place"), others.column("unit"), others.column("bus"), first, member, owner,
        limits.state, limits.low, limits.high, limits.scale,
        system.draw_bus, system.near_bus, system.watch_bus, system.watch_low, held.astype(np.int64), order,
        limits.stops, gated, relay, follows,
    )  # fmt: skip


def with_ratings(made: Frame, system: System, relay: bool, follows: bool) -> Frame:
    """The frame for a system with other ratings, and thus other limits; without a rating no angle is judged."""
    limits, others = system.limits, system.unweighted
    place, unit, bus = (others.column(name) for name in ("place", "unit", "bus"))
    return made._replace(
        low=limits.low, high=limits.high, relay=relay, follows=follows, other=place, other_unit=unit, other_bus=bus
    )  # fmt: skip


def space(s: np.ndarray, layout: Layout, a: Frame) -> Space:
    """Buffers of a run that starts at s."""
    nx, nb, m = layout.nx, layout.buses, len(a.rotor)
    s, f = s.copy(), np.zeros(layout.first_setpoint)
    blank = np.zeros((4, nb), complex)
    return Space(
        s, f, s[layout.voltages].view(complex), f[layout.voltages].view(complex),
        blank[0].copy(), blank[1].copy(), blank[2].copy(), blank[3].copy(),
        np.zeros((2, 4, len(a.near_bus)), complex),
        np.zeros(nx), np.zeros(nx), np.zeros(nx), np.zeros(nx), np.zeros((3, nb), complex), np.array([0.0, 1.0, 0.5]),
        np.stack([s[a.rotor], np.zeros(m)]), np.stack([s[a.speed], np.zeros(m)]), s[a.other], np.zeros((3, m)),
        np.zeros((2, len(a.watch_bus))), np.full(1, -1.0), np.zeros((2, len(a.order))), np.zeros((2, len(a.held))),
        np.zeros((4, nb)), np.zeros(8, np.int64),
    )  # fmt: skip


def newton_space(q: Space) -> NewtonSpace:
    """Work space of Newton's method for the buffers of a run."""
    return NewtonSpace(q.s.astype(complex), q.f.astype(complex), np.zeros_like(q.volt))

"""What the stepper itself reads: the network between two events, and places in the signal vector s.

The stepper works on places only; it knows no device and no control law.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.words import record
from stabctl.dynamics.assembly import System
from stabctl.dynamics.layout import Layout

from ._substitution import Factors


@record
class Net(NamedTuple):
    """The network between two events."""

    factors: Factors
    island: np.ndarray  # (units) island of each unit, -1 if it is tripped or blacked out
    island_at: np.ndarray  # (buses) island of each bus, -1 if it is blacked out
    islands: int  # how many have a voltage source
    alive: np.ndarray  # (buses) whether its island has a voltage source
    faulted: bool  # a fault is on, so low voltages are ignored
    whole: bool  # every unit is on


class Relative(NamedTuple):
    """First places of the signals that laws read: of every rotor unit, against the COI of the others in its island."""

    speed: int  # pu   of its group
    acceleration: int  # pu/s
    angle: int  # rad   less the initial value
    online: int  # of every unit, 1 if it is on
    time: int  # s   at the start of the step; its place alone, and the next is `due`

    @property
    def due(self) -> int:
        """Place of the bits of the frames that are due."""
        return self.time + 1

    @property
    def end(self) -> int:
        """Place after the last."""
        return self.time + 2


@record
class Places(NamedTuple):
    """Places and constants that the stepper itself reads. The type is the same for every system."""

    voltages: int  # the first voltage
    elapsed: int  # the time over which orders have moved, s
    seen: Relative  # signals that laws read
    rotor: np.ndarray  # (rotor units) the angles
    speed: np.ndarray  # (rotor units) the speeds: states, or outputs of virtual rotors
    unit: np.ndarray  # (rotor units) rows of their units
    inertia: np.ndarray  # (rotor units) s
    weight: np.ndarray  # (rotor units) s   in the center of inertia that the criterion judges against
    judged: np.ndarray  # (rotor units) whether the frequency of its island is
    other: np.ndarray  # (angles without weight) of phase-locked loops, and of grid-forming storage
    other_unit: np.ndarray  # (angles without weight) rows of their units, -1: storage
    other_bus: np.ndarray  # (angles without weight) rows of their buses
    other_speed: np.ndarray  # (angles without weight) their frequencies, -1: none
    other_weight: np.ndarray  # (angles without weight) s   in the center of inertia of an island without rotors, else 0
    other_energy: np.ndarray  # (angles without weight) energies of storage
    other_ip: np.ndarray  # (angles without weight) active currents that it delivers
    other_low: np.ndarray  # (angles without weight) pu s   energies when empty
    other_high: np.ndarray  # (angles without weight) pu s   energies when full
    first: np.ndarray  # (rotor units + 1) where the group of each begins in `member`
    member: np.ndarray  # (members of all groups) rotor units of the groups, one group after the other
    owner: np.ndarray  # (signals) row of the unit that owns the signal, -1: none
    limited: np.ndarray  # (limits) states with non-windup limits
    low: np.ndarray  # (limits) their limits, in the unit of the state over that of `scale`
    high: np.ndarray  # (limits)
    scale: np.ndarray  # (limits) signals that multiply the limits
    draw_bus: np.ndarray  # (drawing buses) rows of the buses with voltage-dependent currents
    near_bus: np.ndarray  # (iterated buses) the same, and remote buses whose voltages these currents depend on
    watch_bus: np.ndarray  # (loads and terminals of links) rows of their buses
    watch_low: np.ndarray  # (loads and terminals of links) pu   voltages below which they count as lost, 0: blocked
    held: np.ndarray  # (held) what laws and gates write: orders, then whether a gate is open; constant over a part
    acting: np.ndarray  # rows of `held` that change a power: gates, and orders of devices with a rating
    order: np.ndarray  # (storage devices) what they read their orders from, in the order of the case's table
    begun: int  # the first order at the beginning of the step, or of its part; then come those wanted there
    wanted: np.ndarray  # (storage devices) orders that the law wants
    own: np.ndarray  # (storage devices) rotor units whose signals their orders follow, -1: none
    stops: np.ndarray  # (stops) rows of `limited` at whose limits a power jumps
    gated: bool  # some of `held` are gates, which read outputs
    relay: bool  # the orders switch between fixed values, at instants to be found within a step
    follows: bool  # the orders follow the signals at every stage of a step; otherwise they are held over a step
    inertial: bool  # they follow the accelerations that they cause
    abrupt: bool  # they may jump while they follow the signals


def places(
    system: System,
    layout: Layout,
    seen: Relative,
    held: np.ndarray,
    order: np.ndarray,
    *,
    acting: np.ndarray,
    begun: int,
    wanted: np.ndarray,
    own: np.ndarray,
    groups: Sequence[np.ndarray],
    gated: bool,
    relay: bool,
    follows: bool,
    inertial: bool,
    abrupt: bool,
) -> Places:
    """The places that the stepper reads in a system.

    Parameters
    ----------
    system
        Devices.
    layout
        Layout of the signal vector; it begins with the states and voltages of the system.
    seen
        Places of the signals that laws read.
    held
        Places that laws and gates write.
    order
        Places that the storage devices read their orders from.
    acting
        Rows of `held` that change a power.
    begun
        First place of the orders at the beginning of a step, and of those wanted there.
    wanted
        Places of the orders that the law wants.
    own
        Rotor unit of each storage device, -1: none.
    groups
        Rotor units of the group of each rotor unit.
    gated
        Whether some of `held` are gates.
    relay
        Whether they switch between fixed values.
    follows
        Whether they follow the signals at every stage of a step.
    inertial
        Whether they follow the accelerations that they cause.
    abrupt
        Whether they may jump while they follow the signals.
    """
    rotors, limits, watched = system.rotors, system.limits, system.watched
    first = np.cumsum([0, *(len(group) for group in groups)], dtype=np.int64)
    member = np.concatenate([np.zeros(0, np.int64), *groups]).astype(np.int64)
    owner = np.full(layout.size, -1, np.int64)
    owner[: len(layout.owner)] = layout.owner
    return Places(
        layout.nx, layout.step, Relative(*map(int, seen)),
        rotors.angle, rotors.speed, rotors.unit, rotors.inertia, rotors.inertia,
        np.ones(len(rotors.unit), bool), **_others(system), first=first, member=member, owner=owner,
        limited=limits.state, low=limits.low, high=limits.high, scale=limits.scale,
        draw_bus=system.draw_bus, near_bus=system.near_bus,
        watch_bus=np.array([one.bus for one in watched], np.int64),
        watch_low=np.array([one.low for one in watched], float),
        held=held.astype(np.int64), acting=acting, order=order, begun=begun, wanted=wanted, own=own.astype(np.int64),
        stops=limits.stops, gated=gated, relay=relay, follows=follows, inertial=inertial, abrupt=abrupt,
    )  # fmt: skip


def with_ratings(made: Places, system: System, **how: Any) -> Places:
    """The places for a system with other ratings, and thus other limits; without a rating no angle is judged.

    `how` is `acting`, `relay`, `follows`, `inertial` and `abrupt`.
    """
    limits = system.limits
    return made._replace(low=limits.low, high=limits.high, **_others(system), **how)


def _others(system: System) -> dict[str, Any]:
    """The columns of `Places` for the angles without weight."""
    column = system.unweighted.column
    return {
        "other": column("place"),
        "other_unit": column("unit"),
        "other_bus": column("bus"),
        "other_speed": column("frequency"),
        "other_weight": np.zeros(len(column("place"))),
        "other_energy": column("energy"),
        "other_ip": column("current"),
        "other_low": column("floor", float),
        "other_high": column("capacity", float),
    }

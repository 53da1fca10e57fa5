"""What the stepper looks at itself, by place in s, and the buffers of one run.

The stepper knows places only: no device and no control law.
"""

from typing import NamedTuple

import numpy as np

from stabctl.dynamics.assembly import System
from stabctl.dynamics.layout import Layout

from .substitution import Factors


class Net(NamedTuple):
    """The network between two events."""

    factors: Factors
    island: np.ndarray  # (units) its island, -1 once tripped or dead
    alive: np.ndarray  # (buses) has a unit in its island that holds a voltage
    faulted: bool  # a fault is on: low voltages do not count


class Frame(NamedTuple):
    """Places and constants that the stepper itself reads. Its type is the same for every system."""

    places: np.ndarray  # (3) of the voltages, of the step, of the signals against the COI
    rotor: np.ndarray  # (rotor units) places of the angles; the speeds follow
    unit: np.ndarray  # (rotor units) rows of their units
    inertia: np.ndarray  # (rotor units) s
    owner: np.ndarray  # (size of s) row of the unit whose signal it is, -1: none
    limited: np.ndarray  # places of the states that stop at limits
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray  # places of the signals that the limits are per unit of
    draw_bus: np.ndarray  # rows of the buses with currents that depend on their voltage
    near_bus: np.ndarray  # the same, and those whose voltages such currents read from elsewhere
    watch_bus: np.ndarray  # rows of the buses of loads
    watch_low: np.ndarray  # pu   voltages below which they count as lost
    held: np.ndarray  # places that sampled devices write: the orders


class Space(NamedTuple):
    """Buffers and work space of one run. `volt` and `current` are complex views of the voltages in s and f."""

    s: np.ndarray
    f: np.ndarray
    volt: np.ndarray
    current: np.ndarray
    work: np.ndarray
    source: np.ndarray
    begun: np.ndarray  # (buses) the substitution up to what is iterated
    kept: np.ndarray  # (buses) voltages of the stage before
    moves: np.ndarray  # (2, 4, buses) how they moved in each stage of the two steps before
    x0: np.ndarray
    sum: np.ndarray
    angles: np.ndarray  # (2, rotor units) rad   before the first event, and the largest change against the COI so far
    off: np.ndarray  # (2, rotor units) s   how long their island is outside the range of frequency, and at most
    low: np.ndarray  # (loads) s     time below the threshold
    orders: np.ndarray  # (held) before a decision
    coi: np.ndarray  # (4, buses) inertia, speed, acceleration and angle of the islands
    marks: np.ndarray  # bus and rotor unit to blame; step, stage and decided?, where Newton was asked for


class NewtonSpace(NamedTuple):
    """Work space of Newton alone: complex twins of s and f, and voltages."""

    s: np.ndarray
    f: np.ndarray
    new: np.ndarray


def frame(system: System, layout: Layout, deviation: int, held: np.ndarray) -> Frame:
    """The frame of a system whose signals are laid out so.

    Parameters
    ----------
    system
        Devices.
    layout
        Places; the states and voltages are the system's own.
    deviation
        Place of the signals of the rotor units against the COI of the rest, their rates, and whether units are on.
    held
        Places that sampled devices write.
    """
    rotors, limits = system.rotors, system.limits
    places = np.array([layout.nx, layout.step, deviation], np.int64)
    owner = np.full(layout.size, -1, np.int64)
    owner[: len(layout.owner)] = layout.owner
    return Frame(
        places, rotors.angle, rotors.unit, rotors.inertia, owner,
        limits.state, limits.low, limits.high, limits.scale,
        system.draw_bus, system.near_bus, system.watch_bus, system.watch_low, held.astype(np.int64),
    )  # fmt: skip


def space(s: np.ndarray, layout: Layout, a: Frame) -> Space:
    """Buffers of one run that starts at s."""
    nx, nb, m = layout.nx, layout.buses, len(a.rotor)
    s, f = s.copy(), np.zeros(layout.first_setpoint)
    blank = np.zeros((4, nb), complex)
    return Space(
        s, f, s[layout.voltages].view(complex), f[layout.voltages].view(complex),
        blank[0].copy(), blank[1].copy(), blank[2].copy(), blank[3].copy(), np.zeros((2, 4, nb), complex),
        np.zeros(nx), np.zeros(nx), np.stack([s[a.rotor], np.zeros(m)]), np.zeros((2, m)),
        np.zeros(len(a.watch_bus)), np.zeros(len(a.held)), np.zeros((4, nb)),
        np.zeros(5, np.int64),
    )  # fmt: skip


def newton_space(q: Space) -> NewtonSpace:
    """Work space of Newton for the buffers of a run."""
    return NewtonSpace(q.s.astype(complex), q.f.astype(complex), np.zeros_like(q.volt))

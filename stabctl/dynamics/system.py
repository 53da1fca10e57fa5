"""Who feeds whom: the only file that wires devices to buses and to each other.

Every number that may change lives in one flat buffer z = [states | v | field | power | order]; `Signals` are named
views of it, and `Rates` are views of the answer f = [state rates | g], g the injected currents.
"""

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from stabctl._util.jit import inline
from stabctl.devices.blocks import copy
from stabctl.devices.exciters import exdc2, exst3, sexs
from stabctl.devices.governors import tgov
from stabctl.devices.loads import zip_load
from stabctl.devices.machines import gencls, genrou, stator
from stabctl.devices.stabilizers import pss
from stabctl.devices.storage import esd

FAMILIES = (gencls, genrou, sexs, exst3, exdc2, pss, tgov, esd)  # those with states, in the order of z
NAMES = tuple("storage" if k is esd else k.__name__.rpartition(".")[2] for k in FAMILIES)


# Parameters (record arrays) and places (index arrays) of every device:
# <family>, <family>_machine   constants, and the row of the machine they belong to
# storage_bus, load_bus, machine_bus   rows of the buses they stand at
# load, law     constants of loads (models.load.Par) and of the storage controllers (controllers.signals.Par)
# load_slot, storage_slot   entries of draw_bus, the distinct buses of loads and storage
# owner         row of the machine of every state but those of the storage, which outlasts its machine
# rotor         place of each machine's angle in z; its speed follows
# inertia       H on the system base, s
# held, held_low, held_high   places and limits of the states that stop at limits
# moving, moving_low, moving_high, moving_machine   the same for limits per unit of a machine's terminal voltage
Plant = namedtuple(
    "Plant",
    (
        *(part for name in NAMES for part in (name, f"{name}_machine")),
        *("storage_bus", "law", "load", "load_bus", "draw_bus", "load_slot", "storage_slot", "machine_bus"),
        *("owner", "rotor", "inertia", "held", "held_low", "held_high"),
        *("moving", "moving_low", "moving_high", "moving_machine"),
    ),
)

# Named views of z, a record per device of a family; then
# v      (buses, 2)   voltage, real and imaginary part, pu
# field  (machines)   exciter reference; field voltage or E' where there is no exciter, pu
# power  (machines)   governor reference; mechanical power where there is no governor, pu
# order  (storage)    share of the rating to absorb
Signals = namedtuple("Signals", ("z", *NAMES, "v", "field", "power", "order"))

# Views of f: a row of state rates per device of a family, and g (buses, 2), the injected currents.
Rates = namedtuple("Rates", (*NAMES, "g"))


class Wires(NamedTuple):
    """What devices tell each other within one sweep, one entry per machine (per storage device for the last)."""

    vs: np.ndarray
    efd: np.ndarray
    pm: np.ndarray
    stator: np.ndarray  # stator.Output, to read
    stator_row: np.ndarray  # the same memory, to write
    absorbed: np.ndarray  # pu   power of the storage devices


class Buffers(NamedTuple):
    """One flat vector and its answer, with their views."""

    z: np.ndarray
    s: Signals
    f: np.ndarray
    r: Rates
    w: Wires


class Sizes(NamedTuple):
    """Numbers of states, of voltage components, of machines and of storage devices."""

    states: int
    voltages: int
    machines: int
    storage: int


def sizes(plant: Plant, buses: int) -> Sizes:
    """Lengths of the parts of z."""
    states = sum(len(getattr(plant, name)) * len(k.State._fields) for name, k in zip(NAMES, FAMILIES, strict=True))
    return Sizes(states, 2 * buses, len(plant.machine_bus), len(plant.storage))


def first_state(plant: Plant, family: str) -> int:
    """Place in z of the first state of a family."""
    before = zip(NAMES[: NAMES.index(family)], FAMILIES, strict=False)
    return sum(len(getattr(plant, name)) * len(k.State._fields) for name, k in before)


def records(kind: type, n: int, scalar: type = float) -> np.ndarray:
    """`n` zeroed records of `kind`."""
    return np.zeros(n, np.dtype([(name, scalar) for name in kind._fields])).view(np.recarray)


def buffers(plant: Plant, buses: int, scalar: type = float) -> Buffers:
    """Zeroed buffers; the one place that decides the layout of z and f."""
    n = sizes(plant, buses)
    nv, m = n.states + n.voltages, n.machines
    z, f = np.zeros(nv + 2 * m + n.storage, scalar), np.zeros(nv, scalar)
    states, rows, at = [], [], 0
    for name, k in zip(NAMES, FAMILIES, strict=True):
        count, width = len(getattr(plant, name)), len(k.State._fields)
        part = slice(at, at + count * width)
        states.append(z[part].view([(field, z.dtype) for field in k.State._fields]).view(np.recarray))
        rows.append(f[part].reshape(count, width))
        at += count * width
    v, g = z[n.states : nv].reshape(buses, 2), f[n.states :].reshape(buses, 2)
    s = Signals(z, *states, v, z[nv : nv + m], z[nv + m : nv + 2 * m], z[nv + 2 * m :])
    shown = records(stator.Output, m, scalar)
    w = Wires(*np.zeros((3, m), scalar), shown, shown.view(scalar).reshape(m, -1), np.zeros(n.storage, scalar))
    return Buffers(z, s, f, Rates(*rows, g), w)


@inline
def sources(s, plant, on, g):
    """Injections that depend on states only: the Norton currents of the machines that are on."""
    for b in range(len(g)):
        g[b, 0] = g[b, 1] = 0
    for j in range(len(plant.gencls)):
        i = plant.gencls_machine[j]
        if on[i] >= 0:
            re, im = gencls.norton(s.gencls[j], s.field[i], plant.gencls[j])
            g[plant.machine_bus[i], 0] += re
            g[plant.machine_bus[i], 1] += im
    for j in range(len(plant.genrou)):
        i = plant.genrou_machine[j]
        if on[i] >= 0:
            re, im = genrou.norton(s.genrou[j], s.field[i], plant.genrou[j])
            g[plant.machine_bus[i], 0] += re
            g[plant.machine_bus[i], 1] += im


@inline
def draws(s, plant, g):
    """Adds the injections that depend on the voltages: loads and storage."""
    for j in range(len(plant.load)):
        b = plant.load_bus[j]
        re, im = zip_load.output(s.v[b], plant.load[j])
        g[b, 0] += re
        g[b, 1] += im
    for j in range(len(plant.storage)):
        if s.order[j] != 0 or s.storage[j].share != 0:
            b = plant.storage_bus[j]
            y = esd.output(s.storage[j], s.order[j], s.v[b], plant.storage[j])
            g[b, 0] += y.re
            g[b, 1] += y.im


@inline
def rates(s, plant, w, r):
    """State rates of every device at the voltages s.v."""
    copy(s.field, w.efd)
    copy(s.power, w.pm)
    for j in range(len(plant.gencls)):
        i = plant.gencls_machine[j]
        v = s.v[plant.machine_bus[i]]
        copy(gencls.output(s.gencls[j], s.field[i], v, plant.gencls[j]), w.stator_row[i])
    for j in range(len(plant.genrou)):
        i = plant.genrou_machine[j]
        v = s.v[plant.machine_bus[i]]
        copy(genrou.output(s.genrou[j], s.field[i], v, plant.genrou[j]), w.stator_row[i])
    for i in range(len(w.vs)):
        w.vs[i] = 0
    for j in range(len(plant.pss)):
        i = plant.pss_machine[j]
        x, p, u = s.pss[j], plant.pss[j], pss.Input(s.z[plant.rotor[i] + 1])
        y = pss.output(x, u, p)
        copy(pss.flow(x, u, y, p), r.pss[j])
        w.vs[i] = y
    for j in range(len(plant.sexs)):
        i = plant.sexs_machine[j]
        x, p, u = s.sexs[j], plant.sexs[j], sexs.Input(s.field[i], w.vs[i], w.stator[i].vt, w.stator[i].ve)
        y = sexs.output(x, u, p)
        copy(sexs.flow(x, u, y, p), r.sexs[j])
        w.efd[i] = y
    for j in range(len(plant.exst3)):
        i = plant.exst3_machine[j]
        x, p, u = s.exst3[j], plant.exst3[j], exst3.Input(s.field[i], w.vs[i], w.stator[i].vt, w.stator[i].ve)
        y = exst3.output(x, u, p)
        copy(exst3.flow(x, u, y, p), r.exst3[j])
        w.efd[i] = y
    for j in range(len(plant.exdc2)):
        i = plant.exdc2_machine[j]
        x, p, u = s.exdc2[j], plant.exdc2[j], exdc2.Input(s.field[i], w.vs[i], w.stator[i].vt, w.stator[i].ve)
        y = exdc2.output(x, u, p)
        copy(exdc2.flow(x, u, y, p), r.exdc2[j])
        w.efd[i] = y
    for j in range(len(plant.tgov)):
        i = plant.tgov_machine[j]
        x, p, u = s.tgov[j], plant.tgov[j], tgov.Input(s.power[i], s.z[plant.rotor[i] + 1])
        y = tgov.output(x, u, p)
        copy(tgov.flow(x, u, y, p), r.tgov[j])
        w.pm[i] = y
    for j in range(len(plant.gencls)):
        i = plant.gencls_machine[j]
        u = stator.Input(w.efd[i], w.pm[i])
        copy(gencls.flow(s.gencls[j], u, w.stator[i], plant.gencls[j]), r.gencls[j])
    for j in range(len(plant.genrou)):
        i = plant.genrou_machine[j]
        u = stator.Input(w.efd[i], w.pm[i])
        copy(genrou.flow(s.genrou[j], u, w.stator[i], plant.genrou[j]), r.genrou[j])
    for j in range(len(plant.storage)):
        x, p = s.storage[j], plant.storage[j]
        y = esd.output(x, s.order[j], s.v[plant.storage_bus[j]], p)
        copy(esd.flow(x, s.order[j], y, p), r.storage[j])
        w.absorbed[j] = y.P


@inline
def hold(z, f, plant, w):
    """Stops the states that rest at a limit (non-windup)."""
    for k in range(len(plant.held)):
        i = plant.held[k]
        if (z[i].real >= plant.held_high[k] and f[i].real > 0) or (z[i].real <= plant.held_low[k] and f[i].real < 0):
            f[i] = 0
    for k in range(len(plant.moving)):
        i, v = plant.moving[k], w.stator[plant.moving_machine[k]].vt
        low, high = plant.moving_low[k] * v, plant.moving_high[k] * v
        if (z[i].real >= high.real and f[i].real > 0) or (z[i].real <= low.real and f[i].real < 0):
            f[i] = 0


@inline
def confine(z, plant, w):
    """Brings the states that stop at limits back to them."""
    for k in range(len(plant.held)):
        i = plant.held[k]
        z[i] = min(max(z[i], plant.held_low[k]), plant.held_high[k])
    for k in range(len(plant.moving)):
        i, v = plant.moving[k], w.stator[plant.moving_machine[k]].vt
        z[i] = min(max(z[i], plant.moving_low[k] * v), plant.moving_high[k] * v)

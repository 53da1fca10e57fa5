"""The compiled loop: RK4 on the states at a fixed step, network voltages by substitution, orders once per step."""

from typing import NamedTuple

import numpy as np

from stabctl._util.jit import entry, inline, noinline
from stabctl.controllers import laws
from stabctl.controllers.signals import Seen
from stabctl.devices.blocks import copy, magnitude
from stabctl.dynamics import system
from stabctl.dynamics.system import Buffers, Plant

from .substitution import Factors, solve_apart
from .voltages import FAILED, settle

DONE, SLIPPED, NO_VOLTAGE, LOW_VOLTAGE, RUNAWAY = range(5)


class Net(NamedTuple):
    """The network between two events."""

    factors: Factors
    island: np.ndarray  # (machines) its island, -1 once tripped or dead
    alive: np.ndarray  # (buses) has a machine in its island
    faulted: bool  # a fault is on: low voltages do not count


class Scratch(NamedTuple):
    """Work space of one run. `volt` and `current` are complex views of b.s.v and b.r.g."""

    volt: np.ndarray
    current: np.ndarray
    new: np.ndarray
    work: np.ndarray
    source: np.ndarray
    seen: np.ndarray  # (buses that draw) voltages before an iteration
    past: np.ndarray
    kept: np.ndarray
    x0: np.ndarray
    sum: np.ndarray
    angle0: np.ndarray  # (machines) rad   angles before the first event
    peak: np.ndarray  # (machines) rad   largest change of angle against the COI so far
    low: np.ndarray  # (loads) s     time below the threshold
    wish: np.ndarray  # (storage)    orders wanted by a controller outside the loop
    weight: np.ndarray  # (machines) inertia, speed, acceleration and angle of the islands
    fast: np.ndarray
    rate: np.ndarray
    turn: np.ndarray
    bus: np.ndarray  # (1) bus to blame
    rotor: np.ndarray  # (1) machine to blame


def scratch(b: Buffers, plant: Plant) -> Scratch:
    """Work space for the buffers of one run, at its start."""
    n, nx, m = len(b.s.v), len(b.f) - b.r.g.size, len(plant.machine_bus)
    volt, current = b.s.v.reshape(-1).view(complex), b.r.g.reshape(-1).view(complex)
    blank = np.zeros((6, n), complex)
    return Scratch(
        volt, current, *(row.copy() for row in blank), np.zeros(nx), np.zeros(nx), b.z[plant.rotor].copy(), np.zeros(m),
        np.zeros(len(plant.load)), np.zeros(len(plant.storage)), *np.zeros((4, m)), np.zeros(1, int), np.zeros(1, int)
    )  # fmt: skip


@inline
def extrapolate(v, past):
    """Guess of v half a step ahead, from its value and the one half a step ago."""
    for i in range(len(v)):
        now = v[i]
        v[i] = 2 * now - past[i]
        past[i] = now


@noinline
def center(b, plant, net, q):
    """Sums of inertia and of inertia times speed, acceleration and angle change, per island."""
    for k in range(len(q.weight)):
        q.weight[k] = q.fast[k] = q.rate[k] = q.turn[k] = 0.0
    for i in range(len(plant.rotor)):
        k, h, at = net.island[i], plant.inertia[i], plant.rotor[i]
        if k >= 0:
            q.weight[k] += h
            q.fast[k] += h * b.z[at + 1]
            q.rate[k] += h * b.f[at + 1]
            q.turn[k] += h * (b.z[at] - q.angle0[i])


@noinline
def decide(b, plant, net, q, h):
    """New orders of the storage devices, each against the rest of its machine's island; has one changed?"""
    changed = False
    for j in range(len(plant.storage)):
        i = plant.storage_machine[j]
        k, own, at = net.island[i], plant.inertia[i], plant.rotor[i]
        wanted = q.wish[j] if k >= 0 and plant.law[j].kind == laws.OUTSIDE else 0.0
        if k >= 0 and q.weight[k] > own:
            rest = q.weight[k] - own
            v = b.s.v[plant.storage_bus[j]]
            seen = Seen(
                b.z[at + 1] - (q.fast[k] - own * b.z[at + 1]) / rest,
                b.f[at + 1] - (q.rate[k] - own * b.f[at + 1]) / rest,
                magnitude(v[0], v[1]),
            )
            wanted = laws.order(seen, plant.law[j], q.wish[j])
        wanted = min(max(wanted, -1.0), 1.0)
        reach = plant.storage[j].ramp * h
        now = b.s.order[j]
        if plant.storage[j].ramp > 0:
            wanted = min(max(wanted, now - reach), now + reach)
        changed |= wanted != now
        b.s.order[j] = wanted
    return changed


@noinline
def judge(b, plant, net, q, criterion, h):
    """Has a machine lost synchronism or run away, or a load lost its voltage? Keeps the peaks."""
    verdict, worst = DONE, 0.0
    center(b, plant, net, q)
    for i in range(len(plant.rotor)):
        k, at = net.island[i], plant.rotor[i]
        if k < 0:
            continue
        move = abs(b.z[at] - q.angle0[i] - q.turn[k] / q.weight[k])
        if move > q.peak[i]:
            q.peak[i] = move
        if not move < criterion.max_angle and not move <= worst:
            verdict, worst, q.rotor[0] = SLIPPED, move, i
        if verdict == DONE and not criterion.slowest < b.z[at + 1] < criterion.fastest:
            verdict, q.rotor[0] = RUNAWAY, i
    if verdict == DONE and criterion.low_voltage_s > 0 and not net.faulted:
        for j in range(len(plant.load)):
            v = b.s.v[plant.load_bus[j]]
            low = v[0] * v[0] + v[1] * v[1] < plant.load[j].vlow * plant.load[j].vlow
            q.low[j] = q.low[j] + h if low and net.alive[plant.load_bus[j]] else 0.0
            if q.low[j] > criterion.low_voltage_s:
                verdict, q.bus[0] = LOW_VOLTAGE, plant.load_bus[j]
    return verdict


@noinline
def record(b, net, row):
    """z, then field voltage, mechanical and terminal power of the machines (0 once off), and the storage powers."""
    at, m = len(b.z), len(b.w.efd)
    for k in range(at):
        row[k] = b.z[k]
    for i in range(m):
        on = 1.0 if net.island[i] >= 0 else 0.0
        row[at + i] = on * b.w.efd[i]
        row[at + m + i] = on * b.w.pm[i]
        row[at + 2 * m + i] = on * b.w.stator[i].Pt
    for j in range(len(b.w.absorbed)):
        row[at + 3 * m + j] = b.w.absorbed[j]


@noinline
def freeze(b, plant, net):
    """Stops a machine that is off, with its controls."""
    for k in range(len(plant.owner)):
        if net.island[plant.owner[k]] < 0:
            b.f[k] = 0


@noinline
def from_above(b, plant, net, q):
    """Start the search for voltages from those without draws: of several solutions the loads live on the highest."""
    system.sources(b.s, plant, net.island, b.r.g)
    solve_apart(net.factors, q.current, q.work, q.volt)
    for i in range(len(q.volt)):
        if not net.alive[i]:
            q.volt[i] = 0


@noinline
def sunk(b, plant, net):
    """Is a load near or below its threshold although no fault is on?"""
    if net.faulted:
        return False
    for j in range(len(plant.load)):
        v, edge = b.s.v[plant.load_bus[j]], 1.1 * plant.load[j].vlow
        if v[0] * v[0] + v[1] * v[1] < edge * edge and net.alive[plant.load_bus[j]]:
            return True
    return False


@entry
def advance(b, plant, net, q, criterion, h, steps, last, history):
    """`steps` steps of h seconds on one network; (verdict, steps made).

    Row k of `history` (if it has rows) is the record at the start of step k; with `last`, one more at the end.
    """
    nx = len(q.x0)
    whole = True
    for i in range(len(net.island)):
        whole &= net.island[i] >= 0
    for i in range(len(q.volt)):
        if not net.alive[i]:
            q.volt[i] = 0
    copy(q.volt, q.past)
    for step in range(steps + last):
        if sunk(b, plant, net):
            from_above(b, plant, net, q)
        for stage in range(4):
            if stage == 1 or stage == 3:
                extrapolate(q.volt, q.past)
            copy(q.volt, q.kept)
            decided = stage > 0
            while True:
                n = settle(b, plant, net, q)
                if decided or n == FAILED:
                    break
                decided = True
                copy(b.z, q.x0)
                center(b, plant, net, q)
                if not decide(b, plant, net, q, h):
                    break
            if n == FAILED:
                return NO_VOLTAGE, step
            system.rates(b.s, plant, b.w, b.r)
            system.hold(b.z, b.f, plant, b.w)
            if not whole:
                freeze(b, plant, net)
            if stage == 0 and step < len(history):
                record(b, net, history[step])
            if stage == 0 and step == steps:
                return DONE, steps
            weight = h / 6 if stage == 0 or stage == 3 else h / 3
            reach = h if stage == 2 else h / 2
            for k in range(nx):
                total = weight * b.f[k] + (q.sum[k] if stage else q.x0[k])
                q.sum[k] = total
                b.z[k] = total if stage == 3 else q.x0[k] + reach * b.f[k]
            system.confine(b.z, plant, b.w)
        verdict = judge(b, plant, net, q, criterion, h)
        if verdict != DONE:
            return verdict, step + 1
    return DONE, steps

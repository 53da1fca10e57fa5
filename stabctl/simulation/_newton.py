"""Newton's method for the bus voltages where the fixed-point iteration is slow or fails, called by the compiled loop.

S are the admittances left of the network when the rows that are not iterated are eliminated, c the currents of the
voltage sources, i(v) those that depend on the voltages, D their slopes, and F = v - inv(S) (c + i(v)) is the residual.

    keep      (S - D) v = c + i(v) - D v    D of an earlier instant, as long as v converges quickly
    descend   (S - D) x = S F               D at v; the step -x is halved until F falls
    creep     ((1 + 1/h) S - D) x = S F     implicit Euler steps -x of dv/dt = -F; their length h grows as F falls

`keep` comes first, from the predicted voltages. It is for small changes only: where voltages jump, or a load passes the
kink of its threshold, the fixed-point iteration is tried as in any other network, and then `descend` from the voltages
of the stage before. Where this solution has ended at a kink, `descend` from the voltages without load finds another
one. At last `creep` is used from the voltages before, and from zero, for a load whose voltage collapses has a solution
below its threshold.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from stabctl._util.jit import entry, inline
from stabctl._util.words import record
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import perform

from ._buffers import NOTE
from ._newton_factors import Pattern, eliminate, substitute
from ._substitution import backward, forward, middle, solve_apart
from ._voltages import CLOSE, FAILED, LIMIT, NEAR, TOLERANCE, draw, iterate, square

if TYPE_CHECKING:
    from ._buffers import Run
    from ._places import Places

END = 1e-10  # pu   voltage error at which `keep` ends
SMALL = 1e-8  # pu   first change at which it ends; the error is at most a tenth of it, see `QUICK`
QUICK = 0.1  # of a change, at most left of it in the next one while slopes are kept
RENEWALS = 8  # of the slopes, at one instant
FAR = 0.05  # pu   a change of a voltage that is too large for `keep`
STEPS = 40  # -    of `descend`
SLOW_STEPS = 400  # -    of `creep`
HALVINGS = 12  # -    of a step
LONGEST = 0.2  # pu   change of a voltage in a step of `creep`
SHORTEST = 1e-3  # -    its h
TINY = 1e-30  # complex step


@record
class Newton(NamedTuple):
    """What Newton's method needs on one network, and its work space."""

    calls: np.ndarray  # (calls, 5)   of the devices with voltage-dependent currents, for complex numbers
    s: np.ndarray  # (signals), complex   a copy of `Run.s`
    f: np.ndarray  # (nx + 2 nb), complex   currents, at the places of the voltages
    pattern: Pattern
    slopes: np.ndarray  # (drawing buses, 2), complex, pu   of the currents by Re v and by Im v
    M: np.ndarray  # (entries, 4)   factors of S - D
    v: np.ndarray  # (iterated buses), complex, pu   voltages from which the iteration, or a step, begins
    F: np.ndarray  # (iterated rows), complex, pu   residual
    x: np.ndarray  # (iterated rows, 2), pu   right-hand side, and solution, real and imaginary part
    open: np.ndarray  # (nb), complex, pu   voltages without voltage-dependent currents


def space(calls: np.ndarray, pattern: Pattern, places: "Places", run: "Run") -> Newton:
    """Work space for a network of this pattern."""

    def room(of: np.ndarray, *more: int) -> np.ndarray:
        return np.zeros((len(of), *more), complex)

    rows = pattern.L[1:]
    M, x = np.zeros((len(pattern.S), 4)), np.zeros((len(rows), 2))
    slopes, v, F, open_ = room(places.draw_bus, 2), room(places.near_bus), room(rows), room(run.volt)
    return Newton(calls, room(run.s), room(run.f), pattern, slopes, M, v, F, x, open_)


@entry
def newton(program, places, net, run, of):
    """Solve for the voltages, the sources being substituted forward already; whether they were found is in the notes.

    If not, they are those of the stage before, and the bus with the largest residual is in the notes.
    """
    run.notes[NOTE.newton] += 1
    run.notes[NOTE.found] = 1
    begun = run.notes[NOTE.begun]
    if begun == NEAR:
        if keep(program, places, net, run, of):
            return
        run.notes[NOTE.kept] = 0
    if begun != FAILED and iterate(TOLERANCE, program, places, net, run) < LIMIT:
        return
    run.notes[NOTE.kept] = 0
    for start in range(4):
        begin(start, places, net, run, of)
        if creep(program, places, net, run, of) if start > 1 else descend(program, places, net, run, of):
            return
    begin(0, places, net, run, of)
    run.notes[NOTE.found] = 0


@inline
def begin(start, places, net, run, of):
    """Set the iterated voltages to those of the stage before (0, 2), those without load (1), or zero (3)."""
    if start == 1:
        solve_apart(net.factors, run.solve.source, run.solve.work, of.open)
        forward(net.factors, run.solve.source, run.solve.work)
    for b in places.near_bus:
        run.volt[b] = of.open[b] if start == 1 else 0.0 if start == 3 else run.solve.before[b]


@inline
def keep(program, places, net, run, of):
    """Iterate with slopes kept from one instant to the next; returns whether it ended, if not with v unchanged."""
    F, work, bus = net.factors, run.solve.work, places.near_bus
    first, before, renewals = F.again[0], 0.0, 0
    for i in range(len(bus)):
        of.v[i] = run.volt[bus[i]]
    while True:
        if run.notes[NOTE.kept] == 0:
            if renewals == RENEWALS:
                break
            take_slopes(program, places, net, run, of)
            if not eliminate(of.pattern, 1.0, of.slopes, of.M):
                break
            run.notes[NOTE.kept], before = 1, 0.0
            renewals += 1
        draw(program, places, net, run)
        for j in range(len(places.draw_bus)):
            d = places.draw_bus[j]
            v = run.volt[d]
            work[F.back[d]] -= of.slopes[j, 0] * v.real + of.slopes[j, 1] * v.imag
        for i in range(len(of.x)):
            of.x[i, 0], of.x[i, 1] = work[first + i].real, work[first + i].imag
        substitute(of.pattern, of.M, of.x)
        moved = 0.0
        for b in bus:
            v = solved(b, net, of)
            size = square(v - run.volt[b])
            if not size <= moved:
                moved = size
            run.volt[b] = v
        moved = np.sqrt(moved)
        if not moved < FAR:
            break
        if moved < (END if before > 0 else SMALL) or moved * moved < END * (before - moved):
            for i in range(len(of.x)):
                work[first + i] = of.x[i, 0] + 1j * of.x[i, 1]
            backward(F, work, run.volt)
            return True
        if before > 0 and not moved < QUICK * before:
            run.notes[NOTE.kept] = 0
            if not moved < before:
                break
        before = moved
    for i in range(len(bus)):
        run.volt[bus[i]] = of.v[i]
    return False


@inline
def descend(program, places, net, run, of):
    """Newton steps, halved until the residual falls; returns whether it ends at zero."""
    bus, before = places.near_bus, residual(program, places, net, run, of)
    for _ in range(STEPS):
        if before < CLOSE:
            backward(net.factors, run.solve.work, run.volt)
            return True
        take_slopes(program, places, net, run, of)
        if not solve_for_step(1.0, places, net, run, of) > 0:
            break
        for i in range(len(bus)):
            of.v[i] = run.volt[bus[i]]
        now, scale = np.inf, 1.0
        for _halving in range(HALVINGS):
            for i in range(len(bus)):
                run.volt[bus[i]] = of.v[i] - scale * solved(bus[i], net, of)
            now = residual(program, places, net, run, of)
            if now < before:
                break
            scale *= 0.5
        if not now < before:
            break
        before = now
    return False


@inline
def creep(program, places, net, run, of):
    """Implicit Euler steps of v' = -F; returns whether they end where F is zero."""
    pace, before = 0.3, residual(program, places, net, run, of)
    for _ in range(SLOW_STEPS):
        if before < TOLERANCE:
            backward(net.factors, run.solve.work, run.volt)
            return True
        take_slopes(program, places, net, run, of)
        while not 0 < solve_for_step(1 + 1 / pace, places, net, run, of) < LONGEST:
            pace *= 0.5
            if pace < SHORTEST:
                return False
        for b in places.near_bus:
            run.volt[b] -= solved(b, net, of)
        now = residual(program, places, net, run, of)
        pace = min(max(pace * before / now, 0.05), 1e6)
        before = now
    return False


@inline
def solve_for_step(scale, places, net, run, of):
    """Solve (scale S - D) x = S F; returns the largest change of a voltage, 0 if there are no factors."""
    largest = 0.0
    run.notes[NOTE.kept] = 0
    if not eliminate(of.pattern, scale, of.slopes, of.M):
        return 0.0
    for i in range(len(of.x)):
        of.x[i, 0] = of.x[i, 1] = 0
    for e in range(len(of.pattern.S)):
        more = of.pattern.S[e] * of.F[of.pattern.col[e]]
        of.x[of.pattern.row[e], 0] += more.real
        of.x[of.pattern.row[e], 1] += more.imag
    substitute(of.pattern, of.M, of.x)
    for b in places.near_bus:
        largest = max(largest, square(solved(b, net, of)))
    return np.sqrt(largest)


@inline
def solved(b, net, of):
    """The solution x at a bus."""
    k = net.factors.cols[b] - net.factors.again[0]
    return of.x[k, 0] + 1j * of.x[k, 1]


@inline
def residual(program, places, net, run, of):
    """Fill F in the iterated rows; returns its largest magnitude, whose bus is in the notes."""
    F, highest = net.factors, 0.0
    draw(program, places, net, run)
    middle(F, run.solve.work)
    for b in places.near_bus:
        miss = run.volt[b] - run.solve.work[F.cols[b]]
        of.F[F.cols[b] - F.again[0]] = miss
        size = square(miss)
        if not size <= highest:
            highest, run.notes[NOTE.bus] = size, b
    return np.sqrt(highest)


@inline
def take_slopes(program, places, net, run, of):
    """Slopes of the currents at the present voltages, by complex steps of all real, then all imaginary parts."""
    at = places.voltages
    copy(run.s, of.s)
    for k in range(2):
        for d in places.draw_bus:
            re = at + 2 * d
            of.s[re], of.s[re + 1] = run.s[re], run.s[re + 1]
            of.s[re + k] += 1j * TINY
            of.f[re] = of.f[re + 1] = 0
        perform(of.calls, program.w, program.k, of.s, of.f, net.island)
        for j in range(len(places.draw_bus)):
            re = at + 2 * places.draw_bus[j]
            of.slopes[j, k] = (of.f[re].imag + 1j * of.f[re + 1].imag) / TINY

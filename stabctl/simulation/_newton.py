"""Newton's method for the bus voltages where the fixed-point iteration fails: for few buses dense, for many sparse.

Both make the same steps. With Z, the impedances between the buses with voltage-dependent currents, and D, the slopes of
these currents, the step x of their voltages, whose residual is F, is that of the whole network:

    (1 + s - Z D) x = F    <=>    ((1 + s) Y - D) x = Y F,    F = 0 at the other buses

The factors of Y - D are kept from one instant to the next and used as long as the residual falls quickly with them.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from . import _judgment, _voltages, stepper
from ._buffers import NOTE, dense, newton_space
from ._substitution import OPTIONS, matrix
from ._voltages import HALVINGS, STEPS, TINY, TOLERANCE, currents, solved
from .stepper import Cursor, Plan
from .wired import Wired

NO_ROWS = np.empty((0, 0))
QUICKLY = 0.4  # of the residual, at most left after a step with factors of an earlier instant
CLOSE = 1e-2  # of the tolerance: with kept factors the last step gains less than with Newton's
MANY = 200  # buses with voltage-dependent currents, from which on the sparse method is faster


@dataclass
class Slopes:
    """What is kept of a network: its real matrix, and factors of Y - D at an earlier instant."""

    net: Any = None
    R: Any = None
    factors: Any = None

    def of(self, net: Any) -> "Slopes":
        """For a network; what is kept of another one is dropped."""
        if self.net is not net:
            Y = matrix(net.factors)
            real = sp.kron(Y.real, sp.identity(2)) + sp.kron(Y.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))
            self.net, self.R, self.factors = net, real.tocsc(), None
        return self


def advance(
    wired: Wired, program: Any, places: Any, net: Any, run: Any, rules: Any, plan: Plan,
    history: np.ndarray = NO_ROWS, kept: Slopes | None = None,
) -> tuple[int, int]:  # fmt: skip
    """Steps of the compiled loop, `stepper.advance`, with Newton's method where it asks for it.

    Returns the verdict and the number of steps made.
    """
    at, kept = stepper.START, kept or Slopes()
    while True:
        verdict, at = stepper.advance(program, places, net, run, rules, plan, at, history)
        at = Cursor(*at)
        if verdict != _judgment.NEWTON:
            return verdict, at.step
        if not of_wired(wired, program, places, net, run, kept):
            return _judgment.NO_VOLTAGE, at.step


def of_wired(wired: Wired, program: Any, places: Any, net: Any, run: Any, kept: Slopes) -> bool:
    """The same as `newton`, with the program for complex numbers that is kept with the system."""
    z = wired.for_newton()._replace(k=program.k)
    return newton(z.current, z, places, net, run, newton_space(run), kept=kept)


def newton(calls: Any, program: Any, places: Any, net: Any, run: Any, z: Any, *, kept: Slopes) -> bool:
    """Solve for the voltages by Newton's method; returns whether a solution was found.

    Starts from the present voltages, then from those without load, which finds the solution again where the present
    one ends at the kink of a load; then tries long implicit steps, and finally these from zero voltage.

    Parameters
    ----------
    calls
        Calls of the devices with voltage-dependent currents, for complex numbers.
    program
        The program for complex numbers.
    places, net, run
        Places, network and buffers of the run. On success `run.volt` is the solution; otherwise it is unchanged, and
        the bus with the largest residual is in `run.notes`.
    z
        Work space (`newton_space`).
    kept
        What the calls of a run share.
    """
    before, open_ = run.volt.copy(), np.empty_like(run.volt)
    solved(net.factors, run.solve.source, run.solve.work, open_)
    small = dense(len(places.draw_bus) if len(places.draw_bus) <= MANY else 0)
    for begin, slow in ((before, False), (open_, False), (before, True), (0.0, True)):
        run.volt[:] = begin
        with suppress(np.linalg.LinAlgError):  # singular slopes
            if len(places.draw_bus) > MANY:
                found = sparse(calls, program, places, net, run, z, slow, kept.of(net))
            else:
                found = _voltages.newton_from(calls, program, places, net, run, z, small, slow)
            if found:
                return True
    run.volt[:] = before
    return False


def sparse(calls: Any, program: Any, places: Any, net: Any, run: Any, z: Any, slow: bool, kept: Slopes) -> bool:
    """The same as `voltages.newton_from`, by factors of the whole network."""
    bus, n, R = places.draw_bus, len(places.draw_bus), kept.R
    solved(net.factors, run.solve.source, run.solve.work, z.new)
    open_ = z.new[bus]
    v, out = run.volt[bus].view(float).reshape(n, 2).astype(complex), np.zeros((n, 2), complex)
    step, F, before, pace, fresh = np.zeros((n, 2)), np.zeros(n, complex), np.inf, 0.3, True
    pairs = (2 * bus[:, None] + np.arange(2)).ravel()
    rows, columns = np.repeat(pairs, 2), np.repeat(pairs.reshape(n, 2), 2, axis=0).ravel()
    for _ in range(3 * STEPS if slow else STEPS):
        now, tried, miss = np.inf, v, F
        for halving in range(HALVINGS if fresh else 1):
            tried = (v.real - 0.5**halving * step).astype(complex)
            currents(calls, program, places, net, z, tried, out)
            run.current[:] = 0
            run.current[bus] = out[:, 0].real + 1j * out[:, 1].real
            solved(net.factors, run.current, run.solve.work, z.new)
            miss = tried[:, 0].real + 1j * tried[:, 1].real - open_ - z.new[bus]
            now = np.abs(miss).max()
            if now < before or slow:
                break
        if now < (np.inf if slow else before):
            quick, v, F = now < QUICKLY * before, tried, miss
            if before < np.inf:
                pace = min(max(pace * before / now, 0.05), 1e6)
            before = now
            if now < (TOLERANCE if slow else CLOSE * TOLERANCE):
                run.current[:] += run.solve.source
                solved(net.factors, run.current, run.solve.work, run.volt)
                return True
        elif fresh:
            F = miss
            break
        else:
            quick = False  # a step with earlier factors: repeat it with present ones
        fresh = slow or not quick or kept.factors is None
        if fresh:
            try:
                bent = slopes(calls, program, places, net, z, v, out)
                D = sp.csc_matrix((bent.ravel(), (rows, columns)), shape=R.shape)
                factors = spl.splu((1 + 1 / pace if slow else 1.0) * R - D, **OPTIONS)
            except RuntimeError:
                break
            kept.factors = None if slow else factors
        else:
            factors = kept.factors
        residual = np.zeros(len(run.volt), complex)
        residual[bus] = F
        step = factors.solve(R @ residual.view(float)).reshape(-1, 2)[bus]
    run.notes[NOTE.bus] = bus[int(np.argmax(np.abs(F)))]
    return False


def slopes(calls: Any, program: Any, places: Any, net: Any, z: Any, v: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Slopes of the currents by the voltages of their buses (buses, 2, 2), by complex steps."""
    bent = []
    for k in range(2):
        tried = v.copy()
        tried[:, k] += 1j * TINY
        currents(calls, program, places, net, z, tried, out)
        bent.append(out.imag / TINY)
    return np.stack(bent, axis=2)

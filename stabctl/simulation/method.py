"""The integration method as a table, and what it does with the states: stages, non-windup limits.

Each stage starts from the beginning of the step and follows the rates of the stage before it, as in the methods of Heun
and Kutta (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.1):

    x_(k+1) = x_0 + h f_k / reach_k        x(h) = x_0 + h (f_0 / weight_0 + f_1 / weight_1 + ...)

Stages count from 0. The table has divisors, because h / 6 and h * (1 / 6) differ in the last bit.
"""

from typing import NamedTuple

from stabctl._util.jit import inline, noinline


class Method(NamedTuple):
    """An explicit method."""

    reach_divisor: tuple[float, ...]  # (stages)   the next stage is the step over this away from its beginning
    weight_divisor: tuple[float, ...]  # (stages)   the rates count for the step over this in the result
    middle: int  # stage whose voltages are those in the middle of the step


RK4 = Method((2.0, 2.0, 1.0, 1.0), (6.0, 3.0, 3.0, 6.0), 2)  # Kutta's of order 4
STAGES = len(RK4.reach_divisor)


@noinline
def after_first(weight, reach, x, f, total, s):
    """From stage 0 to stage 1: its states s = x + reach f, and the sum that ends as x(h), total = x + weight f."""
    for k in range(len(x)):
        total[k] = x[k] + weight * f[k]
        s[k] = x[k] + reach * f[k]


@noinline
def after_middle(weight, reach, x, f, total, s):
    """From a stage in the middle to the next. In loops of their own all three use vector instructions."""
    for k in range(len(x)):
        total[k] += weight * f[k]
        s[k] = x[k] + reach * f[k]


@noinline
def after_last(weight, total, f, s):
    """From the last stage to the end of the step."""
    for k in range(len(total)):
        s[k] = total[k] + weight * f[k]


@inline
def advance_states(stage, span, run):
    """Set the states to those of the next stage of a step of `span` seconds, or of its end, whatever their limits."""
    weight, reach = span / RK4.weight_divisor[stage], span / RK4.reach_divisor[stage]
    if stage == 0:
        after_first(weight, reach, run.part.x, run.f, run.part.total, run.s)
    elif stage < STAGES - 1:
        after_middle(weight, reach, run.part.x, run.f, run.part.total, run.s)
    else:
        after_last(weight, run.part.total, run.f, run.s)


@inline
def hold_at_limits(run, places):
    """Set the rates of states to zero that began the step at a non-windup limit, are there now, and would leave it.

    A state that reaches its limit within the step keeps its rates and is clipped; without them it would stop short.
    """
    for k in range(len(places.limited)):
        i, per = places.limited[k], run.s[places.scale[k]]
        low, high, x, s = places.low[k] * per, places.high[k] * per, run.part.x[i], run.s[i]
        if (x >= high and s >= high and run.f[i] > 0) or (x <= low and s <= low and run.f[i] < 0):
            run.f[i] = 0


@inline
def clip_at_limits(s, places):
    """Clip the states with non-windup limits."""
    for k in range(len(places.limited)):
        i, per = places.limited[k], s[places.scale[k]]
        s[i] = min(max(s[i], places.low[k] * per), places.high[k] * per)


@noinline
def freeze_disconnected(places, net, run):
    """Set the rates of disconnected units to zero."""
    for k in range(len(run.part.x)):
        if places.owner[k] >= 0 and net.island[places.owner[k]] < 0:
            run.f[k] = 0

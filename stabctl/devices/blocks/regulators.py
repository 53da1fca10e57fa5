"""Integrator and PI regulator with non-windup limits.

A limit that is a constant, or a constant times a signal, is better listed in LIMITS of the device: the simulator then
stops the state exactly there.
"""

from stabctl._util.jit import inline

from .limits import clip


@inline
def non_windup(rate, x, low, high):
    """State derivative (1/s) of an integrator x with non-windup limits."""
    if (x.real >= high.real and rate.real > 0) or (x.real <= low.real and rate.real < 0):
        return 0 * rate
    return rate


@inline
def integral(KI, x):
    """State x of an integrator, 0 where its gain KI is 0 (there is none)."""
    return x if KI > 0 else 0 * x


@inline
def pi(KP, error, x, low, high):
    """error -> [ KP + KI/s ], limited -> y, state x (the integral)."""
    return clip(KP * error + x, low, high)


@inline
def pi_rate(KP, KI, error, x, low, high):
    """State derivative (1/s) of `pi`: the integral stops while the output is at a limit and driven beyond it.

    Source: IEEE Std 421.5-2016, annex E, non-windup proportional-integral block.
    """
    return non_windup(KI * error, KP * error + x, low, high)


@inline
def beyond(K, excess, x):
    """PI controller that acts only beyond a limit: excess -> [ K + KI/s ], at least 0 -> y, state x, at least 0."""
    y = K * excess + x
    if y.real > 0:
        return y
    return 0 * y


@inline
def beyond_rate(KI, excess, x):
    """State derivative (1/s) of `beyond`: the integral does not fall below 0, which LIMITS of the device repeats."""
    if x.real > 0 or excess.real > 0:
        return KI * excess
    return 0 * x

"""Limits, gates, deadband, rate limit; integrator and PI regulator with non-windup limits."""

from stabctl._util.jit import inline


@inline
def at_least(x, low):
    """x, but never below `low`."""
    return low if x.real < low.real else x


@inline
def at_most(x, high):
    """x, but never above `high`."""
    return high if x.real > high.real else x


@inline
def clip(x, low, high):
    """x between its limits; with equal limits a constant, whose derivative is 0 there too."""
    if x.real <= low.real:
        return low
    if x.real > high.real:
        return high
    return x


@inline
def low_value(a, b):
    """Low-value gate: the smaller of two signals, the first where they are equal."""
    return b if b.real < a.real else a


@inline
def high_value(a, b):
    """High-value gate: the larger of two signals, the first where they are equal."""
    return b if b.real > a.real else a


@inline
def deadband(x, low, high):
    """Deadband: zero for x within low..high, otherwise the distance beyond its edge (no step); none if low = high."""
    if low == high:
        return x - low
    if x.real < low.real:
        return x - low
    if x.real > high.real:
        return x - high
    return 0 * x


@inline
def available(x, stored, low, high):
    """x, but not above 0 where a store is down to `low`, nor below 0 where it is filled to `high`."""
    if (stored.real <= low and x.real > 0) or (stored.real >= high and x.real < 0):
        return 0 * x
    return x


@inline
def two_slopes(x, below, above):
    """below x for x < 0, otherwise above x."""
    if x.real < 0:
        return below * x
    return above * x


@inline
def rate_limit(rate, low, high):
    """Rate limit: the state derivative (1/s), limited to low..high."""
    return clip(rate, low, high)


@inline
def growth_limit(rate, wanted, most):
    """State derivative (1/s), at most `most` where `wanted` >= 0, otherwise at least -most: growth away from zero."""
    return at_most(rate, most) if wanted.real >= 0 else at_least(rate, -most)


@inline
def while_within(x, measured, low, high):
    """x while `measured` is within low..high, otherwise 0; high = 0 means no upper bound."""
    if measured.real < low or (high > 0 and measured.real > high):
        return 0 * x
    return x


# Integrator and PI regulator with non-windup limits.
#
# A limit that is a constant, or a constant times a signal, is better listed in LIMITS of the device: the simulator then
# stops the state exactly there.


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
def regulated(KP, KI, x):
    """State x of a PI regulator, 0 where KP acts alone; without any gain the output stays what it was at the start."""
    return x if KI > 0 or KP <= 0 else 0 * x


@inline
def pi(KP, KI, error, x, low, high):
    """error -> [ KP + KI/s ], limited -> y, state x (the integral), which stops while y is driven beyond a limit.

    Source: IEEE Std 421.5-2016, annex E, non-windup proportional-integral block.
    """
    wanted = KP * error + x
    return clip(wanted, low, high), non_windup(KI * error, wanted, low, high)


@inline
def beyond(KP, KI, excess, x):
    """PI controller that acts only beyond a limit: excess -> [ KP + KI/s ], at least 0 -> y, state x, at least 0.

    LIMITS of the device repeats that the integral does not fall below 0.
    """
    y = KP * excess + x
    return y if y.real > 0 else 0 * y, KI * excess if x.real > 0 or excess.real > 0 else 0 * x

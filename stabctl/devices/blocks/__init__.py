"""Scalar blocks shared by every device, and the only place where a value is limited.

Each accepts a float or a complex-step number: no `abs`, `min`, `sign` or `conj`, and a branch looks only at
the real part. A limit is returned plain, never as `lo + 0*x` (which is nan at x = inf). A block with memory is a pair:
its output, and the rate of its state, such as `lag` and `lag_rate`.
"""

from .curves import line, lookup, quadratic, through
from .delays import delay1, delay1_rate, delay2, delay2_rates
from .lags import SHORT, circuit_rate, lag, lag_rate, lead_lag, second_order, second_order_rates, washout
from .limits import at_least, at_most, clip, deadband, high_value, low_value, rate_limit
from .phasors import angle, copy, magnitude
from .regulators import non_windup, pi, pi_rate

__all__ = [
    "SHORT",
    "angle",
    "at_least",
    "at_most",
    "circuit_rate",
    "clip",
    "copy",
    "deadband",
    "delay1",
    "delay1_rate",
    "delay2",
    "delay2_rates",
    "high_value",
    "lag",
    "lag_rate",
    "lead_lag",
    "line",
    "lookup",
    "low_value",
    "magnitude",
    "non_windup",
    "pi",
    "pi_rate",
    "quadratic",
    "rate_limit",
    "second_order",
    "second_order_rates",
    "through",
    "washout",
]

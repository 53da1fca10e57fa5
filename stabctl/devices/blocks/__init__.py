"""Scalar blocks shared by all devices, and the only place where values are limited.

Each block works for floats and for complex steps: no `abs`, `min`, `sign` or `conj`, and conditions test only the real
part. A limit is returned as it is, never as `lo + 0*x` (which is nan at x = inf). A block with a state is a pair of
functions: its output and the derivative of its state, such as `lag` and `lag_rate`.
"""

from .curves import line, lookup, polyline, power, quadratic, through
from .delays import delay1, delay1_rate, delay2, delay2_rates
from .lags import SHORT, circuit_rate, derivative, lag, lag_rate, lead_lag, second_order, second_order_rates, washout
from .limits import (
    at_least,
    at_most,
    available,
    clip,
    deadband,
    growth_limit,
    high_value,
    low_value,
    rate_limit,
    two_slopes,
    while_within,
)
from .phasors import angle, copy, magnitude, shortened
from .rectifiers import compound, crowbar, field_demand, rectified, regulation
from .regulators import beyond, beyond_rate, integral, non_windup, pi, pi_rate

__all__ = [
    "SHORT",
    "angle",
    "at_least",
    "at_most",
    "available",
    "beyond",
    "beyond_rate",
    "circuit_rate",
    "clip",
    "compound",
    "copy",
    "crowbar",
    "deadband",
    "delay1",
    "delay1_rate",
    "delay2",
    "delay2_rates",
    "derivative",
    "field_demand",
    "growth_limit",
    "high_value",
    "integral",
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
    "polyline",
    "power",
    "quadratic",
    "rate_limit",
    "rectified",
    "regulation",
    "second_order",
    "second_order_rates",
    "shortened",
    "through",
    "two_slopes",
    "washout",
    "while_within",
]

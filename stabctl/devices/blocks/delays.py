"""Pade approximations of a delay exp(-sT): unit gain, and phase within 1 degree up to w T = 0.59 or 1.67.

A delay shorter than 2 ms is bypassed, like any short lag.
"""

from stabctl._util.jit import inline

from .lags import lag_rate, lead_lag, second_order, second_order_rates


@inline
def delay1(T, u, x):
    """u -> [ (1 - sT/2)/(1 + sT/2) ] -> y, state x."""
    return lead_lag(-T / 2, T / 2, u, x)


@inline
def delay1_rate(T, u, x):
    """State derivative (1/s) of `delay1`."""
    return lag_rate(T / 2, u, x)


@inline
def delay2(T, u, x, dx):
    """u -> [ (1 - sT/2 + s^2 T^2/12)/(1 + sT/2 + s^2 T^2/12) ] -> y, states x and dx."""
    return second_order(-T / 2, T * T / 12, T / 2, T * T / 12, u, x, dx)


@inline
def delay2_rates(T, u, x, dx):
    """State derivatives (1/s) of `delay2`."""
    return second_order_rates(T / 2, T * T / 12, u, x, dx)

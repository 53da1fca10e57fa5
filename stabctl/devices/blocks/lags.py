"""Lag, lead-lag, washout, second-order block, rotor circuit, Pade approximations of a delay."""

from stabctl._util.jit import inline

SHORT = 1e-3  # s   a control time constant below this bypasses its block


@inline
def lag(T, u, x):
    """u -> [ 1/(1 + sT) ] -> y, state x; bypassed where T < SHORT."""
    if T >= SHORT:
        return x, (u - x) / T
    return u, 0 * x


@inline
def lead_lag(T1, T2, u, x):
    """u -> [ (1 + s T1)/(1 + s T2) ] -> y, state x (the lagged input); bypassed where T2 < SHORT."""
    if T2 >= SHORT:
        return x + T1 / T2 * (u - x), (u - x) / T2
    return u, 0 * x


@inline
def washout(T, u, x):
    """u -> [ sT/(1 + sT) ] -> y, state x (the lagged input); bypassed where T < SHORT."""
    if T >= SHORT:
        return u - x, (u - x) / T
    return u, 0 * x


@inline
def derivative(K, T, u, x):
    """u -> [ sK/(1 + sT) ] -> y, state x (the lagged input); 0 where T < SHORT."""
    if T >= SHORT:
        return K / T * (u - x), (u - x) / T
    return 0 * u, 0 * x


@inline
def lag_rate(T, u, x):
    """State derivative (1/s) of `lag` alone."""
    return lag(T, u, x)[1]


@inline
def second_order(N1, N2, D1, D2, u, x, dx):
    """u -> [ (1 + s N1 + s^2 N2)/(1 + s D1 + s^2 D2) ] -> y, states x and dx (the filtered input and its rate).

    A notch at w (rad/s) has N2 = D2 = 1/w^2 and N1 < D1. Where D2 < SHORT^2 it is the lead-lag of N1 and D1.
    """
    if D2 >= SHORT * SHORT:
        return x + N1 * dx + N2 / D2 * (u - x - D1 * dx), dx, (u - x - D1 * dx) / D2
    y, rate = lead_lag(N1, D1, u, x)
    return y, rate, 0 * dx


@inline
def circuit_rate(T, drive, x):
    """State derivative (1/s) of a rotor circuit, drive/T; T = 0: there is none, and nothing depends on x."""
    return drive / T if T > 0 else 0 * x


# Pade approximations of a delay exp(-sT): unit gain, and phase within 1 degree up to w T = 0.59 or 1.67.
#
# A delay shorter than 2 ms is bypassed, like any short lag.


@inline
def delay1(T, u, x):
    """u -> [ (1 - sT/2)/(1 + sT/2) ] -> y, state x."""
    return lead_lag(-T / 2, T / 2, u, x)


@inline
def delay2(T, u, x, dx):
    """u -> [ (1 - sT/2 + s^2 T^2/12)/(1 + sT/2 + s^2 T^2/12) ] -> y, states x and dx."""
    return second_order(-T / 2, T * T / 12, T / 2, T * T / 12, u, x, dx)

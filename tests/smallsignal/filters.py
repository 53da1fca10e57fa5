"""Washout and stabilizer of the tests of closed loops, as transfer functions."""

import control

S = control.tf("s")
WASHOUT = 3 * S / (1 + 3 * S) / (1 + 0.05 * S)
PSS = 20 * (10 * S / (1 + 10 * S)) * (1 + 0.05 * S) / (1 + 0.02 * S) * (1 + 3 * S) / (1 + 5.4 * S)

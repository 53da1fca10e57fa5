"""WSCC nine-bus system, two-axis machines: the eigenvalues printed by Sauer and Pai, the classical clearing time.

Sauer, Pai, Power System Dynamics and Stability, example 8.1: constant-power loads, constant mechanical torque. The
saturation of their exciters, SE = 0.0039 exp(1.555 Efd), is that of ours up to its slope at the operating point.
"""

import numpy as np
import pytest

import stabctl as st
from stabctl.dynamics import operating_point

BOOK = (
    -0.7209 + 12.7486j, -0.1908 + 8.3672j, -5.4875 + 7.9487j, -5.3236 + 7.9220j, -5.2218 + 7.8161j, -5.1761, -3.3995,
    -0.4445 + 1.2104j, -0.4394 + 0.7392j, -0.4260 + 0.4960j, -3.2258,
)  # fmt: skip


def test_eigenvalues_are_those_of_the_book(points):
    modes = points("wscc9").modes()
    found = modes.eigenvalues
    assert len(found) == 2 * len(BOOK) - 3 + 2  # three real ones; angle and frequency are defined only to each other
    assert (found == 0).sum() == 2
    assert modes.stable
    for value in BOOK:
        assert np.abs(found - value).min() < 4e-3  # 3.2e-3 of 12.8, the other ones 2e-3


def test_saturation_is_that_of_the_book_at_the_operating_point(points):
    """Value and slope of SE(Efd) Efd."""
    point = points("wscc9")
    for unit, (A, B) in enumerate(zip(*(point.constants("ieeet1")[1][n] for n in ("SA", "SB")), strict=True)):
        E = point.s[point.layout.signals[unit, "Efd"]]
        SE = 0.0039 * np.exp(1.555 * E)
        assert B * (E - A) ** 2 == pytest.approx(SE * E, rel=1e-6)
        assert 2 * B * (E - A) == pytest.approx(SE * (1 + 1.555 * E), rel=1e-6)


def test_power_flow_is_that_of_the_book(points):
    V = points("wscc9").V
    book = (1.04, 1.025, 1.025, 1.026, 0.996, 1.013, 1.026, 1.016, 1.032)
    angles = (0.0, 9.3, 4.7, -2.2, -4.0, -3.7, 3.7, 0.7, 2.0)
    assert np.abs(np.abs(V) - book).max() < 6e-4
    assert np.abs(np.rad2deg(np.angle(V)) - angles).max() < 0.06


def test_classical_clearing_time(cases):
    """Fault at bus 7, cleared by opening 5-7, loads as impedances: 0.162 s, judged by the first swings.

    Without damping machine 3 still loses synchronism after 6.6 s (0.162 s) or 15.7 s (0.161 s), which the rule for
    swings that do not decay finds.
    """
    point = operating_point.solve(cases("wscc9").with_loads("impedance").classical())
    fault, options = st.Contingency("7", trip="5-7"), {"resolution": "1ms", "scan": 0}
    assert point.clearing_time(fault, longest=0, **options).seconds == pytest.approx(0.162, abs=1e-9)
    assert point.clearing_time(fault, **options).seconds == pytest.approx(0.160, abs=1e-9)

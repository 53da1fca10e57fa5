"""Kundur, Power System Stability and Control, Example 12.6: his figures, ours, and what lies between.

The book's own machine, written out in `textbook`, gives its figures to the last digit printed (manual, thyristor).
Three things part it from the derivative of our simulated equations, each measured here:

- saturation: the book's linearization takes the *incremental* saturation on both axes at once; the derivative of a
  total flux saturates incrementally along the flux only. This is the largest part: 0.014 to 0.019 in the damping ratio
  of the local modes. The curve itself matters less: ours is a quadratic through the book's exponential at 1.0 and
  1.2 pu.
- the book keeps the mechanical torque, we keep the power (Pm / w): 0.005.
- we keep the speed in the stator voltage, the book does not: -0.001 (manual), -0.007 (thyristor).
"""

from dataclasses import replace

import numpy as np
import pytest
from textbook import ASAT, BSAT, PSIT1, Option, swings

from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, linearize

BOOK = {
    "manual": (-0.111 + 3.43j, -0.492 + 6.82j, -0.506 + 7.02j),
    "thyristor": (0.031 + 3.84j, -0.490 + 7.15j, -0.496 + 7.35j),
    "pss": (-0.501 + 3.77j, -1.826 + 8.05j, -1.895 + 8.35j),
}


def hertz(s):
    return np.imag(s) / (2 * np.pi)


def ratio(s):
    return -np.real(s) / np.abs(s)


@pytest.mark.parametrize("control", BOOK)
def test_our_modes_against_the_book(modes, control):
    m = modes(f"two_area_{control}")
    ours, book = m.eigenvalues[m.swings()], np.array(BOOK[control])
    # Measured: manual -0.153+3.419j -0.623+6.750j -0.634+6.943j; thyristor 0.033+3.822j -0.625+7.048j -0.626+7.245j;
    # pss -0.519+3.849j -1.980+8.068j -2.050+8.366j
    assert np.abs(hertz(ours) - hertz(book)).max() < 0.02  # 0.012, 0.017, 0.013
    off = ratio(ours) - ratio(book)
    assert abs(off[0]) < 0.015  # inter-area: 0.012, -0.001, 0.002
    assert off[1:] == pytest.approx(0.018, abs=0.003)  # local, too well damped: 0.020 0.019, 0.020 0.019, 0.017 0.017


@pytest.mark.parametrize("control", ["manual", "thyristor"])
def test_the_book_is_reproduced_with_its_own_assumptions(control):
    off = swings(Option(control)) - np.array(BOOK[control])
    assert np.abs(off.real).max() < 0.0011  # 0.0003, 0.0009
    assert np.abs(off.imag).max() < 0.013  # 0.012, 0.004


def test_the_book_with_stabilizers():
    """With the printed constants the local modes come out 0.09 1/s better damped than printed; why is not known."""
    off = swings(Option("pss")) - np.array(BOOK["pss"])
    assert np.abs(off.imag).max() < 0.07  # 0.067, 0.023, 0.032
    assert off.real == pytest.approx([-0.011, -0.082, -0.092], abs=0.001)


@pytest.mark.parametrize("control", BOOK)
def test_what_parts_our_modes_from_the_book(modes, control):
    """The textbook machine with the three differences removed is ours but for the shape of the saturation curve."""
    m = modes(f"two_area_{control}")
    ours = m.eigenvalues[m.swings()]
    like_ours = swings(Option(control, incremental=False, speed_voltage=True, constant_power=True))
    assert np.abs(ratio(ours) - ratio(like_ours)).max() < 0.006  # 0.003, 0.003, 0.004
    assert np.abs(hertz(ours) - hertz(like_ours)).max() < 0.018  # 0.004, 0.008, 0.017


@pytest.mark.parametrize(
    ("change", "manual", "thyristor"),
    [
        ({"incremental": False}, 0.0147, 0.0193),
        ({"constant_power": True}, 0.0047, 0.0044),
        ({"speed_voltage": True}, -0.0009, -0.0069),
    ],
)
def test_each_difference_alone(change, manual, thyristor):
    """Change of the damping ratio of the first local mode."""
    for control, wanted in (("manual", manual), ("thyristor", thyristor)):
        changed, book = (ratio(swings(Option(control, **c))[1]) for c in (change, {}))
        assert changed - book == pytest.approx(wanted, abs=5e-4)


@pytest.mark.parametrize("control", BOOK)
def test_the_curve_of_saturation_matters_little(modes, control):
    """The quadratic laid along the book's exponential at the operating flux, 1.075 pu, not through its points."""
    m = modes(f"two_area_{control}")
    case = m.linear.point.case
    taken = ASAT * np.exp(BSAT * (1.075 - PSIT1))
    start = 1.075 - 2 / BSAT
    s10, s12 = (taken * ((flux - start) / (1.075 - start)) ** 2 / flux for flux in (1.0, 1.2))
    rows = {n: par._replace(S10=s10, S12=s12) for n, par in case.devices["genrou"].items()}
    tangent = analyze(linearize(operating_point.solve(replace(case, devices={**case.devices, "genrou": rows}))))
    moved = tangent.damping_ratio[tangent.swings()] - m.damping_ratio[m.swings()]
    assert np.abs(moved).max() < 0.004  # 0.0002, 0.0011, 0.0033

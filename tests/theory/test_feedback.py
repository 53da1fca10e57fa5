import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stabctl._util.errors import StudyError
from stabctl.theory.feedback_laws import (
    FeedbackLaw,
    acceleration_magnitude,
    compare,
    paper_laws,
    respond,
    speed_acceleration,
)
from stabctl.theory.omib import OMIB, swing_curve
from stabctl.theory.phase_plane import critical_energy, energy

PAPER = OMIB()
number = st.floats(-2, 2)


@given(speed=number, Pa=number, Kv=number, part=st.floats(-0.9, 0.9))
def test_laws_hold_with_the_acceleration_they_cause(speed, Pa, Kv, part):
    M = PAPER.M
    Ka = part * M
    P = speed_acceleration(speed, Pa, M=M, Kv=Kv, Ka=Ka)
    a = (Pa - P) / M
    assert abs(P - Kv * speed - Ka * a) < 1e-12 * (1 + M * abs(a) + abs(P))
    side = 1 if speed >= 0 else -1
    P = acceleration_magnitude(side, Pa, M=M, Ka=Ka)
    a = (Pa - P) / M
    assert abs(P - Ka * abs(a) * side) < 1e-12


def test_acceleration_feedback_is_negative_inertia():
    law = paper_laws()[0]
    run = respond(PAPER, 0.25, law).curve
    after = run.t > 0.25
    lighter = OMIB(H=PAPER.H * (PAPER.M + law.Ka) / PAPER.M)
    U = energy(lighter, run.angle[after], run.speed[after])
    assert np.ptp(U) < 1e-9 * U[0]  # 1e-11
    assert U[0] < critical_energy(PAPER) < energy(PAPER, run.angle[after][0], run.speed[after][0])


def test_speed_feedback_takes_the_energy_that_the_device_absorbs():
    run = respond(PAPER, 0.25, paper_laws()[1]).curve
    after = run.t > 0.25
    t, U = run.t[after], energy(PAPER, run.angle[after], run.speed[after])
    absorbed = np.trapezoid(run.power[after] * run.speed[after], t)
    assert U[0] - U[-1] == pytest.approx(absorbed, rel=1e-5)  # 1e-6, of the trapezoids
    assert (np.diff(U) < 1e-12).all()


def test_without_gain_the_laws_are_no_device():
    plain = swing_curve(PAPER, 0.2, until=2)
    for law in (FeedbackLaw("none"), FeedbackLaw("none", magnitude=True)):
        assert respond(PAPER, 0.2, law, until=2).peak_angle == pytest.approx(plain.angle.max(), abs=1e-9)


def test_four_laws_of_the_paper():
    found = compare(PAPER).responses
    assert all(r.stable for r in found)
    peaks = [r.peak_angle for r in found]
    assert peaks == pytest.approx([2.232, 2.368, 2.074, 1.999], abs=5e-4)  # 2.2316, 2.3681, 2.0739, 1.9993
    swing = [r.max_speed - r.min_speed for r in found]
    assert max(peaks) == peaks[1]
    assert min(swing) == swing[3]
    assert [r.min_speed for r in found] == pytest.approx([-10.8707, -8.1931, -8.6923, -7.3056], abs=5e-5)
    assert swing[2] > swing[1]  # against the text of the paper: 16.546 > 16.047 rad/s
    assert abs(found[0].damping) < 1e-9  # 5e-14
    assert [r.damping for r in found[1:]] == pytest.approx([0.134, 0.133, 0.181], abs=1e-3)


def test_a_fault_too_long_is_lost_with_every_law():
    assert not any(r.stable for r in compare(PAPER, 40, until=2).responses)


@pytest.mark.parametrize(
    "law", [FeedbackLaw("a", Ka=-PAPER.M), FeedbackLaw("b", Ka=0.02, magnitude=True), FeedbackLaw("c", Kv=math.nan)]
)
def test_gains_without_a_single_acceleration_are_refused(law):
    with pytest.raises(StudyError, match=f"Law '{law.name}'"):
        respond(PAPER, 0.25, law)

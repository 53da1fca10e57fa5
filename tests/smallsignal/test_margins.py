"""Delay and gain margins of closed loops against the first unstable delay and gain in the simulation."""

from dataclasses import replace

import numpy as np
import pytest
from filters import PSS, WASHOUT

import stabctl as st
from stabctl._util.errors import StudyError


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


def grows(base, controllers):
    """Whether the swings after a small load pulse grow from 60 to 90 s, or have grown to the limits before."""
    pulse = [st.LoadStep(7, "0.1s", p=0.3), st.LoadStep(7, "0.5s", p=-0.3)]
    run = base.simulate(pulse, "90s", control=controllers)
    swing = np.abs(run.arrays.speed[:, 1:] - run.arrays.speed[:, :1]).max(axis=1)
    early, middle, late = (swing[(run.time > t) & (run.time < t + 5)].max() for t in (1, 55, 85))
    return late > min(early, middle)


def stabilizer(i, rate):
    return st.Controller.from_control(PSS, f"speed:{i}", f"vs:{i}", rate=rate, name=f"pss {i}")


def damper():
    return st.Controller.from_control(200 * WASHOUT, "deviation:1", "order:1@5", rate=60, name="damper")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "frames"),
    [
        (lambda: [stabilizer(i, 60) for i in (1, 2, 3, 4)], 9),
        (lambda: [damper()], 18),
        (lambda: [damper(), stabilizer(3, 30), stabilizer(1, 30)], 6),
    ],
    ids=["stabilizers", "damper", "two rates"],
)
def test_the_first_unstable_frame_and_gain_are_those_of_the_simulation(base, make, frames):
    controllers = make()
    found = base.margins(*controllers)
    frame = 1 / min(c.rate for c in controllers)
    assert found.delay == pytest.approx(frames * frame)
    for more, unstable in ((frames - 1, False), (frames, True)):
        assert grows(base, [replace(c, delay=c.delay + more * frame) for c in controllers]) == unstable
    for gain in (found.gain_up, found.gain_down):
        inside, outside = (gain * (1 - 0.02 * np.sign(gain - 1) * k) for k in (1, -1))
        assert not grows(base, [c.scaled(inside) for c in controllers])
        assert grows(base, [c.scaled(outside) for c in controllers])


def test_an_unstable_loop_has_no_margins(base):
    with pytest.raises(StudyError, match="is unstable, so it has no margins"):
        base.margins(damper().scaled(0.01))


def test_rates_that_do_not_divide_each_other_are_delayed_by_their_common_period(base):
    late = st.Controller("deviation:1", "order:1@5", [], [], [], [[150.0]], rate=50, delay="20ms")
    other = st.Controller("deviation:3", "order:3@11", [], [], [], [[150.0]], rate=20)
    found = base.margins(late, other).delay
    assert found in (0.1, 0.2, 0.3, 0.4, 0.5)
    for more, stable in ((found - 0.1, True), (found, False)):
        loop = base.closed_loop(late.delayed(0.02 + more), other.delayed(more))
        assert loop.modes().stable is stable


@pytest.mark.slow
def test_an_undamped_system_has_margins(cases):
    base = cases("two_area").classical().initialize(storage="50MW")
    law = st.Controller("deviation:1", "order:1@5", [], [], [], [[10.0]])
    found = base.margins(law)
    assert found.loops[0].delay == pytest.approx(found.delay, rel=0.02)  # 212.5 and 215.2 ms: a mode grows from 1e-6/s
    for share, stable in ((0.98, True), (1.02, False)):
        assert base.closed_loop(law.delayed(share * found.delay)).modes().stable is stable

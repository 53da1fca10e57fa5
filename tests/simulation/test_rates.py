"""Time steps and frames: every frame begins a step, and a fast controller shortens the step or is refused."""

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area").initialize(storage="50MW")


@pytest.mark.parametrize("rate", [7, 60, 1000])
def test_a_function_is_called_at_every_frame(base, rate):
    """Also where frames are closer than steps, or no whole number of steps apart."""
    seen_at = []
    one = st.Controller.from_function(lambda seen: seen_at.append(seen.time) or 0.0, "speed:1", "vs:1", rate=rate)
    base.simulate(until="0.5s", control=one, step="0.01s")
    assert seen_at == pytest.approx(np.arange(np.ceil(0.5 * rate - 1e-9)) / rate, abs=1e-9)


def fast(a):
    """A lag of 1/a s, whose output hardly matters."""
    return st.Controller.from_control(control.tf(1e-3 * a, [1, a]), "speed:1", "vs:1", name="fast")


def test_a_fast_controller_shortens_the_step(base):
    """Without that, Runge-Kutta steps of 1/120 s would be unstable."""
    run = base.simulate(st.LoadStep(7, "0.1s", p=50), "1s", control=fast(3000.0))
    assert run.step < 2.5 / 3000
    assert np.isfinite(run.rows).all()
    slow = base.simulate(st.LoadStep(7, "0.1s", p=50), "1s", control=fast(300.0))
    assert run.arrays.speed[-1] == pytest.approx(slow.arrays.speed[-1], abs=1e-7)


def test_a_step_that_is_too_long_for_a_controller_names_it(base):
    with pytest.raises(StudyError, match=r"near 3000 1/s \(that of controller fast\); give at most 0.000833 s"):
        base.simulate(until="1s", control=fast(3000.0), step="5ms")


@pytest.mark.parametrize("rate", [None, 60])
def test_an_unstable_controller_has_a_warning(stabctl, tmp_path, rate):
    growing = st.Controller.from_control(control.tf(1, [1, -0.5]), "speed:1", "vs:1", rate=rate, name="odd")
    (sentence,) = growing.warnings
    assert "odd is unstable in open loop" in sentence
    assert "0.5 1/s" in sentence
    assert "unstable in open loop" in str(growing)
    assert st.Controller.from_control(control.tf(1, [1, 0]), "speed:1", "vs:1", rate=rate).warnings == ()
    growing.save(tmp_path / "odd.toml")
    words = ("simulate", "two_area", "--until", "0.1s", "--controller", tmp_path / "odd.toml")
    assert f"stabctl: warning: {sentence}" in stabctl(*words)[2].replace("\n", " ")

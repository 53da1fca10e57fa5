"""Closed loops in python-control: the same modes, residues and responses, discrete if controllers are sampled."""

import control
import numpy as np
import pytest
from filters import WASHOUT

import stabctl as st

SIGNALS = {"inputs": "vref:2, order:3@11", "outputs": "speed:2, flow:7-8"}


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


def damper(rate=None, delay=0.0):
    return st.Controller.from_control(40 * WASHOUT, "deviation:1", "order:1@5", rate=rate, delay=delay, name="damper")


CONTROLLERS = {
    "continuous": lambda: [damper()],
    "sampled": lambda: [damper(60, "50ms")],
    "two rates": lambda: [
        damper(60, "50ms"),
        st.Controller.from_control(5 * WASHOUT, "speed:3", "vs:3", rate=30, delay="100ms", name="pss"),
    ],
}
each = pytest.mark.parametrize("make", CONTROLLERS.values(), ids=CONTROLLERS)


@each
def test_the_poles_are_the_modes(base, make):
    loop = base.closed_loop(*make(), **SIGNALS)
    system, modes = loop.to_control(), loop.modes()
    period = {"continuous": 0, "sampled": 1 / 60, "two rates": 1 / 30}[
        next(k for k, v in CONTROLLERS.items() if v is make)
    ]
    assert system.dt == pytest.approx(period)
    poles = system.poles()
    wanted = np.exp(modes.eigenvalues * period) if period else modes.eigenvalues
    assert max(np.abs(poles - z).min() for z in wanted[1:]) < 1e-10 * np.abs(wanted).max()  # at most 1e-13
    assert system.input_labels == list(loop.inputs)
    assert system.state_labels == list(loop.states)


@each
def test_residues_are_the_slopes_of_eigenvalues(base, make):
    """Two routes: the residue of a mode, and its change with a small feedback closed by python-control."""
    loop = base.closed_loop(*make(), **SIGNALS)
    system, modes = loop.to_control(), loop.modes()
    k = modes.swings()[0]
    for i, j in ((0, 0), (0, 1)):
        gain = 1e-4 / np.abs(modes.residues(i, j)[k])
        shifted = [control.feedback(system[i, j], -g).poles() for g in (gain, -gain)]
        if system.dt:
            shifted = [np.log(z[np.abs(z) > 1e-3]) / system.dt for z in shifted]
        ends = [s[np.abs(s - modes.eigenvalues[k]).argmin()] for s in shifted]
        slope = (ends[0] - ends[1]) / (2 * gain)
        assert abs(slope / modes.residues(i, j)[k] - 1) < 1e-6  # at most 1.5e-8


def test_sampled_residues_become_the_continuous_ones(base):
    """The error falls as the frame."""

    def residue(loop):
        modes = loop.modes()
        return modes.residues("speed GENROU 2", "reference SEXS 2")[modes.swings()[0]]

    signals = {"inputs": "vref:2", "outputs": "speed:2"}
    exact = residue(base.closed_loop(damper(), **signals))
    errors = [abs(residue(base.closed_loop(damper(rate), **signals)) - exact) for rate in (100, 200, 400)]
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.1)
    assert errors[1] / errors[2] == pytest.approx(2, abs=0.1)


@each
def test_the_exported_loop_answers_as_the_simulation(base, make):
    """A small step of a voltage reference, given by one more controller at the frames of the period."""
    loop = base.closed_loop(*make(), inputs="vref:2", outputs="speed:2")
    period = loop.period or 1 / 60
    size, seen = 1e-4, []

    def step(inputs):
        seen.append(inputs["speed:2"])
        return size if inputs.time >= 0.2 - 1e-9 else 0.0

    probe = st.Controller.from_function(step, "speed:2", "vref:2", rate=round(1 / period), name="step")
    base.simulate(until="3s", control=[*make(), probe])
    t = period * np.arange(len(seen) - round(0.2 / period))
    system = loop.to_control()
    wanted = control.forced_response(system, t, np.full(len(t), size)).outputs
    got = np.array(seen[len(seen) - len(t) :])
    assert np.abs(got - wanted).max() < 1e-3 * np.abs(wanted).max()  # 1.5e-4
    assert (
        np.abs(loop.response([0.6]) - system(np.exp(1.2j * np.pi * system.dt) if system.dt else 1.2j * np.pi)).max()
        < 1e-9
    )

"""Names survive python-control, or can be given back; the whole loop is the same on both ways."""

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area").initialize(storage="50MW")


def damper(**more):
    return st.Controller.from_control(control.tf([60, 0], [3, 1]), "deviation:1", "order:1@5", name="damper", **more)


def test_a_controller_has_names_in_python_control():
    K = damper().to_control()
    assert (K.name, K.input_labels, K.output_labels, K.state_labels) == (
        "damper", ["deviation:1"], ["order:1@5"], ["x1 damper"],
    )  # fmt: skip
    four = st.Controller.from_control(control.ss([], [], [], np.eye(4)), "deviation", "order").to_control()
    assert four.input_labels == ["deviation 1", "deviation 2", "deviation 3", "deviation 4"]


def test_interconnect_is_the_closed_loop_by_name(base):
    one = damper()
    plant, K = base.linearize("vref:2, order:1@5", "speed:2, deviation:1").to_control(), one.to_control()
    loop = control.interconnect(
        [plant, K],
        connections=[
            ["damper.deviation:1", f"{plant.name}.speed deviation 1"],
            [f"{plant.name}.order ESD 1@5", "damper.order:1@5"],
        ],
        inplist=[f"{plant.name}.reference SEXS 2"],
        outlist=[f"{plant.name}.speed GENROU 2"],
        inputs=["reference SEXS 2"],
        outputs=["speed GENROU 2"],
    )
    ours = base.closed_loop(one, inputs="vref:2", outputs="speed:2")
    assert (loop.input_labels, loop.output_labels) == (list(ours.inputs), list(ours.outputs))
    assert [label.removeprefix(f"{plant.name}_") for label in loop.state_labels[:-1]] == list(ours.states[:-1])
    assert loop.state_labels[-1] == "damper_x1 damper"
    assert np.abs(loop.A - ours.A).max() < 1e-12 * np.abs(ours.A).max()


def test_sampled_systems_come_back_as_controllers(base):
    """sample_system keeps names; the controller is that sampled by ours."""
    again = st.Controller.from_control(control.sample_system(damper().to_control(), 1 / 60, method="tustin"))
    ours = damper().sampled(60)
    assert (again.inputs, again.outputs, again.rate) == (ours.inputs, ours.outputs, 60)
    z = np.exp(0.1j)
    assert again.to_control()(z) == pytest.approx(ours.to_control()(z), rel=1e-12)


def test_systems_without_names_take_those_given(base):
    K = damper().to_control()
    later = control.series(K, control.tf([1], [0.05, 1]))
    with pytest.raises(StudyError, match="have no names"):
        st.Controller.from_control(later)
    again = st.Controller.from_control(later, K.input_labels, K.output_labels)
    assert (again.inputs, again.outputs) == (("deviation:1",), ("order:1@5",))
    assert base.closed_loop(again).modes().stable


def test_reduce_keeps_names(base):
    model = base.linearize("vref:2, order:1@5", "speed:2, deviation:1")
    small = model.reduce(20)
    assert (small.inputs, small.outputs, len(small.states)) == (model.inputs, model.outputs, 20)
    error = np.abs(small.response([0.6]) - model.response([0.6])).max()
    assert error < 1e-3 * np.abs(model.response([0.6])).max()
    assert small.to_control().output_labels == list(model.outputs)
    with pytest.raises(StudyError, match="has sampled or delayed controllers"):
        base.closed_loop(damper(rate=60), inputs="vref:2", outputs="speed:2").reduce(10)

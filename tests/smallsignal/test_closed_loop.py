"""One controller in simulation and linear model: the ring-down is the eigenvalue of the closed loop."""

import re

import control
import numpy as np
import pytest
from filters import PSS, WASHOUT
from ringdown import errors, modal_pole, ringdown
from uneven import uneven_point

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.smallsignal.analysis import analyze


@pytest.fixture(scope="module")
def thyristor(cases):
    """Kundur's system without stabilizers, whose inter-area mode grows, with storage."""
    return cases("two_area_thyristor").initialize(storage="50MW")


def least_damped(base, controllers):
    """Least damped electromechanical eigenvalue of the closed loop, 1/s."""
    modes = base.closed_loop(*controllers).modes()
    return modes.eigenvalues[min(modes.swings(), key=lambda k: modes.damping_ratio[k])]


def stabilizers():
    return [st.Controller.from_control(PSS, f"speed:{i}", f"vs:{i}", name=f"pss {i}") for i in (1, 2, 3, 4)]


def damper():
    return st.Controller.from_control(40 * WASHOUT, "deviation:1", "order:1@5", name="damper")


CONTROLLERS = {
    "stabilizers": (stabilizers, 1e-5),  # 7.7e-6
    "stabilizers at 60/s": (lambda: [c.sampled(60) for c in stabilizers()], 1e-5),  # 5.1e-7
    "stabilizers at 60/s, 3 frames": (lambda: [c.sampled(60, "50ms") for c in stabilizers()], 1e-5),  # 3.8e-6
    "stabilizers at 60/s, 12 frames": (lambda: [c.sampled(60, "200ms") for c in stabilizers()], 3e-4),  # 1.8e-4
    "continuous delay": (lambda: [damper().delayed("100ms")], 2e-4),  # 6.1e-5
    "sampled delay": (lambda: [damper().sampled(60, "100ms")], 2e-4),  # 3.7e-5
    "line power, which follows the order at once": (
        lambda: [
            st.Controller.from_control(-0.02 * WASHOUT, "flow:7-8", "order:3@11", rate=60, delay="50ms", name="flow")
        ],
        1e-4,  # 1.6e-5
    ),
    "line power, continuous": (
        lambda: [st.Controller.from_control(-0.02 * WASHOUT, "flow:7-8", "order:3@11", name="flow")],
        1e-4,
    ),
    "measured frequency": (
        lambda: [st.Controller.from_control(20 * WASHOUT, "bus_frequency:7", "order:1@5", name="frequency")],
        1e-4,  # 2.6e-5
    ),
    "Python function": (
        lambda: [st.Controller.from_function(lambda seen: 20 * seen["deviation"], "deviation", "order", delay="50ms")],
        5e-4,  # 3.0e-4
    ),
    "two rates": (lambda: [damper().sampled(60), stabilizers()[2].sampled(30, "100ms")], 1e-4),  # 1.8e-5
}
FAST = ("stabilizers", "sampled delay", "line power, which follows the order at once", "two rates")


@pytest.mark.parametrize("name", [n if n in FAST else pytest.param(n, marks=pytest.mark.slow) for n in CONTROLLERS])
def test_the_ringdown_is_the_eigenvalue_of_the_closed_loop(thyristor, name):
    make, tolerance = CONTROLLERS[name]
    controllers = make()
    wanted = least_damped(thyristor, controllers)
    assert abs(wanted - least_damped(thyristor, [])) > 3e-3  # 1/s   the controllers matter
    poles, run = ringdown(thyristor, controllers, bus=7)
    assert run.outcome.stable
    frequency, decay = errors(poles, wanted)
    assert frequency < 1e-5  # at most 6.6e-6
    assert decay < tolerance


def stepped(base, controllers, inputs, outputs, period):
    """The map over a period (s) and the outputs at its start, of unit vectors stepped frame by frame at 60/s."""
    plant = base.linearize([c.outputs[0] for c in controllers] + inputs, [c.inputs[0] for c in controllers] + outputs)
    n, m = plant.B.shape
    frame = control.ss(plant.A, plant.B, np.eye(n), np.zeros((n, m))).sample(1 / 60)
    sizes = [1 + len(c.A) + c.frames for c in controllers]
    start = np.eye(n + sum(sizes) + len(inputs))
    seen, (x, *own, more) = [], np.split(start, np.cumsum([n, *sizes]))
    own = [list(np.split(rows, [1, 1 + len(c.A)])) for c, rows in zip(controllers, own, strict=True)]
    for k in range(round(60 * period)):
        y = plant.C @ x + plant.D @ np.vstack([*(held for held, _, _ in own), more])
        seen.append(y)
        for i, c in enumerate(controllers):
            if k % (60 // c.rate) == 0:
                _, z, line = own[i]
                line = np.vstack([line, c.C @ z + c.D @ y[i : i + 1]])
                own[i] = [line[:1], c.A @ z + c.B @ y[i : i + 1], line[1:]]
        x = frame.A @ x + frame.B @ np.vstack([*(held for held, _, _ in own), more])
    return np.vstack([x, *(rows for one in own for rows in one)]), seen[0][len(controllers) :]


@pytest.mark.parametrize("rates", [(60, 60), (60, 30)])
@pytest.mark.parametrize("late", [0, 1, 3])
def test_a_period_is_its_frames_one_by_one(rates, late):
    """A frame sees the line power that the order held before moves at once; the controllers differ."""
    base = uneven_point()
    one = st.Controller.from_control(-3 * WASHOUT, "flow:10-30", "order:7@20", rate=rates[0], delay=late / 60)
    two = st.Controller.from_control(PSS, "pe:7", "vs:3", rate=rates[1], delay=2 * late / 60)
    assert one.D.any()
    assert base.linearize("order:7@20", "flow:10-30, pe:7").D.all()
    inputs, outputs = ["order:3@30", "storage:10"], ["flow:30-40", "voltage:30"]
    loop = base.closed_loop(one, two, inputs=inputs, outputs=outputs)
    n = len(loop.A)
    end, seen = stepped(base, [one, two], inputs, outputs, loop.period)
    M, G, _ = loop.transition()
    for found, wanted in ((M, end[:, :n]), (G, end[:, n:]), (loop.C, seen[:, :n]), (loop.D, seen[:, n:])):
        assert np.abs(found - wanted).max() < 1e-9 * np.abs(wanted).max()


def device_of(base, machine):
    return next(f"order:{s.machine}@{s.bus}" for s in base.case.storage if s.machine == machine)


@pytest.mark.slow
def test_a_sampled_damper_on_ieee39(cases):
    base = cases("ieee39").initialize(storage="50MW")
    one = st.Controller.from_control(200 * WASHOUT, "deviation:1", device_of(base, 1), rate=60, delay="50ms")
    wanted = least_damped(base, [one])
    frequency, decay = errors(ringdown(base, one, bus=16, mw=5.0)[0], wanted)
    assert max(frequency, decay) < 5e-4


@pytest.mark.slow
def test_a_damper_on_wnaps(cases):
    """34 machines: the modal coordinate of the mode, since many modes are near each other."""
    base = cases("wnaps").initialize(storage="50MW")
    one = st.Controller.from_control(200 * WASHOUT, "deviation:14", device_of(base, 14), name="damper")
    wanted, found = modal_pole(base, one, bus=83)
    assert abs(found.imag / wanted.imag - 1) < 2e-6  # 3.7e-7
    assert abs(found.real / wanted.real - 1) < 1e-5  # 1.7e-6


@pytest.mark.parametrize("late", ["continuous", "delayed", "sampled"])
def test_a_band_selects_the_modes_as_it_does_without_controllers(thyristor, late):
    one = {"continuous": damper(), "delayed": damper().delayed("100ms"), "sampled": damper().sampled(60, "100ms")}
    loop = thyristor.closed_loop(one[late])
    whole, part = loop.modes(), loop.modes("0.1..0.9Hz")
    assert type(part) is type(whole)
    assert np.array_equal(part.eigenvalues, whole.eigenvalues)
    inside = whole.df[whole.df.frequency_hz.between(0.1, 0.9)].reset_index(drop=True)
    assert 0 < len(inside) < len(whole.df)
    assert part.df.equals(inside)
    assert loop.modes(band=(0.1, 0.9)).band == part.band == thyristor.modes("0.1..0.9Hz").band == (0.1, 0.9)
    for wrong in (3, "2..1Hz", "0.1..x"):
        with pytest.raises(StudyError) as told:
            thyristor.modes(wrong)
        with pytest.raises(StudyError, match=re.escape(str(told.value))):
            loop.modes(wrong)
    if late == "delayed":
        with pytest.raises(StudyError, match="ends there, not at 12 Hz"):
            loop.modes("0.1..12Hz")


def test_the_closed_loop_of_continuous_controllers_is_that_of_python_control(thyristor):
    """Two routes: our interconnection with names, and feedback() of python-control's matrices."""
    plant = thyristor.linearize("vs", "speed").to_control()
    gains = control.append(*[control.ss(PSS)] * 4)
    theirs = np.sort_complex(control.feedback(plant, -gains).poles())
    ours = np.sort_complex(np.linalg.eigvals(thyristor.closed_loop(*stabilizers()).A))
    assert np.abs(ours - theirs).max() < 1e-6 * np.abs(theirs).max()


def test_sampling_infinitely_fast_is_continuous(thyristor):
    """The error of the modes falls as the frame, from half a frame of delay."""
    exact = least_damped(thyristor, [damper()])
    gaps = [abs(least_damped(thyristor, [damper().sampled(rate)]) - exact) for rate in (100, 200, 400)]
    assert gaps[0] / gaps[1] == pytest.approx(2, abs=0.1)
    assert gaps[1] / gaps[2] == pytest.approx(2, abs=0.1)


def test_the_angle_reference_stays_the_only_zero(thyristor):
    for controllers in ([damper()], [damper().sampled(60, "50ms")]):
        modes = thyristor.closed_loop(*controllers).modes()
        assert modes.eigenvalues[0] == 0
        assert modes.label(0).startswith("angle reference")


def test_a_common_period_of_several_rates(thyristor):
    assert thyristor.closed_loop(damper().sampled(60), stabilizers()[0].sampled(30)).period == pytest.approx(1 / 30)
    assert thyristor.closed_loop(damper().sampled(60), stabilizers()[0].sampled(50)).period == pytest.approx(1 / 10)


@pytest.mark.parametrize("rates", [(60,), (60, 30), (50, 10), (30, 20)])
def test_modes_of_the_system_stay_however_many_frames_there_are_in_a_period(thyristor, rates):
    """Modes are left out that decay to less than a fifth within one frame of the fastest controller, and it is said."""
    gain = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1e-9]]
    outputs = "order:1@5", "order:2@6"
    loop = thyristor.closed_loop(
        *(st.Controller(("deviation:1",), (y,), *gain, rate=r) for y, r in zip(outputs, rates, strict=False))
    )
    s = thyristor.modes().eigenvalues
    there = s[(s.real > loop.floor) & (np.abs(s.imag) < 0.99 * np.pi / loop.period)]
    assert len(there) > 20
    for found, wanted in ((loop.modes().eigenvalues, there), (loop.eigenvalues(), there[1:])):
        assert np.abs(found[:, None] - wanted).min(axis=0).max() < 1e-4
        assert found.real.min() > loop.floor == pytest.approx(max(rates) * np.log(0.2))
    assert f"eigenvalues with real parts above {loop.floor:.3g} 1/s, 3 electro" in str(loop.modes())
    assert "above" not in str(thyristor.closed_loop(damper()).modes())


def test_labels_and_export(thyristor):
    loop = thyristor.closed_loop(damper(), inputs="vref:2", outputs="speed:2")
    system = loop.to_control()
    assert system.nstates == len(loop.states) == len(thyristor.linearize().states) + 2
    assert loop.states[-1] == "x2 damper"
    assert system.input_labels == ["reference SEXS 2"]
    bare = thyristor.linearize("vref:2", "speed:2")
    assert np.abs(loop.response([0.6]) - bare.response([0.6])).max() > 1e-5


@pytest.mark.parametrize("rates", [(60, 59), (2,), (12, 15)])
def test_frames_that_repeat_too_seldom_to_know_the_modes_are_refused(thyristor, rates):
    """At 1/s a mode of 1.1 Hz would be one of 0.1 Hz."""
    gain = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1e-9]]
    outputs = "order:1@5", "order:2@6"
    with pytest.raises(StudyError, match=r"repeat every .* s, so that modes above .* Hz are not known"):
        thyristor.closed_loop(
            *(st.Controller(("deviation:1",), (y,), *gain, rate=r) for y, r in zip(outputs, rates, strict=False))
        )


def test_a_sampled_loop_has_no_continuous_analysis(thyristor):
    loop = thyristor.closed_loop(damper().sampled(60))
    with pytest.raises(StudyError, match="has sampled controllers; use modes"):
        analyze(loop)


def test_a_pole_has_no_frequency_response(thyristor):
    """The energy is an integral."""
    with pytest.raises(StudyError, match="has a pole at one of the frequencies"):
        thyristor.linearize("order:1@5", "energy:1@5").response([0.0])

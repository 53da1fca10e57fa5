"""Margins of single loops against python-control on the exported loop gain, and against eigenvalues."""

from dataclasses import replace

import control
import numpy as np
import pytest
from uneven import uneven_point

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.dynamics.named import all_named
from stabctl.dynamics.signals import OUTPUTS, chosen
from stabctl.smallsignal.opened_loop import LINEAR, OpenedLoop

S = control.tf("s")
WASHOUT = 200 * 3 * S / (1 + 3 * S) / (1 + 0.05 * S)
PSS = 20 * (10 * S / (1 + 10 * S)) * (1 + 0.05 * S) / (1 + 0.02 * S)


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area_thyristor").initialize(storage="50MW")


def damper(**options):
    return st.Controller.from_control(WASHOUT, "deviation:1", "order:1@5", name="damper", **options)


def stabilizer(i, **options):
    return st.Controller.from_control(PSS, f"speed:{i}", f"vs:{i}", name=f"pss {i}", **options)


def exported(base, controllers):
    """L(s) or L(z) of the first controller in python-control, the other loops closed; sign of negative feedback."""
    first = controllers[0]
    plant = base.linearize([c.outputs[0] for c in controllers], [c.inputs[0] for c in controllers]).to_control()
    own = control.append(*(c.to_control() for c in controllers))
    if first.rate:
        plant = control.c2d(plant, 1 / first.rate, "zoh")
        late = control.ss(control.tf([1], [1, *[0] * first.frames], 1 / first.rate))
        own = control.append(*[late] * len(controllers)) * own if first.frames else own
    others = np.diag([0.0] + [1.0] * (len(controllers) - 1))
    return -control.feedback(own * plant, others, sign=1)[0, 0]


LOOPS = {
    "continuous": lambda: [damper()],
    "two stabilizers": lambda: [stabilizer(1), stabilizer(3)],
    "sampled": lambda: [damper(rate=60)],
    "sampled, 100 ms": lambda: [damper(rate=60, delay="100ms")],
    "sampled, two": lambda: [damper(rate=60, delay="50ms"), stabilizer(3, rate=60, delay="50ms")],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(LOOPS))
def test_the_margins_are_those_of_python_control(base, name):
    controllers = LOOPS[name]()
    found = base.margins(*controllers).loops[0]
    system = exported(base, controllers)
    top = np.pi * controllers[0].rate if controllers[0].rate else 2 * np.pi * 50
    w = np.unique(np.r_[np.geomspace(0.05, top, 1500), 2 * np.pi * np.linspace(0.4, 2.5, 2500)])[:-1]
    L = system(1j * w) if system.isctime() else system(np.exp(1j * w * system.dt))
    GM, PM, _, phase_w, gain_w, _ = control.stability_margins(
        (np.abs(L), np.rad2deg(np.unwrap(np.angle(L))), w), returnall=True
    )
    factors = GM[(GM > 1e-3) & (GM < 1e3)]
    assert found.gain_up == pytest.approx(min(factors[factors > 1], default=np.inf), rel=1e-4)
    assert found.gain_down == pytest.approx(max(factors[factors < 1], default=0.0), rel=1e-4)
    for factor, hz in ((found.gain_up, found.gain_up_hz), (found.gain_down, found.gain_down_hz)):
        if np.isfinite(hz):
            assert hz == pytest.approx(phase_w[np.abs(GM / factor - 1).argmin()] / (2 * np.pi), rel=1e-4)
    assert found.phase_deg == pytest.approx(min(np.abs(PM), default=np.inf), abs=1e-3)
    assert found.delay == pytest.approx(min(np.deg2rad(PM % 360) / gain_w, default=np.inf), rel=1e-4)
    if len(PM):
        assert found.phase_hz == pytest.approx(gain_w[np.abs(PM).argmin()] / (2 * np.pi), rel=1e-5)
    near = 2 * np.pi * found.disk_hz * np.linspace(0.98, 1.02, 401)
    disk, gain_db, phase = control.disk_margins(system, np.sort(np.r_[w, near[near <= top]]))
    assert found.disk == pytest.approx(disk, rel=1e-4)
    near = 2 * np.pi * found.distance_hz * np.linspace(0.98, 1.02, 401)
    w = np.r_[w, near[near <= top]]
    L = system(1j * w) if system.isctime() else system(np.exp(1j * w * system.dt))
    assert found.distance == pytest.approx(np.abs(1 + L).min(), rel=1e-4)
    assert 20 * np.log10(found.disk_gain) == pytest.approx(gain_db, rel=1e-3)
    assert found.disk_phase_deg == pytest.approx(phase, rel=1e-3)


@pytest.mark.parametrize("delay", ["0ms", "50ms"])
def test_a_frame_reads_what_the_outputs_before_it_move_at_once(delay):
    """The loop gain is E K (C (z - P)^-1 G + D / z), and returns 1 at every mode of the closed loop."""
    base = uneven_point()
    one = st.Controller.from_control(-3 * S / (1 + S), "flow:10-30", "order:7@20", rate=60, delay=delay)
    two = st.Controller.from_control(PSS, "pe:7", "vs:3", rate=60, delay="100ms")
    smooth = st.Controller.from_control(PSS, "speed:3", "vs:7")
    reads = chosen(base.case, "flow:30-40, pe:7", OUTPUTS)
    loop = OpenedLoop(base, all_named(base, [one, two, smooth]), [LINEAR, LINEAR, None], reads)
    plant = base.linearize("order:7@20, vs:3, vs:7", "flow:10-30, pe:7, speed:3, flow:30-40").to_control()
    assert (plant.D[[0, 1, 3], 0] != 0).all()
    back = np.eye(3)[:, 2:] * smooth.to_control() * np.eye(4)[2:3]
    closed = control.feedback(plant, back, sign=1)
    A, B, C, D = closed.A, closed.B[:, :2], closed.C[[0, 1, 3, 1]], closed.D[[0, 1, 3, 1], :2]
    held = control.ss(A, B, C, 0 * D).sample(1 / 60)
    for s in (0.1 + 2j, -0.3 + 11j, 90j):
        z = np.exp(s / 60)
        y = held(z) + D / z
        K = [c.to_control()(z) * z**-c.frames for c in (one, two)]
        G, signals = loop(s)
        assert np.abs(G - np.diag(K) @ y[:2]).max() < 1e-9 * np.abs(G).max()
        assert np.abs(signals - y[2:]).max() < 1e-9 * np.abs(y).max()
    modes = base.closed_loop(one, two, smooth).modes()
    for s in modes.eigenvalues[modes.swings()]:
        assert abs(np.linalg.det(np.eye(2) - loop(s)[0])) < 1e-7


@pytest.mark.parametrize("options", [{"rate": 60}, {"rate": 60, "delay": "100ms"}, {"delay": "100ms"}, {}], ids=str)
def test_the_margins_of_one_loop_are_those_of_the_eigenvalues(base, options):
    found = base.margins(damper(**options))
    (loop,) = found.loops
    assert found.gain_up == pytest.approx(loop.gain_up, rel=1.1e-4)  # eigenvalues: to 0.01 %
    assert found.gain_down == pytest.approx(loop.gain_down, rel=1.1e-4)
    if "rate" in options:
        assert found.delay == pytest.approx(np.ceil(60 * loop.delay) / 60)  # the first unstable frame
    else:
        assert found.delay == pytest.approx(loop.delay, abs=2e-5)


@pytest.mark.parametrize(
    ("reads", "gain", "delay", "hz"), [("pe:1", -50, 86.73e-3, 4.070), ("voltage:7", -3, 364.9e-3, 0.6218)]
)
def test_a_crossover_that_leads_has_almost_a_turn_of_delay(base, reads, gain, delay, hz):
    """There the angle of -L is negative, so delay does not lead to -1 at once: the other crossover decides."""
    lag = S / (1 + 0.02 * S) if reads == "voltage:7" else 3 * S / (1 + 3 * S) / (1 + 0.05 * S)
    one = st.Controller.from_control(gain * lag, reads, "order:1@5")
    found = base.margins(one)
    (loop,) = found.loops
    assert loop.phase_hz < 0.97 * loop.delay_hz
    assert loop.phase_deg / 360 / loop.phase_hz != pytest.approx(loop.delay, rel=0.2)
    assert loop.delay == pytest.approx(delay, rel=1e-3)
    assert loop.delay_hz == pytest.approx(hz, rel=1e-3)
    assert found.delay == pytest.approx(loop.delay, abs=2e-5)  # by the roots
    for more, stable in ((0.99, True), (1.01, False)):
        assert base.closed_loop(one.delayed(more * delay)).modes().stable == stable


def test_a_direct_path_above_1_allows_no_delay(base):
    """Stable without delay, but the order moves the line power at once, with a gain of 3.15: a neutral loop."""
    one = st.Controller.from_control(3 * S / (1 + 0.02 * S), "flow:7-8", "order:1@5")
    found = base.margins(one)
    assert found.delay == 0
    assert found.loops[0].delay == 0
    late = base.closed_loop(one.delayed("1ms"))
    modes = late.modes()
    assert modes.counted is None
    assert not modes.certified
    assert not modes.stable
    assert "cannot be counted" in str(modes)
    assert late.eigenvalues().real.max() > 0
    with pytest.raises(StudyError, match="unstable"):
        base.margins(one.delayed("1ms"))


@pytest.mark.slow
@pytest.mark.parametrize("rate", [None, 60])
def test_each_output_alone_loses_stability_at_its_margins(base, rate):
    """The closed loop with only this controller's gain or delay changed: its eigenvalues leave where margins say."""
    late = {"rate": rate, "delay": "50ms"}
    controllers = [damper(**late), stabilizer(3, **late)]
    found = base.margins(*controllers)

    def growth(k, changed):
        every = [changed if j == k else c for j, c in enumerate(controllers)]
        return base.closed_loop(*every).modes().eigenvalues.real.max()

    limits = 0
    for k, (c, loop) in enumerate(zip(controllers, found.loops, strict=True)):
        for factor, hz in ((loop.gain_up, loop.gain_up_hz), (loop.gain_down, loop.gain_down_hz)):
            if np.isnan(hz):
                continue
            limits += 1
            inside, outside = (factor * (1 + 0.002 * np.sign(factor - 1) * side) for side in (-1, 1))
            assert growth(k, c.scaled(inside)) < 1e-6 < growth(k, c.scaled(outside))
            swings = base.closed_loop(*[x.scaled(factor) if j == k else x for j, x in enumerate(controllers)])
            away = np.abs(swings.modes().eigenvalues - 2j * np.pi * hz).min()
            assert away < 1e-6
        if np.isfinite(loop.delay):
            limits += 1
            frames = np.ceil(loop.delay * rate) if rate else 0
            before, after = ((frames - 1) / rate, frames / rate) if rate else (0.999 * loop.delay, 1.001 * loop.delay)
            assert growth(k, replace(c, delay=c.delay + before)) < 1e-6
            assert growth(k, replace(c, delay=c.delay + after)) > 1e-6
    assert limits >= 3


def test_the_table_and_the_text(base):
    found = base.margins(damper(rate=60), stabilizer(3, rate=60))
    assert list(found.df["name"]) == ["damper: order:1@5", "pss 3: vs:3"]
    assert found.df["disk"].tolist() == [loop.disk for loop in found.loops]
    assert str(found).splitlines()[0] == found.together
    assert len(str(found).splitlines()) == 3


def test_the_figure_has_the_margins_at_the_loop_gain(base):
    found = base.margins(damper(rate=60, delay="100ms"))
    (loop,) = found.loops
    size, phase = found.plot().axes
    x, y = size.lines[0].get_data()
    assert x.min() >= 1e-3
    margins = {round(line.get_xdata()[0], 6): line.get_ydata() for line in size.lines if len(line.get_xdata()) == 2}
    marked = margins[round(loop.gain_up_hz, 6)]
    assert marked[0] == pytest.approx(-20 * np.log10(loop.gain_up))
    assert np.interp(loop.gain_up_hz, x, y) == pytest.approx(marked[0], abs=0.3)  # between the points of the curve
    crossover = next(
        line for line in phase.lines if len(line.get_xdata()) == 2 and line.get_xdata()[0] == loop.phase_hz
    )
    assert abs(np.diff(crossover.get_ydata())[0]) == pytest.approx(loop.phase_deg)


def test_every_curve_is_that_of_the_loop_in_its_legend(base):
    """The smallest disk margin is first, and every margin ends on the curve of its color."""
    found = base.margins(stabilizer(1), damper(), stabilizer(3))
    size, phase = found.plot().axes
    shown = [next(r for r in found.loops if line.get_label().startswith(r.name)) for line in size.lines[:3]]
    assert shown == sorted(found.loops, key=lambda loop: loop.disk) != list(found.loops)
    ended = 0
    for ax in (size, phase):
        curves = {line.get_color(): line for line in ax.lines if len(line.get_xdata()) > 2}
        for color, loop in zip(curves, shown, strict=True):
            hz = loop.gain_up_hz if ax is size else loop.phase_hz
            for margin in (line for line in ax.lines if line.get_color() == color and line is not curves[color]):
                assert margin.get_xdata() == pytest.approx([hz, hz])
                assert np.abs(margin.get_ydata() - np.interp(hz, *curves[color].get_data())).min() < 0.5  # dB, deg
                ended += 1
    assert ended == 3  # two phase margins and a gain margin


def test_which_loops_have_a_gain(base):
    """None next to sampled controllers for continuous ones, none with two rates."""
    mixed = base.margins(damper(rate=60), stabilizer(3))
    assert [loop.name for loop in mixed.loops] == ["damper: order:1@5"]
    rates = base.margins(damper(rate=60), stabilizer(3, rate=30))
    assert rates.loops == ()
    assert rates.df.empty


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [
        st.Feedback(speed_gain=0.2, min_voltage=0.0).sampled(60, "50ms"),
        st.StorageLaw(slope=0.05, deadband=0.0).sampled(60, "50ms"),
    ],
    ids=["sampled feedback", "sampled storage law"],
)
def test_a_law_has_the_margins_of_its_controllers(cases, law):
    base = cases("two_area").initialize(storage="100MW")
    found = base.margins(law)
    assert found.df.equals(base.margins(*law.controllers(base.case)).df)
    assert len(found.loops) == len(base.case.storage)
    assert min(loop.disk for loop in found.loops) < 1.9  # 1.14


@pytest.mark.slow
def test_a_relay_has_the_margins_of_no_gain_and_limit_cycles_of_a_law(cases):
    base = cases("two_area").initialize(storage="200MW")
    relay = st.BangBang(deadband=1e-3).sampled(60, "400ms")
    found = base.margins(relay)
    assert all(loop.disk == 2 and loop.gain_up == np.inf for loop in found.loops)
    cycles = base.limit_cycles(relay)
    assert len(cycles) > 0
    assert cycles.df.equals(base.limit_cycles(*relay.controllers(base.case)).df)


@pytest.mark.parametrize("study", ["margins", "limit_cycles", "closed_loop"])
def test_what_is_not_a_controller_is_refused(base, study):
    with pytest.raises(StudyError, match="is not a Controller, so it has no linear model"):
        getattr(base, study)("pod")

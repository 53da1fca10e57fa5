"""Controllers in the simulation: limits, deadband, delay, ramp, gate, anti-windup, and what is refused."""

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import EquilibriumError, StudyError
from stabctl.controllers.realization import anti_windup

S = control.tf("s")
LAG = control.ss(100 / (1 + 0.1 * S))
STEP = st.LoadStep(7, "0.1s", p=50)


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area").initialize(storage="50MW")


def with_state(seen, x):
    return 0.0, x


def order(run, device=0):
    return run.arrays.order[:, device]


def test_a_controller_at_rest_gives_nothing(base):
    run = base.simulate(until="1s", control=st.Controller.from_control(LAG, "deviation:1", "order:1@5"))
    assert np.abs(order(run)).max() < 1e-9
    assert np.abs(run.arrays.speed - 1).max() < 1e-9


@pytest.mark.parametrize("rate", [None, 60])
def test_a_deadband_is_subtracted(base, rate):
    """The order grows from 0 at the edge of the deadband, on either side; with frames, one is between the two."""
    gain, dead = control.ss([], [], [], [[100.0]]), 0.02
    one = st.Controller.from_control(gain, "speed:1", "order:1@5", rate=rate, deadband=dead)
    run = base.simulate([STEP, st.LoadStep(7, "1s", p=-150)], "3s", control=one)
    wanted = 100 * (run.speed.values[:, 0] - 1)
    beyond = wanted - np.clip(wanted, -dead, dead)
    assert beyond.min() < 0 < beyond.max()
    moved = np.abs(np.gradient(wanted, run.time)).max() / rate if rate else 0.0
    assert np.abs(order(run) - beyond).max() < 1e-6 + 1.5 * moved < dead


@pytest.mark.parametrize("rate", [None, 60])
def test_every_input_has_its_own_gain_to_every_output(base, rate):
    """Of three inputs and two outputs; with frames, an order is that of the signals at one of the frames around it."""
    D = np.array([[40.0, -7.0, 3.0], [11.0, 25.0, -19.0]])
    reads, drives = ("speed:1", "speed:2", "speed:4"), ("order:1@5", "order:4@10")
    one = st.Controller.from_control(control.ss([], [], [], D), reads, drives, rate=rate)
    run = base.simulate(STEP, "2s", control=one)
    slips = run.speed.values[:, [0, 1, 3]] - 1
    orders = run.arrays.order[:, [0, 3]]
    wanted = slips @ D.T
    moved = np.abs(np.gradient(wanted, run.time, axis=0)).max() / rate if rate else 0.0
    assert np.abs(wanted).max() > 0.005
    assert np.abs(orders - wanted).max() < 1e-6 + 1.5 * moved


def test_orders_of_two_controllers_are_limited_in_sum(base):
    gives = {"one": lambda seen: 0.7, "other": lambda seen: 0.8}
    each = {"inputs": "deviation:1", "outputs": "order:1@5", "rate": 60}
    two = [st.Controller.from_function(law, name=name, **each) for name, law in gives.items()]
    run = base.simulate(until="0.5s", control=two)
    assert order(run).max() == 1.0
    assert run.dataset.storage_order.values.max() == 1.0
    assert run.arrays.storage[:, 0].max() == pytest.approx(50.0, rel=1e-9)


def test_orders_are_late_by_the_delay(base):
    late = st.Controller.from_control(control.ss([], [], [], [[300.0]]), "deviation:1", "order:1@5", rate=60)
    first = []
    for frames in (0, 1, 3, 12):
        run = base.simulate(STEP, "1s", control=late.delayed(frames / 60))
        first.append(run.time[np.flatnonzero(np.abs(order(run)) > 1e-9)[0]])
    assert np.diff(first) == pytest.approx([1 / 60, 2 / 60, 9 / 60], abs=1e-9)


def test_limits_hold_and_are_left_without_windup(base):
    """An integrator at its limit: with tracking it leaves the limit soon after the input changes sign."""

    def last_at_limit(tracking):
        integral = control.ss(500 / S)
        one = st.Controller.from_control(integral, "deviation:1", "order:1@5", limits=0.2, tracking=tracking)
        run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc"), "5s", control=one)
        assert np.abs(order(run)).max() == pytest.approx(0.2, abs=1e-12)
        return run.time[np.abs(order(run)) > 0.2 - 1e-9].max()

    assert last_at_limit("50ms") < last_at_limit(None) - 0.5


def test_a_sampled_integrator_leaves_its_limit_without_windup(base):
    """The law of the anti-windup at frames: with tracking, the state at the limit stays near what the limit needs."""

    def last_at_limit(tracking):
        integral = control.ss(500 / S)
        one = st.Controller.from_control(
            integral, "deviation:1", "order:1@5", rate=60, delay="50ms", limits=0.2, tracking=tracking
        )
        run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc"), "5s", control=one)
        assert np.abs(order(run)).max() == pytest.approx(0.2, abs=1e-12)
        return run.time[np.abs(order(run)) > 0.2 - 1e-9].max()

    assert last_at_limit("50ms") < last_at_limit(None) - 0.5


@pytest.mark.parametrize("tracking", ["50ms", "0.2s", None])
def test_at_its_limit_a_late_integrator_follows_its_equations(base, tracking):
    """With u = 500 x, 50 ms late, and v = u limited: x' = y + (v - u) / (500 Tt), in frames of 1/600 s as well."""
    one = st.Controller.from_control(
        control.ss(500 / S), "deviation:1", "order:1@5", delay="50ms", limits=0.2, tracking=tracking
    )
    fault, h = st.Contingency("7-8@0.4", clear="6cyc"), 1e-3
    run, frames = (base.simulate(fault, "3s", control=c) for c in (one, one.sampled(600)))
    T, speed, H = np.arange(0, 3, h), run.arrays.speed, base.inertia
    y = np.interp(T, run.time, speed[:, 0] - speed[:, 1:] @ H[1:] / H[1:].sum())
    x, wanted = np.zeros((2, len(T)))
    for k in range(len(T) - 1):
        u = 500 * x[k - 50] if k >= 50 else 0.0
        wanted[k] = np.clip(u, -0.2, 0.2)
        x[k + 1] = x[k] + h * (y[k] + (0 if tracking is None else (wanted[k] - u) / 500 / one.tracking))
    orders = np.interp(T, run.time, order(run))
    assert np.abs(wanted).max() == 0.2
    assert np.abs(orders - wanted)[:-1].max() < 0.002  # 0.0011
    assert np.abs(orders - np.interp(T, frames.time, order(frames))).max() < 0.004


@pytest.mark.parametrize(("rate", "left"), [(None, -1 / 0.08), (50, np.exp(-1 / 50 / 0.08))])
def test_the_output_beyond_a_limit_decays_with_the_tracking_time(rate, left):
    """Of the excess e of two outputs: e' = -e/0.08 s, or a factor exp(-T/0.08 s) per frame T."""
    block = control.ss(-np.eye(3), np.ones((3, 1)), [[1.0, 2.0, -0.5], [0.3, 0.0, 4.0]], np.zeros((2, 1)))
    law = st.Controller.from_control(block, "deviation:1", "order:1@5, order:2@6", rate=rate, tracking=0.08)
    C, L = law.C, anti_windup(law, 3)
    assert (-C @ L if rate is None else np.eye(2) - C @ L) == pytest.approx(left * np.eye(2), abs=1e-12)


@pytest.mark.parametrize("rate", [None, 60])
def test_a_gate_on_the_rate_of_the_frequency(base, rate):
    """A controller armed by the measured rate of change of frequency acts while that is large."""
    gate = st.Gate("rocof:7", low=0.05, magnitude=True)
    one = st.Controller.from_control(LAG, "deviation:1", "vs:1", rate=rate, gate=gate)
    run = base.simulate(STEP, "2s", control=one)
    system = run.point.system
    rate_of_frequency = run.rows[:, system.family("rocof").w[0, -1]]
    w = system.family("frame" if rate else "lti").w[0]
    added = run.rows[:, w[-1]] - run.rows[:, w[5]]  # to the stabilizer that is there
    large = np.abs(rate_of_frequency) > 0.05
    assert large.any()
    assert not large.all()
    assert (np.abs(added[~large]) == 0).all()
    assert (np.abs(added[large]) > 0).mean() > 0.9  # not before the first frame, or the first derivative


@pytest.mark.parametrize("options", [{"relay": True, "rate": 60}, {}])
def test_a_gain_leaves_the_limits(base, options):
    """So it does not scale what a relay gives, or an output at its limit."""
    one = st.Controller("deviation:1", "order:1@5", [], [], [], [[500.0]], limits=0.2, deadband=1e-3, **options)
    for gain in (1.0, 3.0):
        run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc"), "2s", control=one.scaled(gain))
        assert np.abs(order(run)).max() == pytest.approx(0.2, abs=1e-12)


def test_a_ramp_limits_the_change_per_frame(base):
    one = st.Controller.from_control(LAG, "deviation:1", "order:1@5", rate=60, ramp=0.6)
    run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc"), "3s", control=one)
    assert np.abs(np.diff(order(run))).max() == pytest.approx(0.01, abs=1e-12)


def test_a_relay_gives_its_limits_or_nothing(base):
    one = st.Controller.from_control(
        control.ss([], [], [], [[1.0]]),
        "deviation:1",
        "order:1@5",
        rate=60,
        relay=True,
        limits=(-1, 0.5),
        deadband=1e-4,
    )
    run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc"), "3s", control=one)
    assert set(np.unique(order(run))) == {-1.0, 0.0, 0.5}


@pytest.mark.parametrize("rate", [None, 60])
def test_a_gate_opens_and_closes(base, rate):
    one = st.Controller.from_control(
        100 * control.ss([], [], [], [[1.0]]), "deviation:1", "order:1@5", rate=rate, gate=st.Gate("voltage:7", 0.9)
    )
    run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc", at="0.5s"), "3s", control=one)
    low = np.abs(run.arrays.V[:, 6]) < 0.9
    assert low.any()
    assert np.abs(order(run)[low]).max() == 0
    assert np.abs(order(run)).max() > 0.01


@pytest.mark.parametrize("rate", [None, 60])
def test_a_window_of_time(base, rate):
    gate = st.Gate(start=1.0, end=1.505)
    one = st.Controller.from_control(LAG, "deviation:1", "order:1@5", rate=rate, gate=gate)
    run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc", at="0.5s"), "3s", control=one)
    inside = (run.time > 1.02) & (run.time < 1.505 - 1e-9)
    assert np.abs(order(run)[inside]).min() > 0
    assert np.abs(order(run)[(run.time < 1 - 1e-9) | (run.time > 1.505 + 1 / 60)]).max() == 0


def test_the_controller_of_a_tripped_machine_stops(base):
    one = st.Controller.from_control(LAG, "speed:1", "vs:1", name="pss")
    run = base.simulate(st.TripMachine(1, 0.5), "1.5s", control=one, criterion=st.Criterion(max_angle=1e3))
    state = run.rows[:, base.layout.nx]  # of the controller, behind those of the system
    after = run.time > 0.5 + 1e-9
    assert np.ptp(state[after]) == 0


@pytest.mark.parametrize("read", ["speed:1", "state:speed GENROU 1", "state:field voltage SEXS 1"])
@pytest.mark.parametrize("kind", ["continuous", "sampled", "function"])
def test_inputs_of_a_tripped_machine_count_as_at_rest(base, kind, read):
    """Also its states, and those of its controls."""
    gain = control.ss([], [], [], [[50.0]])
    one = st.Controller.from_control(gain, [read], "order:2@6", rate=60 if kind == "sampled" else None)
    if kind == "function":
        one = st.Controller.from_function(lambda seen: 50 * seen[read], [read], "order:2@6")
    events = [st.LoadStep(7, "0.1s", p=50), st.TripMachine(1, 0.5)]
    run = base.simulate(events, "2s", control=one, criterion=st.Criterion(max_angle=1e3))
    before = run.time < 0.5
    assert np.abs(order(run, 1)[before]).max() > 1e-3
    assert np.abs(order(run, 1)[run.time > 0.55]).max() == 0


def test_the_storage_of_a_tripped_machine_is_still_read(cases):
    """It has its own connection: a state of it goes on, and so does what reads it."""
    base = cases("two_area").initialize([st.Storage(1, 5, 50.0, lag=0.1), st.Storage(2, 6, 50.0)])
    read = st.Controller("state:power ESD 1@5", "order:2@6", [], [], [], [[1.0]], name="read")
    drive = st.Controller.from_function(lambda seen: 0.2, "deviation:1", "order:1@5", gate=st.Gate(start=1.0))
    run = base.simulate(st.TripMachine(1, 0.5), "2s", control=[read, drive], criterion=st.Criterion(max_angle=1e3))
    share = run.arrays.storage[:, 0] / 50
    assert share[-1] == pytest.approx(0.2, rel=1e-3)
    assert np.abs(order(run, 1) - share).max() < 1e-9


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: st.Controller.from_control(S, "speed:1", "vs:1"), "is improper: its numerator has degree 1"),
        (lambda: st.Controller.from_control(LAG), r"have no names \(u\[0\]\); give inputs"),
        (lambda: st.Controller.from_control(3, "speed:1", "vs:1"), "is not a python-control"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", rate=60, delay="20ms"), "give 16.67 or 33.33 ms"),
        (lambda: st.Controller.from_control(LAG, "speed:1,speed:2", "vs:1"), "matrix B .* is 1 x 1, but must be 1 x 2"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", limits=(0.1, 0.2)), "must include 0"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", delay="5cyc"), "is not a time"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", ramp=1.0), "needs a sampled controller"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", relay=True), "give finite ones"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", relay=True, limits=0.0), "always 0; give others"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", relay=True, limits=(-np.inf, 0.1)), "finite ones"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", relay=True, limits=(-0.1, np.inf)), "finite ones"),
        (lambda: st.Gate(low=2, high=1), "never open"),
        (lambda: st.Controller("speed:1", "vs:1", [["a"]], [[1]], [[1]], [[0]]), "matrix A .* is not made of numbers"),
        (lambda: st.Controller("speed:1", "vs:1", [[1], [1, 2]], [[1]], [[1]], [[0]]), "is not made of numbers"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1").sampled(0), "rate of 0 frames per second"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", rate=0), "rate of 0 frames per second"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", gate="voltage:7"), "is not a gate"),
        (lambda: st.Controller.from_function(abs, "speed:1", "vs:1", start=0.0), "start = 0.0 are not states"),
        (lambda: st.Feedback(1.0, braking="eq14"), r"braking = 'eq14' .* must be True or False"),
        (lambda: st.Gate(low=0.8), "low, high and magnitude are those of a signal"),
        (lambda: st.Gate(magnitude=True), "low, high and magnitude are those of a signal"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", limits=0), "the output is always 0"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1").sampled(60.0), "give a whole number from 1 to"),
        (lambda: st.Controller.from_control(LAG, "speed:1", "vs:1", delay="7ms").sampled(60), "not a whole number of"),
        (lambda: st.Gate("voltage:7"), "always open; give low or high"),
        (lambda: st.Controller("speed:1", "vs:1", [], [], [], [[1]], name="a\vb"), "name = .* give one line of text"),
        (lambda: st.Controller.from_function(with_state, "speed:1", "vs:1"), r"with states, give start=\[0.0\]"),
        (lambda: st.Controller.from_function(lambda seen: 0, "speed:1", "vs:1", start=[0.0]), "takes no states"),
        (lambda: st.Controller("speed:1", "vs:1", [], [], [], [[1]], start=(1.0,)), "states of a Python function"),
        (lambda: st.Controller("speed:1", "vs:1", [], [], [], [[1]], tracking=0.1), "there are none"),
    ],
)
def test_mistakes_in_a_controller(make, says):
    with pytest.raises(StudyError, match=says):
        make()


def test_a_sampled_controller_keeps_its_delay_in_whole_frames():
    late = st.Controller.from_control(LAG, "speed:1", "vs:1", delay="100ms")
    assert [late.sampled(60).delay, late.sampled(60, delay=0).delay] == [0.1, 0.0]
    assert late.sampled(60, delay="16.67ms").delay == 1 / 60


@pytest.mark.parametrize("rate", [None, 50])
def test_a_controller_in_python_control_is_continuous_or_sampled(rate):
    """Not of any time base, which would join both kinds; back from there it is the same controller."""
    block = control.ss([[-3.0, 1.0], [0.0, -7.0]], [[1.0, 0.2], [0.3, 2.0]], [[5.0, 0.5]], [[0.7, -0.1]])
    one = st.Controller.from_control(block, "deviation:1, speed:2", "order:1@5", rate=rate, name="pod")
    system = one.to_control()
    assert system.dt == (1 / rate if rate else 0)
    with pytest.raises(ValueError, match="timebases"):
        control.append(system, control.ss(-1, 1, 1, 0, 0 if rate else 1 / 50))
    again = st.Controller.from_control(system, one.inputs, one.outputs)
    assert again.rate == rate
    assert all(np.array_equal(getattr(again, key), getattr(one, key)) for key in "ABCD")


def test_a_complex_output_is_no_output(base):
    law = st.Controller.from_function(lambda seen: 1j, "deviation:1", "order:1@5")
    with pytest.raises(StudyError, match="returned 1j at"):
        base.simulate(until="0.1s", control=law)


def test_margins_say_what_they_need(base):
    law = st.Controller.from_function(lambda seen: 5 * seen["deviation:1"], "deviation:1", "order:1@5")
    with pytest.raises(StudyError, match="margins need matrices"):
        base.margins(law)


@pytest.mark.parametrize(
    ("reads", "drives", "says"),
    [
        ("speeed:1", "vs:1", "'speeed' is not an output; did you mean speed"),
        ("speed:1", "orderq:1@5", "'orderq' is not an input; did you mean order_q or order"),
        ("speed:1", "order:1@7", "two_area has no storage device 1@7; did you mean 1@5"),
        ("flow:7-80", "vs:1", "There is no branch 7-80"),
        ("speed:9", "vs:1", "There is no machine 9"),
        ("deviation:1+2+3+4", "vs:1", "leaves no other machine to compare with"),
        ("speed:1", "field:1", "has an exciter; use vref:1"),
        ("state:speed of 1", "vs:1", "has no state 'speed of 1'; similar ones are"),
        ("deviation", "vs:1", "has matrices for 1 inputs and 1 outputs, but its signal names stand for 4 inputs"),
    ],
)
def test_signals_that_the_case_does_not_have(base, reads, drives, says):
    one = st.Controller.from_control(LAG, reads, drives)
    with pytest.raises(StudyError, match=says):
        base.simulate(until="0.1s", control=one)


def test_what_a_controller_drives_is_what_others_read_and_what_is_recorded():
    """Pm of a machine without governor and Efd of one without exciter: the set-point and what the controller adds."""
    bare = st.load("two_area").without_device("pss").without_device("sexs").without_device("tgov")
    point = bare.initialize(storage="3@11=50MW")
    rest = point.simulate(until="0.1s").dataset
    for read, driven, recorded in (("pm:1", "power:1", "mechanical_power"), ("efd:1", "field:1", "field_voltage")):
        step = st.Controller.from_function(lambda seen: 0.01, "speed:1", driven, rate=60)
        follow = st.Controller.from_control(control.ss([], [], [], [[0.5]]), read, "order:3@11")
        run = point.simulate(until="0.5s", control=[follow, step])
        change = run.dataset[recorded].sel(machine=1).values - rest[recorded].sel(machine=1).values[0]
        assert change == pytest.approx(0.01, abs=1e-12)
        assert order(run, 0)[1:] == pytest.approx(0.005, abs=1e-12)


def test_a_ramp_limit_of_a_device_is_not_for_controllers(base):
    """It stands between a law and its device; a controller would pass it by."""
    ramped = base.case.with_storage("50MW", ramp=25.0)
    law = st.StorageLaw(slope=0.05, deadband=0.02)
    with pytest.raises(StudyError, match="whose ramp limit holds for laws only"):
        ramped.simulate(until="1s", control=list(law.controllers(ramped)))
    ramped.simulate(until="1s", control=law)


def test_a_gate_has_one_signal(base):
    one = st.Controller.from_control(LAG, "deviation:1", "vs:1", gate=st.Gate("voltage", low=0.8))
    with pytest.raises(StudyError, match="gate: 'voltage' are 11 signals; give one, such as voltage:1"):
        base.simulate(until="0.1s", control=one)


def test_an_algebraic_loop_is_named(base):
    direct = control.ss([], [], [], [[0.01]])
    for reads, drives in (("efd:1", "vs:1"), ("absorbed:1", "order:1@5")):
        one = st.Controller.from_control(direct, reads, drives, name="loop")
        with pytest.raises(EquilibriumError, match=r"algebraic loop: .*controller loop.*; add a lag"):
            base.simulate(until="0.1s", control=one)


@pytest.mark.parametrize("rate", [None, 60])
def test_a_gate_on_a_signal_that_its_own_controller_changes_is_decided_once_per_step(base, rate):
    """The order jumps, the measured frequency with it: the gate stays as it was until the next step."""
    one = st.Controller.from_control(
        300 * LAG, "deviation:1", "order:1@5", rate=rate, gate=st.Gate("rocof:5", low=0.05, magnitude=True)
    )
    run = base.simulate(st.Contingency("7-8@0.4", clear="6cyc"), "5s", control=one)
    assert run.outcome.stable
    assert 0 < (np.abs(run.arrays.order[:, 0]) > 0).mean() < 1

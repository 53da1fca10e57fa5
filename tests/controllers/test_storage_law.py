"""Storage laws on a surface of speed and angle: alone, in a run, at frames, and as files."""

import json
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.controllers import Input, SampledLaw, StorageDevice, decided, hold, storage_law

DEVICE = StorageDevice(45.0, 830.0, 50.0, 137.0, 7.0)
FAULT = st.Contingency("7-8@0.4", clear="20cyc")


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize(storage="50MW")


def order(law, deviation, angle=0.0, *, voltage=1.0, acceleration=0.0, energy=7.0, time=0.0, before=None):
    signals = Input(deviation / 50, acceleration / 50, angle, energy, time)
    return decided(law, law.par(DEVICE), signals, voltage, before)


def relative(run, group):
    """Speed (pu) and change of angle (rad) of a group of rotors against the others."""
    H, own = run.point.inertia, np.isin(range(len(run.point.inertia)), group)
    change = run.arrays.angle - run.arrays.angle[0]
    weights = np.where(own, H / H[own].sum(), -H / H[~own].sum())
    return run.arrays.speed @ weights, change @ weights


@given(some.floats(-2, 2), some.floats(-1, 1), some.floats(0, 1.2))
def test_the_order_has_the_sign_of_the_surface_outside_deadband_and_gate(deviation, angle, voltage):
    law = st.StorageLaw(angle_gain=1.5, deadband="200mHz")
    surface = deviation + 1.5 * angle / (2 * np.pi)
    given = order(law, deviation, angle, voltage=voltage).wanted
    assert given == (np.sign(surface) if voltage >= 0.8 and abs(surface) > 0.2 + 1e-12 else 0)


@given(some.floats(-2, 2))
def test_a_slope_gives_power_in_proportion(deviation):
    """What is beyond the rating is left to the hold: behind a ramp limit, it tells how soon the order turns back."""
    law = st.StorageLaw(slope="500mHz", deadband="100mHz")
    beyond = max(abs(deviation) - 0.1, 0) / 0.5
    assert order(law, deviation).wanted == pytest.approx(np.sign(deviation) * beyond, abs=1e-12)


def test_it_idles_while_the_deviation_changes_quickly():
    law = st.StorageLaw(max_acceleration="2Hz/s")
    assert order(law, 0.5, acceleration=-2.1).wanted == 0
    assert order(law, 0.5, acceleration=1.9).wanted == 1


def test_it_stays_armed_for_a_time_after_the_surface_was_last_beyond_the_level():
    law = st.StorageLaw(arm_at="500mHz", timeout="3s")
    idle = order(law, 0.4)
    assert idle.wanted == 0
    armed = order(law, 0.6, time=1.0, before=idle)
    assert armed == storage_law.Output(1.0, 4.0)
    assert order(law, -0.4, time=3.9, before=armed) == storage_law.Output(-1.0, 4.0)
    assert order(law, -0.4, time=4.0, before=armed).wanted == 0


def test_an_idle_device_returns_its_energy():
    law = st.StorageLaw(return_time="10s", return_power=0.1)
    assert order(law, 0.0, energy=7.2).wanted == pytest.approx(-0.2 / 10 * 137 / 45)  # 0.2 pu s in 10 s, of 45 MW
    assert order(law, 0.0, energy=6.0).wanted == 0.1
    assert order(law, 0.5, energy=7.2).wanted == 1


def test_constants_are_on_the_bases_of_the_device():
    """Gains of feedback are on the machine's base, orders in ratings, speeds in pu of 50 Hz."""
    law = st.Feedback(0.02, 0.003, deadband=0.1, min_voltage=0.7)
    found = decided(law, law.par(DEVICE), Input(0.004, -0.01, 0.0, 7.0, 0.0), 0.8)
    assert found.wanted == pytest.approx((0.02 * 0.004 - 0.003 * 0.01) * 2 * np.pi * 50 * 830 / 45)
    par = st.BangBang("150mHz", 0.6).par(DEVICE)
    assert (par.deadband, par.gate) == (pytest.approx(0.003), 0.6)
    surface = st.StorageLaw(angle_gain=1.5, slope="0.5Hz", deadband="0.2Hz", max_acceleration="2Hz/s", arm_at="0.4Hz")
    own = surface.par(DEVICE)
    assert own[:6] == pytest.approx((1.5 / (2 * np.pi * 50), 0.01, 0.004, 0.8, 0.04, 0.008))


@pytest.mark.parametrize("ramp", [0.0, 2.0])
def test_an_order_is_held_within_its_limits_and_ramp_and_is_zero_without_its_machine(ramp):
    reach = 2.0 * 0.05 if ramp else np.inf
    for wanted, online, goal in ((1.7, 1.0, 1.0), (-1.4, 1.0, -1.0), (0.35, 1.0, 0.35), (0.9, 0.0, 0.0)):
        found = hold.step(hold.Input(wanted, online, before=0.3, aim=wanted, elapsed=0.05), hold.Par(ramp)).order
        assert found == pytest.approx(0.3 + np.clip(goal - 0.3, -reach, reach))


@given(some.floats(-1, 1), some.floats(-4, 4), some.floats(-4, 4), some.floats(0, 1.5))
def test_a_limited_order_follows_an_order_wanted_that_changes_linearly(before, aim, wanted, reach):
    """Against the same limits applied in 4,000 short steps."""
    found = hold.step(hold.Input(wanted, 1.0, before, aim, elapsed=reach / 20), hold.Par(20.0)).order
    kept, n = before, 4000
    for goal in np.clip(aim + (wanted - aim) * np.arange(1, n + 1) / n, -1, 1):
        kept += min(max(goal - kept, -reach / n), reach / n)
    assert abs(found) <= 1
    # In the steps, a kink and the end are found to within a step: 8 / 4,000 of the order wanted.
    assert found == pytest.approx(kept, abs=4e-3)


def test_without_an_angle_it_is_the_bang_bang_law(base):
    law = base.simulate(FAULT, control=st.StorageLaw())
    assert np.array_equal(law.rows, base.simulate(FAULT, control=st.BangBang()).rows)


@pytest.mark.parametrize("groups", [(), ("1+2",), ("1+2", "3+4")])
def test_orders_follow_the_surface_of_each_group(base, groups):
    """Recomputed from the trajectory, away from the switching instants."""
    law = st.StorageLaw(groups=groups, angle_gain=1.0, slope="200mHz", deadband=0, min_voltage=0)
    run = base.simulate(FAULT, 3, control=law)
    for j in range(4):
        own = next(([n - 1 for n in g] for g in law.groups if j + 1 in g), [j])
        w, d = relative(run, own)
        want = np.clip((60 * w + d / (2 * np.pi)) / 0.2, -1, 1)
        quiet = np.append(True, np.abs(np.diff(want)) < 0.02) & (run.time > run.time[0])
        assert np.abs(run.arrays.order[:, j] - want)[quiet].max() < 1e-9
    assert np.abs(run.arrays.order).max() == 1


def test_a_group_that_a_switching_divides_acts_in_each_island_with_the_machines_there(base):
    law = st.StorageLaw(groups=("1+3",), angle_gain=1.0, slope="200mHz", deadband=0, min_voltage=0)
    run = base.simulate([st.Open("7-8", 0.5), st.Open("7-8#2", 0.5)], 2, control=law)
    change, divided = run.arrays.angle - run.arrays.angle[0], run.time > 0.5
    for one, other in ((0, 1), (2, 3)):
        w, d = (x[:, one] - x[:, other] for x in (run.arrays.speed, change))
        want = np.clip((60 * w + d / (2 * np.pi)) / 0.2, -1, 1)
        assert np.abs(run.arrays.order[:, one] - want)[divided].max() < 1e-9
        assert np.abs(run.arrays.order[:, other] + want)[divided].max() < 1e-9
        assert np.ptp(want[divided]) > 0.1


def test_a_group_has_one_order(base):
    run = base.simulate(FAULT, 3, control=st.StorageLaw(groups=("1+2",), min_voltage=0))
    assert np.array_equal(run.arrays.order[:, 0], run.arrays.order[:, 1])
    assert not np.array_equal(run.arrays.order[:, 2], run.arrays.order[:, 3])


def test_the_time_out_ends_the_action_and_the_energy_returns(base):
    law = st.StorageLaw(arm_at="300mHz", timeout="1s", return_time="1s", return_power=0.2, deadband="50mHz")
    run = base.simulate(FAULT, 20, control=law)
    energy = run.arrays.energy - run.arrays.energy[0]
    late = run.time > 15
    assert np.abs(run.arrays.order)[run.time < 5].max() == 1
    assert np.abs(run.arrays.order)[late].max() <= 0.2
    assert np.abs(energy).max() > 5e-3  # MWh
    assert np.abs(energy[-1]).max() < 4e-6  # measured 2e-7


@pytest.mark.parametrize(("rate", "delay"), [(30, "100ms"), (60, 0), (60, "50ms")])
def test_a_law_at_frames_acts_as_its_controllers(base, rate, delay):
    """Two routes: the law with its delay line, and a sampled relay controller for every device."""
    law = st.BangBang().sampled(rate, delay)
    one = base.simulate(FAULT, control=law)
    two = base.simulate(FAULT, control=list(law.controllers(base.case)))
    assert np.array_equal(one.arrays.order, two.arrays.order)
    assert np.abs(one.arrays.speed - two.arrays.speed).max() < 1e-12
    assert np.abs(one.arrays.order).max() == 1


def test_a_law_at_frames_acts_late(base):
    """Proportional: the order is the deviation three frames earlier, held for a frame."""
    law = st.StorageLaw(slope="5Hz", deadband=0, min_voltage=0)
    run = base.simulate(FAULT, 3, control=law.sampled(60, "50ms"), step=1 / 120)
    w, _ = relative(run, [0])
    frames = np.flatnonzero(np.abs(run.time * 60 - np.round(run.time * 60)) < 1e-6)
    frames = frames[np.append(True, np.diff(run.time[frames]) > 1e-6)]
    assert np.abs(run.arrays.order[frames[4:-1], 0] - 12 * w[frames[1:-4]]).max() < 1e-12


def test_angles_in_the_surface_raise_the_clearing_time(base):
    fault = st.Contingency("7-8@0.4")
    plain = base.clearing_time(fault, control=st.BangBang())
    law = base.clearing_time(fault, control=st.StorageLaw(angle_gain=1.0))
    assert plain.cycles == 26  # the paper's law
    assert law.cycles == 27.625


@pytest.mark.parametrize(
    "law",
    [
        st.BangBang("50mHz"),
        st.Feedback(0.01, 0.001),
        st.StorageLaw(("1+2", "3+4"), 1.5, "100mHz", timeout="3s"),
        st.StorageLaw(arm_at=0.4).sampled(60, "50ms"),
    ],
)
def test_a_file_gives_back_the_law(tmp_path, law):
    found = st.load_controller(law.save(tmp_path / "law.toml"))
    assert found == law
    assert type(found) is type(law)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('law = "surface"', "law = 'surface': it must be one of storage law, bang-bang, feedback"),
        ('law = "storage law"\nangle = 1', "'angle' is not a known key; did you mean 'angle_gain'"),
        ('law = "bang-bang"\ndeadband = -1', "deadband = -1 Hz"),
        ('law = "bang-bang"\nrate = 60\ndelay = "20ms"', "not a whole number of frames"),
        ('law = "storage law"\ngroups = ["1+x"]', "does not name machines"),
        ('law = "storage law"\ngroups = 3', "groups = 3 does not name machines"),
        ('law = "storage law"\ndelay = "50ms"', "a delay needs a sampling rate; give one"),
        ('law = ["storage law"]', "it must be one of"),
    ],
)
def test_mistakes_in_a_file(tmp_path, text, says):
    path = tmp_path / "law.toml"
    path.write_text(text)
    with pytest.raises(StudyError, match=says) as caught:
        st.load_controller(path)
    assert "law.toml" in str(caught.value)


def test_what_is_not_possible(base):
    for make, says in (
        (lambda: st.StorageLaw(groups=("1+2", "2+3")), "machine 2 is in two groups"),
        (lambda: st.StorageLaw(arm_at=0.05), "must not be less than deadband"),
        (lambda: st.StorageLaw(slope="fast"), "slope"),
        (lambda: SampledLaw(st.BangBang(), 0), "rate of 0"),
        (lambda: SampledLaw(st.BangBang().sampled(60), 60), "not a law that can be sampled"),
        (lambda: base.simulate(FAULT, control=st.StorageLaw(groups="1+7")), "There is no machine 7"),
        (lambda: st.StorageLaw(arm_at=0.4).controllers(base.case), "arm_at of a storage law has no counterpart"),
    ):
        with pytest.raises(StudyError, match=says):
            make()


def test_a_law_on_the_command_line(stabctl, tmp_path):
    path = st.StorageLaw(angle_gain=1.0).save(tmp_path / "law.toml")
    fault = ("clearing-time", "two_area", "--fault", "7-8@0.4", "--storage", "50MW", "--controller", path, "--json")
    assert json.loads(stabctl(*fault)[1])["cycles"] == 27.625
    code, _, said = stabctl(*fault, "--deadband", "50mHz")
    assert code == 2
    assert "have no effect with a storage law" in said


@pytest.mark.parametrize("option", [("--deadband", "0.3"), ("--min-voltage", "0.5")])
def test_siting_refuses_options_of_a_law_that_does_not_act(stabctl, tmp_path, option):
    law = st.StorageLaw(angle_gain=1.0).save(tmp_path / "law.toml")
    orders = st.Controller.from_control(control.tf(1.0, 1), "deviation:1", "order:1@5").save(tmp_path / "orders.toml")
    for path, says in ((law, "have no effect with a storage law"), (orders, "no storage device has the bang-bang law")):
        code, _, said = stabctl("place", "two_area", "--controller", path, *option)
        assert code == 2
        assert says in said


def test_a_law_changes_nothing_at_rest(base):
    law = replace(st.StorageLaw(angle_gain=2.0), deadband=0.0, slope=0.1)
    assert np.abs(base.simulate(None, 1, control=law).arrays.speed - 1).max() < 1e-9


def test_a_device_without_power_has_a_controller_without_gain(cases):
    """As a screen of sizes asks for it: 0 MW at one machine."""
    case = cases("two_area").with_storage("2=0MW,3=50MW")
    none, some = st.Feedback(0.5).controllers(case)
    assert none.D == 0
    assert some.D[0, 0] == pytest.approx(0.5 * 2 * np.pi * 60 * 900 / 50, rel=1e-12)


@pytest.mark.parametrize(("slope", "deadband"), [(0.1, 0.05), (0.04, 0.0), (0.0, 0.03)])
def test_the_controller_of_a_law_has_its_deadband(base, slope, deadband):
    """In ratings beyond a slope, and in pu of speed before a relay; its gain is that of the law."""
    case = base.case
    one = st.StorageLaw(slope=slope, deadband=deadband).controllers(case)[0]
    assert one.deadband == pytest.approx(deadband / slope if slope else deadband / 60)
    assert one.relay == (slope == 0)
    assert one.D[0, 0] == pytest.approx(60 / slope if slope else 1.0)


def test_a_delay_has_so_many_frames_at_most():
    assert st.BangBang().sampled(10_000, 0.2).frames == 2000
    with pytest.raises(StudyError, match=r"a delay of 0.2001 s is 2001 frames; give at most 2000"):
        st.BangBang().sampled(10_000, 0.2001)

"""Motors that draw a share of a load: the same power flow, a stationary start, motion that does not depend on the
division of the load, and the words for a motor that has stalled."""

import json
from dataclasses import replace

import numpy as np
import pytest
from records import cim
from systems import CLASSICAL, MOTOR, small

import stabctl as st
from stabctl._util.errors import StabctlError
from stabctl.dynamics.rows import load_rows
from stabctl.estimation._network_model import NetworkModel
from stabctl.model.tables import Load
from stabctl.simulation.outcome import Stalled
from stabctl.simulation.timeline import timeline
from stabctl.simulation.topology import stage

ZIP = Load(2, 200.0, 50.0, p_power=0.3, q_power=0.1, p_current=0.2, q_current=0.4)
FAULT = st.Contingency("2", clear="100ms", at=0.1)


@pytest.fixture(scope="module")
def plain():
    return small({"gencls": CLASSICAL}, load=ZIP)


@pytest.fixture(scope="module")
def shared(plain):
    return plain.with_motors("40%", H=0.3)


def weak():
    """The case with long lines and little power in them."""
    far = {"branches.1-2.x": 0.3, "branches.2-3.x": 0.2, "branches.2-3#2.x": 0.2}
    return small({"gencls": CLASSICAL}, load=ZIP, p=50.0).set(far)


def voltages(case, until=1.5):
    return case.initialize().simulate(FAULT, until=until).arrays.V


def slip(run):
    """Slip of the first motor in every row."""
    labels = [f"{place.name} {place.table}" for place in run.point.layout.states]
    return run.rows[:, labels.index("slip cim")]


def test_the_power_flow_does_not_change_and_the_start_is_stationary(plain, shared):
    assert np.array_equal(shared.power_flow().V, plain.power_flow().V)
    V = shared.initialize().simulate(until="3s").arrays.V
    assert np.abs(V - plain.power_flow().V).max() < 1e-10  # 3e-14


def test_motor_and_rest_draw_their_shares(shared):
    """At the power-flow voltage; the susceptance of the motor makes up its reactive power."""
    system = shared.initialize().system
    motor, rest = (
        dict(zip(f.device.Par._fields, f.k[0], strict=True)) for f in map(system.family, ("cim", "zip_load"))
    )
    V = abs(shared.power_flow().V[1])
    assert (motor["P0"], motor["Q0"], motor["mva"]) == pytest.approx((0.8, 0.2, 1.25 * 0.8), abs=1e-12)
    power, current = complex(rest["Pp"], rest["Qp"]), complex(rest["Pc"], rest["Qc"]) * V
    assert power == pytest.approx(0.6 * (2.0 * 0.3 + 0.5j * 0.1), abs=1e-12)
    assert current == pytest.approx(0.6 * (2.0 * 0.2 + 0.5j * 0.4), abs=1e-12)
    fixed = system.fixed[1].conjugate() * V**2
    assert fixed == pytest.approx(0.6 * (2.0 * 0.5 + 0.5j * 0.5), abs=1e-12)


def test_a_share_of_zero_and_one_are_the_load_alone_and_the_motor_alone(plain):
    whole = replace(plain, devices={**plain.devices, "cim": {2: MOTOR}})
    assert np.array_equal(voltages(plain.with_motors(0)), voltages(plain))
    assert np.array_equal(voltages(plain.with_motors(1)), voltages(whole))


def test_a_load_with_a_share_equals_two_loads_and_its_two_halves(shared):
    """One row with a motor share; a row of the rest and one of the motor; two rows of half the power with motors."""
    motor = shared.devices["cim"][2]

    def rows(loads, keys):
        return replace(shared, loads=tuple(loads), devices={**shared.devices, "cim": dict.fromkeys(keys, motor)})

    rest = ZIP._replace(p=0.6 * ZIP.p, q=0.6 * ZIP.q)
    apart = rows([rest, rest._replace(p=0.4 * ZIP.p, q=0.4 * ZIP.q, id="motor")], ["2#2"])
    half = shared.loads[0]._replace(p=ZIP.p / 2, q=ZIP.q / 2, id="a")
    halves = rows([half, half._replace(id="b")], [2, "2#2"])
    for other in (apart, halves):
        assert np.abs(voltages(other) - voltages(shared)).max() < 1e-9  # 4e-13


def test_more_motors_recover_later(plain):
    """Voltage 10 ms after clearing, with motors of H = 0.3 s: 0.991, 0.950, 0.911 pu."""
    late = [abs(voltages(plain.with_motors(share, H=0.3), 0.21)[-1, 1]) for share in (0, 0.3, 0.6)]
    assert -np.diff(late) == pytest.approx([0.041, 0.039], abs=0.002)


def test_a_stalled_motor_stops_and_is_named():
    """After a bolted fault of 0.4 s the motor stands still and does not turn backward; synchronism is kept."""
    base = weak().with_motors(0.5, H=0.2).initialize()
    run = base.simulate(replace(FAULT, clear="0.4s"), until="4s")
    assert run.outcome.stable
    assert run.outcome.stalled == (2,)
    assert run.outcome.message.endswith("The motor load at bus 2 has stalled, with a slip of 100 %.")
    assert slip(run).max() == 1.0
    assert abs(run.arrays.V[-1, 1]) == pytest.approx(0.63, abs=0.01)
    short = base.simulate(replace(FAULT, clear="50ms"), until="4s")
    assert short.outcome.stalled == ()
    assert "stalled" not in short.outcome.message
    assert abs(short.arrays.V[-1, 1]) > 0.95
    found = base.clearing_time(FAULT, resolution="6cyc", limit="30cyc", scan=0, longest=0)
    assert found.stalled == (2,)
    assert "In the longest stable run, motor loads at bus 2 have stalled." in str(found)


@pytest.mark.parametrize("low", [0.5, 0.7])
def test_a_stalled_motor_that_holds_its_bus_low_is_a_voltage_collapse(low):
    """At 0.63 pu, beside constant admittance alone: below the threshold of the row for 0.5 s, or not."""
    case = weak().set({"loads.2.p_power": 0, "loads.2.q_power": 0, "loads.2.p_current": 0, "loads.2.q_current": 0})
    base = case.set({"loads.2.v_low": low}).with_motors(0.5, H=0.2).initialize()
    end = base.simulate(replace(FAULT, clear="0.4s"), until="4s").outcome
    assert end.stalled == (2,)
    assert (end.kind, end.bus) == (("voltage_collapse", 2) if low == 0.7 else ("stable", None))
    assert end.time_s == pytest.approx(1.0 if low == 0.7 else 4.0, abs=2e-2)


def test_a_motor_that_crawls_has_stalled():
    """After a fault of 0.1 s it stays between the peaks of its torque; one without fault keeps a slip of 1 %."""
    base = weak().with_motors(0.3, R1=0.3, X1=0.08, R2=0.01, X2=0.25, Xa=0.08, H=0.3).initialize()
    assert slip(base.simulate(until="1s")) == pytest.approx(0.009695, rel=1e-4)
    run = base.simulate(FAULT, until="8s")
    assert 0.5 < slip(run)[-1] < 0.8
    assert abs(np.ptp(slip(run)[-60:])) < 0.02
    assert run.outcome.stalled == (2,)


def test_a_motor_that_reaccelerates_has_not_stalled():
    """At the end of the short run its slip is beyond that of the largest torque, as in a longer one that recovers."""
    base = weak().with_motors(0.5, H=0.2, A=1, C0=0).initialize()
    short, long = (base.simulate(replace(FAULT, clear="0.4s"), until=until) for until in ("0.6s", "4s"))
    (pull_out,) = base.system.family("cim").k[:, cim.Par._fields.index("pull_out")]
    assert slip(short)[-1] > 1.1 * pull_out > 2 * slip(long)[-1]
    assert short.outcome.stalled == long.outcome.stalled == ()


def test_the_step_carries_a_stopped_motor(shared):
    """Its fluxes turn at 377 rad/s: at 1/120 s, RK4 would not be stable."""
    base = shared.initialize()
    assert base.simulate(until="0.1s").step == pytest.approx(2.5 / 384, rel=0.01)
    with pytest.raises(StabctlError, match=r"near 384 1/s \(that of the motor of the load at bus 2, if it stops\)"):
        base.simulate(until="0.1s", step="8ms")


def test_a_load_step_changes_motor_and_rest_alike(shared):
    """50 MW more: the constants of motor and rest are those of a load of 250 MW at this voltage."""
    base = shared.initialize()
    now = stage(base, timeline(base.case, [st.LoadStep(2, 0.1, 50.0, 12.5)])[1].switching)
    V = abs(base.V[1])
    more = dict(load_rows(base.case, base.case.loads[0]._replace(p=250.0, q=62.5), V, key=2, bus=1))
    changed = {table: par for table, _, par in now.constants}
    assert changed["cim"] == pytest.approx(more["cim"].par, rel=1e-12)
    assert changed["zip_load"] == pytest.approx(more["zip_load"].par._replace(Pz=0.0, Qz=0.0), rel=1e-12)
    added = (now.Y - base.admittance())[1, 1]
    assert added == pytest.approx(0.25 * base.system.fixed[1], rel=1e-12)


def test_motors_go_to_loads_without_another_model(plain):
    two = replace(plain, loads=(ZIP._replace(id="a"), ZIP._replace(id="b")))
    two = two.with_device("exponential", 2, a=1.0, b=2.0)
    made = two.with_motors(0.3)
    assert list(made.devices["cim"]) == ["2#2"]
    assert [load.model_share for load in made.loads] == [1.0, 0.3]
    there = two.with_motors(0.3, at=2)
    assert "exponential" not in there.devices
    assert list(there.without_device("cim", "2").devices) == ["gencls"]
    assert list(two.with_device("cim", "2#2").devices["cim"]) == ["2#2"]
    assert made.without_device("cim").devices["exponential"] == two.devices["exponential"]


def test_what_is_no_share_is_told(plain):
    for says, arguments in (
        ("motor share 1.5 is not allowed; give one from 0 to 1", (1.5,)),
        ("motor share '40' is not allowed", ("40",)),
        ("'much' is not a number", ("much",)),
        ("no load at bus 3; the nearest numbers are 2", (0.4, 3)),
    ):
        with pytest.raises(StabctlError, match=says):
            plain.with_motors(*arguments)
    with pytest.raises(StabctlError, match="cim has no parameter 'Pmul'; did you mean Pmult"):
        plain.with_motors(0.4, Pmul=1.2)
    with pytest.raises(StabctlError, match="C0 = 0 of bus 2 leaves the motor no load torque, since A, B and D are 0"):
        plain.with_motors(0.4, C0=0)
    assert plain.with_motors(0.4, C0=0, D=1, E=2).initialize()
    with pytest.raises(StabctlError, match=r"1\.2 is not allowed; it must be a number from 0 to 1"):
        plain.with_load(2, model_share=1.2)


def test_one_of_several_loads_is_chosen_by_its_id(plain):
    two = plain.with_load(2, 30, 5, id="shop", p_power=1)
    assert [(x.id, x.p) for x in two.loads] == [("", 200.0), ("shop", 30.0)]
    assert two.with_load(2, 40, id="shop").loads[1].p == 40.0
    with pytest.raises(StabctlError, match=r"has 2 loads; give the id of one \('', 'shop'\)"):
        two.with_load(2, 40)


def test_a_share_is_written_and_read(shared, tmp_path):
    st.write(shared, tmp_path / "small")
    again = st.load(tmp_path / "small")
    assert again.loads == shared.loads
    assert again.devices["cim"] == shared.devices["cim"]
    assert again.set("loads.2.model_share", "60%").loads[0].model_share == 0.6


def test_the_network_model_of_pmus_knows_the_current_of_motors(shared):
    """Also of a load whose rest is a constant admittance."""
    point = replace(shared, loads=(Load(2, 200.0, 50.0, model_share=0.4),)).initialize()
    assert NetworkModel(point).others.tolist() == [1]


def test_a_command_takes_a_share(shared, plain, tmp_path, stabctl):
    st.write(plain, tmp_path / "small")
    words = "--motor-share", "40%", "--set", "cim.2.H=0.3", "--fault", "2", "--clear", "100ms", "--json"
    code, out, _ = stabctl("simulate", tmp_path / "small", *words)
    alike = shared.initialize().simulate(st.Contingency("2", clear="100ms"))
    assert code == 0
    assert json.loads(out)["max_angle_from_coi_deg"] == alike.max_angle_from_coi_deg
    assert json.loads(out)["stalled"] == []


@pytest.mark.parametrize(
    ("buses", "slip", "says"),
    [
        ((), (), ""),
        ((2,), (1.0,), "The motor load at bus 2 has stalled, with a slip of 100 %."),
        ((2, 5, 7), (0.61, 1.0, 0.43), "The motor loads at buses 2, 5, 7 have stalled, with a slip of 43 to 100 %."),
        ((2, 5), (0.999, 1.0), "The motor loads at buses 2, 5 have stalled, with a slip of 100 %."),
    ],
)
def test_the_slips_of_several_motors_are_from_the_least_to_the_largest(buses, slip, says):
    assert str(Stalled(buses, slip)) == says


def test_motors_go_to_every_load_that_draws_power_however_little(plain):
    """Not to what feeds in, draws reactive power only, or stands at another model than a load."""
    drawn = [ZIP._replace(id=name, p=p, q=1.0) for name, p in zip("abcd", (0.03, 150.0, 0.0, -5.0), strict=True)]
    made = replace(plain, loads=tuple(drawn)).with_motors("40%")
    assert [*made.devices["cim"]] == [2, "2#2"]
    assert [load.model_share for load in made.loads] == [0.4, 0.4, 1.0, 1.0]

"""Every signal that a controller reads or drives is that of the linear model with the same name."""

from contextlib import nullcontext

import control
import numpy as np
import pytest
from systems import KINDS, LIBRARY, REGC, small

import stabctl as st
from stabctl._util.errors import LinearizationError, StudyError
from stabctl.dynamics import operating_point

STEP = 1 / 480  # s   of the simulations
AT = 0.1  # s   when the driven input steps

READ = [
    "speed:2", "angle:2", "rest_speed:2", "coi_speed", "deviation:2", "deviation:1+2", "angle_deviation:1+2",
    "voltage:7", "bus_angle:7", "bus_frequency:7", "rocof:7", "efd:2", "pm:2", "pe:2", "qe:2", "vt:2", "ifd:2",
    "flow:7-8", "flow_q:8-9", "current:7-8", "current:9-8#2", "absorbed:1", "absorbed_q:1", "energy:1", "charge:1",
    "state:field flux GENROU 2",
]  # fmt: skip


@pytest.fixture(scope="module")
def base(cases):
    return cases("two_area").initialize(storage=[st.Storage(1, 5, 50.0, energy=10.0, mva=60.0)])


def simulated(base, drives, reads, size):
    """What is read at frames of 60/s while an input steps, per unit of the step; its second order cancels."""
    runs = []
    for change in (size, -size):
        seen_values = []

        def law(seen, change=change, kept=seen_values):
            kept.append(seen.values.copy())
            return change * (seen.time > AT - 1e-9)

        base.simulate(until="0.5s", control=st.Controller.from_function(law, reads, drives, rate=60), step=STEP)
        runs.append(np.array(seen_values))
    return (runs[0] - runs[1]) / (2 * size)


def difference(base, drives, reads, size):
    """Largest difference of each signal from the linear response, over the largest response; a frame sees the
    voltages of the output before it, so the first is left out."""
    found = simulated(base, drives, reads, size)
    after = np.arange(len(found)) / 60 >= AT - 1e-9
    t = np.arange(after.sum()) / 60
    linear = control.forced_response(base.linearize(drives, reads).to_control(), t, np.ones(len(t))).outputs.T
    assert np.abs(found[~after]).max() < 1e-8 / size
    largest = np.abs(linear).max(axis=0)
    return np.abs(found[after] - linear)[1:].max(axis=0), largest


@pytest.mark.parametrize(("drives", "size"), [("vref:1", 2e-4), ("order_q:1", 0.01)])
def test_what_is_read_is_the_output_of_the_linear_model(base, drives, size):
    wrong, largest = difference(base, drives, READ, size)
    assert (wrong < 1e-5 * largest + 1e-12).all(), dict(zip(READ, wrong / largest, strict=True))  # at most 3.2e-6
    still = {"absorbed:1", "energy:1", "charge:1"} | ({"absorbed_q:1"} if drives == "vref:1" else set())
    assert {name for name, size in zip(READ, largest, strict=True) if size == 0} == still


@pytest.mark.parametrize(
    ("drives", "size"),
    [("load_p:7", 0.01), ("load_q:9", 0.01), ("storage:8", 0.01), ("order:1", 0.01), ("order_q:1", 0.1),
     ("vs:2", 2e-4), ("pref:3", 0.1)],
)  # fmt: skip
def test_what_is_driven_is_the_input_of_the_linear_model(base, drives, size):
    wrong, largest = difference(base, drives, ["speed:1", "speed:4", "angle:2", "absorbed:1", "absorbed_q:1"], size)
    assert (wrong < 1e-5 * largest + 1e-12).all()  # at most 4.0e-6
    assert largest[:3].all()


def test_energy_is_the_integral_of_the_power(base):
    wrong, largest = difference(base, "order:1", ["energy:1", "charge:1", "absorbed:1"], 0.1)
    assert (wrong < 1e-8 * largest).all()  # 3.4e-10
    seconds = 0.4 - 1 / 60  # to the last frame
    assert largest[0] == pytest.approx(0.5 * seconds)  # pu s: 50 MW
    assert largest[1] == pytest.approx(0.5 * seconds / 360)  # of 10 MWh


COMMANDS = [
    ("ipcmd", {"regc_a": REGC}),
    ("iqcmd", {"regc_a": REGC}),
    ("pset", (KINDS | LIBRARY)["reec_c"]),
    ("qset", (KINDS | LIBRARY)["reec_b, currents"]),
    ("pset", (KINDS | LIBRARY)["repc_a, voltage"]),
    ("vset", (KINDS | LIBRARY)["repc_a, voltage"]),
    ("pset", (KINDS | LIBRARY)["dera1"]),
    ("qset", (KINDS | LIBRARY)["repc_a, reactive power"]),
    ("qset", (KINDS | LIBRARY)["dera1, active current first"]),
]


@pytest.mark.parametrize(
    ("name", "devices"), [COMMANDS[0], *(pytest.param(*c, marks=pytest.mark.slow) for c in COMMANDS[1:])]
)
def test_set_points_of_converters_are_driven(name, devices):
    wrong, largest = difference(operating_point.solve(small(devices)), f"{name}:1", ["speed:2", "voltage:2"], 1e-3)
    assert largest.all()
    assert wrong[0] < 3e-6 * largest[0]  # 1.1e-6
    assert wrong[1] < 3e-4 * largest[1]  # 9.8e-5, as far as the voltages are iterated (1e-7 pu)


@pytest.mark.parametrize(
    ("devices", "bypassed"),
    [
        (KINDS["sexs bypassed"], {"transducer SEXS 1", "lead-lag SEXS 1", "field voltage SEXS 1"}),
        pytest.param((KINDS | LIBRARY)["regfm_a1"], set(), marks=pytest.mark.slow),
    ],
)
def test_a_state_is_read_if_it_ever_moves(devices, bypassed):
    """Also one that rests behind a limit, and is not in the linear model; that of a bypassed block is refused."""
    point = operating_point.solve(small(devices))
    run = point.simulate(st.Contingency("2", clear="150ms"), "3s")
    moved = np.ptp(run.rows[:, : point.layout.nx], axis=0) > 0
    for one, moves in zip(point.layout.states, moved, strict=True):
        reader = st.Controller(f"state:{one.label}", "load_p:2", [], [], [], [[1.0]])
        for study in (lambda c: point.simulate(until="10ms", control=c), point.closed_loop):
            refused = pytest.raises(StudyError, match=f"The state {one.label} of small never moves: a time constant")
            with refused if one.label in bypassed else nullcontext():
                study(reader)
        assert not (moves and one.label in bypassed)


def test_the_state_of_storage_without_a_lag_is_refused(cases):
    """What reads it was designed for another system."""
    reads, case = "state:power ESD 1@5", cases("two_area")
    assert case.initialize(storage=[st.Storage(1, 5, 50.0, lag=0.1)]).linearize("order", reads).C.any()
    with pytest.raises(StudyError, match="give the device that time constant, such as a lag of storage"):
        case.initialize(storage="50MW").linearize("order", reads)


def test_a_storage_device_stays_within_its_apparent_power(base):
    """Active power has priority: 60 MVA leave sqrt(60^2 - 50^2) Mvar beside 50 MW."""
    both = st.Controller.from_function(
        lambda seen: np.array([2.0, 2.0]) * (seen.time > 0.1), "speed:1", "order:1,order_q:1"
    )
    reactive = st.Controller.from_function(lambda seen: 2.0 * (seen.time > 0.1), "speed:1", "order_q:1")
    for controllers, P, Q in ((both, 50, np.sqrt(60**2 - 50**2)), (reactive, 0, 60), ([both, both], 50, 33.166)):
        run = base.simulate(until="0.2s", control=controllers)
        esd = run.point.system.family("esd")
        absorbed = run.rows[-1, esd.w[0, -1] + np.arange(2)] * 100
        assert absorbed == pytest.approx([P, Q], rel=1e-4)


def test_losses_leave_the_energy_without_a_derivative(cases):
    lossy = cases("two_area").initialize(storage=[st.Storage(1, 5, 50.0, energy=10.0, efficiency=0.9)])
    assert "energy ESD 1@5" not in lossy.linearize("order:1", "absorbed:1").states
    with pytest.raises(LinearizationError, match=r"1@5 of two_area has losses"):
        lossy.linearize("order:1", "energy:1")


def test_a_second_device_of_a_machine_at_its_bus_has_its_own_name(cases):
    """Rows 1 and 2 are 50 and 30 MW at bus 5; what is ordered of the second, the second does."""
    rows = st.Storage(1, 5, 50.0), st.Storage(1, 5, 30.0), st.Storage(2, 6, 40.0)
    base = cases("two_area").with_storage(rows).initialize()
    one = st.Controller.from_function(lambda seen: -1.0, "deviation:1", "order:1@5#2")
    run = base.simulate(until="0.2s", control=one)
    assert run.devices() == ["1@5", "1@5#2", "2@6"]
    assert np.abs(run.storage.values).max(axis=0) == pytest.approx([0, 30, 0], abs=1e-6)
    law = st.BangBang(min_voltage=0.0)
    several = law.controllers(base.case)
    assert [one.outputs for one in several] == [("order:1@5",), ("order:1@5#2",), ("order:2@6",)]
    fault = st.Contingency("7", clear="6cyc")
    powers = [base.simulate(fault, "2s", control=control).storage.values for control in (law, [*several])]
    assert np.abs(powers[0]).max(axis=0) == pytest.approx([50, 30, 40], rel=1e-6)
    assert np.mean(np.abs(powers[1] - powers[0]) > 1) < 0.02
    assert base.closed_loop(*several).modes().stable


@pytest.mark.parametrize(
    ("reads", "drives", "says"),
    [
        ("speed:1", "pset:1", "no converter control with a set-point pset"),
        ("speed:1", "pset", "has no signal pset"),
        ("speed:1", "ipcmd:1", "is not a converter"),
        ("frequency:7", "vs:1", "let it read bus_frequency:7"),
        ("charge:2", "vs:1", "the storage device 2@6 is unlimited"),
    ],
)
def test_signals_that_are_refused(cases, reads, drives, says):
    base = cases("two_area").initialize(storage="50MW")
    one = st.Controller.from_control(control.tf(0.1, 1), reads, drives)
    with pytest.raises(StudyError, match=says):
        base.simulate(until="0.1s", control=one)


@pytest.mark.parametrize(
    ("electrical", "plant", "drive", "says"),
    [
        ({"PfFlag": 1}, None, "qset:3", r"keeps its power factor \(PfFlag = 1\), so qset .*; set PfFlag = 0"),
        ({"PfFlag": 1}, {"RefFlag": 1}, "vset:3", "keeps its power factor"),
        ({}, {"RefFlag": 0}, "vset:3", r"controls its reactive power \(RefFlag = 0\), so vset .*; give qset"),
        ({}, {"RefFlag": 1}, "qset:3", r"controls its voltage \(RefFlag = 1\), so qset .*; give vset"),
        ({}, {"RefFlag": 1}, "vset:3", None),
        ({}, {"RefFlag": 0}, "qset:3", None),
        ({}, None, "qset:3", None),
    ],
)
def test_a_set_point_that_nothing_reads_is_refused_and_the_others_have_an_effect(electrical, plant, drive, says):
    case = st.load("two_area").with_device("regc_a", 3).with_device("reec_a", 3, **electrical)
    base = (case if plant is None else case.with_device("repc_a", 3, Kp=0.5, **plant)).initialize()
    one = st.Controller.from_function(lambda _: np.array([-0.1]), "voltage:5", drive, rate=10)
    if says:
        with pytest.raises(StudyError, match=f"Unit 3 of two_area {says}"):
            base.simulate(until="0.3s", control=one)
        with pytest.raises(StudyError, match=says):
            base.linearize(drive, "voltage:5")
    else:
        assert np.ptp(base.simulate(until="1s", control=one).voltage.sel(bus=3).values) > 1e-3


def test_a_command_that_a_control_gives_is_refused():
    """With an electrical control, the current command is its output."""
    base = operating_point.solve(small((KINDS | LIBRARY)["reec_c"]))
    one = st.Controller.from_control(control.tf(0.1, 1), "speed:2", "ipcmd:1")
    with pytest.raises(StudyError, match="A control of converter 1 sets Ipcmd"):
        base.simulate(until="0.1s", control=one)

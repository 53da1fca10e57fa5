"""Storage behind converters: as its published parts, its balances and limits, and the ideal device as a limit."""

from dataclasses import replace

import numpy as np
import pytest
from records import esd_regc, reec_c, regc_a, regc_b, regc_c, regfm_a1, regfm_b1, repc_a
from stored import KEEP_ON, driven, signal, with_esd
from systems import KINDS, one_of, small

from stabctl import devices
from stabctl._util.errors import CaseError, StudyError
from stabctl.controllers import BangBang, Controller
from stabctl.devices.storage import order as orders_of
from stabctl.dynamics import family, operating_point, storage
from stabctl.model.tables import Machine, Storage
from stabctl.simulation import steps
from stabctl.simulation.events import Clear, Fault, Open
from stabctl.simulation.setup import setup
from stabctl.simulation.simulate import simulate
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.stages import stages
from stabctl.smallsignal import linearize

SHORT = [Fault("2", 0.5, impedance=0.02j), Clear("2", 0.6)]
FAULT = {"events": SHORT, "until": 1.5}
MODELS = "regc", "regc_b", "regc_c", "regfm", "regfm_b1"
SLOW = "regc_b_repc", "regc_c_repc"
PLANT = one_of("regc_repc", *SLOW)
FOLLOWING = "regc", "regc_b", "regc_c", *PLANT
ALL = *MODELS, *PLANT


def beside(case, models, mva):
    """The case without storage and with a converter unit at bus 2, at zero power."""
    unit = Machine(3, 2, mva, 0.0, 2, name="unit")
    tables = {name: {**case.devices.get(name, {}), 3: par} for name, par in models.items()}
    return replace(case, machines=(*case.machines, unit), devices={**case.devices, **tables}, storage=())


def unit_driven(case, changes, events=(), until=1.5, step=1 / 240):
    """A run with set-points of unit 3 changed: {time: {name: change}}."""
    point = operating_point.solve(case)
    sim = Simulation(setup(point, step=step, criterion=KEEP_ON), list(events))
    unit = len(case.machines) - 1
    for t, values in changes.items():
        assert sim.advance(t)
        for name, change in values.items():
            at = point.layout.setpoint(unit, name)
            sim.s[at] = point.s[at] + change
    assert sim.advance(until), sim.outcome
    return sim.finish()


REPC = repc_a.Par(FFlag=1, Kp=0.5, Kpg=0.5, Kig=8.0, Tp=0.02, Tg=0.02, Dup=20.0, Pmin=-1.0, Qmin=-1.0, Qmax=1.0)
REEC = reec_c.Par(0, 0, 0, Pmin=-1.0, Qmin=-1.0, Qmax=1.0, T=1e9)
PUBLISHED = {
    "regc": ({"regc_a": regc_a.Par(0), "reec_c": REEC}, "", "Qext"),
    "regc with voltage support": (
        {"regc_a": regc_a.Par(0, Lvplsw=0.0), "reec_c": REEC._replace(Kqv=2.0, PqFlag=1)},
        "Lvplsw=0 Kqv=2 PqFlag=1",
        "Qext",
    ),
    "regc_c": ({"regc_c": regc_c.Par(0, 0, Imax=1.11), "reec_c": REEC}, "", "Qext"),
    "regc_b": ({"regc_b": regc_b.Par(0, Imax=1.11), "reec_c": REEC}, "", "Qext"),
    "regc_repc": (
        {"regc_a": regc_a.Par(0), "reec_c": REEC, "repc_a": REPC},
        "repc_Ddn=20 repc_Dup=20",
        "Qset",
    ),
    "regc_b_repc": (
        {"regc_b": regc_b.Par(0, Imax=1.11), "reec_c": REEC, "repc_a": REPC},
        "repc_Ddn=20 repc_Dup=20",
        "Qset",
    ),
    "regc_c_repc": (
        {"regc_c": regc_c.Par(0, 0, Imax=1.11), "reec_c": REEC, "repc_a": REPC},
        "repc_Ddn=20 repc_Dup=20",
        "Qset",
    ),
    "regfm": ({"regfm_a1": regfm_a1.Par(0, 0, Pmin=-1.0, ImaxF=1.2)}, "ImaxF=1.2", "Qref"),
    "regfm_b1": ({"regfm_b1": regfm_b1.Par(0, 0, ImaxF=1.2)}, "ImaxF=1.2", "Qref"),
}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in PUBLISHED])
def test_it_moves_as_its_published_parts_in_a_unit_of_their_own(name):
    """The same system with the converter as a generating unit of 0 MW, whose references are set instead of orders."""
    models, text, q = PUBLISHED[name]
    case = with_esd(storage_model=name.split()[0], converter=text)
    orders, references = {}, {}
    for t, P, Q in ((0.1, 0.9, 0.0), (0.7, -0.8, 0.5)):
        par = devices.every()[case.storage[0].device].from_case(case.storage[0], 100.0)
        active, reactive = orders_of.shares(orders_of.State(0.0, 0.0, 0.0), orders_of.Input(P, Q), par, (1.0, 1.0))
        orders[t], references[t] = (P, Q), {"Pset" if q == "Qset" else "Pref": -0.8 * active, q: -0.8 * reactive}
    run = _ordered(case, orders)
    other = unit_driven(beside(case, models, 50.0), references, SHORT)
    assert other.arrays.V == pytest.approx(run.arrays.V, abs=1e-7)  # 1.6e-8, to which voltages are solved
    assert -other.arrays.P[:, 2] == pytest.approx(run.arrays.storage[:, 0], abs=1e-5)  # MW
    assert np.ptp(run.arrays.storage) > 40


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("regc", "QFlag=1 VFlag=0"),
        ("regc_repc", "repc_RefFlag=1 repc_Ddn=20 repc_Dup=20"),
        ("regc_c", "QFlag=1 VFlag=0"),
        ("regfm", "ImaxF=1.2"),
        ("regfm_b1", "ImaxF=1.2"),
    ],
)
def test_the_voltage_order_moves_the_reference_of_the_published_model(name, text):
    models, _, q = PUBLISHED[name]
    reference = {"Qref": "Vref", "Qset": "Vset"}.get(q, "Qext")
    if reference == "Vset":
        models = models | {"repc_a": REPC._replace(RefFlag=1)}
    if reference == "Qext":
        models = models | {"reec_c": REEC._replace(QFlag=1, VFlag=0)}
    case = with_esd(storage_model=name, converter=text)
    run = _ordered(case, {0.1: (0.0, 0.0, 0.04), 0.8: (0.0, 0.0, -0.05)})
    other = unit_driven(beside(case, models, 50.0), {0.1: {reference: 0.04}, 0.8: {reference: -0.05}}, SHORT)
    assert other.arrays.V == pytest.approx(run.arrays.V, abs=1e-7)
    at = storage.places(run.point.system, case).Q[0]
    assert np.ptp(run.rows[:, at]) > 0.05  # pu


DIRECT, BY_PLANT = "QFlag=1 VFlag=0", "repc_RefFlag=1"


@pytest.mark.parametrize(
    ("model", "text", "order", "says"),
    [
        ("ideal", "", "order_v", f"has no voltage reference, .* grid-forming, or grid-following with {DIRECT}"),
        ("regc", "", "order_v", "has no voltage reference"),
        ("regc", "QFlag=1 VFlag=1", "order_v", "has no voltage reference"),
        ("regc_repc", f"{DIRECT} repc_Qmax=1.1", "order_v", f"has no voltage reference, .* on it; set {BY_PLANT}"),
        ("regc", DIRECT, "order_q", f"with {DIRECT} follows its voltage reference, .* give order_v"),
        ("regc_c", DIRECT, "order_q", f"with {DIRECT} follows its voltage reference"),
        ("regc_repc", BY_PLANT, "order_q", f"with {BY_PLANT} follows its voltage reference"),
        (
            "regc_repc",
            f"{DIRECT} repc_Qmax=1.1 {BY_PLANT}",
            "order_q",
            f"with {BY_PLANT} follows its voltage reference",
        ),
    ],
)
def test_an_order_without_effect_is_refused_and_the_one_or_the_setting_that_has_one_is_named(model, text, order, says):
    point = operating_point.solve(with_esd(storage_model=model, converter=text))
    with pytest.raises(StudyError, match=f"The storage device 1@2 of small {says}"):
        linearize(point, [f"{order}:1@2"], ["voltage:2"])


@pytest.mark.parametrize(
    ("model", "text", "orders"),
    [
        ("regfm", "", "qv"),
        ("regfm_b1", "", "qv"),
        ("regc", "", "q"),
        ("regc", DIRECT, "v"),
        ("regc_repc", f"{DIRECT} repc_Qmax=1.1", "q"),
        ("regc_repc", f"{DIRECT} repc_Qmax=1.1 {BY_PLANT}", "v"),
    ],
)
def test_every_order_that_is_accepted_moves_the_voltage(model, text, orders):
    point = operating_point.solve(with_esd(storage_model=model, converter=text))
    m = linearize(point, [f"order_{kind}:1@2" for kind in orders], ["voltage:2"])
    gain = np.abs(m.D - m.C @ np.linalg.solve(m.A - 1j * np.eye(len(m.A)), m.B))  # at 1 rad/s
    assert gain.min() > 1e-4


@pytest.mark.parametrize("order", ["order:1", "order_q:1@2", "order_v:1", "voltage order ESD 1@2", "vref:1"])
def test_the_hint_that_no_orders_are_given_counts_orders_of_every_kind(order):
    point = operating_point.solve(with_esd(storage_model="regfm"))
    run = simulate(point, None, 0.1, control=Controller(("voltage:2",), (order,), [], [], [], [[1.0]]))
    assert ("No orders are given to the storage" in str(run)) == (order == "vref:1")


def _ordered(case, orders):
    """A run with active and reactive orders, and orders of voltage."""
    point = operating_point.solve(case)
    sim, at = Simulation(setup(point, step=1 / 240, criterion=KEEP_ON), SHORT), storage.places(point.system, case)
    for t, (P, Q, *V) in orders.items():
        assert sim.advance(t)
        sim.orders[0] = P
        if V:
            sim.s[at.order_v[0]] = V[0]
        else:
            sim.s[at.order_q[0]] = Q
    assert sim.advance(1.5)
    return sim.finish()


@pytest.mark.parametrize("model", ALL)
def test_without_orders_nothing_moves(model):
    run = driven(with_esd(storage_model=model, energy=0.1), {}, until=2.0)
    moved = np.abs(run.rows - run.rows[0])[:, : run.point.layout.step].max()
    assert moved < 1e-9  # 2e-13
    assert np.abs(run.arrays.storage).max() < 1e-9


@pytest.mark.parametrize("model", ALL)
def test_a_law_at_rest_gives_no_order(model):
    point = operating_point.solve(with_esd(storage_model=model))
    sim = Simulation(setup(point, BangBang()))
    assert sim.advance(1.0)
    assert np.abs(sim.s[: point.layout.step] - point.s[: point.layout.step]).max() < 1e-9


@pytest.mark.parametrize("model", ALL)
def test_the_current_stays_within_its_limit_and_reaches_it(model):
    most = 0.9 if model.endswith("_repc") else 1.05
    limit = f"Imax={most} Kqv=4" if model.startswith("regc") else f"ImaxF={most}"
    run = driven(with_esd(storage_model=model, mva=40.0, converter=limit), {0.2: 1.0, 0.9: -1.0}, **FAULT)
    size = np.hypot(signal(run, "Ip"), signal(run, "Iq"))
    assert size.max() <= most * (1 + 1e-9)
    assert size.max() > most - 0.01


def test_currents_of_the_lags_beyond_the_limit_are_shortened_at_the_same_angle():
    par = operating_point.solve(with_esd(converter="Imax=1.1")).system.family("esd_regc").k[0]
    p = esd_regc.Par(*par)
    x = esd_regc.guess(1.0, p)._replace(ip=-1.0, iq=0.9, vfilt=1.0)
    assert np.array(esd_regc.module.terminal(x, 1.0, p)) == pytest.approx(
        1.1 * np.array([-1.0, 0.9]) / np.hypot(1.0, 0.9)
    )
    assert esd_regc.module.terminal(x._replace(ip=-0.5), 1.0, p) == (-0.5, 0.9)


@pytest.mark.parametrize("model", ["ideal", *ALL])
def test_the_power_is_what_the_current_carries(model):
    """P + jQ from voltage and injected current, pu; with the network: Y V equals the currents of all devices."""
    run = driven(with_esd(storage_model=model), {0.2: 0.7, 0.8: -0.5}, **FAULT)
    point = run.point
    f, j = storage.members(point.system, point.case)[0]
    par = f.device.Par(*f.k[j])
    for row in run.rows[10::40]:
        x = f.device.State(*row[f.w[j, 0] : f.w[j, 0] + len(f.device.State._fields)])
        u = f.device.Input(*row[f.w[j, family.INPUTS : -1]])
        at = f.w[j, family.BUS]
        known = {"x": x, "u": u, "v": (row[at], row[at + 1]), "p": par}
        if f.device.has("internal"):
            known["i"] = f.device.internal(x, par)
        I = complex(*f.device.evaluate("current", known))
        V = complex(*known["v"])
        if f.device.has("source"):
            I += complex(*f.device.source(x, u, par))
        if f.device.has("admittance"):
            I -= complex(*f.device.admittance(par)) * V
        y, _ = f.device.outputs_and_rates(known)
        assert complex(y.P, y.Q) == pytest.approx(-V * I.conjugate(), abs=1e-12)


@pytest.mark.parametrize("efficiency", [1.0, 0.81])
@pytest.mark.parametrize("model", ALL)
def test_the_store_holds_the_integral_of_the_power(model, efficiency):
    """Energy gained against the sum over the stages of all Runge-Kutta steps."""
    case = with_esd(storage_model=model, energy=0.05, charge=0.5, efficiency=efficiency)
    run = driven(case, {0.2: 1.0, 0.9: -0.7}, **FAULT)
    at = storage.places(run.point.system, case).P[0]
    gained, way = [0.0], np.sqrt(efficiency)
    for part in stages(run):
        P = part.signals[:, :, at]
        rate = np.where(P > 0, way, 1 / way) * P
        gained += (part.sizes * (rate @ [1 / 6, 1 / 3, 1 / 3, 1 / 6])).tolist()
    gained = np.cumsum(gained)
    energy = signal(run, "energy")
    assert energy - energy[0] == pytest.approx(gained, abs=1e-9)  # 6.6e-10 pu s
    assert np.ptp(gained) > 0.2  # pu s


@pytest.mark.parametrize("model", FOLLOWING)
def test_a_grid_following_device_that_becomes_full_or_empty_stops_at_once(model):
    for order in (1.0, -1.0):
        run = driven(with_esd(storage_model=model, energy=0.01, charge=0.5), {0.2: order, 1.2: -order}, until=2.0)
        share, P = run.arrays.energy[:, 0] / 0.01, run.arrays.storage[:, 0] * order
        assert share.min() >= 0
        assert share.max() <= 1
        done = np.flatnonzero(share == (order + 1) / 2)[0]
        resting = (run.time > run.time[done]) & (run.time < 1.2)
        assert P[done - 1] > 39
        assert P[resting].max() == 0
        assert P[resting].min() > -5e-3  # with a phase-locked loop -1.4e-3, of the reactive current as the frame turns
        assert P[-1] == pytest.approx(-40, rel=0.01)


@pytest.mark.parametrize("order", [1.0, -1.0])
@pytest.mark.parametrize(("model", "late"), [("regfm", 0.11), ("regfm_b1", 0.04)])
def test_a_grid_forming_device_that_becomes_full_or_empty_goes_to_zero_and_counts_what_flows_until_then(
    model, late, order
):
    """`late`: seconds of rated power that flow beyond the store; the power then stays away from that side."""
    run = driven(with_esd(storage_model=model, energy=0.01, charge=0.5), {0.2: order}, until=4.0)
    charge, P = order * (signal(run, "charge") - 0.5) + 0.5, order * run.arrays.storage[:, 0]
    done = run.time[np.flatnonzero(charge > 1)[0]]
    assert P.max() > 39
    assert P[run.time > done + 0.5].max() < 3
    assert abs(P[run.time > done + 1.5].mean()) < 0.5
    beyond = (charge.max() - 1) * 0.01 * 3600 / 40  # s
    assert 0 < beyond < late


@pytest.mark.parametrize("model", ALL)
def test_nothing_winds_up_while_a_limit_holds_the_power_back(model):
    """After three seconds beyond a limit a device turns around as fast as after half a second."""
    limit = {"regfm": "Pmin=-0.6 ImaxF=1.2", "regfm_b1": "ImaxSS=0.67 ImaxF=1.2"}.get(model, "Imax=0.6")
    long, short = (
        driven(with_esd(storage_model=model, converter=limit), {0.2: 1.0, t: -1.0}, until=t + 1.0) for t in (3.2, 1.2)
    )
    after = [run.arrays.storage[run.time > t + 1e-9, 0][:200] for run, t in ((long, 3.2), (short, 1.2))]
    held = long.arrays.storage[np.searchsorted(long.time, 3.1), 0]
    assert 25 < held < 34  # of 40 MW ordered
    assert after[0] == pytest.approx(after[1], abs=5.0)  # 3.8 of 80 MW; the swing of the machine differs
    assert after[0][-1] < -25


def test_with_fast_lags_and_much_current_it_tends_to_the_ideal_device():
    """The distance in MW falls in proportion to the lags; without low-voltage logic, as the ideal device has none."""
    ideal = driven(with_esd(storage_model="ideal"), {0.2: 1.0, 0.7: -1.0}, until=1.2, step=1 / 1200)
    far = []
    for T in (0.008, 0.004, 0.002):
        free = "Lvplsw=0 Lvpnt1=0.02 Lvpnt0=0.01 Rrpwr=1e4 dPmax=1e4 dPmin=-1e4 Imax=9"
        free += "".join(f" {lag}={T}" for lag in ("Tg", "Trv", "Tpord", "Tiq", "Tfltr"))
        run = driven(with_esd(converter=free), {0.2: 1.0, 0.7: -1.0}, until=1.2, step=1 / 1200)
        far.append(np.abs(run.arrays.storage - ideal.arrays.storage).mean())
        speeds = np.abs(run.arrays.speed - ideal.arrays.speed).max()
    assert far[0] / far[1] == pytest.approx(2, rel=0.1)  # 1.98
    assert far[1] / far[2] == pytest.approx(2, rel=0.1)
    assert speeds < 2.5e-5  # 2.0e-5 pu with lags of 2 ms, of a swing of 5e-4


def test_devices_of_several_models_take_their_own_orders():
    rows = [Storage(1, 2, 40.0, storage_model=m) for m in ("regc", "ideal", "regfm")]
    rows += [Storage(2, 3, 40.0), Storage(2, 3, 20.0, storage_model="regc")]
    run = driven(with_esd(*rows), {0.1: [0.5, -0.3, 0.2, 0.4, -0.6]}, until=6.0)
    assert run.arrays.order[-1] == pytest.approx([0.5, -0.3, 0.2, 0.4, -0.6], abs=0)
    assert run.arrays.storage[-1, [0, 1, 3, 4]] == pytest.approx([20, -12, 16, -12], abs=0.2)
    droop = 40 * (signal(run, "omega", 2)[-1] - 1) / 0.01
    assert run.arrays.storage[-1, 2] == pytest.approx(8 + droop, abs=0.2)


@pytest.mark.parametrize("model", ALL)
def test_another_rating_is_another_device(model):
    case = with_esd(storage_model=model)
    resized = operating_point.solve(case).resized([60.0])
    row = Storage(1, 2, 60.0, mva=75.0, storage_model=model, converter=case.storage[0].converter)
    fresh = operating_point.solve(with_esd(row))
    assert resized.case.storage == fresh.case.storage
    runs = [Simulation(setup(point, BangBang(deadband=0.01)), SHORT) for point in (resized, fresh)]
    for sim in runs:
        sim.advance(1.5)
    one, other = (sim.finish().rows for sim in runs)
    assert one == pytest.approx(other, abs=1e-10)
    assert abs(one[:, storage.places(fresh.system, fresh.case).P[0]]).max() > 0.5


@pytest.mark.parametrize("model", MODELS)
def test_the_linear_model_predicts_a_small_order(model):
    point = operating_point.solve(with_esd(storage_model=model))
    sim = Simulation(setup(point, step=1 / 480))
    sim.orders[0] = 0.01
    assert sim.advance(1.0)
    run = sim.finish()
    linear = linearize(point, ["order:1@2"], ["absorbed:1@2"])
    A, B, C, D = linear.A, linear.B, linear.C, linear.D
    from scipy.linalg import expm

    n = len(A)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n:] = A, B
    step = expm(block / 480)
    x, found = np.r_[np.zeros(n), 0.01], []
    for _ in run.time:
        found.append(float((C @ x[:n] + D[:, 0] * 0.01).item()))
        x = step @ x
    P = run.arrays.storage[:, 0] / 100
    assert P == pytest.approx(np.array(found), abs=4e-6)  # of 4e-3: second order
    assert np.ptp(P) > 3e-3


def test_grid_forming_storage_keeps_its_island_alive_and_grid_following_storage_does_not():
    case = with_esd(storage_model="regfm", mva=300.0)
    lines = [Open("2-3", 0.5), Open("2-3#2", 0.5), Open("1-2", 0.5)]
    for model, alive in (("regfm", True), ("regc", False)):
        point = operating_point.solve(replace(case, storage=(case.storage[0]._replace(storage_model=model),)))
        sim = Simulation(setup(point, criterion=KEEP_ON), lines)
        sim.advance(0.8)
        V = abs(sim.V[1])
        assert (V > 0.3) == alive, (model, V)


@pytest.mark.parametrize("model", [*FOLLOWING, "supercap_regc_c"])
def test_grid_following_storage_of_a_blacked_out_island_is_off(model):
    """Also where its current does not vanish with the voltage."""
    point = operating_point.solve(with_esd(storage_model=model, energy=0.5))
    run = simulate(point, [Open("2-3", 0.5), Open("2-3#2", 0.5), Open("1-2", 0.5)], 1.0, criterion=KEEP_ON)
    off = run.time > 0.5
    assert np.abs(run.arrays.V[off, 1]).max() == 0
    assert np.abs(run.arrays.storage[off]).max() == 0
    assert np.ptp(run.arrays.energy[off]) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"converter": "Imx=1.2"}, "no parameter 'Imx' of REGC_A and REEC_C of storage; choose one of Imax"),
        ({"converter": "Imax=-1"}, "must be a number above 0"),
        ({"converter": "Imax"}, "does not set a parameter"),
        ({"converter": "Tg=0"}, "Tg = 0.0 must be a number of at least 0.001"),
        ({"converter": "Qmin=0.5 Qmax=0.2"}, "Qmin = 0.5 is above Qmax = 0.2"),
        (
            {"storage_model": "regc_repc", "converter": "repc_Kpi=1"},
            "no parameter 'repc_Kpi' of REPC_A, REGC_A and REEC_C of storage; choose one of repc_K",
        ),
        ({"storage_model": "regc_repc", "converter": "QFlag=1 VFlag=0"}, "set it above the voltage, such as 1.1"),
        ({"storage_model": "regfm", "converter": "mq=0"}, "must be above 0 with VFlag = 1"),
        ({"storage_model": "regfm", "converter": "Emin=1 Emax=0.9"}, "Emax = 0.9 must be above Emin = 1"),
        ({"storage_model": "regfm", "characteristic": "current"}, "applies only to ideal devices"),
        ({"storage_model": "ideal", "converter": "Imax=1.2"}, "applies only to devices behind a converter"),
        (
            {"storage_model": "regd"},
            "must be one of ideal, regc, regc_b, regc_c, regc_repc, regc_b_repc, regc_c_repc, regfm, regfm_b1",
        ),
        ({"mva": 30.0}, "30 MVA is less than its rating of 40 MW"),
    ],
)
def test_what_a_converter_cannot_be_is_refused_with_its_row(options, message):
    with pytest.raises(CaseError, match=r"storage\.csv row 2") as error:
        with_esd(**options)
    assert message in str(error.value)


@pytest.mark.parametrize(("mva", "found"), [("120%", 48.0), ("60MVA", 60.0), (0.0, 0.0)])
def test_mva_in_percent_of_the_rating(mva, found):
    case = small(KINDS["bare"]).with_storage("1=40MW", mva=mva, storage_model="regc")
    assert case.storage[0].mva == pytest.approx(found)
    for wrong in ("80%", "x%", "0pu", "1.1pu"):
        with pytest.raises(StudyError, match="at least 100%"):
            case.with_storage("1=40MW", mva=wrong)


@pytest.mark.parametrize(("model", "converter", "limit"), [("regc", "Imax=1.2", 1.2), ("regfm", "", 2.0)])
def test_mva_for_the_rated_power_at_a_low_voltage(model, converter, limit):
    case = small(KINDS["bare"])
    found = case.with_storage("1=40MW", mva="0.8pu", storage_model=model, converter=converter)
    assert found.storage[0].mva == pytest.approx(40 * max(1, 1 / (0.8 * limit)))
    with pytest.raises(StudyError, match="need a converter"):
        case.with_storage("1=40MW", mva="0.8pu")


def test_the_message_of_a_short_step_names_the_inner_loop_or_the_time_constant():
    point = operating_point.solve(with_esd(storage_model="regc_c"))
    assert steps.checked(point, None) < 1 / 200
    assert steps.cause(point) in ("Ed ESD 1@2", "Eq ESD 1@2")  # they take part alike
    fast = operating_point.solve(with_esd(converter="Tg=0.002"))
    assert steps.cause(fast).startswith("Tg = 0.002 s of esd_regc, ESD 1@2")
    bypassed = operating_point.solve(with_esd(storage_model="regc_c", converter="Te=0"))
    assert steps.checked(bypassed, None) == 1 / 120


def dense(matrix):
    return matrix.toarray() if hasattr(matrix, "toarray") else np.asarray(matrix)


@pytest.mark.parametrize("model", ALL)
def test_complex_step_equals_central_differences(model):
    """Derivatives of the whole system, at a state off the equilibrium."""
    point = operating_point.solve(with_esd(storage_model=model, energy=1.0, lag=0.1, efficiency=0.9))
    lay, s = point.layout, point.s.copy()
    s[: lay.step] += 1e-3 * np.random.default_rng(1).standard_normal(lay.step)
    limits = point.system.limits
    s[limits.state[point.s[limits.state] == limits.low]] = 0.0
    s[[k for k, p in enumerate(lay.states) if p.name == "share"]] = -0.4
    at = [k for k, p in enumerate(lay.states) if p.table == f"esd_{model}" and k not in limits.state]
    d = point.equations.at(s.copy())
    for k in at:
        h = 1e-6
        up, down = (point.equations.at(s + h * sign * (np.arange(len(s)) == k)) for sign in (1, -1))
        slope = (up.rates - down.rates) / (2 * h)
        assert dense(d.of_rates[:, [k]])[:, 0] == pytest.approx(slope, abs=2e-5 * max(1, np.abs(slope).max()))


@pytest.mark.parametrize("model", one_of("regc_repc", "regc_b_repc"))
def test_an_order_passes_the_block_diagram_of_the_plant_controller(model):
    """Ordered to absorbed power: PI, Tg, then Tpord and Tg of the converter, and 1/(1+sTp) in the feedback."""
    times = {"repc_Kpg": 0.3, "repc_Kig": 2.0, "repc_Tp": 0.25, "repc_Tg": 0.1, "Tpord": 0.03, "Tg": 0.015}
    text = " ".join(f"{name}={value}" for name, value in times.items()) + (" Te=0" if "_b_" in model else "")
    point = operating_point.solve(with_esd(storage_model=model, converter=text))
    linear = linearize(point, ["order:1@2"], ["absorbed:1@2"])
    s = 1j * np.geomspace(0.1, 100, 20)
    forward = (0.3 + 2.0 / s) / (1 + 0.1 * s) / (1 + 0.03 * s) / (1 + 0.015 * s)
    wanted = 0.4 * forward / (1 + forward / (1 + 0.25 * s))  # pu of 100 MVA per rating of 40 MW
    A, B, C, D = linear.A, linear.B, linear.C, linear.D
    found = [(C @ np.linalg.solve(z * np.eye(len(A)) - A, B) + D).item() for z in s]
    assert np.abs(np.array(found) - wanted).max() < 1e-8


def test_without_power_control_the_order_bypasses_the_plant_controller():
    """With FFlag = 0 the active power is that of `regc`."""
    runs = [
        driven(with_esd(storage_model=model, converter=text), {0.2: 1.0, 0.7: -1.0})
        for model, text in (("regc", ""), ("regc_repc", "repc_FFlag=0 repc_Kp=0 repc_Ki=0"))
    ]
    assert runs[0].arrays.storage == pytest.approx(runs[1].arrays.storage, abs=1e-6)
    assert np.ptp(runs[0].arrays.storage) > 70


def test_with_typical_gains_the_plant_controller_takes_tens_of_seconds():
    """Kpg = 0.1, Kig = 0.05: a first part Kpg/(1+Kpg) at once, the rest with (1+Kpg)/Kig = 22 s."""
    case = with_esd(storage_model="regc_repc", converter="repc_Kpg=0.1 repc_Kig=0.05 repc_Tp=0.25 repc_Tg=0.1")
    run = driven(case, {0.2: 1.0}, until=6.2, step=1 / 120)
    exact = 40 * (1 - np.exp(-0.05 / 1.1 * 6.0) / 1.1)
    assert run.arrays.storage[-1, 0] == pytest.approx(exact, abs=0.3)


@pytest.mark.parametrize("order", [1.0, -1.0])
def test_the_plant_controller_leaves_what_a_full_or_empty_store_cannot_deliver(order):
    run = driven(with_esd(storage_model="regc_repc", energy=0.01, charge=0.5), {0.2: order}, until=3.0)
    integral = -order * signal(run, "repc_xp")
    assert integral.max() > 0.75
    assert abs(integral[-1]) < 1e-3


@pytest.mark.parametrize("model", PLANT)
@pytest.mark.parametrize("held", [0, 1])
def test_with_default_gains_the_plant_controller_is_stable(model, held):
    row = Storage(1, 2, 40.0, storage_model=model, converter=f"repc_RefFlag={held}")
    found = np.linalg.eigvals(linearize(operating_point.solve(with_esd(row)), ["order:1@2"], ["absorbed:1@2"]).A)
    assert np.sort(found.real)[-1] < 1e-6

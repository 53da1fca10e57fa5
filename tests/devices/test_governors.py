"""Governors: block diagrams by frequency response, limits reached and left, stationary start; in plain Python."""

import re

import control
import numpy as np
import pytest
from block_diagram import W, motion, opened, response, rest
from records import degov, degov1, gast, ggov1, hygov, ieeeg1, ieeeg3, ieesgo, pidgov, tgov1, wpidhy
from systems import GAS, GOVERNORS, one_of

from stabctl._util.schema import fields

S = 1j * W
GATE = {"G0": (0.05, 0.15), "G1": (0.4, 0.5), "P1": (0.2, 0.25), "G2": (0.7, 0.8), "P2": (0.5, 0.55), "P3": (1.0, 1.2)}
POWER = 0.6


def block(numerator, denominator):
    """Frequency response of a block at W, coefficients in falling powers of s."""
    return control.tf(numerator, denominator)(S)


def lag(T):
    return block([1], [T, 1])


def tgov1_diagram(p, x):
    return {
        "omega": -block([p.T2, 1], [p.T3, 1]) * lag(p.T1) / p.R - p.Dt,
        "Pref": lag(p.T1) / p.R * block([p.T2, 1], [p.T3, 1]),
    }


def gast_diagram(p, x):
    through = lag(p.T1) * lag(p.T2)
    return {"omega": -through / p.R - p.Dturb, "Pref": through}


def ieeeg1_diagram(p, x):
    shares, stage, total = [(p.K1, p.K2, p.T4), (p.K3, p.K4, p.T5), (p.K5, p.K6, p.T6), (p.K7, p.K8, p.T7)], 1.0, 0.0
    for high, low, T in shares:
        stage = stage * lag(T)
        total = total + (high + low) * stage
    turbine = total * lag(p.T3)
    return {"omega": -p.K * block([p.T2, 1], [p.T1, 1]) * turbine, "Pref": turbine}


def hygov_diagram(p, x):
    """At gate g0 the head is 1 and the flow g0: dq = dg/(1 + s g0 Tw/2), dh = 2 (dq - dg)/g0."""
    g0 = x["gate"]
    governor = lag(p.Tf) * block([p.Tr, 1], [p.r * p.Tr, 0])
    desired = governor / (1 + p.R * governor)
    q = block([1], [g0 * p.Tw / 2, 1])
    turbine = p.At * (q + (g0 - p.qNL) * 2 * (q - 1) / g0) * lag(p.Tg)
    return {"omega": -desired * turbine - p.Dturb * g0, "Pref": desired * turbine}


def ieesgo_diagram(p, x):
    turbine = lag(p.T4) * ((1 - p.K2) + p.K2 * (1 - p.K3) * lag(p.T5) + p.K2 * p.K3 * lag(p.T5) * lag(p.T6))
    return {"omega": -p.K1 * block([p.T2, 1], [p.T1, 1]) * lag(p.T3) * turbine, "Pref": turbine}


def ieeeg3_diagram(p, x):
    forward = block([1], [p.TG * p.TP, p.TG, 0])
    gate = forward / (1 + forward * (p.sigma + p.delta * block([p.TR, 0], [p.TR, 1])))
    turbine = p.a23 * block([(p.a11 - p.a13 * p.a21 / p.a23) * p.TW, 1], [p.a11 * p.TW, 1])
    return {"omega": -gate * turbine, "Pref": gate * turbine}


def engine(p):
    """From the control error to the throttle, and the delay."""
    box = block([p.T3, 1], [p.T1 * p.T2, p.T1, 1])
    actuator = p.K * block([p.T4, 1], [1, 0]) * lag(p.T5) * lag(p.T6)
    return box * actuator, control.tf(*control.pade(p.TD / 4, 2))(S) ** 4


def degov_diagram(p, x):
    throttle, delay = engine(p)
    return {"omega": -throttle * delay + x["throttle"]}


def degov1_diagram(p, x):
    throttle, delay = engine(p)
    if p.M == 0:
        throttle = throttle / (1 + p.DROOP * throttle)
        return {"omega": -throttle * delay + x["throttle"], "Pref": throttle * delay, "P": 0 * S}
    through = throttle * delay
    return {"omega": -through + x["throttle"], "Pref": through, "P": -p.DROOP * lag(p.TE) * through}


def slope(p, gate):
    """Of the curve from the gate to the power."""
    xs, ys = np.array([p.G0, p.G1, p.G2, 1.0]), np.array([0.0, p.P1, p.P2, p.P3])
    k = int(np.searchsorted(xs, gate)) - 1
    return (ys[k + 1] - ys[k]) / (xs[k + 1] - xs[k])


def pidgov_diagram(p, x):
    terms = (block([p.Kp, p.Ki], [1, 0]) * lag(p.Ta) + block([p.Kd, 0], [p.Ta, 1])) * lag(p.Ta)
    servo, droop, Tz = lag(p.Tb), p.Rperm * lag(p.Treg), p.Atw * p.Tw
    gate = terms * servo / (1 + (droop * terms * servo if p.feedback else 0))
    turbine = slope(p, x["gate"]) * block([-Tz, 1], [Tz / 2, 1])
    return {
        "omega": -gate * turbine - p.Dturb,
        "Pref": droop * gate * turbine,
        "P": 0 * S if p.feedback else -droop * gate * turbine,
    }


def wpidhy_diagram(p, x):
    terms = block([p.Kd, p.Kp, p.Ki], [1, 0]) * lag(p.Ta) ** 2 * lag(p.Tb) * block([1], [1, 0])
    droop = p.Reg * lag(p.Treg)
    turbine = slope(p, x["gate"]) * block([-p.Tw, 1], [p.Tw / 2, 1])
    return {"omega": -terms * turbine - p.D, "Pref": -droop * terms * turbine, "P": droop * terms * turbine}


def ggov1_diagram(p, x):
    Td, rating = p.Teng, p.Trate / p.base
    delay = block([Td**2 / 12, -Td / 2, 1], [Td**2 / 12, Td / 2, 1])
    turbine = p.Kturb * delay * block([p.Tc, 1], [p.Tb, 1])
    C = p.Kpgov + p.Kigov / S + p.Kdgov * S * lag(p.Tdgov)
    feedback = {1: 0.0, 0: 0.0, -1: p.R * lag(0.01), -2: p.R * lag(p.Tact)}[p.select]
    valve = lag(p.Tact) * C / (1 + C * feedback)
    measured = lag(p.Tpelec) * (p.Kimw / S + (p.R if p.select == 1 else 0.0))
    return {
        "omega": rating * (turbine * ((x["valve"] if p.fuel == 1 else 0.0) - valve) - p.Dm),
        "Pref": rating * turbine * valve * (1 + p.Kimw / S / p.R),
        "P": -turbine * valve * measured,
    }


DIAGRAMS = {  # device -> its diagram; ranges of parameters that are not 0.05 to 0.8
    tgov1: (tgov1_diagram, {}),
    gast: (gast_diagram, {}),
    ieeeg1: (ieeeg1_diagram, {f"K{n}": (0.1, 0.15) for n in range(1, 9)} | {"K": (10, 30)}),
    hygov: (hygov_diagram, {"R": (0.03, 0.08), "At": (1.0, 1.3), "qNL": (0.05, 0.1), "VELM": (0.1, 0.2)}),
    ieesgo: (ieesgo_diagram, {"K1": (10, 30)}),
    ieeeg3: (ieeeg3_diagram, {"a23": (0.8, 1.2), "a13": (0.8, 1.2), "a21": (1.2, 1.6)}),
    degov: (degov_diagram, {}),
    degov1: (degov1_diagram, {}),
    pidgov: (pidgov_diagram, GATE),
    ggov1: (ggov1_diagram, {"db": (0, 0), "Kturb": (1, 2)}),
    wpidhy: (wpidhy_diagram, GATE | {"Reg": (-0.08, -0.03), "Pmax": (5, 9)}),
}
FLAGS = {"M": (0, 1), "feedback": (0, 1), "select": (1, 0, -1, -2), "fuel": (0, 1)}


def random_par(device, ranges, seed):
    """Parameters with limits out of reach."""
    rng, values = np.random.default_rng(seed), {}
    for name in fields(device.Par):
        low, high = ranges.get(name, (0.05, 0.8))
        values[name] = FLAGS[name][seed % len(FLAGS[name])] if name in FLAGS else float(rng.uniform(low, high))
        if name in ("AT",) or (name.endswith("max") and name not in ranges):
            values[name] = 9.0
        elif name.endswith("min"):
            values[name] = -9.0
    return device.Par(**values)


def still(device, par, power=POWER):
    """States and inputs at rest."""
    given = {"omega": 1.0, "P": power}
    return rest(device, opened(device, par), {n: given[n] for n in device.Input._fields if n in given}, {"Pm": power})


@pytest.mark.parametrize("device", DIAGRAMS, ids=lambda d: d.name)
def test_the_linearized_governor_is_its_block_diagram(device):
    """20 parameter sets, 30 frequencies, every input."""
    diagram, ranges = DIAGRAMS[device]
    for seed in range(20):
        par = random_par(device, ranges, seed)
        x, u = still(device, par)
        wanted = diagram(par, device.State(*x)._asdict())
        found = response(device, opened(device, par), x, u, list(wanted), "Pm")
        for name, one, other in zip(wanted, found, wanted.values(), strict=True):
            assert np.abs(one - other).max() < 1e-9 * (np.abs(other).max() + 1e-9), (seed, name)


STATE_OF = {  # device -> the state with the limits
    device: next(iter(device.limits)) for device in GOVERNORS if device.limits
}


@pytest.mark.parametrize("device", one_of(*GOVERNORS), ids=lambda d: d.name)
def test_every_limit_is_reached_and_left_without_windup(device):
    """Low speed, then high speed: each limit holds, and is left within a second when the speed turns."""
    par = GOVERNORS[device]
    x, u = still(device, par)
    half = 8.0

    def inputs(t):
        return u | {"omega": 1.0 if t < 1 else 0.9 if t < 1 + half else 1.1}

    wound = device in (pidgov, wpidhy)  # the integral of these controllers has no limit
    out = motion(device, par, x, inputs, 1 + (4 if wound else 2.25) * half)
    time = 2.5e-3 * np.arange(len(out))
    before = out[time < 1]
    assert np.abs(before - before[0]).max() < 1e-9
    if device in STATE_OF:
        name = STATE_OF[device]
        signal, (low, high) = out[:, device.State._fields.index(name)], device.limits[name]
        low, high = getattr(par, low), getattr(par, high)
    else:
        signal, low, high = out[:, -1], par.Pmin, par.Pmax
    assert signal.max() == pytest.approx(high, abs=1e-6)
    assert signal.min() == pytest.approx(low, abs=1e-6)
    turned = np.flatnonzero(time >= 1 + half)
    assert signal[turned[0] - 2] == pytest.approx(high, abs=1e-6)
    left = turned[np.flatnonzero(signal[turned] < high - 1e-3)[0]]
    if not wound:
        assert time[left] - time[turned[0]] < 1.0


@pytest.mark.parametrize(
    ("device", "state", "rates"),
    [(ieeeg1, "valve", ("Umin", "Umax")), (hygov, "desired", (None, "VELM")), (ieeeg3, "gate", ("Umin", "Umax")),
     (pidgov, "gate", ("Velmin", "Velmax")), (wpidhy, "gate", ("Velmin", "Velmax"))],
    ids=lambda v: getattr(v, "name", ""),
)  # fmt: skip
def test_the_gate_moves_no_faster_than_its_limits(device, state, rates):
    par = GOVERNORS[device]
    x, u = still(device, par)
    out = motion(device, par, x, lambda t: u | {"omega": 0.95 if t < 6 else 1.05}, 14.0)
    speed = np.diff(out[:, device.State._fields.index(state)]) / 2.5e-3
    fastest = getattr(par, rates[1])
    slowest = getattr(par, rates[0]) if rates[0] else -fastest
    assert speed.max() == pytest.approx(fastest, rel=1e-9)
    assert speed.min() == pytest.approx(slowest, rel=1e-9)


def test_the_temperature_limit_of_gast_takes_over_from_the_speed():
    """A small demand of speed above AT: the power ends where AT + KT (AT - power) = power, at AT."""
    par = gast.Par(R=0.05, T1=0.4, T2=0.1, T3=3.0, AT=0.8, KT=2.0, Vmax=1.0, Vmin=0.0)
    x, u = still(gast, par)
    out = motion(gast, par, x, lambda t: u | {"omega": 0.985}, 40.0)
    assert out[:, -1].max() > 0.85
    assert out[-1, -1] == pytest.approx(0.8, abs=1e-4)


def test_the_delay_of_degov_is_as_good_as_its_description_says():
    """The diagram above has this delay."""
    shown = float(re.search(r"within 1 degree up to omega TD = (\d\.\d)", degov.module.__doc__)[1])
    section = control.tf(*control.pade(1 / 4, 2))
    below, above = (np.angle(section(1j * w) ** 4 * np.exp(1j * w), deg=True) for w in (shown, shown + 0.1))
    assert abs(below) < 1 < abs(above)  # 0.97, 1.06


def test_degov_waits_for_its_delay():
    par = GOVERNORS[degov]._replace(TD=0.5, Tmax=9.0)
    x, u = still(degov, par)
    out = motion(degov, par, x, lambda t: u | {"omega": 0.999}, 2.0)
    throttle, power = out[:, degov.State._fields.index("throttle")], out[:, -1] / 0.999
    late = round(0.5 / 2.5e-3)
    assert np.abs(power[late + 100 :] - throttle[100 : len(throttle) - late]).max() < 1e-4
    assert throttle[-1] > 0.61


@pytest.mark.parametrize("device", GOVERNORS, ids=lambda d: d.name)
def test_a_record_of_the_present_length_is_read(device):
    """The names of DYR are the parameters of the device, each once; WSIEG1 has more, which must be 0."""
    for kind, names in device.dyr.items():
        own = [n.lstrip("+") for n in names.split() if not n.startswith("_")]
        known = set(own) - {"JBUS"}
        assert known == set(fields(device.Par)) or (kind == "WSIEG1" and known > set(fields(device.Par)))
        assert len(own) == len(set(own))


def test_ieeeg1_tells_shares_that_do_not_add_up_and_refuses_cross_compound_units():
    values = dict(zip(fields(ieeeg1.Par), GOVERNORS[ieeeg1], strict=True))
    par, said = ieeeg1.from_record("IEEEG1", values | {"JBUS": 0})
    assert par == GOVERNORS[ieeeg1]
    assert not said
    assert ieeeg1.from_record("IEEEG1", values | {"JBUS": 0, "K3": 0.5})[1] == [
        "K1 to K8 of IEEEG1 sum to 0.8, not 1; used as given"
    ]
    with pytest.raises(ValueError, match="cross-compound"):
        ieeeg1.from_record("IEEEG1", values | {"JBUS": 5})


def gas(change, until=20.0, turn=12.0, **values):
    """Times and signals by name of GGOV1 while the speed is changed from 1 s on, and the other way from `turn` on."""
    par = ggov1.prepare(GAS._replace(base=100.0, **values))
    x, u = still(ggov1, par)
    out = motion(
        ggov1, par, x, lambda t: u | {"omega": 1.0 + (0.0 if t < 1 else change if t < turn else -change)}, until
    )
    names = [*ggov1.State._fields, "Pm"]
    signals = dict(zip(names, out.T, strict=True))
    time = 2.5e-3 * np.arange(len(out))
    assert np.abs(out[time < 1] - out[0]).max() < 1e-9
    return time, signals, par


@pytest.mark.parametrize(("change", "limit"), [(-0.04, "Vmax"), (0.04, "Vmin")])
def test_the_valve_of_ggov1_is_at_a_limit_and_leaves_it_without_windup(change, limit):
    time, found, par = gas(change, Kpload=0.0, Kiload=0.0, Rmax=1.0, Rmin=-1.0)
    edge = getattr(par, limit)
    assert found["valve"][time < 12][-1] == pytest.approx(edge, abs=1e-6)
    assert found["valve"].min() >= par.Vmin - 1e-9
    assert found["valve"].max() <= par.Vmax + 1e-9
    assert np.abs(found["valve"][time > 12.5][0] - edge) > 0.1


@pytest.mark.slow
def test_the_valve_of_ggov1_moves_no_faster_than_its_rates():
    time, found, par = gas(-0.04, Kpload=0.0, Kiload=0.0)
    rate = np.gradient(found["valve"], time)
    assert rate.max() == pytest.approx(par.Rmax, rel=1e-6)
    assert rate.min() == pytest.approx(par.Rmin, rel=1e-6)


@pytest.mark.slow
def test_the_load_limiter_of_ggov1_holds_the_exhaust_and_gives_way():
    """At low speed the exhaust settles at Ldref/Kturb + Wfnl; at high speed the governor takes over within a second."""
    time, found, par = gas(-0.04, until=53.0, turn=50.0, Ldref=0.8, Rmax=1.0, Rmin=-1.0)
    late = (time > 48) & (time < 50)
    assert found["exhaust"][late] == pytest.approx(par.Ldref / par.Kturb + par.Wfnl, abs=2e-3)
    assert found["Pm"][late] == pytest.approx(par.Ldref, abs=2e-2)
    assert found["Pm"][time > 52][0] < 0.6


def test_the_acceleration_limiter_of_ggov1_lowers_the_request():
    """A speed that rises by 0.05 pu/s, above Aset = 0.01, closes the valve, although the governor may not lower it."""
    valves = []
    for gain in (10.0, 0.0):
        par = ggov1.prepare(GAS._replace(Aset=0.01, errmin=0.0, Ka=gain))
        x, u = still(ggov1, par)
        out = motion(ggov1, par, x, lambda t, u=u: u | {"omega": 1.0 + 0.05 * t}, 0.8)
        valves.append(out[:, ggov1.State._fields.index("valve")])
    assert valves[0][-1] < 0.55
    assert valves[1] == pytest.approx(0.6, abs=1e-9)


RECORD = {"select": 1, "Kpgov": 10.0, "Kimw": 0.0, "Kpload": 2.0, "Kiload": 0.67}


@pytest.mark.parametrize(
    ("changed", "text"),
    [({"Kpgov": 0.0}, "Kpgov = 0"), ({"Kimw": 0.01, "select": 0}, "Rselect = 0"), ({"Kpload": 0.0}, "Kiload = 0.67")],
)
def test_ggov1_refuses_what_it_does_not_represent(changed, text):
    with pytest.raises(ValueError, match=text):
        ggov1.from_record("GGOV1", RECORD | changed)

"""Controls of converters: block diagrams by frequency response, limits reached and left, stationary start."""

import numpy as np
import pytest
from block_diagram import distance, evaluate, feedback, motion, one, opened, response, rest, s
from records import csvgn1, dera1, reec_b, reec_c, repc_a, wtdt_a
from systems import REEC, REGC, small

from stabctl import devices
from stabctl._util.schema import fields
from stabctl.controllers import Controller
from stabctl.devices.blocks import lookup
from stabctl.devices.converters.electrical import NO_LIMIT, rising
from stabctl.dynamics import operating_point
from stabctl.io.psse import dyr
from stabctl.simulation import simulation
from stabctl.simulation.events import LoadStep

P, Q = 0.7, 0.2
AT = {"vt": 1.0, "V": 1.0, "f": 1.0, "P": P, "Q": Q, "fset": 1.0, "wg": 1.0, "Paux": 0.0}


def draw(device, seed, **given):
    """Parameters at random, time constants of 0.03 to 2, gains of 0.3 to 10; deadbands closed."""
    rng = np.random.default_rng(seed)
    made = {name: 0.0 for name in device.Par._fields if name not in fields(device.Par)}
    made |= {f.name: float(10 ** rng.uniform(-1.5, 0.3)) for f in fields(device.Par).values()}
    closed = {"dbd1": 0.0, "dbd2": 0.0, "fdbd1": 0.0, "fdbd2": 0.0, "V0": 1.0, "Vref0": 1.0, "Vdip": 0.1, "Vup": 9.0}
    closed |= {"Vblkl": 0.1, "Vblkh": 9.0}
    far = {n: 99.0 for n in device.Par._fields if n.startswith(("Iq", "Ip")) and n[2:].isdecimal()}
    known = made | closed | far | {"bus": 0, "Vfrz": 0.0} | given
    return device.Par(**{name: known[name] for name in device.Par._fields})


def still(device, p, outputs, **given):
    """Opened parameters, states and inputs at rest."""
    p = opened(device, p)
    u = {n: (AT | given)[n] for n in device.Input._fields if n in AT | given}
    return p, *rest(device, p, u, outputs)


def lag(T):
    return 1 / (1 + s * T)


def electrical(p, x, u):
    """Responses of Ipcmd and Iqcmd of an electrical control at 1 pu."""
    vf, power = lag(p.Trv), lag(p.Tpord)
    q = {"pfref": one(P), "P": u["pfref"] * lag(p.Tp)} if p.PfFlag else {"Qext": one()}
    if p.QFlag:
        inner = p.Kvp + p.Kvi / s
        outer = p.Kqp + p.Kqi / s if p.VFlag else 1
        reactive = {n: inner * outer * g for n, g in q.items()} | {"vt": -1 * vf * inner}
        if p.VFlag:
            reactive["Q"] = -1 * inner * outer
    else:
        reactive = {n: lag(p.Tiq) * g for n, g in q.items()} | {"vt": -Q * lag(p.Tiq) * vf}
    if p.QFlag and "VcmpFlag" in p._fields:
        seen = slopes(p) if p.VcmpFlag else {"V": 1.0, "Q": p.Kc, "P": 0.0}
        inner = (p.Kvp + p.Kvi / s) * lag(p.Tr1)
        reactive["vt"] = -seen["V"] * inner
        reactive |= {n: reactive.get(n, 0 * s) - seen[n] * inner for n in ("P", "Q") if seen[n]}
    if "PFlag" not in p._fields:  # REEC_A and REEC_D support the voltage in a dip alone
        reactive["vt"] = reactive["vt"] - p.Kqv * vf
    active = {"Pref": power, "vt": -P * vf}
    if getattr(p, "PFlag", 0):
        active["wg"] = P * power
    if "Paux" in u:
        active["Paux"] = one()
    return {"Ipcmd": active, "Iqcmd": reactive}


def slopes(p):
    """How |V - (Rc + j Xc) I| moves with voltage and power at 1 pu."""
    a, b = 1 - p.Rc * P - p.Xc * Q, p.Xc * P - p.Rc * Q
    behind = np.hypot(a, b)
    return {
        "V": (a * (1 + p.Rc * P + p.Xc * Q) - b * b) / behind,
        "P": (-a * p.Rc + b * p.Xc) / behind,
        "Q": (-a * p.Xc - b * p.Rc) / behind,
    }


def plant(p, x, u):
    """Responses of the references of a plant controller."""
    regulator, meter = (p.Kp + p.Ki / s) * (1 + s * p.Tft) * lag(p.Tfv), lag(p.Tfltr)
    reactive = {"Vset" if p.RefFlag else "Qset": regulator}
    held = slopes(p) if p.VcFlag else {"V": 1.0, "Q": p.Kc}
    seen = held if p.RefFlag else {"Q": 1.0}
    reactive |= {n: -1 * slope * meter * regulator for n, slope in seen.items()}
    if not p.FFlag:
        return {"Pref": {"Pset": one()}, "Qext": reactive}
    through = (p.Kpg + p.Kig / s) * lag(p.Tg)
    active = {"Pset": through, "P": -1 * lag(p.Tp) * through, "fset": p.Ddn * through, "f": -p.Ddn * through}
    return {"Pref": active, "Qext": reactive}


CURRENTS = {"Ipcmd": P, "Iqcmd": Q}
FLAGS = [dict(zip(("QFlag", "VFlag", "PfFlag", "PqFlag"), flags, strict=True)) for flags in np.ndindex(2, 2, 2, 2)]
DIAGRAMS = {
    **{name: (name, electrical, CURRENTS, FLAGS) for name in ("reec_a", "reec_b", "reec_c")},
    "reec_a with speed": ("reec_a", electrical, CURRENTS, [{**flags, "PFlag": 1, "Vref1": 0.1} for flags in FLAGS]),
    "reec_d": ("reec_d", electrical, CURRENTS, [{**flags, "VcmpFlag": k % 2} for k, flags in enumerate(FLAGS * 3)]),
    "repc_a": (
        "repc_a",
        plant,
        {"Pref": P, "Qext": Q},
        [{"RefFlag": r, "VcFlag": c, "FFlag": f, "Ddn": 7.0, "Dup": 7.0, "Xc": 0.1} for r, c, f in np.ndindex(2, 2, 2)],
    ),
}


@pytest.mark.parametrize("name", DIAGRAMS)
def test_linearized_it_is_its_block_diagram(name):
    """20 sets of parameters, 30 frequencies, every flag."""
    model, diagram, outputs, flags = DIAGRAMS[name]
    device = devices.every()[model]
    for seed in range(20):
        par = draw(device, seed, **{"Vref1": 0.0, "PFlag": 0} | flags[seed % len(flags)])
        p, x, u = still(device, par, outputs)
        for output, wanted in diagram(p, x, u).items():
            found = response(device, p, x, u, list(wanted), output)
            assert distance(found, list(wanted.values())) < 1e-9, (seed, output)


def test_the_drive_train_is_its_block_diagram():
    for seed in range(20):
        p = draw(wtdt_a, seed, Htfrac=0.1 + 0.04 * seed, Pm=P, turning=1.0, D=2.0)
        Ht, Hg = p.Htfrac * p.H, p.H - p.Htfrac * p.H
        K = 2 * (2 * np.pi * p.Freq1) ** 2 * Ht * Hg / p.H
        shaft = K / s + p.Dshaft
        wanted = -1 / (2 * Hg * s - P + p.D + feedback(shaft, 1 / (2 * Ht * s + P)))
        x = [1.0, 1.0, P / K]
        rates, _ = evaluate(wtdt_a, p, x, {"P": P})
        assert np.abs(rates).max() < 1e-12
        assert distance(response(wtdt_a, p, x, {"P": P}, ["P"], "wg"), [wanted]) < 1e-9


def test_two_masses_that_are_stiffly_coupled_are_one():
    two = draw(wtdt_a, 0, Htfrac=0.6, Freq1=1e3, Dshaft=0.0, D=1.0, Pm=P, turning=1.0, H=3.0)
    one_mass = two._replace(Htfrac=0.0)
    K = 2 * (2 * np.pi * 1e3) ** 2 * 0.6 * 0.4 * 3.0
    slow = [
        response(wtdt_a, p, x, {"P": P}, ["P"], "wg")
        for p, x in ((two, [1.0, 1.0, P / K]), (one_mass, [1.0, 1.0, 0.0]))
    ]
    assert np.abs(slow[0] / slow[1] - 1).max() < 1e-3


def test_the_static_compensator_is_its_block_diagram():
    v = (0.98, 0.1)
    vt2 = v[0] ** 2 + v[1] ** 2
    for seed in range(20):
        p = draw(csvgn1, seed, base=100.0, mva=1.0, Cbase=60.0)
        p = opened(csvgn1, p)
        x, u = rest(csvgn1, p, {}, {"Q": Q}, v)
        wanted = p.K * (1 + s * p.T1) * (1 + s * p.T2) * lag(p.T3) * lag(p.T4) * lag(p.T5) * vt2
        assert distance(response(csvgn1, p, x, u, ["Vref"], "Q", v), [wanted]) < 1e-9


def driven(device, p, outputs, signal, change, until=8.0, **given):
    """Times and signals by name while an input is `change` higher for 3 s, then as much lower."""
    _, x, u = still(device, p, outputs, **given)
    p = device.prepared(p)
    rates, _ = evaluate(device, p, x, u)
    assert np.abs(rates).max() < 1e-8
    out = motion(device, p, x, lambda t: u | {signal: u[signal] + (change if t < 3 else -change)}, until)
    names = [*device.State._fields, *device.Output._fields]
    return np.arange(len(out)) * 2.5e-3, dict(zip(names, out.T, strict=True))


SMALL = {"dbd1": 0.0, "dbd2": 0.0, "Kqv": 0.0, "Kqi": 1.0, "Kvi": 5.0, "Imax": 1.2}
LIMITED = [  # device, parameters, input that is driven and how far, output, its limits
    (reec_b, {"Pmax": 0.9, "Pmin": 0.1}, "Pref", 1.0, "Ipcmd", 0.9, 0.1),
    (reec_b, {"Pmax": 9.0, "Pmin": 0.0}, "Pref", 2.0, "Ipcmd", np.sqrt(1.2**2 - Q**2), 0.0),
    (reec_b, {"Qmax": 0.3, "Qmin": -0.1}, "Qext", 1.0, "Iqcmd", 0.3, -0.1),
    (reec_b, {"QFlag": 1, "Vmax": 1.05, "Vmin": 0.95, "Kvi": 0.0, "Kqi": 20.0, "Kvp": 4.0}, "Q", -1.0, "Iqcmd",
     0.2, -0.2),
    (reec_b, {"QFlag": 1, "Vmax": 9.0, "Vmin": -9.0, "Kqp": 4.0}, "Qext", 0.2, "Iqcmd", 1.2, -1.2),
    (reec_b, {"QFlag": 1, "PqFlag": 1, "Vmax": 9.0, "Vmin": -9.0, "Kqp": 4.0}, "Qext", 0.2, "Iqcmd",
     np.sqrt(1.2**2 - P**2), -np.sqrt(1.2**2 - P**2)),
    (reec_b, {"Kqv": 2.0, "Iqvmax": 0.1, "Iqvmin": -0.3, "Vref0": 1.0, "Tiq": 5.0e3, "Trv": 0.0}, "vt", -0.3, "Iqcmd",
     0.3, -0.1),
    (repc_a, {"RefFlag": 1, "Qmax": 0.4, "Qmin": -0.4}, "Vset", 0.5, "Qext", 0.4, -0.4),
    (repc_a, {"FFlag": 1, "Pmax": 0.9, "Pmin": 0.2, "Kpg": 1.0, "Kig": 2.0}, "Pset", 1.0, "Pref", 0.9, 0.2),
    (repc_a, {"RefFlag": 0, "Kp": 1.0, "Ki": 1e-6, "emax": 0.1, "emin": -0.2}, "Qset", 0.5, "Qext", 0.3, 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("device", "given", "signal", "change", "what", "high", "low"), LIMITED)
def test_a_limit_is_reached_and_left_without_windup(device, given, signal, change, what, high, low):
    base = device.Par(0, **SMALL) if device is reec_b else repc_a.Par(Kp=2.0, Ki=2.0, dbd1=0.0, dbd2=0.0)
    outputs = CURRENTS if device is reec_b else {"Pref": P, "Qext": Q}
    t, found = driven(device, base._replace(**given), outputs, signal, change)
    y, kept = found[what], t > 1.5
    assert y[kept].max() == pytest.approx(high, abs=2e-3)
    assert y.min() == pytest.approx(low, abs=2e-3)
    assert y[(t > 3.0) & (t < 3.5)].min() < high - 0.01


def test_outside_its_voltages_an_electrical_control_rests():
    p = reec_b.Par(0, **SMALL, Vdip=0.8)
    _, x, u = still(reec_b, p, CURRENTS)
    out = motion(reec_b, p, x, lambda t: u | {"vt": 0.5 if t > 0.1 else 1.0, "Pref": 0.3, "Qext": 0.0}, 0.5)
    names = reec_b.State._fields
    after = out[45:]
    assert np.ptp(after[:, names.index("pord")]) < 1e-12
    assert np.ptp(after[:, names.index("iq")]) < 1e-12
    assert np.ptp(after[:, names.index("vm")]) > 0.1


def test_an_empty_battery_stops_discharging_and_charges_again():
    p = reec_c.Par(0, 0, 0, T=2.0, SOCini=0.3, SOCmin=0.2, Imax=1.2, Pmin=-1.0, Pmax=1.0)
    _, x, u = still(reec_c, p, {"Ipcmd": 0.0, "Iqcmd": 0.0}, P=0.0, Q=0.0)
    p = reec_c.automatic(reec_c.prepare(p), reec_c.Input(*(0.0 for _ in reec_c.Input._fields)))
    current = reec_c.State._fields.index("soc")
    assert x[current] == pytest.approx(0.3)
    out = motion(
        reec_c,
        p,
        x,
        lambda t: u | {"Pref": 0.5 if t < 2 else -0.5, "P": 0.5 if t < 0.5 else -0.5 if t > 2 else 0.0},
        3.0,
    )
    t = 2.5e-3 * np.arange(len(out))
    ip = out[:, -2]
    assert out[:, current].min() == pytest.approx(0.2 - 0.0, abs=2e-2)
    assert out[t > 2.9, current][0] > 0.3
    assert ip[(t > 2.2)].max() < -0.4


@pytest.mark.parametrize("step", [None, 1 / 960])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_battery_that_delivers_or_charges_at_the_start_stops_at_its_limit_of_charge(sign, step):
    """An order of 0.4 instead of 0.2 pu moves 0.1 T in half a second; turned, the battery works again."""
    par = reec_c.Par(0, 0, 0, T=1.0, SOCini=0.5, SOCmin=0.4, SOCmax=0.6, Imax=1.5, Pmin=-1.0)
    point = operating_point.solve(small({"regc_a": REGC, "reec_c": par}, p=sign * 80.0))

    def orders(now):
        return sign * np.array([0.2 if 0.5 <= now.time < 2.5 else -0.4 if now.time >= 2.5 else 0.0])

    act = Controller.from_function(orders, "voltage:1", "pset:1", rate=60)
    run = simulation.run(point, control=act, until=3.0, step=step)
    P = sign * run.rows[:, point.layout.signals[0, "P"]]
    assert P[(run.time > 0.7) & (run.time < 0.95)] == pytest.approx(0.4, abs=1e-3)
    assert np.abs(P[(run.time > 1.5) & (run.time < 2.5)]).max() < 1e-6
    assert P[-1] == pytest.approx(-0.2, abs=1e-3)


def test_curves_of_current_over_voltage_limit_it():
    """Half the voltage leaves 0.5 pu of reactive current by VDL1 and 0.2 pu of active current by VDL2."""
    reec_a = devices.every()["reec_a"]
    points = {"Vq1": 0.0, "Iq1": 0.0, "Vq2": 1.0, "Iq2": 1.0, "Vq3": 1.1, "Iq3": 1.0, "Vq4": 1.2, "Iq4": 1.0}
    points |= {"Vp1": 0.4, "Ip1": 0.1, "Vp2": 0.6, "Ip2": 0.3, "Vp3": 0.9, "Ip3": 1.0, "Vp4": 1.0, "Ip4": 1.0}
    p = reec_a.prepare(reec_a.Par(0, **SMALL, **points)._replace(Kqv=9.0, Iqvmax=9.0, Vref0=1.0, Vdip=0.6))
    _, x, u = still(reec_a, p, CURRENTS)
    out = motion(reec_a, p, x, lambda t: u | {"vt": 1.0 if t < 0.1 else 0.5}, 0.6)
    assert out[-1, -2:] == pytest.approx([0.2, 0.5], abs=1e-6)


@pytest.mark.parametrize("model", ["reec_a", "reec_c", "reec_d"])
@pytest.mark.parametrize("curve", ["q", "p"])
@pytest.mark.parametrize(
    "points",
    [
        [(-1.0, 1.6), (2.0, 1.5)],
        [(0.2, 0.3), (0.7, 1.1), (1.4, 1.3)],
        [(0.0, 0.0), (0.6, 0.7)],
        [(0.0, 0.4)],
        [(0.1, 0.0), (0.5, 0.9), (0.8, 1.2), (1.2, 0.6)],
        [(0.2, 0.9), (0.5, 1.1), (0.9, 0.0)],  # no current above 0.9 pu: a point, although its current is zero
        [(0.2, 0.9), (0.9, 0.0)],
        [(0.6, 0.4), (0.0, 0.9)],  # a current at zero voltage, given last
    ],
)
def test_unused_points_of_a_curve_are_not_part_of_it(model, curve, points):
    """What follows the last point as 0, 0 changes the curve nowhere."""
    device = devices.every()[model]
    count = 10 if model == "reec_d" else 4
    given = {f"{n}{curve}{k}": 0.0 for n in "VI" for k in range(1, count + 1)}
    for k, (volts, limit) in enumerate(points, 1):
        given |= {f"V{curve}{k}": volts, f"I{curve}{k}": limit}
    known = {name: 0.0 for name in device.Par._fields if name not in fields(device.Par)}
    p = device.prepare(device.Par(**(known | {n: f.default for n, f in fields(device.Par).items()} | given)))
    volts, limits = ([getattr(p, f"{n}{curve}{k}") for k in range(1, count + 1)] for n in "VI")
    for v in np.linspace(0, 2, 21):
        assert lookup(v, volts, limits) == pytest.approx(np.interp(v, *zip(*sorted(points), strict=True)))


def test_points_of_a_curve_that_do_not_ascend_are_left_out():
    reec_a = devices.every()["reec_a"]
    p = reec_a.prepare(reec_a.Par(0, Vq1=0.5, Iq1=0.4, Vq2=0.5, Iq2=0.9, Vq3=0.0, Iq3=0.0, Vq4=0.0, Iq4=0.0))
    volts = [p.Vq1, p.Vq2, p.Vq3, p.Vq4]
    assert volts == sorted(set(volts))
    assert lookup(0.5, volts, [p.Iq1, p.Iq2, p.Iq3, p.Iq4]) == 0.4  # the first at that voltage
    none = reec_a.prepare(reec_a.Par(0, **{f"{n}{k}": 0.0 for n in ("Vq", "Iq") for k in range(1, 5)}))
    assert none.Iq1 == none.Iq4 == 99.0


def test_records_of_what_is_not_modeled_are_refused_or_told():
    reec_a = devices.every()["reec_a"]
    with pytest.raises(ValueError, match="Thld = 2"):
        reec_a.from_record("REECA1", {"bus": 0, "Thld": 2.0, "Thld2": 0.0})
    with pytest.raises(ValueError, match="remote bus 7"):
        reec_b.from_record("REECB1", {"bus": 7})
    _, said = repc_a.from_record("REPCA1", {"branch_from": 1, "branch_to": 2, "circuit": "A"})
    assert said == ["measures its own power instead of that of branch 1-2 ckt A."]


@pytest.mark.parametrize(
    ("given", "signal", "change", "state", "high", "low"),
    [
        ({"Pmax": 0.9, "Pmin": 0.3, "FreqFlag": 0}, "Pref", 1.0, "pord", 0.9, 0.3),
        ({"Pmax": 0.9, "Pmin": 0.3, "Ddn": 40.0, "Dup": 40.0}, "f", -0.05, "pord", 0.9, 0.3),
        ({"Imax": 0.8, "Pmax": 2.0, "FreqFlag": 0, "PfFlag": 0}, "Pref", 0.9, "ip", np.sqrt(0.8**2 - Q**2), 0.0),
        ({"Imax": 0.8, "PfFlag": 0, "PqFlag": 1, "FreqFlag": 0}, "Qref", 2.0, "iq", np.sqrt(0.15), -np.sqrt(0.15)),
    ],
)
def test_a_limit_of_distributed_generation_is_reached_and_left(given, signal, change, state, high, low):
    p = dera1.Par(mva=1.0, V0=1.0, bus=0.0, dPmax=9.0, dPmin=-9.0)._replace(**given)
    x, u = rest(dera1, opened(dera1, p), {"f": 1.0}, {"P": P, "Q": Q})
    rates, _ = evaluate(dera1, p, x, u)
    assert np.abs(rates).max() < 1e-8
    out = motion(dera1, p, x, lambda t: u | {signal: u[signal] + (change if t < 2 else -change)}, 4.0)
    t, y = np.arange(len(out)) * 2.5e-3, out[:, dera1.State._fields.index(state)]
    assert y[t < 2].max() == pytest.approx(high, abs=2e-3)
    assert y.min() == pytest.approx(low, abs=2e-3)
    assert y[(t > 2) & (t < 2.3)].min() < high - 0.01


@pytest.mark.parametrize(("load", "droop", "edge"), [(-100.0, 20.0, 6e-4), (100.0, 8.0, -4e-4)])
@pytest.mark.parametrize("gains", [{}, {"Kpg": 0.5, "Kig": 2.0}])
def test_the_frequency_control_of_distributed_generation_is_a_droop(load, droop, edge, gains):
    """After a load step dP, P = P0 - R (f - 1 - edge), and D (f - 1) of the machine takes the rest but for losses."""
    der = dera1.Par(0, 0, 0, Ddn=20.0, Dup=8.0, fdbd1=-6e-4, fdbd2=4e-4)._replace(**gains)
    point = operating_point.solve(small({"dera1": der}, p=200.0))
    run = simulation.run(point, [LoadStep(2, 0.5, p=load)], until=60.0)
    f, P = run.arrays.speed[-1, 0] - 1, run.rows[-1, point.layout.signals[0, "P"]]
    assert P - 0.5 == pytest.approx(-droop * (f - edge), abs=1e-7)  # measured 2e-9
    assert np.ptp(run.arrays.speed[run.time > 50.0]) < 1e-8
    D, R = 2.0 * 4000.0, droop * 400.0  # MW/pu of the machine and of the generation
    assert f == pytest.approx((-load + R * edge) / (D + R), rel=0.02)  # measured 0.013


@pytest.mark.parametrize(
    ("given", "told"), [({"dPmax": 0.5}, 1), ({"Vdip": 0.8}, 1), ({}, 0), ({"Tpord": 0.02, "dPmax": 0.5}, 0)]
)
def test_an_order_without_a_lag_has_no_rate_limit_and_the_import_says_so(given, told):
    """The block of Tpord is bypassed below 1 ms, as any lag, and with it what acts on its state."""
    said = list(dyr._short_lags(REEC._replace(**({"Tpord": 0.0} | given)), "electrical control"))
    assert said == told * ["Tpord = 0 s: no lag of the power order, so dPmin, dPmax and Vdip do not hold it."]


def test_trips_of_distributed_generation_are_refused():
    with pytest.raises(ValueError, match="VtripFlag = 1"):
        dera1.from_record("DERA1", {"VtripFlag": 1, "FtripFlag": 0})


@pytest.mark.parametrize("last", [1, 2, 3, 4])
def test_a_point_of_a_curve_with_a_voltage_and_no_current_is_one(last):
    """Only points 0, 0 at its end are unused."""
    volts, limits = [0.2 * k for k in range(1, 5)], [1.0, 0.8, 0.6, 0.4]
    limits[last - 1] = 0.0
    given = {
        f"{n}{k}": (volts if n[0] == "V" else limits)[k - 1] if k <= last else 0.0
        for n in ("Vq", "Iq", "Vp", "Ip")
        for k in range(1, 5)
    }
    found = rising(devices.every()["reec_a"].Par(0, **given))
    if last == 1:
        assert found.Iq1 == NO_LIMIT
    else:
        assert [found.Vq1, getattr(found, f"Vq{last}")] == [0.2, volts[last - 1]]
        assert getattr(found, f"Iq{last}") == 0.0
        assert all(getattr(found, f"Ip{k}") == 0.0 for k in range(last, 5))
        assert all(getattr(found, f"Vp{k}") < getattr(found, f"Vp{k + 1}") for k in range(1, 4))

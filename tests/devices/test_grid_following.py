"""Grid-following converters behind an impedance, REGC_B and REGC_C: block diagrams, limits, phase-locked loop."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from block_diagram import distance, evaluate, feedback, one, opened, response, s, slopes
from records import regc_a, regc_b, regc_c
from systems import REGC, REGC_B, REGC_C, small

import stabctl as st
from stabctl.dynamics import operating_point
from stabctl.model import network
from stabctl.simulation import simulation
from stabctl.simulation.events import Clear, Fault, LoadStep, Open

FAULT = [Fault("2", 0.1), Clear("2", 0.2)]
FILES = Path(__file__).parents[2] / "docs" / "examples"
BOTH = [("regc_b", REGC_B), ("regc_c", REGC_C)]
KINDS = [(name, p._replace(PqFlag=k, Te=Te)) for name, p in BOTH for k, Te in ((0, 0.02), (1, 0.0))]
P, Q = 0.7, 0.2


def run(case, events=FAULT, until=1.0):
    return simulation.run(operating_point.solve(case), events, until)


def signal(of, name, unit=0):
    return of.rows[:, of.point.layout.signals[unit, name]]


def drawn(seed, *names):
    """Random parameters."""
    rng = np.random.default_rng(seed)
    return {n: float(10 ** rng.uniform(-2.0, 0.5)) for n in names}


def at_infinite_bus(device, p):
    """States and inputs at rest, P and Q delivered at 1 pu."""
    x, u = list(device.guess(1.0 + 0j, P - 1j * Q, p)), {"Ipcmd": P, "Iqcmd": Q}
    assert np.abs(evaluate(device, p, x, u)[0]).max() < 1e-12
    return x, u


@pytest.mark.parametrize(("vt", "gain", "above"), [(1.0, 1.0, 0), (0.6, 0.5, 0), (1.3, 1.0, 1)])
def test_regc_a_linearized_is_its_block_diagram(vt, gain, above):
    """1/(1+sTg) from each command; low-voltage management halves Ip at 0.6 pu, Khv takes Iq from 1.2 pu on.

    P = gain(vt) Ip vt, Q = (Iq - Khv (vt - Volim)) vt, both without delay.
    """
    for seed in range(20):
        p = opened(regc_a, REGC._replace(**drawn(seed, "Tg", "Tfltr", "Khv"), Lvplsw=seed % 2))
        x, u, v = [P, Q, vt], {"Ipcmd": P, "Iqcmd": Q}, (vt, 0.0)
        assert np.abs(evaluate(regc_a, p, x, u, v)[0]).max() < 1e-12
        lag = vt / (1 + s * p.Tg)
        assert distance(response(regc_a, p, x, u, ["Ipcmd"], "P", v), [gain * lag]) < 1e-9
        assert distance(response(regc_a, p, x, u, ["Iqcmd"], "Q", v), [lag]) < 1e-9
        dP, dQ, _ = slopes(lambda z, p=p, x=x, u=u: evaluate(regc_a, p, x, u, (z[0], 0.0))[1], np.array([vt + 0j]))
        of_gain = P * vt / (p.Lvpnt1 - p.Lvpnt0) if gain < 1 else 0.0
        assert dP[0] == pytest.approx(gain * P + of_gain, rel=1e-12)
        assert dQ[0] == pytest.approx(Q - above * p.Khv * (2 * vt - p.Volim), rel=1e-12)


@pytest.mark.parametrize("model", ["regc_a", "regc_b", "regc_c"])
def test_a_current_lag_below_a_millisecond_is_refused(model):
    """Bypassed, the current would depend on commands that depend on the voltage that it makes."""
    with pytest.raises(st.StabctlError, match=r"Tg_s: 0\.0005 is not allowed; it must be a number of at least 0\.001"):
        small({"regc_a": REGC}).with_device(model, 1, Tg="0.5ms")


def test_a_phase_locked_loop_at_its_limit_is_told_when_it_slips():
    """The frequency falls beyond what the loop may follow, 60 - 0.5/(2 pi) Hz."""
    found = run(small({"regc_c": REGC_C._replace(wmin=-0.5)}), [LoadStep("2", 0.1, 400.0)], 20.0)
    assert (found.outcome.kind, found.outcome.machine) == ("lost_synchronism", 1)
    assert "its frequency at a limit of its range from 59.92 to 61.91 Hz" in str(found.outcome)


@pytest.mark.parametrize("RateFlag", [0, 1])
@pytest.mark.parametrize("Te", [0.0, 0.3])
def test_regc_b_linearized_is_its_block_diagram(RateFlag, Te):
    """1/(1+sTg) and 1/(1+sTe) from each command to its power, whatever the impedance."""
    for seed in range(20):
        p = REGC_B._replace(**drawn(seed, "Tg", "Tfltr", "Re", "Xe"), RateFlag=RateFlag, Te=Te)
        p = opened(regc_b, p)
        x, u = at_infinite_bus(regc_b, p)
        lags = one() / (1 + s * p.Tg) / (1 + s * Te)
        assert distance(response(regc_b, p, x, u, ["Ipcmd"], "P"), [lags]) < 1e-9
        assert distance(response(regc_b, p, x, u, ["Iqcmd"], "Q"), [lags]) < 1e-9


@pytest.mark.parametrize("Te", [0.0, 0.3])
def test_regc_c_linearized_is_its_block_diagram(Te):
    """The current control is (Kip + Kii/s)/(1+sTe) with feedback; the PLL has s^2 + Kppll s + Kipll = 0."""
    for seed in range(20):
        p = opened(regc_c, REGC_C._replace(**drawn(seed, "Tg", "Re", "Xe", "Kip", "Kii"), Te=Te, wb=377.0))
        x, u = at_infinite_bus(regc_c, p)
        loop = (p.Kip + p.Kii / s) / (1 + s * Te)
        control = one() / (1 + s * p.Tg) * feedback(loop, one())
        assert distance(response(regc_c, p, x, u, ["Ipcmd"], "P"), [control]) < 1e-9
        assert distance(response(regc_c, p, x, u, ["Iqcmd"], "Q"), [control]) < 1e-9
        A = slopes(lambda z, p=p, u=u: evaluate(regc_c, p, z, u)[0], np.array(x, complex))
        assert sorted(np.linalg.eigvals(A[:2, :2]), key=np.imag) == pytest.approx(
            sorted(np.roots([1.0, p.Kppll, p.Kipll]), key=np.imag), rel=1e-9
        )


@pytest.mark.parametrize(("name", "p"), KINDS)
def test_it_starts_at_the_power_flow_and_holds_still(name, p):
    still = run(small({name: p}), [], 0.5)
    assert np.abs(still.rows - still.rows[0])[:, : still.point.layout.step].max() < 1e-10
    S = still.point.flow.S[0] * still.point.case.base_mva / 400.0
    assert [signal(still, n)[0] for n in ("P", "Q", "vt")] == pytest.approx([S.real, S.imag, 1.02], abs=1e-10)


@pytest.mark.parametrize(("name", "p"), KINDS)
def test_its_current_stays_within_the_limit_and_its_power_goes_into_the_network(name, p):
    found = run(small({name: p._replace(Imax=0.9)}))
    given = signal(found, "P") + 1j * signal(found, "Q")
    amps = np.abs(given) / signal(found, "vt")
    assert amps.max() < 0.9 + 1e-9
    assert (amps.max() > 0.9 - 1e-6) == (p.Te > 0)  # without lag the constant commands hold
    assert found.outcome.stable
    before = found.time < 0.1
    Y = network.admittance(found.point.net, network.UNSWITCHED).toarray()
    V = found.arrays.V[before]
    injected = (V * (V @ Y.T).conj())[:, 0] * found.point.case.base_mva
    assert np.abs(400.0 * given[before] - injected).max() < 1e-6  # MVA
    assert abs(given[-1] - given[0]) < 0.05


@pytest.mark.parametrize("PqFlag", [0, 1])
def test_the_current_with_priority_keeps_what_it_is_ordered(PqFlag):
    """Both orders are 0.8 pu at a limit of 1 pu: the other current gets 0.6 pu."""
    for device, p in ((regc_b, REGC_B), (regc_c, REGC_C)):
        p = p._replace(PqFlag=PqFlag, Imax=1.0, **({"wb": 377.0} if device is regc_c else {}))
        wanted = [0.8, 0.6] if PqFlag else [0.6, 0.8]
        x = list(device.guess(1.0 + 0j, complex(wanted[0], -wanted[1]), p))
        rates, y = evaluate(device, p, x, {"Ipcmd": 0.8, "Iqcmd": 0.8})
        assert np.abs(rates).max() < 1e-12
        assert y[:2] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("RateFlag", [0, 1])
def test_active_current_or_power_rises_at_most_at_its_rate(RateFlag):
    """At half the voltage, 0.1 pu/s of power is 0.2 pu/s of current; a fall is not limited."""
    for device, p in ((regc_b, REGC_B), (regc_c, REGC_C)):
        p = p._replace(RateFlag=RateFlag, Rrpwr=0.1, **({"wb": 377.0} if device is regc_c else {}))
        x = list(device.guess(0.5 + 0j, 0.4 + 0j, p))
        at = device.State._fields.index("ip")
        up, down = (evaluate(device, p, x, {"Ipcmd": ip, "Iqcmd": 0.0}, (0.5, 0.0))[0][at] for ip in (0.9, 0.1))
        assert up == pytest.approx(0.1)
        assert down == pytest.approx(-0.3 / p.Tg * (0.5 if RateFlag else 1.0))
        charging = list(device.guess(0.5 + 0j, -0.4 + 0j, p))
        assert evaluate(device, p, charging, {"Ipcmd": -0.9, "Iqcmd": 0.0}, (0.5, 0.0))[0][at] == pytest.approx(-0.1)


def test_regc_b_without_lag_of_its_voltage_is_regc_a():
    """Te below 1 ms: the current is its reference. The admittance in the network changes nothing."""
    change = [LoadStep("2", 0.1, 60.0, 20.0)]
    other = run(small({"regc_a": REGC._replace(Tg=0.02, Lvplsw=0.0, Rrpwr=99.0)}), change)
    same = run(small({"regc_b": REGC_B._replace(Te=0.0, Rrpwr=99.0)}), change)
    assert np.ptp(same.arrays.V[:, 0].real) > 1e-3
    assert np.abs(same.arrays.V - other.arrays.V).max() < 2e-7


def test_regc_c_with_fast_loops_is_regc_b():
    fast = REGC_C._replace(Te=0.0, Kip=500.0, Kii=5e3, Kppll=1e3, Kipll=1e3, wmax=99.0, wmin=-99.0)
    change = [LoadStep("2", 0.1, 60.0, 20.0)]
    one, other = (run(small({n: p}), change, 0.6) for n, p in (("regc_c", fast), ("regc_b", REGC_B._replace(Te=0.0))))
    V = np.array([np.interp(other.time, one.time, np.abs(one.arrays.V[:, k])) for k in range(3)]).T
    after = other.time > 0.12
    assert np.abs(V - np.abs(other.arrays.V))[after].max() < 5e-5  # 2.8e-5 of 4e-3


def test_the_phase_locked_loop_follows_frequency_and_angle_of_the_voltage():
    """30 MW more: the loop has the frequency of the falling rotor, and its angle trails by dw'/Kipll."""
    found = run(small({"regc_c": REGC_C}), [LoadStep("2", 0.1, 30.0)], 3.0)
    speed = found.arrays.speed[:, 0] - 1
    assert speed[-1] < -1e-4
    assert signal(found, "wpll")[-1] - 1 == pytest.approx(speed[-1], rel=0.02)
    k = next(k for k, p in enumerate(found.point.layout.states) if p.name == "theta_pll")
    theta, bus = found.rows[:, k], np.unwrap(np.angle(found.arrays.V[:, 0]))
    assert theta[-1] - theta[0] < -0.05
    assert theta[-1] == pytest.approx(bus[-1], abs=1e-3)
    assert signal(found, "vq") == pytest.approx(signal(found, "vt") * np.sin(bus - theta), abs=1e-9)


def test_without_a_voltage_source_its_island_has_no_voltage():
    for name, p in BOTH:
        found = run(small({name: p}), [Open("2-3", 0.1), Open("2-3#2", 0.1)])
        assert np.abs(found.arrays.V[-1, :2]).max() == 0


def test_the_phase_locked_loop_is_limited_and_does_not_wind_up():
    p = REGC_C._replace(wmax=3.0, wmin=-2.0, wb=377.0)
    x = list(regc_c.guess(1.0 + 0j, P - 1j * Q, p))
    at = regc_c.Output._fields.index("wpll")
    for turn, edge, limit in ((0.5, 4.0, 3.0), (-0.5, -4.0, -2.0)):
        rates, y = evaluate(regc_c, p, [0.0, edge, *x[2:]], {"Ipcmd": P, "Iqcmd": Q}, (np.cos(turn), np.sin(turn)))
        assert (y[at] - 1) * p.wb == pytest.approx(limit)
        assert rates[1] == 0


def test_records_take_the_source_impedance_of_the_raw_file(tmp_path):
    """Kinds of records as models of the library and as user-written models; ZR and ZX are Re and Xe."""
    shutil.copy(FILES / "three.raw", tmp_path)
    constants = "1 0 0.02 0.03 20 -25 8 0.01 1.1"
    own = "5 70 20 700 12 -12"
    kinds = {
        f"'REGCB1' 1 {constants}": ("regc_b", regc_b),
        f"'USRMDL' 1 'REGCBU1' 101 1 2 7 4 8 {constants}": ("regc_b", regc_b),
        f"'REGCC1' 1 {constants} {own}": ("regc_c", regc_c),
    }
    for text, (name, device) in kinds.items():
        (tmp_path / "three.dyr").write_text(f"101 'GENCLS' 1 0 0 /\n102 {text} /\n")
        case = st.load(tmp_path / "three.raw", dyr=tmp_path / "three.dyr")
        (par,) = case.devices[name].values()
        assert (par.RateFlag, par.PqFlag, par.Tg, par.Tfltr, par.Iqrmax, par.Iqrmin) == (1, 0, 0.02, 0.03, 20, -25)
        assert (par.Rrpwr, par.Te, par.Imax, par.Re, par.Xe) == (8, 0.01, 1.1, 0, 0.25)
        if device is regc_c:
            assert (par.Kip, par.Kii, par.Kppll, par.Kipll, par.wmax, par.wmin) == (5, 70, 20, 700, 12, -12)
        assert case.initialize().simulate(until="0.1s").outcome.stable

"""REGFM_B1, the virtual synchronous machine: inertia, droop, block diagram, current limits, recovery."""

from dataclasses import replace

import numpy as np
import pytest
from block_diagram import distance, evaluate, feedback, one, opened, response, s, slopes
from recorded import signal, state
from records import regfm_b1
from systems import VIRTUAL, small

import stabctl as st
from stabctl._util.errors import EquilibriumError
from stabctl.dynamics import operating_point
from stabctl.simulation import simulation
from stabctl.simulation.events import Clear, Fault, LoadStep

BARE = VIRTUAL._replace(TPf=0.0, D2=0.0, H=2.0, D1=30.0, mp=0.05)


def run(case, events, until):
    return simulation.run(operating_point.solve(case), events, until)


def island(p):
    """One converter of 400 MVA supplies a load of 200 MW and 50 Mvar."""
    case = small({"regfm_b1": p}, p=0.0)
    buses = (case.buses[0]._replace(kind="swing"), case.buses[1])
    devices = {"regfm_b1": {1: p}}
    return replace(case, buses=buses, branches=case.branches[:1], machines=case.machines[:1], devices=devices)


@pytest.fixture(scope="module")
def faulted():
    """A fault of 100 ms at the load, which takes a current above ImaxF."""
    return run(small({"regfm_b1": VIRTUAL}), [Fault("2", 0.1), Clear("2", 0.2)], 6.0)


@pytest.fixture(scope="module")
def overloaded():
    """300 MW more for 8 s, of which droop would give the converter more than kf ImaxSS."""
    return run(small({"regfm_b1": VIRTUAL}), [LoadStep("2", 0.1, 300.0), LoadStep("2", 8.1, -300.0)], 20.0)


def test_it_starts_at_the_power_flow_and_holds_still():
    still = run(island(VIRTUAL), [], 2.0)
    point = still.point
    assert np.abs(still.rows - still.rows[0])[:, : point.layout.step].max() < 1e-10
    S = point.flow.S[0] * point.case.base_mva / 400.0
    V = abs(point.V[point.system.unit_bus[0]])
    found = [point.s[point.layout.signals[0, name]] for name in ("P", "Q", "vt", "omega", "Pref", "Vref")]
    assert found == pytest.approx([S.real, S.imag, V, 1.0, S.real, V + VIRTUAL.mq * S.imag], abs=1e-11)
    assert point.inertia == pytest.approx([VIRTUAL.H * 4.0])


def test_a_load_step_is_met_by_inertia_first():
    """d omega/dt = -dP/(2H) with dP at the terminals; the droop is so small that it takes no part for 20 ms."""
    p = BARE._replace(D1=0.0, mp=1.0)
    found = run(island(p), [LoadStep("2", 0.1, 20.0)], 0.2)
    P, omega, t = signal(found, "P"), signal(found, "omega"), found.time
    after = np.searchsorted(t, 0.1 + 1e-9)
    rate = (omega[after + 1] - omega[after]) / (t[after + 1] - t[after])
    assert P[after] - P[0] > 0.04
    assert rate == pytest.approx(-(P[after] - P[0]) / (2 * p.H), rel=5e-3)  # 3e-3


def test_in_the_end_droop_and_damping_share_a_load_step():
    """omega - 1 = -dP/(1/mp + D1); the transient damping slows the fall and leaves its end alone."""
    runs = [run(island(BARE._replace(D2=D2)), [LoadStep("2", 0.1, 20.0)], 12.0) for D2 in (0.0, 100.0)]
    for found in runs:
        P, omega = signal(found, "P"), signal(found, "omega")
        assert P[-1] - P[0] > 0.04
        assert omega[-1] - 1 == pytest.approx(-(P[-1] - P[0]) / (1 / BARE.mp + BARE.D1), rel=1e-6)
    early = [np.interp(0.15, found.time, signal(found, "omega")) for found in runs]
    assert 1 - 1e-4 > early[1] > early[0] + 5e-5


def test_two_share_a_load_step_in_inverse_proportion_to_their_droop():
    case = small({"regfm_b1": VIRTUAL}, p=200.0)
    other = VIRTUAL._replace(mp=0.05, H=3.0)
    machines = (case.machines[0], case.machines[1]._replace(base=600.0))
    loads = (case.loads[0]._replace(p=500.0, q=100.0),)
    found = run(
        replace(case, machines=machines, loads=loads, devices={"regfm_b1": {1: VIRTUAL, 2: other}}),
        [LoadStep("2", 0.1, 30.0)],
        12.0,
    )
    drops = [p.mp * np.diff(signal(found, "P", k)[[0, -1]])[0] for k, p in enumerate((VIRTUAL, other))]
    assert drops[0] > 1e-4
    assert drops[1] == pytest.approx(drops[0], rel=1e-5)
    assert signal(found, "omega")[-1] - 1 == pytest.approx(-drops[0], abs=1e-9)


@pytest.mark.parametrize("VdrpFlag", [0, 1])
def test_linearized_it_is_its_block_diagram(VdrpFlag):
    """At an infinite bus and without active power, P follows delta by EV/X and Q follows E by V/X."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        names = ("H", "D1", "D2", "wD", "mp", "mq", "Tp", "kpv", "kiv", "TPf", "TQf", "TIf", "kpPLL", "kiPLL")
        drawn = {n: float(10 ** rng.uniform(-1.5, 0.3)) for n in names}
        drawn["XL"] = float(rng.uniform(0.05, 0.3))
        p = opened(regfm_b1, VIRTUAL._replace(**drawn, VdrpFlag=VdrpFlag, wb=377.0, mva=1.0))
        E = 1 + 0.2 * p.XL  # at Q = 0.2
        x = [0.0, 0.0, 0.0, 0.0, 0.0, 0.2, 1.0, 0.0, 0.2, E, 0.0, 0.0, 0.0, 0.0]
        u = {"Pref": 0.0, "Qref": 0.0, "Vref": 1 + 0.2 * p.mq}
        assert np.abs(evaluate(regfm_b1, p, x, u)[0]).max() < 1e-12
        rotor = 1 / (2 * p.H * s + p.D1 + p.D2 * s / (s + p.wD) + 1 / p.mp / (1 + s * p.Tp))
        omega = feedback(rotor, p.wb / s * (E / p.XL) / (1 + s * p.TPf))
        volts = feedback(p.kpv + p.kiv / s, p.mq / p.XL / (1 + s * (p.TIf if VdrpFlag else p.TQf)))
        assert distance(response(regfm_b1, p, x, u, ["Pref"], "omega"), [omega]) < 1e-9
        assert distance(response(regfm_b1, p, x, u, ["Vref"], "E"), [volts]) < 1e-9
        if not VdrpFlag:
            assert distance(response(regfm_b1, p, x, u, ["Qref"], "E"), [p.mq * volts * one()]) < 1e-9
        A = slopes(lambda z, at=(p, u): evaluate(regfm_b1, at[0], z, at[1])[0], np.array(x, complex))
        loop = np.linalg.eigvals(A[12:, 12:])  # theta_pll and xpll at V = 1
        wanted = np.roots([1, p.wb * p.kpPLL, p.wb * p.kiPLL])
        assert sorted(loop, key=lambda z: (z.real, z.imag)) == pytest.approx(
            sorted(wanted, key=lambda z: (z.real, z.imag)), rel=1e-9
        )


def test_the_current_is_limited_through_a_fault_and_after_it(faulted):
    P, Q, vt = (signal(faulted, name) for name in ("P", "Q", "vt"))
    amps = np.hypot(P, Q) / vt
    during = (faulted.time > 0.1001) & (faulted.time < 0.1999)
    assert amps.max() < VIRTUAL.ImaxF + 1e-9
    assert amps[during][0] == pytest.approx(VIRTUAL.ImaxF, abs=1e-9)


def test_nothing_winds_up_in_a_fault(faulted):
    """The angle stays within its limits, the loop is held without voltage, and all is as before a few seconds later."""
    t, vt = faulted.time, signal(faulted, "vt")
    lead = state(faulted, "delta") - state(faulted, "theta_pll")
    angle = np.arcsin(VIRTUAL.XL * VIRTUAL.ImaxSS)
    assert faulted.outcome.stable
    assert lead.max() < angle + 1e-3
    assert lead.min() > -angle - 1e-3
    assert np.abs(signal(faulted, "omega") - 1).max() <= VIRTUAL.dwmax
    for name in ("over", "under"):
        assert state(faulted, name).min() == 0
        assert state(faulted, name)[-1] == 0
    late = t > 1.0
    assert np.abs(vt[late] - vt[0]).max() < 0.02
    droop = (signal(faulted, "omega")[-1] - 1) / VIRTUAL.mp
    assert signal(faulted, "P")[-1] - signal(faulted, "P")[0] == pytest.approx(-droop, abs=2e-3)


def test_the_phase_locked_loop_is_held_without_voltage():
    p = VIRTUAL._replace(VPLLfrz=0.05)
    found = run(small({"regfm_b1": p}), [Fault("1", 0.1), Clear("1", 0.2)], 1.0)
    dark = signal(found, "vt") < 0.05
    theta = state(found, "theta_pll")[dark]
    assert dark.sum() > 5
    assert np.ptp(theta[1:-1]) == 0


def test_an_overload_is_limited_in_steady_state_and_leaves_without_windup(overloaded):
    """The active current settles at kf ImaxSS, whatever droop asks for; the limit then opens again."""
    t, P, over = overloaded.time, signal(overloaded, "P"), state(overloaded, "over")
    loaded = np.searchsorted(t, 8.0)
    asked = P[0] + (1 - signal(overloaded, "omega", 1)[loaded]) / VIRTUAL.mp  # at the frequency of the machine
    assert asked > 1.5
    assert state(overloaded, "idf").max() > 0.95
    assert state(overloaded, "idf")[loaded] == pytest.approx(0.9, abs=1e-3)
    amps = np.hypot(P, signal(overloaded, "Q")) / signal(overloaded, "vt")
    assert amps[loaded] < VIRTUAL.ImaxSS + 1e-3
    assert over[loaded] > 1e-3
    assert over[-1] == 0
    assert P[-1] - P[0] == pytest.approx((1 - signal(overloaded, "omega")[-1]) / VIRTUAL.mp, abs=1e-3)
    assert P[-1] == pytest.approx(P[0], abs=5e-3)


def test_a_source_without_storage_takes_no_power_in():
    ends = []
    for flag in (0, 1):
        found = run(small({"regfm_b1": VIRTUAL._replace(ESFlag=flag)}, p=60.0), [LoadStep("2", 0.1, -190.0)], 20.0)
        ends.append(signal(found, "P")[-1])
    assert ends[0] == pytest.approx(0.0, abs=1e-3)  # -3e-4: the loop follows a frequency that still moves
    assert ends[1] < -0.1


def test_modes_are_named_after_its_loops():
    modes = st.initialize(small({"regfm_b1": VIRTUAL})).modes()
    named = {modes.label(k) for k in range(len(modes.eigenvalues))}
    loops = "virtual rotor", "voltage control", "reactive power droop", "PLL", "current limits"
    assert {f"{loop} of REGFM_B1 1" for loop in loops} <= named
    assert [modes.label(k) for k in modes.swings()] == ["converter 1 against the rest"]


def test_a_limit_below_its_dispatch_is_named():
    for given in ({"ImaxF": 0.6}, {"ImaxSS": 0.6}):
        with pytest.raises(EquilibriumError, match=r"REGFM_B1 of machine 1 at bus 1 cannot be initialized: "):
            operating_point.solve(small({"regfm_b1": VIRTUAL._replace(**given)}))


def test_parameters_that_the_equations_do_not_allow_are_refused():
    wrong = {"ImaxSS": {"ImaxSS": 12.0}, "dwmax": {"dwmax": -0.1}, "D1": {"FFlag": 0.0}}
    for field, given in wrong.items():
        assert [name for name, _ in VIRTUAL._replace(**given).errors()] == [field]

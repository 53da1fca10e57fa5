"""Grid-forming converters: droop, limits, block diagram, and an island that has no other source."""

from dataclasses import replace

import numpy as np
import pytest
from block_diagram import distance, evaluate, feedback, one, opened, response, s, slopes
from recorded import signal, state
from records import regfm_a1
from systems import FORMING, VIRTUAL, small

import stabctl as st
from stabctl._util.errors import EquilibriumError, StudyError
from stabctl.dynamics import operating_point
from stabctl.model import network
from stabctl.simulation import simulation
from stabctl.simulation.events import Clear, Fault, LoadStep, Open
from stabctl.smallsignal import analyze
from stabctl.smallsignal.areas import areas

SLOW = FORMING._replace(mp=0.02, mq=0.1, TPf=0.02, kiv=20.0)


def island(one=FORMING, other=SLOW):
    """Two converters of 400 and 600 MVA supply a load of 500 MW."""
    case = small({"regfm_a1": one}, p=200.0)
    machines = (case.machines[0], case.machines[1]._replace(base=600.0))
    loads = (case.loads[0]._replace(p=500.0, q=100.0),)
    return replace(case, machines=machines, loads=loads, devices={"regfm_a1": {1: one, 2: other}})


def run(case, events, until):
    return simulation.run(operating_point.solve(case), events, until)


@pytest.fixture(scope="module")
def stepped():
    """30 MW and 20 Mvar more; no limit is reached."""
    return run(island(), [LoadStep("2", 0.1, 30.0, 20.0)], 12.0)


@pytest.fixture(scope="module")
def overloaded():
    """150 MW more for 8 s of 20 s; Pmax = 0.6 keeps 240 MW of it at converter 1."""
    return run(island(FORMING._replace(Pmax=0.6)), [LoadStep("2", 0.1, 150.0), LoadStep("2", 8.1, -150.0)], 20.0)


def test_it_starts_at_the_power_flow_and_holds_still():
    still = run(island(), [], 2.0)
    point = still.point
    assert np.abs(still.rows - still.rows[0])[:, : point.layout.step].max() < 1e-10  # 3e-13
    for unit, mva in enumerate((400.0, 600.0)):
        S = point.flow.S[unit] * point.case.base_mva / mva
        found = [point.s[point.layout.signals[unit, name]] for name in ("P", "Q", "vt", "omega", "Pref", "Vref")]
        mq = (FORMING, SLOW)[unit].mq
        V = abs(point.V[point.system.unit_bus[unit]])
        assert found == pytest.approx([S.real, S.imag, V, 1.0, S.real, V + mq * S.imag], abs=1e-11)


def test_a_load_step_changes_the_frequency_along_the_droop(stepped):
    """omega - 1 = -mp dP at each converter, so that the powers share in inverse proportion to mp."""
    drops = [p.mp * np.diff(signal(stepped, "P", k)[[0, -1]])[0] for k, p in enumerate((FORMING, SLOW))]
    speeds = [signal(stepped, "omega", k)[-1] - 1 for k in (0, 1)]
    assert str(stepped.outcome) == (
        "All machines and converters stayed in synchronism until 12.000 s; frequency 59.98 (converter 2) to "
        "60.00 Hz (converter 1), lowest voltage 0.99 pu at bus 2."
    )
    assert drops[0] > 1e-4
    assert drops[1] == pytest.approx(drops[0], rel=1e-6)
    assert speeds == pytest.approx([-drops[0], -drops[1]], abs=1e-10)


def test_a_law_reads_the_rate_of_a_virtual_speed_in_the_last_step():
    """Virtual speed is no state: its acceleration, against the other converter, is its change over the step."""
    case = island(FORMING._replace(TPf=0.1), SLOW._replace(TPf=0.2)).with_storage("14MW")
    law = st.Feedback(acceleration_gain=0.003)
    found = case.initialize().simulate([LoadStep("2", 0.1, 30.0, 20.0)], until="1s", control=law)
    relative = signal(found, "omega", 0) - signal(found, "omega", 1)
    wanted = 2 * np.pi * 60 * law.acceleration_gain * 400 / 14 * np.diff(relative) / np.diff(found.time)
    order, later = found.dataset["storage_order"].values[1:, 0], found.time[1:] > 0.12
    assert np.abs(wanted[later]).max() > 0.01
    assert np.abs(order - wanted)[later].max() < 1e-5  # 6.3e-6


def test_the_voltage_follows_the_reactive_power_along_the_droop(stepped):
    for k, p in enumerate((FORMING, SLOW)):
        Q, vt = signal(stepped, "Q", k), signal(stepped, "vt", k)
        assert Q[-1] - Q[0] > 0.01
        assert vt[-1] - vt[0] == pytest.approx(-p.mq * (Q[-1] - Q[0]), abs=1e-9)


def test_an_overload_goes_to_the_other_converter_and_leaves_without_windup(overloaded):
    t, P, over = overloaded.time, signal(overloaded, "P"), state(overloaded, "pmax")
    loaded = np.searchsorted(t, 8.0)
    assert P[loaded] == pytest.approx(0.6, abs=1e-4)
    assert P[(t > 0.1) & (t < 3.0)].max() > 0.62
    other = signal(overloaded, "P", 1)
    droop = signal(overloaded, "omega", 1)[loaded] - 1
    assert droop == pytest.approx(-SLOW.mp * (other[loaded] - other[0]), abs=1e-5)
    assert droop < -FORMING.mp * (0.6 - P[0]) - 1e-3
    assert over.min() == 0
    assert over[loaded] > 1e-3
    assert over[-1] == 0
    assert P[-1] == pytest.approx(P[0], abs=1e-6)
    assert signal(overloaded, "omega")[-1] == pytest.approx(1.0, abs=1e-8)


def test_a_lost_load_does_not_push_the_power_below_its_lower_limit():
    case = island(FORMING._replace(Pmin=0.3))
    found = run(case, [LoadStep("2", 0.1, -250.0)], 10.0)
    assert signal(found, "P")[-1] == pytest.approx(0.3, abs=1e-4)
    assert signal(found, "omega")[-1] > 1 + FORMING.mp * (signal(found, "P")[0] - 0.3) + 1e-3


def test_reactive_power_returns_to_its_limit():
    found = run(island(FORMING._replace(Qmax=0.35)), [LoadStep("2", 0.1, 0.0, 100.0)], 10.0)
    Q = signal(found, "Q")
    assert Q[0] < 0.31
    assert Q.max() > 0.36
    assert Q[-1] == pytest.approx(0.35, abs=1e-5)


def test_the_current_is_limited_through_a_fault_and_after_it():
    found = run(small({"regfm_a1": FORMING._replace(ImaxF=1.5)}), [Fault("2", 0.1), Clear("2", 0.2)], 3.0)
    P, Q, vt = (signal(found, name) for name in ("P", "Q", "vt"))
    amps = np.hypot(P, Q) / vt
    during = (found.time > 0.1001) & (found.time < 0.1999)
    assert amps.max() < 1.5 + 1e-9
    assert amps[during] == pytest.approx(1.5, abs=1e-9)
    assert found.outcome.stable
    assert P[-1] - P[0] == pytest.approx((1 - signal(found, "omega")[-1]) / FORMING.mp, abs=1e-4)


def test_the_power_at_its_terminals_goes_into_the_network(overloaded):
    """Branches and loads take what the two converters give, at every instant."""
    point = overloaded.point
    Y = network.admittance(point.net, network.UNSWITCHED).toarray()
    injected = overloaded.arrays.V * (overloaded.arrays.V @ Y.T).conj() * point.case.base_mva
    for unit, (bus, mva) in enumerate(((0, 400.0), (2, 600.0))):
        given = mva * (signal(overloaded, "P", unit) + 1j * signal(overloaded, "Q", unit))
        assert np.abs(given - injected[:, bus]).max() < 1e-6  # MVA of 600


def test_it_keeps_an_island_alive():
    """Cut off from the large machine it carries the load alone, at the frequency of its droop."""
    found = run(small({"regfm_a1": FORMING}), [Open("2-3", 0.1), Open("2-3#2", 0.1)], 8.0)
    P = signal(found, "P")
    assert found.outcome.kind == "islanded"
    assert abs(found.arrays.V[-1, 1]) > 0.9
    assert P[-1] < P[0] - 0.1
    assert signal(found, "omega")[-1] - 1 == pytest.approx(FORMING.mp * (P[0] - P[-1]), abs=1e-9)


@pytest.mark.parametrize("VFlag", [0, 1])
def test_linearized_it_is_its_block_diagram(VFlag):
    """At an infinite bus and without active power, P follows delta by EV/X and Q follows E by V/X."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        drawn = {n: float(10 ** rng.uniform(-1.5, 0.3)) for n in ("mp", "mq", "kpv", "kiv", "TPf", "TQf")}
        drawn["XL"] = float(rng.uniform(0.05, 0.3))
        p = opened(regfm_a1, FORMING._replace(**drawn, VFlag=VFlag, wb=377.0, mva=1.0))
        E = 1 + 0.2 * p.XL  # at Q = 0.2
        x = [0.0, 0.0, 0.2, 1.0, E if VFlag else 0.0, 0.0, 0.0, 0.0, 0.0]
        u = {"Pref": 0.0, "Qref": 0.0, "Vref": (1 if VFlag else E) + 0.2 * p.mq}
        assert np.abs(evaluate(regfm_a1, p, x, u)[0]).max() < 1e-12
        turn = p.wb / s * (E / p.XL)
        omega = feedback(one(p.mp), turn / (1 + s * p.TPf))
        regulator = p.kpv + p.kiv / s if VFlag else one()
        volts = feedback(regulator, p.mq / p.XL / (1 + s * p.TQf))
        assert distance(response(regfm_a1, p, x, u, ["Pref"], "omega"), [omega]) < 1e-9
        assert distance(response(regfm_a1, p, x, u, ["Vref", "Qref"], "E"), [volts, p.mq * volts]) < 1e-9


def test_a_step_of_its_reference_is_that_of_the_swing_equation():
    """The filter of P makes 2H = TPf/mp: omega(t) of a second-order system, in closed form, in the linear model."""
    p = FORMING._replace(TPf=0.5, VFlag=0, mq=0.0, XL=0.3, Pmin=-1.0)
    base = st.initialize(small({"regfm_a1": p}, p=0.0))
    linear = base.linearize()
    names = [(place.table, place.name) for place in linear.places]
    i, j = names.index(("regfm_a1", "delta")), names.index(("regfm_a1", "pf"))
    slope = linear.A[j, i] * p.TPf
    wb = 2 * np.pi * base.case.frequency_hz
    assert linear.A[i, j] == pytest.approx(-wb * p.mp)
    assert 1 / p.XL > slope > 0.5
    swing = np.linalg.eigvals(linear.A[np.ix_([i, j], [i, j])])
    H = p.TPf / (2 * p.mp)
    assert sorted(swing, key=np.imag) == pytest.approx(
        sorted(np.roots([2 * H, 1 / p.mp, wb * slope]), key=np.imag), rel=1e-9
    )


def test_a_power_beyond_its_current_is_told_with_a_column_of_its_table():
    """Not with the largest angle, which follows from ImaxSS."""
    with pytest.raises(EquilibriumError, match=r"ImaxSS = 0\.7 pu is .*; widen ImaxSS in regfm_b1\.csv \(--set"):
        operating_point.solve(small({"regfm_b1": VIRTUAL._replace(ImaxSS=0.7)}, p=380.0))


def test_its_modes_are_those_of_the_motion_after_a_step():
    """The linear model follows a load step so small that nothing bends; one zero, the common angle."""
    base = st.initialize(island())
    modes = base.modes()
    assert (modes.eigenvalues == 0).sum() == 1
    assert modes.stable
    assert modes.label(0).startswith("angle reference")
    assert [modes.label(k) for k in modes.swings()] == ["converter 1 against converter 2"]
    named = {modes.label(k) for k in range(len(modes.eigenvalues))}
    assert {"power droop of REGFM_A1 1", "voltage control of REGFM_A1 2"} <= named
    linear = base.linearize(inputs="load_p:2", outputs="voltage:2")
    found = simulation.run(base, [LoadStep("2", 0.0, 0.01)], 2.0)
    moved = found.rows[:, [base.layout.states.index(p) for p in linear.places]]
    x = moved[-1] - moved[0]
    values, V = np.linalg.eig(linear.A)
    drive = np.linalg.solve(V, linear.B[:, 0] * 0.01 / base.case.base_mva)
    slow = np.abs(values) < 1e-6
    grown = np.where(slow, 2.0, np.expm1(2.0 * values) / np.where(slow, 1, values))
    wanted = (V @ (grown * drive)).real
    assert np.abs(x - wanted).max() < 1e-5 * np.abs(wanted).max()  # 5.4e-7


def test_shapes_of_modes_are_those_of_the_speeds_at_fifty_hertz():
    """The virtual speed is an output, the speed of a machine a state: both are rows of C times the eigenvector."""
    case = replace(small({"regfm_a1": FORMING}), frequency_hz=50.0)
    modes = analyze(st.linearize(case, outputs="speed"))
    speeds, moving = modes.observability(), np.abs(modes.eigenvalues) > 1e-6
    assert (np.abs(speeds[0, moving]) > 1e-6).any()
    assert modes.speeds[:, moving] == pytest.approx(speeds[:, moving], abs=1e-9)


def test_without_machines_there_are_areas_and_clearing_times():
    base = st.initialize(island())
    assert {m for group in areas(base.modes(), 2).groups for m in group} == {1, 2}
    found = base.clearing_time("3", resolution="1cyc", limit="120cyc")
    lost = next(one for one in found.runs if not one.stable)
    assert (lost.outcome, lost.machine) == ("lost_synchronism", 1)
    assert 60 < found.cycles < 110  # 84


def test_a_limit_below_its_dispatch_is_named():
    for given in ({"Pmax": 0.5}, {"ImaxF": 0.6}):
        with pytest.raises(EquilibriumError, match=r"REGFM_A1 of machine 1 at bus 1 cannot be initialized: "):
            operating_point.solve(small({"regfm_a1": FORMING._replace(**given)}))


@pytest.mark.parametrize("seed", range(8))
def test_its_fastest_eigenvalue_at_a_limit_is_that_of_its_equations(seed):
    """At a stiff bus, Q beyond Qmax and P beyond Pmax: the largest of the equations, where that of Q is the fastest."""
    rng = np.random.default_rng(seed)
    gains = {"kpv": rng.uniform(0.5, 2), "kpq": rng.uniform(1, 4), "kpp": 0.05, "kiv": 1.0, "kiq": 1.0, "kip": 0.1}
    p = FORMING._replace(mva=1.0, wb=314.0, **gains, VFlag=seed % 2, TQf=0.01, TPf=0.02, Emax=9.0, ImaxF=9.0)
    at = np.array([0.17, 1.1, 0.5, 1.0, 1.0 if p.VFlag else 0.0, 0.01, 0.0, 0.01, 0.0], complex)
    u = regfm_a1.Input(Pref=1.0, Qref=0.0, Vref=1.0 + p.mq * 0.5 + p.kpq * 0.06)
    J = slopes(lambda z: regfm_a1.equations(regfm_a1.State(*z), u, (1.0, 0.0), p)[1], at)
    fastest = np.abs(np.linalg.eigvals(J)).max()
    bound = regfm_a1.elsewhere(type(p)(*(np.array([value]) for value in p)))[0]
    assert 0.8 * bound < fastest <= 1.1 * bound  # E and cos(delta) are not 1


@pytest.mark.parametrize("given", [{"VFlag": 0}, {"kpv": 1.0}])
def test_the_default_step_follows_its_controllers_at_a_limit(given):
    """At 1/120 s the voltage of its bus rested at 1.0292 instead of 1.0276."""
    point = st.load("two_area").with_device("regfm_a1", 3, Qmax=0.22, **given).initialize()
    ends = [point.simulate("9:+150Mvar@1s", until="3s", step=step).rows[-1] for step in (None, "0.3ms")]
    layout = point.layout
    assert np.abs(ends[0] - ends[1])[: layout.nx].max() < 1e-6
    with pytest.raises(StudyError, match="at a limit of its power"):
        point.simulate("9:+150Mvar@1s", until="3s", step="5ms")

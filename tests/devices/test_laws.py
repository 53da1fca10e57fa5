"""Laws of single devices: a model equals another where both describe the same, and its limits do what they say."""

from dataclasses import replace

import numpy as np
import pytest
from records import gensal, regc_a
from systems import CLASSICAL, EXDC2, EXPONENTIAL, IEEET1, POLES, REGC, ROUND, SEXS, TWO_AXES, small, with_shares

import stabctl as st
from stabctl._util.errors import EquilibriumError, StudyError
from stabctl.devices.blocks import through
from stabctl.dynamics import operating_point
from stabctl.simulation import simulation
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import Clear, Fault, Open

FAULT = [Fault("2", 0.1), Clear("2", 0.18)]
KEEP_ON = Criterion(max_angle=np.inf)


def run(case, events=FAULT, until=2.0):
    return simulation.run(operating_point.solve(case), events, until, criterion=KEEP_ON)


def apart(one, other):
    """Largest difference of speeds and voltages between two runs, both of which move."""
    assert np.ptp(one.arrays.speed[:, 0]) > 1e-3
    speeds = np.abs(one.arrays.speed - other.arrays.speed).max()
    return max(speeds, np.abs(one.arrays.V - other.arrays.V).max())


def state(of, table, name):
    """A state of machine 1 at every instant."""
    k = next(k for k, p in enumerate(of.point.layout.states) if (p.table, p.name, p.unit) == (table, name, 0))
    return of.rows[:, k]


def test_gensal_is_genrou_without_a_transient_circuit_on_the_q_axis():
    """x'q = xq, unsaturated: the two sets of equations are the same."""
    poles = POLES._replace(S10=0.0, S12=0.0)
    both = {n: getattr(poles, n) for n in set(gensal.Par._fields) & set(ROUND._fields)}
    genrou = ROUND._replace(**both, x1q=poles.xq, T1q=0.5)
    assert apart(run(small({"gensal": poles, "sexs": SEXS})), run(small({"genrou": genrou, "sexs": SEXS}))) < 1e-9


def test_a_two_axis_machine_without_a_damper_is_the_limit_of_a_short_time_constant():
    """T'q0 = L/R, and R of an open circuit is infinite."""
    short = TWO_AXES._replace(T1q=1e-5)
    absent = TWO_AXES._replace(x1q=TWO_AXES.xq, T1q=0.0)
    swings = [m.eigenvalues[m.swings()] for m in (small({"two_axis": par}).modes() for par in (short, absent))]
    assert swings[0] == pytest.approx(swings[1], abs=1e-4)  # 2e-5


def test_saturation_of_gensal_adds_field_current_along_its_curve():
    """At rest Efd = E'q + B (E'q - A)^2 + (xd - x'd) id."""
    point = operating_point.solve(small({"gensal": POLES}))
    at = {name: point.s[point.layout.signals[0, name]] for name in ("eq", "id", "Efd")}
    A, B = through(1.0, POLES.S10, 1.2, POLES.S12)
    assert at["eq"] > A
    wanted = at["eq"] + B * (at["eq"] - A) ** 2 + (POLES.xd - POLES.x1d) * at["id"]
    assert at["Efd"] == pytest.approx(wanted, abs=1e-12)


def test_ieeet1_is_exdc2_without_a_first_stage_and_limits():
    exdc2 = EXDC2._replace(TB=0.0, TC=0.0, VRmax=1e6, VRmin=-1e6)
    ieeet1 = IEEET1._replace(VRmax=1e6, VRmin=-1e6)
    assert apart(run(small({"genrou": ROUND, "ieeet1": ieeet1})), run(small({"genrou": ROUND, "exdc2": exdc2}))) < 1e-9


def test_the_regulator_of_ieeet1_stops_at_limits_that_do_not_move():
    """Its terminal voltage falls to 0.06 pu, and its limit does not."""
    found = run(small({"genrou": ROUND, "ieeet1": IEEET1._replace(VRmax=3.0)}))
    vr = state(found, "ieeet1", "vr")
    assert vr.max() == 3.0
    assert (vr == 3.0).sum() > 3
    assert vr.min() >= IEEET1.VRmin


@pytest.mark.parametrize(("exponent", "part"), [(0.0, "power"), (1.0, "current"), (2.0, None)])
def test_whole_exponents_are_constant_power_current_and_admittance(exponent, part):
    load = EXPONENTIAL._replace(a=exponent, b=exponent)
    shares = {f"p_{part}": 1.0, f"q_{part}": 1.0} if part else {}
    zip_load = run(with_shares(small({"gencls": CLASSICAL}), **shares))
    assert apart(zip_load, run(small({"gencls": CLASSICAL, "exponential": load}))) < 1e-6  # 3e-7, voltages to 1e-7


class TestConverter:
    """REGC_A."""

    def test_it_delivers_the_power_of_the_power_flow(self):
        point = operating_point.solve(small({"regc_a": REGC}))
        V, S = abs(point.V[0]), point.flow.S[0] * point.case.base_mva / 400.0
        found = {name: point.s[point.layout.signals[0, name]] for name in ("P", "Q", "vt", "Ipcmd", "Iqcmd")}
        wanted = {"P": S.real, "Q": S.imag, "vt": V, "Ipcmd": S.real / V, "Iqcmd": S.imag / V}
        assert found == pytest.approx(wanted, abs=1e-11)
        assert len(point.rotors.unit) == 1

    def test_an_island_with_nothing_else_is_dead(self):
        found = run(small({"regc_a": REGC}), [Open("2-3", 0.1), Open("2-3#2", 0.1)], 0.5)
        assert found.outcome.kind == "islanded"
        assert "without a machine or grid-forming converter: blacked out" in str(found.outcome)
        assert found.arrays.P[-1, 0] == 0
        assert np.abs(found.arrays.V[-1, :2]).max() == 0
        assert abs(found.arrays.V[-1, 2]) > 0.9

    def test_its_active_current_returns_no_faster_than_rrpwr(self):
        found = run(small({"regc_a": REGC._replace(Rrpwr=1.0)}), until=3.0)
        ip = state(found, "regc_a", "ip")
        rise = np.diff(ip) / np.diff(found.time)
        assert rise.max() == pytest.approx(1.0, rel=1e-6)
        assert (rise > 0.99).sum() > 20
        assert ip.min() < 0.3 * ip[0]
        assert ip[-1] == pytest.approx(ip[0], abs=1e-3)
        assert np.abs(found.arrays.P[(found.time > 0.11) & (found.time < 0.18), 0]).max() < 1.0  # MW of 300

    def test_low_voltage_reduces_active_and_high_voltage_reactive_current(self):
        x = regc_a.State(0.9, 0.2, 1.0)
        assert regc_a.module.delivered(x, 1.0, REGC) == (0.9, 0.2)
        assert regc_a.module.delivered(x, 0.6, REGC) == pytest.approx((0.45, 0.2))
        assert regc_a.module.delivered(x, 0.4, REGC) == (0.0, 0.2)
        assert regc_a.module.delivered(x, 1.3, REGC) == pytest.approx((0.9, 0.2 - 0.7 * 0.1))
        assert regc_a.module.delivered(x, 9.0, REGC)[1] == REGC.Iolim
        assert regc_a.module.delivered(x._replace(vfilt=0.7), 1.0, REGC)[0] == pytest.approx(1.22 * 0.5)
        assert regc_a.module.delivered(x._replace(vfilt=0.7), 1.0, REGC._replace(Lvplsw=0.0))[0] == 0.9

    def test_a_limit_below_its_dispatch_is_named(self):
        with pytest.raises(EquilibriumError, match=r"REGC_A of machine 1 at bus 1 cannot be initialized: Lvpl1 = 0\.5"):
            operating_point.solve(small({"regc_a": REGC._replace(Lvpl1=0.5)}))

    def test_the_rest_of_the_house_knows_units_without_a_rotor(self):
        base = st.initialize(small({"regc_a": REGC}))
        found = base.modes()
        values = np.linalg.eigvals(st.linearize(base).A)
        assert np.abs(np.sort_complex(found.eigenvalues) - np.sort_complex(values)).max() < 1e-6 * np.abs(values).max()
        moved = base.simulate(st.Contingency("2", clear="5cyc"), until="2s")
        assert [text.get_text() for text in moved.plot().texts][:1] == ["machine 2"]
        assert list(moved.df.filter(like="speed").columns) == ["speed_pu:2"]
        with pytest.raises(StudyError, match="machine 1 of small cannot be estimated, because it is a converter"):
            base.estimate(st.Contingency("2", clear="5cyc"))
        with pytest.raises(StudyError, match="cannot be controlled by its speed"):
            base.simulate(st.Contingency("2", clear="5cyc"), storage="50MW", control=st.BangBang())

    def test_a_system_of_converters_alone_is_dead(self):
        case = small({"regc_a": REGC})
        run = st.simulate(case, st.TripMachine(2, 0.1), "0.2s")
        assert "The system is blacked out at 0.100 s: no machine or grid-forming converter is left." in str(run.outcome)
        assert not run.outcome.stable
        run.plot()
        with pytest.raises(EquilibriumError, match="small cannot be initialized: nothing sets its voltage and freq"):
            st.modes(replace(case, devices={"regc_a": {1: REGC, 2: REGC}}))

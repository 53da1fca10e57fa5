"""Laws of the motion: conserved energy, order of the method, fleets, limits without wind-up."""

from dataclasses import replace

import numpy as np
import pytest
from systems import (
    ALL_KINDS,
    CLASSICAL,
    EXDC2,
    EXST3,
    KINDS,
    LIBRARY,
    PSS,
    ROUND,
    SEXS,
    doubled,
    each,
    kind,
    small,
    with_shares,
)

from stabctl import devices
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model.tables import Storage
from stabctl.simulation import simulation
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.events import Clear, Fault, LoadStep, Open

KEEP_ON = Criterion(max_angle=np.inf)


def lossless_two_area(case):
    """Kundur's network without resistances and loads; both areas trade 300 MW."""
    case = case.classical()
    rows = {n: p._replace(ra=0.0, D=0.0) for n, p in case.devices["gencls"].items()}
    trade = dict(zip((1, 2, 3, 4), (200.0, 100.0, 0.0, -200.0), strict=True))
    return replace(
        case,
        devices={"gencls": rows},
        branches=tuple(k._replace(r=0.0) for k in case.branches),
        machines=tuple(m._replace(p=trade[m.machine]) for m in case.machines),
        loads=(case.loads[0]._replace(p=0.0, p_current=0.0),),
        buses=tuple(b._replace(b=0.0) for b in case.buses),
    )


def energy(point, run):
    """Kinetic and potential energy (pu s, each) of a lossless classical system on its intact network.

    E = sum H wb (w - 1)^2 - sum Pm delta - sum_{i<j} E_i E_j B_ij cos(delta_i - delta_j)   (the paper, section 3)
    """
    wb = 2 * np.pi * point.case.frequency_hz
    y = operating_point.source_admittances(point.system)
    at = point.net.machine_bus
    Z = np.linalg.inv(point.admittance().toarray())
    Y = np.diag(y) - y[:, None] * Z[np.ix_(at, at)] * y[None, :]
    assert np.abs(Y.real).max() < 1e-9 * np.abs(Y.imag).max()
    E = run.arrays.Efd[0]
    kinetic = ((run.arrays.speed - 1) ** 2 * point.inertia).sum(axis=1) * wb
    difference = run.arrays.angle[:, :, None] - run.arrays.angle[:, None, :]
    network = -0.5 * (E[:, None] * E * Y.imag * np.cos(difference)).sum(axis=(1, 2))
    unit, par = point.constants("gencls")
    Pm = run.arrays.Pm[0] * par["mva"][np.argsort(unit)]
    return kinetic, network - run.arrays.angle @ Pm


def drift(point, step):
    """Largest change of the energy after the fault, over the kinetic energy it left behind."""
    run = simulation.run(point, [Fault("7", 0.1), Clear("7", 0.2)], 5.0, step=step, criterion=KEEP_ON)
    after = run.time >= 0.2
    kinetic, potential = energy(point, run)
    total = (kinetic + potential)[after]
    assert np.ptp(potential[after]) > 0.3 * kinetic[after].max()  # the two are truly exchanged
    return np.abs(total - total[0]).max() / kinetic[after].max()


def test_a_lossless_classical_system_conserves_its_energy(cases):
    point = operating_point.solve(lossless_two_area(cases("two_area")))
    coarse, fine = drift(point, 1 / 50), drift(point, 1 / 100)
    assert coarse < 4e-6  # 2.0e-6
    assert 2**4 < coarse / fine < 2**6  # 32
    assert fine / drift(point, 1 / 200) > 2**4  # 32


def halved(point, events, until, step):
    """Largest differences, at common instants, between runs of a step, its half and its quarter."""
    runs = [simulation.run(point, events, until, step=step / n, criterion=KEEP_ON) for n in (1, 2, 4)]
    rows = [run.rows[::n, : point.layout.step] for run, n in zip(runs, (1, 2, 4), strict=True)]
    return np.abs(rows[0] - rows[1]).max(), np.abs(rows[1] - rows[2]).max()


ITERATED = {  # their currents depend on the voltage, which is solved to a floor, see the next test
    name for name, models in (KINDS | LIBRARY).items() if any(devices.every()[model].has("current") for model in models)
}


@pytest.mark.parametrize("name", each(name for name in ALL_KINDS if name not in ITERATED))
def test_halving_the_step_shows_the_fourth_order(name):
    """A load step of 20 MW: nothing meets a limit, the load is an admittance; the ratio of the errors is 2^4."""
    with kind(name) as models:
        point = operating_point.solve(small(models))
    assert not len(point.system.draw_bus)
    h = 2.0 ** np.floor(np.log2(0.6 / point.fastest))
    coarse, fine = halved(point, [LoadStep(2, 0.5, 20.0)], 1.5, h)
    assert fine > 1e-12  # the error of the method, not of rounding
    assert 15 < coarse / fine < 22  # 16.2 to 21.1; third order gives 8, fifth 32


def test_loads_that_need_iteration_leave_a_floor_of_a_millionth(points):
    """The voltages are solved to 1e-7 pu; at any step that, and not RK4, is what remains."""
    assert max(halved(points("two_area"), [LoadStep(7, 0.5, 20.0)], 1.5, 1 / 960)) < 2e-6  # 1.2e-6


def motion(run, row):
    """Speed (pu) of the unit in a row of the machines, or the power (pu) of one without a rotor."""
    rotor = np.flatnonzero(run.point.rotors.unit == row)
    return run.arrays.speed[:, rotor[0]] if len(rotor) else run.arrays.P[:, row] / run.point.case.machines[row].base


def same_motion(single, fleet, events, until=3.0, **options):
    a = simulation.run(operating_point.solve(single), events, until, criterion=KEEP_ON, **options)
    b = simulation.run(operating_point.solve(fleet), events, until, criterion=KEEP_ON, **options)
    assert np.ptp(motion(a, 0)) > 1e-4
    assert np.abs(motion(b, 0) - motion(b, 1)).max() < 1e-13
    assert np.abs(a.arrays.V - b.arrays.V).max() < 1e-9
    return max(np.abs(motion(a, 0) - motion(b, 0)).max(), np.abs(a.arrays.Efd[:, 0] - b.arrays.Efd[:, 0]).max())


@pytest.mark.parametrize("name", each())
def test_a_fleet_equals_its_single(name):
    """Two equal machines at one bus move as one of double size."""
    with kind(name) as models:
        case = with_shares(small(models), p_current=1.0, q_current=1.0)
        assert same_motion(case, doubled(case), [Fault("2", 0.1), Clear("2", 0.18)]) < 1e-9


def test_a_fleet_with_storage_equals_its_single():
    case = small(KINDS["sexs, pss, steam"])
    one = case.with_storage([Storage(1, 2, 40.0, "current", lag=0.05), Storage(2, 3, 10.0)])
    two = doubled(case).with_storage([Storage(1, 2, 40.0, "current", lag=0.05), Storage(2, 3, 10.0)])
    parts = [Storage(1, 2, rating, "current", lag=0.05) for rating in (15.0, 25.0)]
    three = doubled(case).with_storage([*parts, Storage(2, 3, 10.0)])
    events = [Fault("2", 0.1), Clear("2", 0.18)]
    assert same_motion(case, doubled(case), events) < 1e-9
    runs = [
        simulation.run(operating_point.solve(c), events, 1.0, control=BangBang(), criterion=KEEP_ON)
        for c in (two, three)
    ]
    assert np.abs(runs[0].arrays.speed - runs[1].arrays.speed).max() < 1e-12
    together = runs[1].arrays.storage[:, 0] + runs[1].arrays.storage[:, 1]
    assert runs[0].arrays.storage[:, 0] == pytest.approx(together, abs=1e-9)
    assert np.abs(runs[0].arrays.storage[:, 0]).max() > 30
    assert one.storage == two.storage


def test_islands_do_not_see_each_other():
    """Two copies of a system, their tie (without flow) opened: one is disturbed as if alone, the other stands still."""
    case = small(KINDS["sexs, pss, steam"])
    swing = operating_point.solve(case).flow.S[1].real * 100
    pair = replace(
        case,
        buses=(*case.buses, *(b._replace(bus=b.bus + 10, kind="pv" if b.bus == 3 else b.kind) for b in case.buses)),
        branches=(
            *case.branches,
            *(k._replace(from_bus=k.from_bus + 10, to_bus=k.to_bus + 10) for k in case.branches),
            case.branches[0]._replace(from_bus=3, to_bus=13),
        ),
        machines=(
            *case.machines,
            case.machines[0]._replace(machine=11, bus=11, storage_bus=12),
            case.machines[1]._replace(machine=12, bus=13, storage_bus=13, p=swing),
        ),
        devices={k: rows | {n + 10: p for n, p in rows.items()} for k, rows in case.devices.items()},
        loads=(*case.loads, case.loads[0]._replace(bus=12)),
    )
    events = [Fault("2", 0.1), Clear("2", 0.18)]
    alone = simulation.run(operating_point.solve(case), events, 2.0, criterion=KEEP_ON)
    both = simulation.run(operating_point.solve(pair), [Open("3-13", 0.0), *events], 2.0, criterion=KEEP_ON)
    assert both.outcome.kind == "islanded"
    assert np.abs(both.arrays.speed[:, :2] - alone.arrays.speed).max() < 1e-10
    assert np.abs(both.arrays.V[:, :3] - alone.arrays.V).max() < 1e-9
    assert np.abs(both.arrays.speed[:, 2:] - 1).max() < 1e-10
    assert np.ptp(alone.arrays.speed[:, 0]) > 1e-3


class TestWindUp:
    """A state at its limit stays there exactly as long as it is driven outwards."""

    @staticmethod
    def check(state, low, high, driven_up):
        assert state.max() == high
        assert state.min() >= low
        at_top = state == high
        assert at_top.sum() > 5
        assert not (at_top[1:] & ~driven_up[:-1] & ~driven_up[1:]).any()  # off it within the step in which it turns

    def test_regulator_of_sexs(self):
        sexs = SEXS._replace(Efdmax=2.6, Efdmin=0.5)
        point = operating_point.solve(small({"genrou": ROUND, "sexs": sexs}))
        run = simulation.run(point, [Fault("2", 0.1), Clear("2", 0.2)], 3.0, criterion=KEEP_ON)
        vref, vm = point.s[point.layout.setpoint(0, "Vref")], self.states(run, "sexs")[:, 0]
        self.check(self.states(run, "sexs")[:, 2], 0.5, 2.6, sexs.KA * (vref - vm) > 2.6)

    def test_regulator_of_exst3(self):
        exst3 = EXST3._replace(VRmax=2.4, VRmin=0.5)
        point = operating_point.solve(small({"genrou": ROUND, "exst3": exst3, "pss": PSS}))
        run = simulation.run(point, [Fault("2", 0.1), Clear("2", 0.2)], 3.0, criterion=KEEP_ON)
        vm, va, vr = self.states(run, "exst3").T
        vref = point.s[point.layout.setpoint(0, "Vref")]
        u = np.clip(vref - vm + self.pss(run), exst3.VImin, exst3.VImax)
        drive = exst3.KA * (va + exst3.TC / exst3.TB * (u - va))
        self.check(vr, 0.5, 2.4, drive > 2.4)

    def test_regulator_of_exdc2_stops_at_limits_that_move_with_the_voltage(self):
        """Within Vt VRmin..Vt VRmax of the step it belongs to, and off the limit at once when driven back."""
        exdc2 = EXDC2._replace(VRmax=3.5, VRmin=-1.0)
        point = operating_point.solve(small({"genrou": ROUND, "exdc2": exdc2}))
        run = simulation.run(point, [Fault("2", 0.1), Clear("2", 0.2)], 3.0, criterion=KEEP_ON)
        top = 3.5 * np.abs(run.arrays.V[:, 0])
        vr = self.states(run, "exdc2")[:, 2]
        assert (vr[1:] - np.maximum(top[1:], top[:-1])).max() < 2e-3  # 1.4e-3: the voltage of the last stage of RK4
        assert (np.abs(vr - top) < 1e-2).sum() > 5  # it does rest there
        assert (np.diff(vr)[np.abs(vr - top)[:-1] < 1e-2] < -0.02).any()  # and leaves

    @staticmethod
    def states(run, table):
        return run.rows[:, [i for i, place in enumerate(run.point.layout.states) if place.table == table]]

    def pss(self, run):
        washout, lag1, lag2 = self.states(run, "pss").T
        fast = PSS.K * (run.arrays.speed[:, 0] - washout)
        first = lag1 + PSS.T1 / PSS.T2 * (fast - lag1)
        return np.clip(lag2 + PSS.T3 / PSS.T4 * (first - lag2), PSS.Vmin, PSS.Vmax)


def test_classical_machine_follows_the_swing_equation():
    """2H w' = Pm - Pe - D (w - 1), d' = wb (w - 1), by central differences of the trajectory."""
    point = operating_point.solve(small({"gencls": CLASSICAL._replace(ra=0.0)}))
    run = simulation.run(point, [Open("2-3#2", 0.1)], 1.0, step=1 / 1000, criterion=KEEP_ON)
    inner = slice(150, -150)
    h = run.time[1] - run.time[0]
    slip = run.arrays.speed[:, 0] - 1
    d_slip, d_angle = np.gradient(slip, h), np.gradient(run.arrays.angle[:, 0], h)
    want = (run.arrays.Pm[:, 0] - run.arrays.P[:, 0] / 400 - CLASSICAL.D * slip) / (2 * CLASSICAL.H)
    assert np.abs(d_angle - 2 * np.pi * 60 * slip)[inner].max() < 1e-4 * np.abs(d_angle).max()
    assert np.abs(d_slip - want)[inner].max() < 1e-4 * np.abs(want).max()
    assert np.abs(want).max() > 1e-3

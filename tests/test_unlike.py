"""Studies of a system of unlike sizes give the same on another base, with other numbers, and in another order.

Every column is compared relative to its own largest value: what is small beside the rest counts as much.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from unlike import based, numbered, unlike, unlike_point

import stabctl as st
from stabctl.clearing.trial import Search, Trial
from stabctl.design import law_measurement
from stabctl.dynamics import operating_point
from stabctl.placement._allocation import gramians
from stabctl.placement.sensitivity import sensitivity
from stabctl.theory.two_machine import equivalent

BUSES = {40: 907, 10: 31, 20: 5, 30: 222, 50: 8, 60: 1}
MACHINES = {7: 14, 3: 66, 12: 2, 5: 41, 9: 30}
LAW = st.StorageLaw(return_time="0.3s", return_power=0.6, deadband="20mHz")


def same_number(n):
    return n


def turned():
    """With the rows in another order; circuits between the same buses keep theirs, after which they are named."""
    case = unlike()
    tables = {name: tuple(reversed(getattr(case, name))) for name in ("buses", "machines", "loads", "storage")}
    return replace(case, **tables)


OTHERS = {  # case, new number of a bus and of a machine, MVA
    "another base": (lambda: based(unlike(), 0.9), same_number, same_number),
    "other numbers": (lambda: numbered(unlike(), BUSES.get, MACHINES.get), BUSES.get, MACHINES.get),
    "another order": (turned, same_number, same_number),
}


@cache
def other(name):
    return operating_point.solve(OTHERS[name][0]())


def fault(bus, base, **more):
    k = base / 137.0
    return st.Contingency(str(bus(50)), clear="3cyc", at=0.1, impedance=(0.05 + 0.1j) * k, **more)


def run(p, bus, machine):
    what = [f"{bus(60)}:+0.004MW@0.05s", f"{bus(40)}:-21MW@0.2s"]
    options = {"until": 0.6, "step": "2ms", "control": LAW}
    return p.simulate(fault(bus, p.case.base_mva, events=what), **options)


@cache
def recorded(name):
    """The run of the system itself, or of another."""
    if not name:
        return run(unlike_point(), same_number, same_number)
    return run(other(name), *OTHERS[name][1:])


def columns(found, bus, machine):
    """Whatever a run shows, by the numbers of the units."""
    case, table = found.point.case, {}
    units = [m.machine for m in case.machines]
    for name in ("speed", "angle", "electrical_power"):
        values = np.asarray(getattr(found, name))
        table |= {(name, n): values[:, units.index(machine(n))] for n in MACHINES}
    rows = [b.bus for b in case.buses]
    volts = np.asarray(found.voltage)
    table |= {("voltage", n): volts[:, rows.index(bus(n))] for n in BUSES}
    devices = [s.machine for s in case.storage]
    for name in ("storage", "storage_energy", "storage_order"):
        values = found.dataset[name].to_numpy()
        table |= {(name, s.machine): values[:, devices.index(machine(s.machine))] for s in unlike().storage}
    return table


@pytest.mark.parametrize("name", OTHERS)
def test_a_run_is_the_same(name):
    one, two = columns(recorded(""), same_number, same_number), columns(recorded(name), *OTHERS[name][1:])
    for key, values in one.items():
        assert two[key] == pytest.approx(values, rel=1e-6, abs=2e-6 * np.abs(values).max()), key
    orders = [one["storage_order", s.machine] for s in unlike().storage]
    assert min(np.abs(order).max() for order in orders) > 0.1


def by_machine(p, machine, values):
    at = [m.machine for m in p.case.machines]
    return np.asarray(values)[..., [at.index(machine(n)) for n in MACHINES]]


def by_bus(p, bus, frame):
    return frame.loc[[bus(n) for n in BUSES]].to_numpy(float)


def later(p, bus, machine):
    times = {"resolution": "1cyc", "limit": "20cyc", "observe": "0.5s", "longest": 0, "scan": 0, "step": None}
    search = Search.of(p.case, criterion=st.Criterion(), **times)
    return list(law_measurement.later(Trial(p, fault(bus, p.case.base_mva), LAW, search), 3, 0.3))


STUDIES = {
    "power flow": lambda p, bus, machine: by_bus(p, bus, p.power_flow().df),
    "circuits": lambda p, bus, machine: p.power_flow().branches.iloc[:, 2:].to_numpy(float),
    "short-circuit power": lambda p, bus, machine: by_bus(p, bus, p.short_circuit().df.set_index("bus"))[:, [0, 3]],
    "modes": lambda p, bus, machine: np.sort(np.abs(p.modes().eigenvalues))[2:],
    "inertia": lambda p, bus, machine: by_machine(p, machine, p.inertia * p.case.base_mva),
    "accelerations": lambda p, bus, machine: np.sort(np.abs(sensitivity(p).acceleration), axis=None),
    "gramians": lambda p, bus, machine: np.sort(np.abs(np.linalg.eigvals(gramians(p).W)), axis=None)[-8:],
    "the theory": lambda p, bus, machine: [equivalent(p.case, machine(n)).critical().time for n in (7, 3, 5)],
    "what is left": later,
    "clearing time": lambda p, bus, machine: [
        p.clearing_time(str(bus(30)), resolution="1cyc", limit="60cyc", observe=1.0, scan=0).seconds
    ],
    "resized": lambda p, bus, machine: by_machine(
        p, machine,
        p.resized([2.0 * s.rating for s in p.case.storage]).simulate(
            fault(bus, p.case.base_mva), until=0.3, control=st.BangBang(0.01)
        ).arrays.P[-1],
    ),
    "loading": lambda p, bus, machine: p.one_line().loading,
    "estimates": lambda p, bus, machine: by_machine(
        p, machine,
        p.estimate(
            fault(bus, p.case.base_mva), 0.5, pmu=st.Pmu.exact(50), record=False
        ).slip_sigma[-1],
    ),
}  # fmt: skip


@pytest.mark.parametrize("study", STUDIES)
@pytest.mark.parametrize("name", OTHERS)
def test_a_study_is_the_same(study, name):
    one = np.asarray(STUDIES[study](unlike_point(), same_number, same_number), float)
    two = np.asarray(STUDIES[study](other(name), *OTHERS[name][1:]), float)
    assert np.abs(one).max() > 0
    assert two == pytest.approx(one, rel=2e-6, abs=1e-9 * np.abs(one).max())


def test_what_is_said_of_it_does_not_depend_on_the_base():
    """Sentences on the case, its modes, a run, with all their numbers; a reactance in pu does, and is left out."""
    one, two = unlike_point(), other("another base")
    says = [[s for s in str(p.case.check()).splitlines()[1:] if not s.startswith("branches")] for p in (one, two)]
    assert says[0] == says[1]
    assert len(says[0]) >= 6
    for say in (lambda p: p.modes(), lambda p: p.power_flow(), lambda p: p.one_line()):
        assert str(say(one)) == str(say(two))
    assert str(recorded("").outcome) == str(recorded("another base").outcome)


def test_the_smallest_units_obey_their_own_equations():
    """Swing equation of the machine of 50 kVA; its load, its neighbors and what the network takes add up."""
    what = ["60:+0.004MW@0.05s", st.TripMachine(3, 0.2)]
    found = unlike_point().simulate(fault(same_number, 137.0, events=what), until=0.6, step="1ms")
    case, t = found.point.case, found.time
    unit = [m.machine for m in case.machines].index(9)

    def signal(name):
        return found.rows[:, found.point.layout.signals[unit, name]]

    speed, late = found.speed.to_numpy()[:, unit], t > 0.21
    p = case.devices["genrou"][9]
    torque = signal("Pm") / speed - signal("Te") - p.D * (speed - 1)
    change = 2 * p.H * (speed[late][-1] - speed[late][0])
    assert change == pytest.approx(np.trapezoid(torque[late], t[late]), abs=5e-6)
    assert found.electrical_power.to_numpy()[:, unit] == pytest.approx(0.05 * signal("P"), rel=1e-9)
    volts = found.arrays.V[:, [b.bus for b in case.buses].index(60)]
    near = found.arrays.V[:, [b.bus for b in case.buses].index(50)]
    drawn = -0.05 * (signal("P") + 1j * signal("Q")) + found.storage.to_numpy()[:, 0]
    m0, load = np.abs(found.point.V[-1]), case.loads[-2]
    ratio = np.abs(volts) / m0
    P, Q = (
        s * (a + b * ratio + (1 - a - b) * ratio**2)
        for s, a, b in ((load.p, load.p_power, load.p_current), (load.q, load.q_power, load.q_current))
    )
    drawn = drawn + P * (1 + 0.004 / load.p * (t > 0.05)) + 1j * Q  # more of the same load
    for k in case.branches[-2:]:
        a, z = 1 / k.tap, complex(k.r, k.x)
        current = (volts - near * a) / z if k.to_bus == 60 else a * (a * volts - near) / z
        drawn = drawn + case.base_mva * volts * current.conjugate()
    quiet = (np.abs(np.subtract.outer(t, [0.05, 0.1, 0.16, 0.2])) > 1e-9).all(axis=1) & (np.abs(volts) > 0.75)
    assert np.abs(drawn[quiet]).max() < 2e-6

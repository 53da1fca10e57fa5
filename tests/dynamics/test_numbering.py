"""How a system is numbered, in which order its tables stand, and on which base: none of it matters."""

from dataclasses import replace

import numpy as np
import pytest
from comparison import KEEP_ON
from systems import kind, rebased, small, with_shares

from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.model.naming import number
from stabctl.model.tables import Link, Storage
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Clear, Fault, LoadStep, Open, TripMachine
from stabctl.simulation.simulation import run
from stabctl.smallsignal import analyze, linearize, nonlinear


def bus(n):
    return 200 - 7 * n


def machine(n):
    return 1000 - 3 * n


def renumbered(case):
    """The same system: other numbers of buses and machines, every table from its end to its start."""

    def key(text):
        return f"{machine(number(text))}{str(text)[len(str(number(text))) :]}" if "#" in str(text) else machine(text)

    def elsewhere(par):
        given = {"bus": bus, "other": machine}
        return par._replace(**{n: f(getattr(par, n)) for n, f in given.items() if getattr(par, n, 0)})

    return replace(
        case,
        buses=tuple(b._replace(bus=bus(b.bus)) for b in case.buses[::-1]),
        branches=tuple(k._replace(from_bus=bus(k.from_bus), to_bus=bus(k.to_bus)) for k in case.branches[::-1]),
        machines=tuple(
            m._replace(machine=machine(m.machine), bus=bus(m.bus), storage_bus=bus(m.storage_bus))
            for m in case.machines[::-1]
        ),
        loads=tuple(d._replace(bus=bus(d.bus)) for d in case.loads[::-1]),
        links=tuple(k._replace(from_bus=bus(k.from_bus), to_bus=bus(k.to_bus)) for k in case.links[::-1]),
        storage=tuple(s._replace(machine=machine(s.machine), bus=bus(s.bus)) for s in case.storage[::-1]),
        devices={k: {key(n): elsewhere(p) for n, p in list(rows.items())[::-1]} for k, rows in case.devices.items()},
    )


def events(place=lambda n: n, unit=lambda n: n):
    return [
        Fault(str(place(8)), 0.1),
        Clear(str(place(8)), 0.2),
        Open(f"{place(7)}-{place(8)}", 0.2),
        LoadStep(place(9), 0.5, 30.0, 10.0),
        TripMachine(unit(4), 0.8),
    ]


@pytest.fixture(scope="module")
def case(cases):
    """Two areas with every sort of load, a link, and storage that is a conductance."""
    found = with_shares(cases("two_area"), p_current=0.3, q_current=0.2, p_power=0.1)
    found = replace(found, links=(Link("a", 6, 10, 50.0, 2.0),))
    return found.with_storage(Storage(m.machine, m.storage_bus, 40.0, "current", lag=0.02) for m in found.machines)


@pytest.fixture(scope="module")
def plain(case):
    return run(operating_point.solve(case), events(), 2.0, control=BangBang(), criterion=KEEP_ON)


def test_numbers_and_order_do_not_matter(case, plain):
    other = run(
        operating_point.solve(renumbered(case)), events(bus, machine), 2.0, control=BangBang(), criterion=KEEP_ON
    )
    assert np.abs(other.arrays.speed[:, ::-1] - plain.arrays.speed).max() < 1e-13  # 4e-16
    assert np.abs(other.arrays.V[:, ::-1] - plain.arrays.V).max() < 1e-11  # 1e-13
    assert np.abs(other.arrays.storage[:, ::-1] - plain.arrays.storage).max() < 1e-10  # 5e-13
    assert np.ptp(plain.arrays.speed) > 1e-3
    assert np.abs(plain.arrays.storage).max() > 30


@pytest.mark.parametrize("base", [0.01, 0.1, 37.0, 1e4])
def test_the_base_does_not_matter(case, plain, base):
    other = run(operating_point.solve(rebased(case, base)), events(), 2.0, control=BangBang(), criterion=KEEP_ON)
    assert np.abs(other.arrays.speed - plain.arrays.speed).max() < 1e-13  # 4e-16
    assert np.abs(other.arrays.V - plain.arrays.V).max() < 1e-11  # 1e-13
    assert np.abs(other.arrays.storage - plain.arrays.storage).max() < 1e-10  # 5e-13


@pytest.mark.parametrize("base", [0.01, 1e4])
def test_clearing_times_are_those_of_any_base(cases, base):
    plain = cases("two_area").classical()
    for fault in ("7-8@0.4", "9"):
        wanted, other = (c.clearing_time(Contingency(fault), observe=1.0) for c in (plain, rebased(plain, base)))
        assert (other.cycles, other.lowest_unstable) == (wanted.cycles, wanted.lowest_unstable)


@pytest.mark.parametrize("base", [1e-6, 0.01, 1e6, 1e9])
@pytest.mark.parametrize("name", ["wscc9", "ieee39"])
def test_linear_and_nonlinear_models_are_those_of_any_base(cases, name, base):
    """What counts as rest is a mismatch in MVA, which is the same on every base."""
    plain, other = (operating_point.solve(c) for c in (cases(name), rebased(cases(name), base)))
    values = [np.sort_complex(analyze(linearize(point)).eigenvalues) for point in (plain, other)]
    assert np.abs(values[1] - values[0]).max() < 1e-13 * np.abs(values[0]).max()  # 7e-15
    moved = np.r_[1e-3, np.zeros(len(values[0]) - 1)]
    rates = [nonlinear(point, (), ["voltage:4"]).dynamics(0, moved, []) for point in (plain, other)]
    assert np.abs(rates[1] - rates[0]).max() < 2e-11  # 6e-12, of 0.004


def test_modes_are_the_same(case):
    values = [
        np.sort_complex(analyze(linearize(operating_point.solve(c))).eigenvalues)
        for c in (case, renumbered(case), rebased(case, 37.0))
    ]
    for other in values[1:]:
        assert np.abs(other - values[0]).max() < 1e-9  # 5e-12


def test_signals_from_elsewhere_go_by_number(case):
    """The bus and the machine that a device names are found whatever their rows."""
    step = LoadStep(2, 0.1, 50.0)
    with kind("signals from elsewhere") as models:
        one = small(models)
        a = run(operating_point.solve(one), [step], 1.0)
        b = run(operating_point.solve(renumbered(one)), [replace(step, bus=bus(2))], 1.0)
    assert np.abs(b.arrays.speed[:, ::-1] - a.arrays.speed).max() < 1e-12

"""Phasors of machines without a PMU in a system of several machines at a bus, links, storage and loads of all kinds."""

from dataclasses import replace

import numpy as np
import pytest
from uneven import uneven, uneven_point

import stabctl as st
from stabctl.dynamics import operating_point
from stabctl.estimation._network_model import AMPLIFIED, BLURRED, Computed, NetworkModel, sharp
from stabctl.estimation.rotor_units import Terminals
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

EVENTS = {
    "nothing": [],
    "a fault": [st.Fault("40-30 ckt 1@0.3", 0.1, 0.1 + 0.3j)],
    "a machine off": [st.TripMachine(5, 0.1)],
    "a circuit open": [st.Open("30-40#2", 0.1)],
    "load and shunt": [st.LoadStep(50, 0.1, p=30.0, q=-17.0), st.SwitchShunt(30, 0.1, g=11.0, b=-44.0)],
}


@pytest.mark.parametrize("name", EVENTS)
def test_missing_phasors_are_exact_or_unknown(name):
    """Machines 7 and 3 stand at one bus: without both PMUs their voltage is known, and of their currents the sum."""
    simulation = Simulation(setup(uneven_point()), EVENTS[name])
    network = NetworkModel(uneven_point())
    simulation.advance(0.16)
    V, I = Terminals(simulation).phasors(simulation.V)
    others, off = network.other_currents(simulation.V, I, simulation.switching), simulation.switching.tripped
    for missing in ([0], [1], [2], [3], [0, 1], [0, 2], [1, 3]):
        known = ~np.isin(np.arange(4), missing)
        told = [np.where(known, one, 99.0) for one in (V, I)]
        found = network.computed(*told, others, switching=simulation.switching, known=known)
        assert found.V == pytest.approx(V[missing], abs=2e-7)
        assert (found.V_parts.sum(-1) == found.V).all()
        if missing == [0, 1]:
            assert np.isnan(found.I).all()
            assert not sharp(found, np.full(2, 0.2j), 1e-3).any()
        else:
            assert found.I == pytest.approx(I[missing], abs=2e-6)
        assert not found.V_parts[:, [*missing, *(4 + m for m in missing)]].any()
        assert not found.V_parts[:, [4 + i for i in off]].any()
    rows, lines = network.each_from_the_rest(simulation.switching, np.ones(4, bool))
    assert rows.tolist() == [i for i in range(4) if i not in off]
    assert lines @ np.r_[V, I, others] == pytest.approx(V[rows], abs=2e-7)
    assert not lines[np.arange(len(rows)), rows].any()
    assert not lines[np.arange(len(rows)), 4 + rows].any()


def test_the_currents_that_are_metered_are_those_of_loads_storage_and_link():
    """Into the network, beside what constant admittances take: power balance at every bus."""
    point = uneven_point()
    simulation, network = Simulation(setup(point)), NetworkModel(point)
    V, I = Terminals(simulation).phasors(point.V)
    found = network.other_currents(point.V, I, simulation.switching)
    buses = [b.bus for b in point.case.buses]
    drawn = np.zeros(len(buses), complex)
    for load in point.case.loads:
        ratio = abs(point.V[buses.index(load.bus)]) / (load.v or abs(point.V[buses.index(load.bus)]))
        shares = (load.p, load.p_power, load.p_current), (load.q, load.q_power, load.q_current)
        P, Q = (s * (p + c * ratio + (1 - p - c) * ratio**2) for s, p, c in shares)
        drawn[buses.index(load.bus)] += complex(P, Q)
    (dc,) = point.case.links
    drawn[buses.index(dc.from_bus)] += dc.p
    drawn[buses.index(dc.to_bus)] += dc.loss - dc.p
    left = -drawn / point.case.base_mva
    fixed = np.abs(point.V) ** 2 * point.system.fixed.conj()  # constant admittances are part of the network
    assert found == pytest.approx(((left + fixed) / point.V).conj()[network.others], abs=1e-7)


def test_a_phasor_is_used_if_it_is_sharp_enough():
    """Errors of the reports, relative to voltage and to the voltage V + Z I behind it."""
    rng, Z = np.random.default_rng(3), np.array([0.02 + 0.3j])
    used = np.zeros(4, int)
    for _ in range(800):
        error = rng.choice([0.03, 1e-3])
        v, i = (rng.normal(size=(1, 5)) + 1j * rng.normal(size=(1, 5)) for _ in range(2))
        v, i = v * rng.choice([0.5, 2.0, 4.0]), i * rng.choice([0.5, 9.0, 30.0])
        v[0, 0] -= rng.uniform(0.0, 1.0) * (v.sum() + Z[0] * i.sum())
        E = v.sum() + Z[0] * i.sum()
        behind = sum(abs(a + Z[0] * b) ** 2 for a, b in zip(v[0], i[0], strict=True)) ** 0.5 / abs(E)
        own = sum(abs(a) ** 2 for a in v[0]) ** 0.5
        reasons = own < AMPLIFIED, behind < AMPLIFIED, behind * error < BLURRED
        found = sharp(Computed(v.sum(-1), i.sum(-1), v, i), Z, error)
        assert found.tolist() == [all(reasons)]
        alone = [not one and sum(reasons) == 2 for one in reasons]
        used += *alone, all(reasons)
    assert used.min() > 20


def test_both_ends_of_a_link_and_loads_are_metered_and_no_other_bus():
    case = uneven(())
    point = operating_point.solve(replace(case, loads=case.loads[1:2]))
    network = NetworkModel(point)
    assert [case.buses[row].bus for row in network.others] == [40, 10, 30]
    simulation = Simulation(setup(point))
    V, I = Terminals(simulation).phasors(point.V)
    others, known = network.other_currents(point.V, I, simulation.switching), np.array([True, True, True, False])
    found = network.computed(V, I, others, switching=simulation.switching, known=known)
    assert found.V == pytest.approx(V[3:], abs=1e-7)

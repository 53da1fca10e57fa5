"""The internal angle: exact in a classical machine, followed through the q-axis flux in a full one."""

from dataclasses import replace

import numpy as np
import pytest

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.estimation.bank import wrapped
from stabctl.estimation.flux import Flux
from stabctl.estimation.rotor_units import Terminals, rotor_units
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import Simulation

RATE = 60


def looked_at(point, events, until):
    """Known machines, and (V, I, E'', angle) at every frame, without noise."""
    simulation, known = Simulation(point, events, record=False), rotor_units(point)
    terminals, rows = Terminals(simulation), []
    for k in range(round(until * RATE)):
        simulation.advance(k / RATE)
        V, I = terminals.phasors(simulation.V)
        rows.append((V[None], I[None], (V + (known.ra + 1j * known.x) / known.mva * I)[None], simulation.angle.copy()))
    return known, rows


def test_power_at_the_terminals_is_that_of_the_load_flow(study):
    for name in ("two_area", "ieee39 classical"):
        point = study(name)[0]
        V, I = Terminals(Simulation(point)).phasors(point.V)
        assert np.abs(V * I.conj() - point.flow.S).max() < 1e-9  # 7e-12


@pytest.mark.parametrize("name", ["two_area classical", "ieee39 classical"])
def test_classical_internal_voltage_is_the_source(study, name):
    point, events, _, _ = study(name)
    _, rows = looked_at(point, events, 3)
    size = point.s[[point.layout.setpoint(unit, "Efd") for unit in point.rotors.unit]]
    assert max(np.abs(E[0] - size * np.exp(1j * delta)).max() for _, _, E, delta in rows) < 1e-12


@pytest.mark.parametrize("name", ["two_area", "wnaps"])
def test_flux_at_rest_turns_the_subtransient_voltage_onto_the_rotor(study, name):
    known, rows = looked_at(study(name)[0], (), 1 / RATE)
    V, I, E, delta = rows[0]
    flux = Flux(known, 1 / RATE, I=I, E=E)
    assert np.abs(wrapped(np.angle(E) - flux.turn(E) - delta)).max() < 1e-8
    assert np.abs(np.angle(E) - delta).max() > 0.5  # 0.53 rad: what it is about


@pytest.mark.parametrize(("name", "cycles", "most"), [("two_area", 6, 0.005), ("wnaps", 3, 0.005)])
def test_flux_follows_the_rotor_through_a_fault(study, name, cycles, most):
    """At the true angles; what is left half a second after clearing comes from the instants of the jumps."""
    point, _, _, (fault, trip) = study(name)
    cleared = 1 + cycles / 60
    known, rows = looked_at(point, Contingency(fault, cycles / 60, trip), 4)
    V, I, E, delta = rows[0]
    flux, there = Flux(known, 1 / RATE, I=I, E=E), np.ones(V.shape, bool)
    worst = 0.0
    for k, (_, I, E, delta) in enumerate(rows[1:], 1):
        flux.predict(I, E, delta[None], received=there, frames=np.ones(V.shape))
        flux.settle(I, E, delta[None], there)
        if k / RATE > cleared + 0.5:
            worst = max(worst, np.abs(wrapped(np.angle(E) - flux.turn(E) - delta)).max())
    assert worst < most  # 0.0028, 0.0031 rad


def test_a_saturated_machine_too():
    case = io.load("two_area")
    rows = {m: p._replace(S10=0.05, S12=0.3) for m, p in case.devices["genrou"].items()}
    point = operating_point.solve(replace(case, devices={**case.devices, "genrou": rows}))
    known, ((V, I, E, delta), *_) = looked_at(point, (), 1 / RATE)
    flux = Flux(known, 1 / RATE, I=I, E=E)
    assert np.abs(wrapped(np.angle(E) - flux.turn(E) - delta)).max() < 1e-8
    for _ in range(60):
        flux.predict(I, E, delta[None], received=V == V, frames=np.ones(V.shape))
        flux.settle(I, E, delta[None], V == V)
    assert np.abs(wrapped(np.angle(E) - flux.turn(E) - delta)).max() < 1e-8

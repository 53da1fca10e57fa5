"""The internal angle: exact in a classical machine, followed through the q-axis fluxes in a full one."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from stabctl import devices, io
from stabctl.dynamics import operating_point
from stabctl.estimation._filter_bank import wrapped
from stabctl.estimation._kernels import iron
from stabctl.estimation._machine_model import QAxis, turn
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.estimation.rotor_units import MODELS, Terminals, rotor_units
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

RATE = 60


def looked_at(point, events, until, rate=RATE):
    """Known machines, and (E'', I on the machine base, angle, speed) at every frame, without noise."""
    simulation, known = Simulation(setup(point), events, record=False), rotor_units(point)
    terminals, rows = Terminals(simulation), []
    for k in range(round(until * rate)):
        simulation.advance(k / rate)
        V, I = terminals.phasors(simulation.V)
        E = V + (known.ra + 1j * known.x) / known.mva * I
        rows.append((E, I / known.mva, simulation.angle.copy(), simulation.speed.copy()))
    return known, rows


def at_rest(point):
    known, ((E, I, delta, _), *_) = looked_at(point, (), 1 / RATE)
    axis = QAxis(known, 1 / RATE, 3)
    return axis, E, I, delta, axis.rest(I[None], E[None])[0]


def test_power_at_the_terminals_is_that_of_the_load_flow(study):
    for name in ("two_area", "ieee39 classical"):
        point = study(name)[0]
        V, I = Terminals(Simulation(setup(point))).phasors(point.V)
        assert np.abs(V * I.conj() - point.flow.S).max() < 1e-9  # 7e-12


@pytest.mark.parametrize("name", ["two_area classical", "ieee39 classical"])
def test_classical_internal_voltage_is_the_source(study, name):
    point, events, _, _ = study(name)
    _, rows = looked_at(point, events, 3)
    size = point.s[[point.layout.setpoint(unit, "Efd") for unit in point.rotors.unit]]
    assert max(np.abs(E - size * np.exp(1j * delta)).max() for E, _, delta, _ in rows) < 1e-12


@pytest.mark.parametrize("name", ["two_area", "wnaps", "ieee39"])
def test_flux_at_rest_turns_the_subtransient_voltage_onto_the_rotor(points, name):
    axis, E, _, delta, flux = at_rest(points(name))
    assert np.abs(wrapped(np.angle(E) - turn(axis.psi(flux), np.abs(E)) - delta)).max() < 1e-8
    assert np.abs(wrapped(np.angle(E) - delta)).max() > 0.2  # 0.53 rad: what it is about


def saturated(case):
    rows = {m: p._replace(S10=0.05, S12=0.3) for m, p in case.devices["genrou"].items()}
    return replace(case, devices={**case.devices, "genrou": rows})


def made_of(model):
    """Change the machines of a case to another model, saturated where it has saturation."""

    def change(case):
        par = devices.every()[model].Par
        rows = {m: dict(p._asdict(), S10=0.05, S12=0.3) for m, p in case.devices["genrou"].items()}
        rows = {m: par(**{k: v for k, v in row.items() if k in par._fields}) for m, row in rows.items()}
        kept = {table: kind for table, kind in case.devices.items() if table != "genrou"}
        return replace(case, devices={**kept, model: rows})

    return change


@pytest.mark.parametrize("model", [m for m in MODELS if m != "gencls"])
def test_with_exact_pmus_angle_and_speed_are_right_at_rest_and_off_nominal_speed(model):
    """NEES is the squared error of both over their variance, which is almost that of the model alone."""
    base = made_of(model)(io.load("two_area_manual")).initialize(storage="50MW")
    exact = EstimatorControl(pmu=Pmu.exact())
    found = base.estimate(Contingency("7", "6cyc", "7-8"), "5s", control=exact)
    late = found.time > 2
    assert np.abs(found.slip[late]).min() > 0.008
    assert found.nees[found.time < 1].max() < 1e-9  # 1e-21
    assert np.nanmean(found.nees[late], axis=0).max() < 4  # 2.5; hundreds with the saturation of E'' instead of psi''


def test_machines_whose_equations_the_filters_do_not_have_are_refused():
    models = {name for name, device in devices.every().items() if device.role == "machine"}
    assert models - set(MODELS) == {"two_axis", "gentpj1"}


@pytest.mark.parametrize(
    ("name", "change", "most"),
    [("two_area", None, 3e-4), ("ieee39", None, 5e-3), ("two_area", saturated, 2e-3)]
    + [("two_area", made_of(model), 2e-3) for model in ("genroe", "gensal", "gensae")],
)
def test_the_fluxes_follow_the_rotor_through_a_fault(name, change, most):
    """At true angles and 600 frames per second, the jumps at the ends of frames."""
    case = io.load(name)
    point = operating_point.solve(change(case) if change else case)
    fault = {"two_area": Contingency("7", "6cyc", "7-8"), "ieee39": Contingency("16", "6cyc", "16-17")}[name]
    rate = 600
    known, rows = looked_at(point, fault, 1.3, rate)
    axis = QAxis(known, 1 / rate, 2)
    E, I, delta, _ = rows[0]
    flux, worst = axis.rest(I[None], E[None])[0], 0.0
    for k, ((E0, I0, d0, before), (E, I, delta, omega)) in enumerate(pairwise(rows), 1):
        iq, to = (I0 * np.exp(-1j * d0)).real, (I * np.exp(-1j * delta)).real
        ramp = np.where(np.abs(to - iq) < 0.05, to - iq, 0.0)
        size = np.abs(E0) / (1 + axis.speed * (before - 1))
        ratio = iron(size, axis.slope, axis.knee, axis.exponential) * axis.psi(flux)
        inputs = np.stack([iq, ratio], -1)[..., None]
        flux = (axis.A @ flux[..., None] + axis.B @ inputs)[..., 0] + axis.ramp[1] * ramp[:, None]
        if k / rate > 1.15:
            worst = max(
                worst,
                np.abs(
                    wrapped(np.angle(E) - turn((1 + axis.speed * (omega - 1)) * axis.psi(flux), np.abs(E)) - delta)
                ).max(),
            )
    assert worst < most


def test_responses_over_several_frames_are_those_of_one_frame_repeated(points):
    axis = at_rest(points("two_area"))[0]
    constant, ramp = np.zeros((4, 2)), np.zeros((4, 2))
    for k in range(3):
        constant = (axis.A @ constant[..., None])[..., 0] + axis.B[..., 0]
        ramp = (axis.A @ ramp[..., None])[..., 0] + k / 3 * axis.B[..., 0] + axis.ramp[1] / 3
    assert np.abs(constant - axis.step[3]).max() < 1e-14
    assert np.abs(ramp - axis.ramp[3]).max() < 1e-14

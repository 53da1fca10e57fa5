"""What the filters know of the machines, frame by frame, against its definition."""

import numpy as np
import pytest
from uneven import uneven_point

from stabctl.dynamics import operating_point
from stabctl.estimation._machine_model import RUNAWAY, UNSETTLED, MachineModel
from stabctl.estimation._swing import HIDDEN, Governors
from stabctl.estimation.estimators import Filtered
from stabctl.estimation.pmu import Frame, Pmu
from stabctl.estimation.rotor_units import ProcessNoise, Terminals, rotor_units
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

PMU, NOISE = Pmu(angle=3e-3, magnitude=2e-3), ProcessNoise(walk=0.005, share=0.02)


@pytest.fixture(scope="module")
def classical(cases):
    return operating_point.solve(cases("two_area").classical())


def frames(point, turns, received):
    """Reports in which every current is turned by an angle (rad), so that powers and their variances differ."""
    V, I = (phasor[None, :] for phasor in Terminals(Simulation(setup(point))).phasors(point.V))
    zero = np.zeros(V.shape)
    return [
        Frame(V, I * np.exp(1j * turn), zero, zero, np.array([here]), zero)
        for turn, here in zip(turns, received, strict=True)
    ]


def test_the_variance_of_the_power_is_the_mean_of_two_reports_and_held_while_none_arrives(classical):
    """2 sm^2 P^2 + 2 sa^2 Q^2 at the terminals of a report, and (share (Pm - P))^2 of the model."""
    known, m = rotor_units(classical), 4
    model = MachineModel(known, PMU, power=True, process=NOISE)
    lost, every = [True, False, True, False], [True] * m
    reports = [model.measured(f) for f in frames(classical, (0.0, 0.3, -0.4, 0.6), (every, lost, lost, every))]
    S = [(seen.frame.V * seen.frame.I.conj() / known.mva)[0] for seen in reports]
    of_report = [2 * PMU.magnitude**2 * s.real**2 + 2 * PMU.angle**2 * s.imag**2 for s in S]
    x, _ = model.begin(reports[0])
    x[..., 2] += 0.25
    held, P, since, rate = of_report[0], reports[0].P[0], np.ones(m), np.zeros(m)
    for seen, variance in zip(reports[1:], of_report[1:], strict=True):
        here = seen.frame.received[0]
        Q = model.predict(x, seen).Q[0]
        jump = np.where(here, since * (seen.P[0] - P), 0.0)
        power = (held + np.where(here, variance, held)) / 2 + (NOISE.share * (x[0, :, 2] - P)) ** 2
        power += np.where(here, since * (seen.P[0] - P - since * rate) / 12, 0.0) ** 2  # of the bend
        gap_angle, gap_speed, _ = model.unreported.hidden[0].T
        assert np.all((gap_speed > 0) == (here & (since > 1)))
        d = 1 / (2 * known.H * PMU.rate)
        expected = model.swing.walk[:, 1, 1] + d**2 * (jump**2 / 12 + power) + gap_speed**2
        assert Q[:, 1, 1] == pytest.approx(expected, rel=1e-12)
        c = 2 * np.pi * 60 / (4 * known.H * PMU.rate**2)
        expected = model.swing.walk[:, 0, 0] + c**2 * (since**2 * jump**2 * 4 / 45 + power) + gap_angle**2
        assert Q[:, 0, 0] == pytest.approx(expected, rel=1e-12)
        model.settle(x, seen)
        rate = np.where(here, (seen.P[0] - P) / since, rate)
        held, P = np.where(here, variance, held), np.where(here, seen.P[0], P)
        since = np.where(here, 1, since + 1)
        assert model.kept.variance[0] == pytest.approx(held, rel=1e-12)


@pytest.mark.parametrize("turn", [-0.8, 0.1, 0.6])
def test_the_slope_of_the_angle_is_that_of_a_chord_of_the_arc_sine(points, turn):
    """From the angle theta that the fluxes say to the one that is reported, for states that are off by `turn`."""
    point = points("two_area")
    model = MachineModel(rotor_units(point), PMU, power=True, process=NOISE)
    seen = model.measured(frames(point, [0.0], [[True] * 4])[0])
    x = model.begin(seen)[0]
    x[..., 0] += turn
    found, size = model.observe(x, seen), np.abs(seen.E)
    theta, reported = found.expected - x[..., 0], np.angle(seen.E) - x[..., 0]
    chord = (reported - theta) / (np.sin(reported) - np.sin(theta)) / size
    assert found.slope[..., 3:] == pytest.approx(model.constants.out * chord[..., None], rel=1e-5)
    assert np.all(found.slope[..., :3] == [1, 0, 0])


@pytest.mark.parametrize("filter_class", ["none", "M"])
def test_the_compiled_filters_are_those_of_filterpy(points, filter_class):
    point, pmu, random = points("two_area"), Pmu(filter_class=filter_class), np.random.default_rng(1)
    known, V, I = rotor_units(point), *Terminals(Simulation(setup(point))).phasors(point.V)
    banks = [Filtered(known, pmu, swing=True, engine=engine) for engine in ("filterpy", "batched")]
    zero = np.zeros((2, 4))
    for k in range(90):
        turned = np.exp(1j * (0.02 * k * (k > 20) + 2e-3 * random.standard_normal((2, 2, 4))))
        frame = Frame(V * turned[0], I * turned[1] * (1 + (30 < k < 40)), zero, zero, random.random((2, 4)) > 0.1, zero)
        one, two = (bank.step(frame) for bank in banks)
        assert np.abs(one.slip - two.slip).max() < 1e-12  # 1e-16
    assert np.abs(banks[0].bank.x - banks[1].bank.x).max() < 1e-10  # 2e-14
    assert np.abs(banks[0].bank.P - banks[1].bank.P).max() < 1e-10


def test_at_the_start_the_fluxes_of_full_machines_are_uncertain_by_a_thousandth(points):
    model = MachineModel(rotor_units(points("two_area")), PMU, power=True, process=NOISE)
    (report,) = (model.measured(f) for f in frames(points("two_area"), (0.0,), ([True] * 4,)))
    x, P = model.begin(report)
    assert P[0, :, 3:, 3:] == pytest.approx(np.broadcast_to(1e-6 * np.eye(2), (4, 2, 2)))
    assert not P[0, :, :3, 3:].any()
    assert np.ptp(x[0, :, 2] - report.P[0]) < 1e-12


def test_the_acceleration_is_that_of_the_swing_equation_with_the_variance_of_its_powers(classical):
    known = rotor_units(classical)
    model = MachineModel(known, PMU, power=True, process=NOISE)
    (report,) = (model.measured(f) for f in frames(classical, (0.2,), ([True] * 4,)))
    x, P = model.begin(report)
    diagonal = [report.variance[0] for _ in range(3)]
    diagonal[0], diagonal[1] = model.observe(x, report).variance[0], np.full(4, 1e-4**2)
    assert P[0] == pytest.approx(np.stack([np.diag([*v, 0, 0]) for v in np.transpose(diagonal)]), rel=1e-12)
    x[..., 2] += [0.1, -0.2, 0.3, 0.0]
    a, variance = model.acceleration(x, P)
    assert a[0] == pytest.approx(np.array([0.1, -0.2, 0.3, 0.0]) / (2 * known.H), abs=1e-15)
    assert variance[0] == pytest.approx((P[0, :, 2, 2] + report.variance[0]) / (2 * known.H) ** 2, rel=1e-12)


def test_a_known_governor_stops_at_its_limits():
    """At rest g is clip(Pref - K s, Pmin, Pmax) - Pref: what the limits leave from the reference."""
    values = {"K": 20.0, "Ts": 0.1, "Tc": 0.3, "T3": 0.0, "T4": 1.0, "T5": 2.0, "Pmax": 0.9, "Pmin": 0.25}
    known = Governors({name: np.array([value]) for name, value in values.items()}, 0.05)
    slip, reference = np.array([[0.01], [-0.01], [0.05], [-0.05]]), np.array([[0.6], [0.6], [0.6], [0.7]])
    for _ in range(600):
        g = known.step(slip, reference)
    assert g[:, 0] == pytest.approx([-0.2, 0.2, 0.25 - 0.6, 0.9 - 0.7], abs=1e-6)


def test_damping_governors_and_lost_reports_take_part_in_what_is_known():
    """Of machines that differ in everything; their mechanical power is that at rest and what the governor adds."""
    known = rotor_units(uneven_point())
    model, rng, m = MachineModel(known, PMU, power=True, process=NOISE), np.random.default_rng(2), len(known.H)
    (report,) = (model.measured(f) for f in frames(uneven_point(), (0.2,), ([True] * m,)))
    x, P = model.begin(report)
    assert np.ptp(known.D) > 0
    assert 0 < len(model.governors.at) < m
    x[..., 1:3] += rng.normal(0, 0.2, (1, m, 2))
    model.kept.g[:], model.unreported.power[:] = rng.normal(0, 0.1, (1, m)), rng.uniform(0, 0.1, (1, m))
    slip, now = x[0, :, 1], x[0, :, 2] + model.kept.g[0] - model.kept.P[0]
    a, variance = model.acceleration(x, P)
    assert a[0] == pytest.approx((now - known.D * slip) / (2 * known.H), rel=1e-12)
    of_power = P[0, :, 2, 2] + report.variance[0] + model.unreported.power[0] ** 2
    assert variance[0] == pytest.approx(of_power / (2 * known.H) ** 2, rel=1e-12)
    assert model.whole(x)[0] == pytest.approx(np.maximum(np.abs(model.kept.P), np.abs(now + model.kept.P))[0])
    asked = []
    model.governors.step = lambda *given: asked.append(given) or model.kept.g
    model._governed(x)
    assert asked[0][0][0] == pytest.approx(slip + now / (2 * known.H) * (0.5 / PMU.rate), rel=1e-12)
    assert np.array_equal(asked[0][1], x[..., 2])


def test_a_filter_that_begins_anew_keeps_speed_and_power():
    known = rotor_units(uneven_point())
    model, rng, m = MachineModel(known, PMU, power=True, process=NOISE), np.random.default_rng(3), len(known.H)
    first, later = (model.measured(f) for f in frames(uneven_point(), (0.0, 0.4), ([True] * m,) * 2))
    x, P = model.begin(first)
    rest, _ = model.at_rest(later)
    x[..., :3] += rng.normal(0, 0.05, (1, m, 3))
    x[..., 1] = 0.0
    model.unreported.moved[..., 1] = [[0.0, 0.3, 1e-5, 0.02]]
    where = np.array([[True, True, False, True]])
    fresh, fresh_P = model.restarted(x, P, later, where)
    assert np.array_equal(fresh[0, 2], x[0, 2])
    assert np.array_equal(fresh_P[0, 2], P[0, 2])
    for i in (0, 1, 3):
        assert fresh[0, i, [0, 3, 4]] == pytest.approx(rest[0, i, [0, 3, 4]], abs=1e-12)
        assert np.array_equal(fresh[0, i, 1:3], x[0, i, 1:3])
        speed = P[0, i, 1, 1] + max(model.unreported.moved[0, i, 1], RUNAWAY) ** 2
        flux = UNSETTLED**2 * np.broadcast_to(model._has_flux, (1, m))[0, i]
        wanted = [flux + 1e-3**2, speed, P[0, i, 2, 2] + 1e-2**2, flux, flux]
        assert fresh_P[0, i] == pytest.approx(np.diag(wanted), rel=1e-12)


def test_what_lost_reports_leave_open_widens_angle_and_speed():
    known = rotor_units(uneven_point())
    model, m = MachineModel(known, PMU, power=True, process=NOISE), len(known.H)
    (report,) = (model.measured(f) for f in frames(uneven_point(), (0.0,), ([True] * m,)))
    x, P = model.begin(report)
    state, both = model.angle_and_slip(x, P)
    assert np.array_equal(both, P[..., :2, :2])
    assert np.array_equal(state, x[..., :2])
    model.unreported.moved[:] = r = np.random.default_rng(4).normal(size=(1, m, 2))
    model.unreported.lost[0, 1] = 7
    _, wide = model.angle_and_slip(x, P)
    for i in range(m):
        more = np.outer(r[0, i], r[0, i]) * HIDDEN[:2, :2] + (i == 1) * np.diag([0.3, 4e-3]) ** 2
        assert wide[0, i] == pytest.approx(P[0, i, :2, :2] + more, rel=1e-12)

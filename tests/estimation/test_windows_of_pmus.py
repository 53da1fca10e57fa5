"""What the windows of P and M class PMUs do to angle, speed, flux and power, and what the filters add for it."""

import numpy as np
import pytest
from uneven import uneven_point

from stabctl.estimation._machine_model import ANGLE, FLOOR, SLIP, MachineModel, PmuWindow
from stabctl.estimation._report_errors import (
    computed_angle_variance,
    computed_current_variance,
    computed_power_variance,
)
from stabctl.estimation._swing import HIDDEN, JUMP
from stabctl.estimation.pmu import Frame, Parts, Pmu, window
from stabctl.estimation.rotor_units import ProcessNoise, Terminals, rotor_units
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

HZ = 50.0
SA, SM, SHARE = 3e-3, 2e-3, 0.02


@pytest.mark.parametrize("half", [1, 3])
def test_the_middle_of_a_window_follows_from_its_means(half):
    """Of a constant acceleration and of one that grows."""
    T, wb = 1 / 50, 2 * np.pi * HZ
    weights, t = window(half), np.arange(-half, half + 1) * T
    seen, v = PmuWindow(half, T, HZ), window(half) @ t**2
    for s0, a, jerk in ((0.01, 0.2, 0.0), (-0.02, -0.1, 1.5)):
        angle = 0.7 + wb * (s0 * t + a * t**2 / 2 + jerk * t**3 / 6)
        speed = s0 + a * t + jerk * t**2 / 2
        y, P = np.array([[[weights @ angle, weights @ speed]]]), np.array([[[[2e-5, 3e-6], [3e-6, 4e-6]]]])
        more = {"acceleration": np.array([[a]]), "jerk": np.array([[jerk]])}
        found, wide = seen.middle(y, P, **more)
        assert found[0, 0] == pytest.approx([0.7, s0], abs=1e-12)
        width = max(half / 3, 1) * T
        added = np.diag([(ANGLE * v / 2 * wb * width * jerk) ** 2, (SLIP * v / 2 * jerk) ** 2])
        assert wide[0, 0] == pytest.approx(P[0, 0] + added, rel=1e-12)
        assert P[0, 0, 0, 0] == 2e-5
    turned = wb * 0.013 * t
    assert seen.turned(np.array(-0.013)) == pytest.approx((weights @ turned**2) ** 0.5)


def test_a_jump_enters_the_window_by_its_weights():
    """With the largest weight k frames ago, 1/(k + 1) of it enters now; of the flux, the largest change counts."""
    half, size = 3, 0.8
    seen, changes = PmuWindow(half, 0.02, HZ), [0.0, *(size * window(half)), 0.0, 0.0, -1e-4, 0.0]
    assert seen.together == pytest.approx(1 / (window(half) ** 2).sum())
    for k, change in enumerate(changes):
        recent = [abs(c) for c in changes[max(k - half, 0) : k + 1]][::-1]
        most = max(c / (n + 1) for n, c in enumerate(recent))
        assert seen.entering(np.array([change])) == pytest.approx([-most if change < 0 else most])
        longest = max(abs(c) for c in changes[max(k - 2 * half, 0) : k + 1])
        noise = seen.flux_noise(np.array([0.02]), np.array([change * 1j]))
        assert noise == pytest.approx(seen.turned(np.array([0.02])) * longest)
    u = np.linspace(0, 1, 2001)
    lacking = np.trapezoid(u * (1 - u), u)  # of the mean of products, 1/6
    found = seen.power_noise(np.array([0.3j]), np.array([0.2]))
    assert found == pytest.approx([seen.together**3 * lacking * 0.06**2], rel=1e-5)


def drawn(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def test_computed_phasors_are_as_uncertain_as_their_parts_make_them():
    """Slopes of arg E - asin(psi/|E|), of the power and of the current by every report, in angle and in magnitude."""
    rng, Z, psi, h = np.random.default_rng(7), 0.01 + 0.25j, 0.35, 1e-6
    V, I = drawn(rng, 6) / 4 + 0.2, drawn(rng, 6) / 5

    def said(n):
        v, i = (V * (1 + n)).sum(), (I * (1 + n)).sum()
        E = v + Z * i
        return np.array([np.angle(E) - np.arcsin(psi / abs(E)), (v * i.conjugate()).real])

    slopes = [(said(h * row) - said(-h * row)) / (2 * h) for row in (*np.eye(6), *(1j * np.eye(6)))]
    both = np.array(slopes).reshape(2, 6, 2)
    angle, power = SM**2 * (both[0] ** 2).sum(0) + SA**2 * (both[1] ** 2).sum(0)
    E, noise = V.sum() + Z * I.sum(), {"angle": SA, "magnitude": SM}
    tilt = (1 + 1j * np.tan(np.arcsin(psi / abs(E)))) / E
    assert computed_angle_variance(V, I, np.array(Z), tilt, **noise) == pytest.approx(angle, rel=1e-6)
    assert computed_power_variance(V, I, (V.sum(), I.sum()), **noise) == pytest.approx(power, rel=1e-6)
    assert computed_current_variance(I, **noise) == pytest.approx(SA**2 * (np.abs(I) ** 2).sum())
    assert computed_current_variance(I, angle=SM, magnitude=SA) == pytest.approx(SA**2 * (np.abs(I) ** 2).sum())


def covariance(model, x, seen, i, window_noise, last, hidden):
    """Of the process of machine i, source by source, as in the docstring of `_swing`."""
    q, s, known = model.q_axis, model.swing, model.known
    P, variance, g, missing, current, rate = last
    here, m = seen.frame.received[0, i], missing[i] + 1
    flux_noise, power_noise, entering = (part[0, i] for part in window_noise)
    dP = seen.P[0, i] - P[i] if here else 0.0
    change = (seen.I[0, i] * np.exp(-1j * x["after"][i]) - current[i]) if here else 0.0
    power = (variance[i] + (seen.variance[0, i] if here else variance[i])) / 2 + power_noise
    power += (SHARE * (x["Pm"][i] + g[i] - P[i])) ** 2
    power += (m * (dP - m * rate[i]) / 12) ** 2 if here else 0.0
    noise = seen.of_current[0, i] or SM**2 * current[i].real ** 2 + SA**2 * current[i].imag ** 2
    step = q.step[min(m, len(q.step) - 1), i]
    together = model._window.together**0.5
    jump = np.array([-s.c[i] * m * m * together * dP, -s.d[i] * m * together * dP, 0, *(step * together * entering)])
    blur = np.array([s.c[i], s.d[i], 0, 0, 0]) * power**0.5
    driven = q.B[i, :, 0] * noise**0.5 + step * (flux_noise + (abs(change) if m > 1 else 0.0))
    drive = np.array([0, 0, 0, *driven])
    moved = hidden[2] + abs(current[i] + change) * hidden[0]
    between = np.array([hidden[0], hidden[1], 0, *(step * moved)])
    a, T = 2 * np.pi * HZ / (4 * known.H[i]), model.T
    t = np.linspace(0, T, 2001)
    walk = np.array([a * t**2, t / (2 * known.H[i]), 0 * t + 1, 0 * t, 0 * t])
    walked = model.process.walk**2 * np.trapezoid(walk[:, None] * walk[None], t, axis=-1)
    return (
        walked + JUMP * np.outer(jump, jump) + np.outer(blur, blur) + np.outer(drive, drive)
        + HIDDEN * np.outer(between, between)
    )  # fmt: skip


@pytest.mark.parametrize("filter_class", ["none", "P", "M"])
def test_the_covariance_of_the_process_is_the_sum_of_its_sources(filter_class):
    """Full and classical machines whose currents jump, reports lost and computed, and windows of the PMUs."""
    known, pmu = rotor_units(uneven_point()), Pmu(angle=SA, magnitude=SM, filter_class=filter_class, rate=50)
    model, m = MachineModel(known, pmu, power=True, process=ProcessNoise(walk=0.03, share=SHARE)), len(known.H)
    rng, none = np.random.default_rng(8), np.zeros((1, m))
    V, I = (one[None] for one in Terminals(Simulation(setup(uneven_point()))).phasors(uneven_point().V))
    x = None
    half = pmu.own_frames(HZ)
    gone = PmuWindow(half, model.T, HZ)
    rate = np.zeros(m)
    for k in range(14):
        turned = np.exp(1j * rng.normal(0, 0.05, (2, 1, m)))
        computed, here = rng.random((1, m)) < 0.2, rng.random((1, m)) < (1.0 if k < 3 else 0.7)
        v, i = V * turned[0], I * turned[1] * (1 + 0.3 * (k > 5))
        parts = Parts(computed, drawn(rng, 1, m, 3) / 3, drawn(rng, 1, m, 3)) if k % 3 else None
        seen = model.measured(Frame(v, i, none, none, here, none, parts, np.array([[abs(k - 6)]])))
        S = v * i.conj() / known.mva
        of_power = 2 * SM**2 * S.real**2 + 2 * SA**2 * S.imag**2
        if parts is not None:
            of_parts = computed_power_variance(parts.V, parts.I, (v, i), angle=SA, magnitude=SM) / known.mva**2
            of_power = np.where(computed, of_parts, of_power)
            wanted = SA**2 * (np.abs(parts.I) ** 2).sum(-1) / known.mva**2 * computed
            assert seen.of_current == pytest.approx(wanted)
        assert seen.variance == pytest.approx(of_power)
        assert seen.E == pytest.approx(v + known.impedance * i)
        assert seen.P == pytest.approx((seen.E * i.conj()).real / known.mva)
        if x is None:
            x, _ = model.begin(seen)
            continue
        x = x + rng.normal(0, 1e-2, x.shape)
        kept = model.kept
        last = [part[0].copy() for part in (kept.P, kept.variance, kept.g, kept.missing, kept.current, kept.rate)]
        step = model.predict(x, seen)
        after = step.x[0, :, 0]
        change = np.where(here, seen.I * np.exp(-1j * after) - kept.current, 0)
        added = [none, none, change.real]
        if half:
            moved = seen.E * np.exp(-1j * after) - kept.voltage
            added = [
                gone.flux_noise(x[..., 1], change),
                gone.power_noise(moved, change) * here,
                gone.entering(change.real),
            ]
        told = {"after": after, "Pm": x[0, :, 2]}
        for n in range(m):
            Q = covariance(model, told, seen, n, added, last, model.unreported.hidden[0, n])
            scale = np.sqrt(np.maximum(Q.diagonal(), 1e-30))
            assert step.Q[0, n] / np.outer(scale, scale) == pytest.approx(Q / np.outer(scale, scale), abs=1e-5), (k, n)
        seen_as = model.observe(x, seen)
        E, theta = seen.E, model.turn
        tilt = (1 + 1j * np.tan(theta)) / E
        variance = np.full((1, m), FLOOR)
        for part in (v * tilt, known.impedance * i * tilt):
            variance += SA**2 * part.real**2 + SM**2 * part.imag**2
        if parts is not None:
            of = computed_angle_variance(parts.V, parts.I, known.impedance, tilt, angle=SA, magnitude=SM) + FLOOR
            variance = np.where(computed, of, variance)
        variance += (gone.turned(x[..., 1]) * (1 - kept.size / np.abs(E))) ** 2 * (half > 0)
        assert seen_as.variance == pytest.approx(variance)
        rate = np.where(here[0], seen.P[0] - last[0], 0.0) / ((last[3] + 1) * model.T)
        model.unreported.moved[:], model.unreported.lost[:] = 0.0, 0
        if half:
            y, both = model.angle_and_slip(x, step.Q)
            a, _ = model.acceleration(x, step.Q)
            wanted = gone.middle(x[..., :2], step.Q[..., :2, :2], acceleration=a, jerk=(-rate / (2 * known.H))[None])
            assert y == pytest.approx(wanted[0], rel=1e-12)
            assert both == pytest.approx(wanted[1], rel=1e-12)
        model.settle(x, seen)

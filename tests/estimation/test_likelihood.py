"""The fit of machine data: its likelihood beside single filters, and its search beside a known maximum."""

from types import SimpleNamespace

import numpy as np
import pytest
from uneven import uneven_point

from stabctl.estimation import fit as fitting
from stabctl.estimation._filter_bank import GATE
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import Filtered
from stabctl.estimation.pmu import Frame, Parts, Pmu
from stabctl.estimation.rotor_units import ProcessNoise, Terminals, rotor_units
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

PMU, PROCESS = Pmu(rate=50), ProcessNoise(walk=0.02)


def frames(seeds=2):
    """Reports that swing and jump; some are lost, some computed."""
    rng, (V, I) = np.random.default_rng(9), Terminals(Simulation(setup(uneven_point()))).phasors(uneven_point().V)
    m = len(V)
    for k in range(25):
        turned = np.exp(1j * (rng.normal(0, 2e-3, (2, seeds, m)) + (k == 12) * rng.normal(0, 0.3, (2, seeds, m))))
        here, none = rng.random((seeds, m)) < 0.9, np.zeros((seeds, m))
        parts = np.zeros((seeds, m, 2 * m), complex)
        computed = Parts(rng.random((seeds, m)) < 0.2, parts, parts) if k > 5 else None
        yield Frame(V * turned[0], I * turned[1] * (1 + 0.2 * (k > 8)), none, none, here, none, computed)


def test_the_likelihood_is_that_of_filters_with_these_data():
    """Each candidate by itself, over its own reports only: computed ones tell nothing."""
    known, told = rotor_units(uneven_point()), list(frames())
    factors = np.random.default_rng(1).uniform(0.7, 1.4, (2, 3, 4))
    found = fitting.likelihood(known, factors, told, pmu=PMU, process=PROCESS)
    cut = 0
    for c in range(3):
        own = rotor_units(uneven_point(), tuple(factors[0, c]), tuple(factors[1, c]))
        filters, total = Filtered(own, PMU, swing=True, process=PROCESS), np.zeros(4)
        for frame in told:
            here = frame.received if frame.parts is None else frame.received & ~frame.parts.computed
            nis = filters.step(frame._replace(received=here, parts=None)).nis
            for k, i in zip(*np.nonzero(np.isfinite(nis)), strict=True):
                total[i] -= (np.log(filters.bank.S[k, i]) + min(nis[k, i], GATE)) / 2
                cut += nis[k, i] > GATE
        assert found[c] == pytest.approx(total, rel=1e-9)
    assert cut > 0


def test_the_search_finds_maximum_and_curvature(monkeypatch):
    """Of a normal likelihood per machine; one that hardly tells the inertia, one beyond the first grid."""
    peaks = np.array([[0.13, -0.21, 0.02, 2.0], [-0.3, 0.11, 0.4, 0.05]])
    spreads = np.array([[0.02, 0.01, 0.3, 0.05], [0.03, 0.05, 0.04, 0.02]])
    asked = []

    def normal(known, factors, told, *, pmu, process):
        asked.append((known, pmu, process, told))
        apart = (np.log(factors) - peaks[:, None, :]) / spreads[:, None, :]
        return -(apart**2).sum(0) / 2

    monkeypatch.setattr(fitting, "likelihood", normal)
    control = EstimatorControl(pmu=PMU, process=PROCESS, inertia_factor=1.2, reactance_factor=0.8)
    m, on = 4, np.random.default_rng(2).random((20, 2, 4)) < 0.6
    told = list(frames())
    found = fitting.fit(SimpleNamespace(frames=told, on=on, control=control, point=uneven_point()))
    values = np.exp(peaks)
    assert found.machines == (7, 3, 12, 5)
    assert found.inertia[:2] == pytest.approx(values[0, :2], rel=1e-9)
    assert found.inertia_sigma[:2] == pytest.approx(spreads[0, :2] * values[0, :2], rel=1e-6)
    assert found.inertia[2] == 1.0
    assert np.isnan(found.inertia_sigma[2])
    most = fitting.SPAN * sum(fitting.FINER)
    assert found.inertia[3] == pytest.approx(np.exp(most))  # as far as the grids reach
    assert found.reactance == pytest.approx(values[1], rel=1e-9)
    assert found.reactance_sigma == pytest.approx(spreads[1] * values[1], rel=1e-6)
    known, pmu, process, reports = asked[0]
    plain = rotor_units(uneven_point())
    assert known.H == pytest.approx(1.2 * plain.H)
    assert known.x == pytest.approx(0.8 * plain.x)
    assert (pmu, process) == (PMU, PROCESS)
    for k, (used, frame) in enumerate(zip(reports, told, strict=True)):  # the first five frames are those at rest
        assert np.array_equal(used.received, frame.received & on[max(k - 5, 0)])
    assert m == len(known.H)


def test_a_saddle_has_no_maximum_and_the_highest_values_count_most():
    shifts = np.array(np.meshgrid(*[np.linspace(-1, 1, 7)] * 2)).reshape(2, -1)
    u, v = shifts
    at, sigma = fitting.paraboloid(shifts, -(u**2) + v**2)
    assert np.isinf([*at, *sigma]).all()
    values = -((u - 0.2) ** 2 + (v + 0.1) ** 2) * 50 + 30 * (u - 0.2) ** 4 + 20 * (u - 0.2) ** 3
    weight = np.sqrt(1 / (1 + values.max() - values) ** 2)
    terms = np.array([np.ones(len(u)), u, v, u * u, u * v, v * v])
    c = np.linalg.solve((terms * weight**2) @ terms.T, (terms * weight**2) @ values)
    bend = np.array([[2 * c[3], c[4]], [c[4], 2 * c[5]]])
    at, sigma = fitting.paraboloid(shifts, values)
    assert at == pytest.approx(-np.linalg.solve(bend, c[1:3]))
    assert sigma == pytest.approx(np.sqrt(np.linalg.inv(-bend).diagonal()))

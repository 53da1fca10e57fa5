"""Network voltages where substitution does not contract, against scipy on the same equations."""

import numpy as np
import pytest
import scipy.sparse as sp
from comparison import KEEP_ON
from in_plain_python import experiment
from scipy.optimize import root
from systems import with_shares

from stabctl.controllers import Feedback
from stabctl.devices import of
from stabctl.dynamics import _codegen, family, operating_point
from stabctl.simulation import center, frame, line, lti
from stabctl.simulation._newton_factors import eliminate, pattern, substitute
from stabctl.simulation._substitution import backward, factor, forward
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run
from stabctl.simulation.timeline import timeline


def at(run, t):
    """Row of the first record at t or later."""
    return np.searchsorted(run.time, t - 1e-9)


class TestNewtonFallback:
    """Two-area near the nose of its loads' voltage: substitution does not contract there."""

    @staticmethod
    def heavy(cases):
        return with_shares(cases("two_area"), p_current=0.0, p_power=1.0, q_power=1.0)

    @pytest.mark.parametrize(
        "fault", [Contingency("8", 0.1, ["7-8", "8-9"], at=0.1), Contingency("7-8@0.4", 0.08, at=0.1)]
    )
    def test_voltages_solve_the_network_where_substitution_would_not_contract(self, cases, fault):
        point = operating_point.solve(self.heavy(cases))
        events = fault.timed(point.case)
        traced = run(point, events, 1.5, criterion=KEEP_ON)
        changes, sources, radius = timeline(point.case, events), self.sources(point), []
        for t in (0.05, 0.12, 0.25, 0.5, 1.0):
            k = min(at(traced, t), len(traced.time) - 1)
            switching = [c for c in changes if c.at <= traced.time[k] + 1e-9][-1].switching
            Y = point.admittance(switching).toarray()

            def substituted(pairs, Y=Y, k=k):
                return np.linalg.solve(Y, sources(traced.rows[k]) + self.draws(point, pairs.view(complex))).view(float)

            v = traced.arrays.V[k].copy().view(float)
            assert np.abs(substituted(v) - v).max() < 1e-7
            slopes = [(substituted(v + e) - substituted(v - e)) / 2e-6 for e in 1e-6 * np.eye(len(v))]
            radius.append(np.abs(np.linalg.eigvals(np.array(slopes))).max())
        assert max(radius) > 1  # 2.6
        assert traced.newton_stages > 100

    @staticmethod
    def sources(point):
        """Currents (buses) of the machines' sources in a row of signals, in plain Python."""

        def currents(row):
            out = np.zeros(len(point.V), complex)
            for f in (f for f in point.system.families if f.device.has("source")):
                for w, k in zip(f.w, f.k, strict=True):
                    state = row[w[family.STATE] : w[family.STATE] + len(f.device.State._fields)]
                    bus = (w[family.BUS] - point.layout.nx) // 2
                    known = {"x": f.device.State(*state), "p": f.device.Par(*k)}
                    if f.device.has("internal"):
                        known["i"] = f.device.evaluate("internal", known)
                    out[bus] += complex(*f.device.evaluate("source", known))
            return out

        return currents

    @staticmethod
    def draws(point, V):
        """Currents (buses) of the loads, in plain Python."""
        out, f = np.zeros(len(V), complex), point.system.family("zip_load")
        for w, k in zip(f.w, f.k, strict=True):
            bus = (w[family.BUS] - point.layout.nx) // 2
            out[bus] += complex(*f.device.current((V[bus].real, V[bus].imag), f.device.Par(*k)))
        return out

    def test_a_sampled_storage_law_acts_on_the_signals_of_an_earlier_frame(self, cases):
        """Its orders, recomputed from the run: three frames late, in proportion to the speed against the others'."""
        point = operating_point.solve(self.heavy(cases).with_storage("50MW"))
        law = Feedback(0.002, min_voltage=0.0).sampled(60, "50ms")
        traced = run(point, Contingency("8", 6 / 60, ["7-8", "8-9"], at=0.1), 0.6, law, criterion=KEEP_ON)
        assert "newton" in point.system.kept, "substitution would do"
        H, speed = point.inertia, traced.arrays.speed
        deviation = speed - ((speed @ H)[:, None] - speed * H) / (H.sum() - H)
        wanted = 0.002 * 2 * np.pi * 60 * np.array([m.base for m in point.case.machines]) / 50 * deviation
        frames = [at(traced, k / 60) for k in range(36)]
        assert np.abs(wanted).max() > 0.03  # 0.035 of the rating
        assert np.abs(traced.arrays.order[frames[3:]] - wanted[frames[:-3]]).max() < 1e-12  # 6e-15

    @pytest.mark.parametrize("device", [center, frame, line, lti])
    def test_families_with_a_loop_of_their_own_exist_for_complex_numbers(self, device):
        assert _codegen.address(device.__name__.rpartition(".")[2], of(device), complex) is not None

    @pytest.mark.slow
    @pytest.mark.parametrize("method", ["keep", "descend", "creep", "newton"])
    def test_it_agrees_with_scipy_on_the_same_equations(self, cases, weakened, method):
        """Sources weakened, so that one load and then both fall below their thresholds.

        Newton's steps may stop at the kink between; slowly they find the solution that there always is.
        """
        point, ended = operating_point.solve(self.heavy(cases)), []
        Y, own = point.admittance().toarray(), self.sources(point)(point.s)
        for name in (name for name in weakened if name.startswith(f"{method} ")):
            source, (found, *V) = float(name.split()[1]) * own, weakened[name]
            ended.append(bool(found))
            if not found:
                assert np.array_equal(V, point.V) or method in ("keep", "descend")
                continue

            def miss(pairs, source=source):
                V = np.ascontiguousarray(pairs).view(complex)
                return np.linalg.solve(Y, Y @ V - source - self.draws(point, V)).view(float)

            pairs = np.array(V).view(float)
            theirs = root(miss, pairs, tol=1e-12)
            assert np.abs(theirs.fun).max() < 1e-12  # 7e-16; it may call a stop at rounding no success
            assert np.abs(theirs.x - pairs).max() < {"creep": 1e-6, "newton": 1e-6}.get(method, 1e-9)
        assert all(ended) == (method in ("creep", "newton"))
        assert sum(ended) > 1

    def test_a_start_from_no_load_finds_the_solution_beyond_a_kink(self, weakened):
        """As the sources rise, Newton steps from the present voltages end nowhere, those from no load do."""
        assert weakened["tried"].tolist() == [False, True]
        assert np.abs(weakened["risen"]).max() < 1e-10  # the voltages of the power flow


@pytest.fixture(scope="module")
def weakened(tmp_path_factory):
    return experiment("newton", tmp_path_factory.mktemp("newton"))


def test_factors_with_slopes_solve_the_equations_in_real_and_imaginary_parts():
    """Any matrix, also where its rows had to be exchanged for the pivots, against dense real equations."""
    exchanged = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 40))
        A = (rng.random((n, n)) < 2 / n) * (rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n)))
        Y = A + A.T + np.diag(rng.random(n) * (seed % 3))
        bus = np.sort(rng.choice(n, int(rng.integers(1, n + 1)), replace=False))
        slopes = rng.normal(size=(len(bus), 2)) + 1j * rng.normal(size=(len(bus), 2))
        try:
            F = factor(sp.csc_matrix(Y), bus)
        except RuntimeError:
            continue  # singular
        exchanged += not np.array_equal(F.back, F.cols)
        of = pattern(F, bus)
        M, x = np.zeros((len(of.S), 4)), np.zeros(n, complex)
        current, v = rng.normal(size=n) + 1j * rng.normal(size=n), np.zeros(n, complex)
        assert eliminate(of, 1.0, slopes, M)
        forward(F, current, x)
        substitute(of, M, x[int(F.again[0]) :].view(float).reshape(-1, 2))
        backward(F, x, v)
        real = np.kron(Y.real, np.eye(2)) + np.kron(Y.imag, [[0.0, -1.0], [1.0, 0.0]])
        for d, (p, q) in zip(2 * bus, slopes, strict=True):
            real[d : d + 2, d : d + 2] -= [[p.real, q.real], [p.imag, q.imag]]
        wanted = np.linalg.solve(real, current.view(float)).view(complex)
        assert np.abs(v - wanted).max() < 1e-10 * np.abs(wanted).max() * np.linalg.cond(real), seed
    assert exchanged > 3


def test_slopes_that_cancel_the_admittances_have_no_factors():
    F = factor(sp.csc_matrix(np.diag([2.0 - 1j, 3.0])), [0, 1])
    of, M = pattern(F, np.array([0, 1])), np.zeros((2, 4))
    assert eliminate(of, 1.0, np.array([[1.0, 0.5], [1.0, 1.0]], complex), M)
    assert not eliminate(of, 1.0, np.array([[2.0 - 1j, 1.0 + 2j], [1.0, 1.0]], complex), M)
    assert not eliminate(of, 1.0, np.array([[np.nan, 0.0], [1.0, 1.0]], complex), M)

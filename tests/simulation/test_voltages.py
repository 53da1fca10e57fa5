"""Network voltages where substitution does not contract, against scipy on the same equations."""

import numpy as np
import pytest
from comparison import KEEP_ON
from scipy.optimize import root
from systems import with_shares

from stabctl.controllers import Feedback
from stabctl.devices import of
from stabctl.dynamics import _codegen, family, operating_point
from stabctl.dynamics.program import program
from stabctl.model.network import UNSWITCHED
from stabctl.simulation import _newton, _voltages, center, frame, line, lti
from stabctl.simulation._buffers import NOTE, buffers, dense, newton_space
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run
from stabctl.simulation.timeline import timeline
from stabctl.simulation.topology import stage
from stabctl.simulation.wired import wired


def at(run, t):
    """Row of the first record at t or later."""
    return np.searchsorted(run.time, t - 1e-9)


class TestNewtonFallback:
    """Two-area near the nose of its loads' voltage: substitution does not contract there."""

    @staticmethod
    def heavy(cases):
        case = cases("two_area")
        return with_shares(case, p_current=0.0, p_power=1.0, q_power=1.0)

    def test_voltages_solve_the_network_where_substitution_would_not_contract(self, cases):
        point = operating_point.solve(self.heavy(cases))
        events = Contingency("8", 6 / 60, ["7-8", "8-9"], at=0.1).timed(point.case)
        traced = run(point, events, 1.5, criterion=KEEP_ON)
        changes, sources, radius = timeline(point.case, events), self.sources(point), []
        for t in (0.05, 0.12, 0.25, 0.5, 1.0):
            k = min(at(traced, t), len(traced.time) - 1)
            switching = [c for c in changes if c.at <= traced.time[k] + 1e-9][-1].switching
            Y = point.admittance(switching).toarray()

            def substituted(pairs, Y=Y, k=k):
                return np.linalg.solve(Y, sources(traced.rows[k]) + self.draws(point, pairs.view(complex))).view(float)

            v = traced.arrays.V[k].copy().view(float)
            assert np.abs(substituted(v) - v).max() < 1e-6
            slopes = [(substituted(v + e) - substituted(v - e)) / 2e-6 for e in 1e-6 * np.eye(len(v))]
            radius.append(np.abs(np.linalg.eigvals(np.array(slopes))).max())
        assert max(radius) > 1  # 2.6

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

    def test_factors_of_an_earlier_instant_give_the_same_voltages(self, cases):
        """Kept while the sources change; near the kinks, where they do not help, present ones are made."""
        point = operating_point.solve(self.heavy(cases))
        made, p = wired(point, None), program(wired(point, None).families, complex)
        net, own = stage(point, UNSWITCHED).net, self.sources(point)(point.s)
        kept, made_again = _newton.Slopes().of(net), 0
        for scale in (1.0, 0.995, 0.99, 0.97, 0.96, 0.9, 0.8, 1.0):
            found = []
            for slopes in (kept, _newton.Slopes().of(net)):
                q, before = buffers(made.start, made.layout, made.places), slopes.factors
                q.solve.source[:] = scale * own
                if _newton.sparse(p.current, p, made.places, net, q, newton_space(q), False, slopes):
                    found.append(q.volt)
                made_again += slopes is kept and slopes.factors is not before
            assert len(found) in (0, 2)
            if found:
                assert np.abs(found[0] - found[1]).max() < 1e-7
        assert 1 < made_again < 8

    @pytest.mark.parametrize("many", [0, 200])
    def test_singular_slopes_are_no_solution(self, cases, monkeypatch, many):
        """Of the dense and of the sparse method: the voltages are unchanged, and a bus with a load is named."""
        point = operating_point.solve(self.heavy(cases))
        made, net = wired(point, None), stage(point, UNSWITCHED).net
        q, p = buffers(made.start, made.layout, made.places), program(made.families, complex)
        q.solve.source[:], q.notes[NOTE.bus] = 0.9 * self.sources(point)(point.s), -1
        before = q.volt.copy()

        def singular(*_, **__):
            raise np.linalg.LinAlgError if not many else RuntimeError

        monkeypatch.setattr(_newton, "MANY", 0 if many else 200)
        monkeypatch.setattr(*((_newton.spl, "splu") if many else (_newton._voltages, "newton_from")), singular)
        kept = _newton.Slopes().of(net)
        assert not _newton.newton(p.current, p, made.places, net, q, newton_space(q), kept=kept)
        assert np.array_equal(q.volt, before)

    @pytest.mark.parametrize("slow", [False, True])
    @pytest.mark.parametrize("scale", [1.0, 0.97, 0.96, 0.955, 0.95, 0.945, 0.94, 0.93, 0.92, 0.9, 0.8, 0.6, 0.3, 0.1])
    def test_it_agrees_with_scipy_on_the_same_equations(self, cases, scale, slow):
        """Sources weakened to `scale`, so that one load and then both fall below their thresholds.

        Plain Newton may stop at the kink between; slowly it finds the solution that there always is.
        """
        point = operating_point.solve(self.heavy(cases))
        made = wired(point, None)
        source = scale * self.sources(point)(point.s)
        Y = point.admittance().toarray()

        def miss(pairs):
            V = np.ascontiguousarray(pairs).view(complex)
            return np.linalg.solve(Y, Y @ V - source - self.draws(point, V)).view(float)

        q = buffers(made.start, made.layout, made.places)
        q.solve.source[:] = source
        p, net = program(made.families, complex), stage(point, UNSWITCHED).net
        found = _voltages.newton_from(
            p.current, p, made.places, net, q, newton_space(q), dense(len(made.places.draw_bus)), slow
        )
        assert found or not slow
        other = buffers(made.start, made.layout, made.places)
        other.solve.source[:] = source
        kept = _newton.Slopes().of(net)
        assert _newton.sparse(p.current, p, made.places, net, other, newton_space(other), slow, kept) == found
        assert np.abs(other.volt - q.volt).max() < 3e-7  # 1.8e-7: the dense method ends at a residual of 1e-7
        if found and not slow:
            assert np.abs(miss(other.volt.view(float))).max() < 2e-9
        assert found or other.notes[NOTE.bus] == q.notes[NOTE.bus]
        if found:
            assert np.abs(miss(q.volt.view(float))).max() < 2e-7
            theirs = root(miss, q.volt.view(float), tol=1e-12)
            assert np.abs(theirs.fun).max() < 1e-12  # 7e-16; it may call a stop at rounding no success
            assert np.abs(theirs.x.view(complex) - q.volt).max() < 1e-6

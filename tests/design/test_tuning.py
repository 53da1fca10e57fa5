"""Tuning of all controllers at once: its derivatives, its plants and what it finds."""

import sqlite3
from contextlib import closing
from dataclasses import replace

import control
import numpy as np
import pytest
from ringdown import modal_pole

from stabctl._util.errors import StudyError
from stabctl.design import damper, outages, pi, stabilizers, tune, values
from stabctl.design.tuning.blocks import noise_size
from stabctl.design.tuning.networks import networks
from stabctl.design.tuning.parts import Asked, Parts
from stabctl.design.tuning.problem import LOWER, WEIGHT, Peak, frequencies, spare, summits
from stabctl.design.tuning.robustness import shorter
from stabctl.design.tuning.search import Search, bent
from stabctl.smallsignal.closed_loop import closed_loop

STORAGE = "3@11=50MW"
KINDS = {
    "lead-lag": [stabilizers(stages=3)],
    "pss": [stabilizers(model="pss")],
    "ieeest": [stabilizers([1, 3], model="ieeest"), stabilizers([2, 4], gain=-3)],
    "pss2b": [stabilizers(model="pss2b", stages=3)],
    "late": [stabilizers(), damper("deviation:1+2", "order:3@11", delay=("50ms", "150ms"), notch=(2, 6))],
    "direct path": [stabilizers([1]), damper("flow:7-8", "order:3@11", gain=0.3, fast=1), pi("voltage:7", "vref:2")],
    "case": [stabilizers([1, 2]), values("sexs.KA"), values("genrou.H", together=True)],
}


def made(cases, kind, *, intact=True, **asked):
    """The parts and the problem of one kind of devices."""
    devices, point = KINDS[kind], cases("two_area_thyristor").initialize(storage=STORAGE)
    every, _ = networks(point, devices, "none" if intact else "all", (1.0,), ())
    parts = Parts.of(every, devices)
    more = {"damping": None, "gains": (0.7,), "doubled": 0.0, "peaks": (), "one_out": True} | asked
    return parts, parts.problem(Asked(**more))


def again(trial, where):
    """The value of a row at other parameters: of its mode, or of the sensitivity at its frequency."""
    problem, k = trial.problem, where.key[0]
    if k >= 0:
        one = problem.scenarios[k]
        s = trial.loop(one.plant, one.factors).eigenvalues
        near = s[[np.abs(s - where.at).argmin()]]
        return float(spare(near)[0]) - (one.floor or 0.0)
    loop, peak = trial.loop(-1 - k), problem.peaks[where.key[1]]
    S = loop.sensitivity(np.array([where.at.imag]))[0] - peak.shift * np.eye(loop.nu)
    size = np.linalg.norm(S, 2) if peak.together else abs(S[where.key[2], where.key[2]])
    return WEIGHT * float(np.log(peak.bound / size))


def test_a_controller_is_out_in_intact_networks_alone(cases):
    parts, problem = made(cases, "lead-lag", intact=False)
    intact = [k for k, owner in enumerate(parts.owner) if parts.networks[owner].intact]
    assert 0 < len(intact) < len(parts.plants)
    out = [(s.plant, i) for s in problem.scenarios for i in np.flatnonzero(s.factors == 0)]
    assert out == [(k, i) for k in intact for i in range(len(parts.tunables))]
    assert all(
        f" without {parts.tunables[i].name}" in s.name
        for s in problem.scenarios
        for i in np.flatnonzero(s.factors == 0)
    )


def test_starts_are_those_of_a_seed(cases):
    parts, problem = made(cases, "lead-lag")
    one, again, other = (list(parts.starts(problem, 3, seed)) for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not any(np.array_equal(a, b) for a in one for b in other)
    assert len({tuple(start) for start in one}) == 3


@pytest.mark.parametrize("kind", KINDS)
def test_every_row_has_the_derivative_that_differences_give(cases, kind):
    """Modes, doubled gains, a controller out, peaks of each loop and of all together: 1e-5 of the largest (3e-6)."""
    peaks = (Peak(1.02), Peak(0.6, 0.5), Peak(1.05, 0.0, True))
    parts, problem = made(cases, kind, peaks=peaks)
    rng = np.random.default_rng(3)
    p = next(parts.starts(problem, 1, 0)) + 0.1 * rng.standard_normal(len(problem.low))
    p[parts.laws.at[:-1]] -= 1.0  # small gains: stable, so that peaks have a meaning
    every, plants = list(range(len(problem.scenarios))), list(range(len(problem.plants)))
    trial = problem.at(p)
    stable = [k for k in plants if trial.loop(k).eigenvalues.real.max() < 0]
    rows = trial.rows(every, stable, 0.2, 8)
    assert {one.key[0] >= 0 for one in rows.where} == ({True, False} if stable else {True})
    direction = rng.standard_normal((6, len(p))) / np.sqrt(len(p))
    step, checked = 1e-4, 0
    for d in direction:
        ends = [problem.at(p + k * step * d) for k in (1, -1, 2, -2)]
        for value, slope, where in zip(rows.value, rows.slope, rows.where, strict=True):
            pair = [again(end, where) for end in ends]
            checked += 1
            found, want = slope @ d, (8 * (pair[0] - pair[1]) - (pair[2] - pair[3])) / (12 * step)
            assert found == pytest.approx(want, rel=1e-5, abs=1e-5 * max(0.1, np.abs(slope).max())), where
            assert abs(pair[0] - value) < 1e-2
    assert checked > 6 * 6


def test_gains_that_are_lowered_are_rows_with_their_derivatives(cases):
    """K and the gain at high frequencies of every controller, relative to its bound; they are linear in p."""
    parts, asked = made(cases, "pss")[0], Asked(0.1, (), 0.0, (), False)
    problem = parts.problem(asked, lowered=True)
    p = next(parts.starts(problem, 1, 0))
    rows, d = problem.at(p).rows([], [], 0.2, 8), np.random.default_rng(4).standard_normal(len(p))
    assert len(rows.value) == 2 * len(parts.tunables)
    for k, t in enumerate(parts.tunables):
        v = np.exp(parts.laws.parts(p)[k])
        wanted = t.structure.variables[0].high / v[0], t.fast / np.exp(t.structure.fast @ np.log(v))
        assert [rows.value[k], rows.value[k + len(parts.tunables)]] == pytest.approx(LOWER * np.log(wanted))
    change = problem.at(p + d).spared - problem.at(p).spared
    assert np.array(rows.slope) @ d == pytest.approx(change)


@pytest.mark.parametrize("kind", ["lead-lag", "pss2b", "late", "direct path"])
def test_noise_is_the_mean_square_of_the_frequency_response(cases, kind):
    """By python-control on a fine grid of 0.1 to 30 Hz: 1e-4; its derivatives by differences: 1e-6."""
    parts, problem = made(cases, kind)
    for t, logs in zip(parts.tunables, parts.laws.parts(next(parts.starts(problem, 1, 1))), strict=True):
        size, slope = noise_size(t.structure, logs)
        hz = np.geomspace(0.1, 30, 2_000)
        n = len(t.inputs)
        M = t.structure.matrix(np.exp(logs))
        K = control.ss(M[1:, n:], M[1:, :n], M[:1, n:], M[:1, :n])(2j * np.pi * hz, squeeze=False)
        variance = np.trapezoid((np.abs(K) ** 2).sum(axis=(0, 1)), hz) / (hz[-1] - hz[0])
        assert size == pytest.approx(np.sqrt(variance), rel=1e-4)
        steps = 1e-4 * np.eye(len(logs))
        ends = [[np.log(noise_size(t.structure, logs + k * e)[0]) for e in steps] for k in (1, -1)]
        assert slope == pytest.approx((np.array(ends[0]) - ends[1]) / 2e-4, abs=1e-6)


@pytest.mark.slow
def test_the_reserve_for_noise_is_kept(cases):
    """Half of the limits: a limit that the search meets and reaches, with less damping than without it."""
    point = cases("two_area_thyristor").initialize()
    options = {"outages": "none", "levels": (1.0,), "gains": (), "check_levels": (), "checks": 0, "starts": 1}
    loud, calm = (tune(point, stabilizers(noise=4e-4, limits=0.05), reserve=r, **options) for r in (None, 0.5))
    shares = [dict(found.reserves) for found in (loud, calm)]
    assert min(shares[0].values()) < 0.2
    assert min(shares[1].values()) == pytest.approx(0.5, abs=2e-3)
    assert calm.reached
    assert 0.1 < calm.damping < loud.damping
    assert "Three standard deviations of the noise leave 0.50 of the limits of vs" in str(calm)
    rng, c = np.random.default_rng(3), calm.controllers[0]  # its own output, 10 minutes at 60 samples a second
    K, T = control.ss(c.A, c.B, c.C, c.D), np.arange(36_000) / 60
    u = control.forced_response(K, T, 4e-4 * rng.standard_normal(len(T))).outputs
    assert 3 * u.std() == pytest.approx(0.05 * (1 - shares[1][c.name]), rel=0.2)


@pytest.mark.parametrize("kind", ["lead-lag", "late", "ieeest", "direct path"])
def test_no_parameters_within_the_bounds_are_quieter_than_those_that_are_called_so(cases, kind):
    parts, problem = made(cases, kind)
    rng = np.random.default_rng(1)
    for t, low, high in zip(parts.tunables, parts.laws.parts(problem.low), parts.laws.parts(problem.high), strict=True):
        if not any(v.name == "f" for v in t.structure.variables):  # a notch
            least = noise_size(t.structure, t.quietest)[0]
            assert all(noise_size(t.structure, rng.uniform(low, high))[0] >= least for _ in range(50))


@pytest.mark.parametrize("kind", ["lead-lag", "ieeest", "late", "direct path"])
def test_the_plants_closed_have_the_modes_of_the_closed_loop(cases, kind):
    """Eigenvalues as of `closed_loop` with the controllers: 1e-6 1/s (2e-9), with delays below 3 Hz 1e-3 (2e-5)."""
    parts, problem = made(cases, kind)
    p = next(parts.starts(problem, 1, 1))
    loop = problem.at(p).loop(0)
    v = [np.exp(part) for part in parts.laws.parts(p)]
    controllers = [t.controller(one) for t, one in zip(parts.tunables, v, strict=True)]
    s = closed_loop(parts.networks[0].point, *controllers).eigenvalues()
    late = any(c.delay for c in controllers)
    s = s[(np.abs(s) > 1e-3) & (np.abs(s) < (20 if late else np.inf))]
    assert len(s) >= 20
    assert np.abs(s[:, None] - loop.eigenvalues).min(axis=1).max() < (1e-3 if late else 1e-6)


@pytest.mark.parametrize("model", ["pss", "ieeest", "pss2b"])
def test_a_packaged_stabilizer_in_the_case_gives_the_same_modes(cases, model):
    """The case with the tuned parameters as devices, linearized anew: 1e-6 1/s (3e-9)."""
    parts, problem = made(cases, model)
    p = next(parts.starts(problem, 1, 2))
    case = parts.networks[0].point.case
    for t, part in zip(parts.tunables, parts.laws.parts(p), strict=True):
        if t.machine is not None:
            case = case.with_device(model, t.machine, **t.structure.values(np.exp(part)))
    own = [
        t.controller(np.exp(part))
        for t, part in zip(parts.tunables, parts.laws.parts(p), strict=True)
        if t.machine is None
    ]
    s = case.closed_loop(*own).eigenvalues()
    s = s[np.abs(s) > 1e-3]
    assert np.abs(s[:, None] - problem.at(p).loop(0).eigenvalues).min(axis=1).max() < 1e-6


def test_peaks_are_those_of_python_control(cases):
    """|S| and the disk margin's |S - 1/2| of loops of ten plants: H-infinity norms within 1 % (largest 2e-4)."""
    checked = 0
    for kind in ("lead-lag", "ieeest", "direct path", "late"):
        parts, problem = made(cases, kind, intact=False)
        p = next(parts.starts(problem, 1, 0)) - np.log(2) * (np.arange(len(problem.low)) == parts.laws.at[0])
        trial = problem.at(p)
        for k in range(len(problem.plants)):
            loop = trial.loop(k)
            if loop.eigenvalues.real.max() > 0:
                continue
            i, shift = k % loop.nu, 0.5 * (k % 2)
            own = control.ss(loop.A, loop.B[:, [i]], loop.out[[i]], [[loop.N[i, i] - shift]])
            assert highest_of(loop, shift, i) == pytest.approx(control.norm(own, p="inf", tol=1e-3), rel=0.01)
            checked += 1
    assert checked >= 8


def highest_of(loop, shift, i):
    """The largest |S - shift| of one loop."""
    peak = Peak(1.0, shift)
    w = frequencies(loop)
    edge = float(np.abs(loop.alone(w)[:, i] - shift).max())
    return max([edge, *(size for size, _, k in summits(loop, peak, 0.5) if k == i)])


# What is found.


@pytest.fixture(scope="module")
def tuned(cases):
    """Stabilizers of Kundur's system, over its outages and two load levels."""
    return tune(cases("two_area_thyristor"), stabilizers(gain=10, fast=120), levels=(0.9, 1.0), starts=2)


@pytest.mark.slow
def test_the_worst_damping_is_that_of_the_closed_loops(cases, tuned):
    """Each network is built anew and closed with the controllers; all modes above 0.1 Hz count, at three gains."""
    case, found = cases("two_area_thyristor"), []
    points = [p for level in (0.9, 1.0) for p in outages(case.with_load_level(level) if level < 1 else case)]
    assert len(points) == len(tuned.before) == 6
    for factor in (1.0, 0.7, 1.3):
        own = [c.scaled(factor) for c in tuned.controllers]
        every = [p.closed_loop(*own).modes() for p in points]
        found.append(min(m.damping_ratio[m.frequency_hz > 0.1].min() for m in every))
        assert all(m.stable for m in every)
    assert found[0] == pytest.approx(tuned.damping, abs=1e-6)
    assert tuned.damping > 0.25
    assert min(found) > tuned.damping - 0.06
    assert tuned.sensitivity[0] <= 2
    assert tuned.ring_down.difference < 0.01
    assert len(tuned.checks) == 3
    twice = [c.scaled(2.0) for c in tuned.controllers]
    least = min(m.damping_ratio[m.frequency_hz > 0.1].min() for m in (p.closed_loop(*twice).modes() for p in points))
    assert least == pytest.approx(tuned.doubled.damping, abs=1e-6)
    assert least >= 0


def test_the_gains_at_high_frequencies_are_kept(tuned):
    for c, (_, allowed, found) in zip(tuned.controllers, tuned.gains, strict=True):
        assert found <= allowed * (1 + 1e-9)
        assert abs(c.D[0, 0]) == pytest.approx(found)


def test_networks_outside_the_tuning_are_damped_too(cases, tuned):
    """A level between, and gains each its own: no less than 70 % of the worst damping (86 %)."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        own = [c.scaled(float(k)) for c, k in zip(tuned.controllers, rng.uniform(0.8, 1.2, 4), strict=True)]
        modes = cases("two_area_thyristor").with_load_level(0.95).initialize().closed_loop(*own).modes()
        assert modes.damping_ratio[modes.frequency_hz > 0.1].min() > 0.7 * tuned.damping


def test_the_table_of_what_it_was_not_tuned_for_is_that_of_closed_loops(cases, tuned):
    """Random gains, a controller out, and another load level, each computed anew from the case."""
    table, case = tuned.holds.set_index("what")["damping_ratio"], cases("two_area_thyristor")

    def least(point, controllers):
        modes = point.closed_loop(*controllers).modes()
        return modes.damping_ratio[modes.frequency_hz > 0.1].min()

    points = [p for level in (0.9, 1.0) for p in outages(case.with_load_level(level) if level < 1 else case)]
    for k in (0.7, 1.3, 2.0):
        own = [c.scaled(k) for c in tuned.controllers]
        assert table[f"all gains x {k:g}"] == pytest.approx(min(least(p, own) for p in points), abs=1e-6)
    out = [[c for c in tuned.controllers if c is not gone] for gone in tuned.controllers]
    intact = [points[0], points[3]]
    wanted = min(least(p, own) for p in intact for own in out)
    assert table["one controller out, no other outage"] == pytest.approx(wanted, abs=1e-6)
    rng = np.random.default_rng(0)
    draws = [rng.uniform(0.7, 1.3, 4) for _ in range(10)]
    every = [[c.scaled(float(k)) for c, k in zip(tuned.controllers, d, strict=True)] for d in draws]
    wanted = min(least(p, own) for p in points for own in every)
    assert table["each gain +-30 %, worst of 10 draws"] == pytest.approx(wanted, abs=1e-6)


@pytest.mark.slow
def test_a_level_that_was_not_tuned_for_is_checked(cases):
    found = tune(cases("two_area_thyristor"), levels=(1.0,), gains=(), outages="none", starts=1, check_levels=(0.8,))
    modes = cases("two_area_thyristor").with_load_level(0.8).initialize().closed_loop(*found.controllers).modes()
    least = modes.damping_ratio[modes.frequency_hz > 0.1].min()
    assert found.holds["damping_ratio"].iloc[-1] == pytest.approx(least, abs=1e-6)
    assert "80 %" in found.holds["what"].iloc[-1]


def test_a_clearing_time_that_falls_is_named(cases, tuned):
    worse = [replace(c, after=c.before, before=c.after) for c in tuned.checks]
    assert len(shorter(worse)) == 3
    text = str(replace(tuned, remarks=tuple(replace(tuned, checks=tuple(worse))._remarks())))
    assert text.count("A clearing time falls by more than 1/8 cycle") == 3


@pytest.mark.slow
def test_threads_change_nothing(cases, tuned):
    again = tune(cases("two_area_thyristor"), stabilizers(gain=10, fast=120), levels=(0.9, 1.0), starts=2, workers=1)
    assert again.parameters.equals(tuned.parameters)


@pytest.mark.slow
def test_an_interrupted_tuning_goes_on_where_it_was(cases, tuned, tmp_path, monkeypatch):
    """After three rounds it is interrupted; those are not run again, and the result is the same to the last bit."""
    ran, run = [], Search.run

    def interrupted(search, steps):
        if len(ran) == 3:
            raise KeyboardInterrupt
        ran.append(steps)
        return run(search, steps)

    def call():
        own = stabilizers(gain=10, fast=120)
        return tune(cases("two_area_thyristor"), own, levels=(0.9, 1.0), starts=2, store=tmp_path, workers=1)

    monkeypatch.setattr(Search, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        call()
    rest = []
    monkeypatch.setattr(Search, "run", lambda search, steps: rest.append(steps) or run(search, steps))
    assert call().parameters.equals(tuned.parameters)
    assert ran + rest == [8, 8, 10, 12, 12]
    (store,) = tmp_path.glob("tuning*")
    with closing(sqlite3.connect(store)) as base:  # two starts from the same parameters have rows of their own
        assert base.execute("SELECT COUNT(*) FROM tuning").fetchone() == (5,)
    rest.clear()
    assert call().parameters.equals(tuned.parameters)
    assert rest == []


def test_a_ring_down_decays_as_the_least_damped_mode_does(tuned):
    """The modal coordinate of the nonlinear simulation after a pulse of 1 MW: frequency and decay within 2e-2."""
    wanted, found = modal_pole(tuned.base, *tuned.controllers, bus=7, seconds=1.5)
    assert abs(found.imag / wanted.imag - 1) < 2e-2
    assert abs(found.real / wanted.real - 1) < 2e-2


@pytest.mark.slow
def test_once_the_damping_is_reached_the_gains_are_lowered(cases, tuned):
    """15 % with gains x 0.7, too, needs 62 % of the gains, K and at high frequencies; no damping is left over."""
    few = tune(cases("two_area_thyristor"), stabilizers(gain=10, fast=120), damping=0.15, levels=(0.9, 1.0), starts=1)
    assert few.reached
    assert few.lowered
    assert 0.15 <= min(few.damping, few.holds["damping_ratio"][0], few.holds["damping_ratio"][1]) < 0.152

    def largest(found):
        K = found.parameters.query("parameter == 'K'")
        return max((K["value"] / K["high"]).max(), *(own / most for _, most, own in found.gains))

    assert largest(few) < 0.7 * largest(tuned)


def test_curvature_follows_the_gradient_and_stays_positive():
    """The secant condition where the gradient rises along the step; otherwise a fifth of the curvature remains."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        root, d, y = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=3)
        H = root @ root.T + np.eye(3)
        new, before = bent(H, d, y), d @ H @ d
        assert np.linalg.eigvalsh(new).min() > 0
        assert d @ new @ d == pytest.approx(max(y @ d, 0.2 * before))
        if y @ d >= 0.2 * before:
            assert new @ d == pytest.approx(y)


@pytest.mark.slow
def test_limits_that_all_networks_miss_leave_the_damping_in_the_working_set(cases):
    """A floor that no gains reach at first, in more scenarios than a working set holds."""
    found = tune(cases("ieee39"), stabilizers([1, 2]), levels=(1.0,), doubled=0.3, starts=1, checks=0, check_levels=())
    devices = [stabilizers()]
    parts = Parts.of(networks(cases("ieee39"), devices, "all", (1.0,), ())[0], devices)
    problem = parts.problem(Asked(None, (), 0.5, (), False))
    search = Search(problem, next(parts.starts(problem, 1, 0)))
    search.check(deep=False)
    floors = [problem.scenarios[k].floor for k in search.which]
    assert sum(floor is not None for floor in floors) >= 14  # all that a working set holds
    assert sum(floor is None for floor in floors) >= 8
    assert found.reached or "Not reached: a damping ratio of 0.3 with doubled gains" in str(found)
    assert found.reached == (found.doubled.damping >= 0.3 and found.damping >= 0 and found.sensitivity[0] <= 2)


@pytest.mark.slow
def test_a_packaged_stabilizer_is_written_back(cases, tmp_path):
    """The case of the result has the same worst damping, and so has its DYR record."""
    found = tune(
        cases("two_area_thyristor"), stabilizers(model="ieeest", gain=20), outages="none", levels=(1,), starts=1
    )
    modes = found.case.modes()
    assert modes.damping_ratio[modes.frequency_hz > 0.1].min() == pytest.approx(found.damping, abs=1e-6)
    assert found.damping > 0.2
    lines = found.save_dyr(tmp_path / "k.dyr").read_text().splitlines()
    assert len(lines) == 4
    assert lines[0].startswith("1 'IEEEST' 1 1 0 ")
    assert len(lines[0].split()) == 3 + 19 + 1  # bus, model, identifier; constants; slash


@pytest.mark.slow
def test_parameters_of_the_case_are_tuned(cases):
    """The gains of the exciters alone: more damping, confirmed in the case of the result."""
    case = cases("two_area_pss")
    gains = values("pss.K", within=(0.2, 5), together=True)
    found = tune(case, gains, outages="none", levels=(1.0,), gains=(), starts=1)
    before, after = case.modes(), found.case.modes()
    worst = [m.damping_ratio[m.frequency_hz > 0.1].min() for m in (before, after)]
    assert worst[1] == pytest.approx(found.damping, abs=1e-6)
    assert worst[1] > worst[0] + 0.02
    assert not found.controllers
    with pytest.raises(StudyError, match="There is no controller: the result is values of the case"):
        _ = found.controller
    assert str(found).startswith("Worst of all networks")
    assert "not reached" not in str(found)
    assert "The required damping is not reached, short by up to 0.01" in str(replace(found, short=0.01))


@pytest.mark.slow
def test_equal_stages_have_exact_delayed_modes_and_margins(cases):
    """Two equal lags leave A without a full set of eigenvectors: the margins are those of stages 0.1 % apart (1e-3)."""
    chain = stabilizers([1], stages=2, washout=(10, 10)).tunables(cases("two_area_thyristor"))[0]

    def controllers(apart):
        v = np.array([10.0, 10.0, 1.0, 0.5, 1.0, 0.5 * (1 + apart)])
        one = chain.controller(v)
        return [replace(one, inputs=f"speed:{n}", outputs=f"vs:{n}", name=f"pss {n}") for n in (1, 2, 3, 4)]

    point = cases("two_area_thyristor").initialize()
    equal, near = (point.margins(*controllers(apart)) for apart in (0.0, 1e-3))
    assert 0.01 < near.delay < 1
    assert equal.delay == pytest.approx(near.delay, rel=5e-3)
    assert equal.gain_up == pytest.approx(near.gain_up, rel=5e-3)
    late = point.closed_loop(*(c.delayed("5ms") for c in controllers(0.0))).modes()
    assert "all found" in str(late)


@pytest.mark.slow
def test_the_simulations_are_those_of_the_level_nearest_1(cases):
    few = {"gains": (), "outages": "none", "starts": 1, "check_levels": (), "checks": 0}
    more = {"fast": 1e3, "stages": 1}
    own = [damper(f"deviation:{i}", "order:1@5", gain=gain, **more) for i, gain in ((1, 500), (3, -500))]
    base = cases("two_area_thyristor").with_storage("50MW")
    found = tune(base, own, levels=(0.8, 1.0), **few)
    assert found.case.name == found.base.case.name == "two_area_thyristor"
    assert "The simulations are at" not in str(found)
    K = found.parameters.query("parameter == 'K'")
    assert K["value"].gt(0).tolist() == [True, False]
    assert K[["low", "high"]].values.tolist() == [[0.5, 500], [-500, -0.5]]
    assert list(found.largest_gains) == ["order 1@5 tuned (deviation 1)", "order 1@5 tuned (deviation 3)"]
    part = tune(base, own, levels=(0.8,), **few)
    assert "The simulations are at 80 % of the load." in str(part)

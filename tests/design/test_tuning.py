"""Tuning of all controllers at once: its derivatives, its plants, what it finds, and what it says."""

import control
import numpy as np
import pytest

from stabctl._util.errors import StudyError
from stabctl.design import damper, outages, pi, stabilizers, tune, values
from stabctl.design.tuning.networks import networks
from stabctl.design.tuning.parts import Asked, Parts
from stabctl.design.tuning.problem import WEIGHT, Peak, frequencies, spare, summits
from stabctl.smallsignal.closed_loop import closed_loop

STORAGE = "3@11=50MW"
KINDS = {
    "lead-lag": [stabilizers(stages=3)],
    "pss": [stabilizers(model="pss")],
    "ieeest": [stabilizers([1, 3], model="ieeest"), stabilizers([2, 4], gain=-3)],
    "pss2b": [stabilizers(model="pss2b", stages=3)],
    "late": [stabilizers(), damper("deviation:1+2", "order:3@11", delay=("50ms", "150ms"), notch=(2, 6))],
    "direct path": [stabilizers([1]), damper("flow:7-8", "order:3@11", gain=0.3, fast=1), pi("voltage:7", "vref:2")],
    "case": [stabilizers([1, 2]), values("exst3.KA"), values("genrou.H", together=True)],
}


def thyristor(cases):
    """Kundur's system with storage; some exciters are EXST3, whose gain is tuned."""
    return cases("two_area_thyristor").initialize(storage=STORAGE)


def made(cases, kind, *, intact=True, **asked):
    """The parts and the problem of one kind of devices."""
    devices = KINDS[kind]
    point = thyristor(cases)
    if kind == "case":
        table = next(name for name in point.case.devices if point.case.model(1, "exciter") == name)
        devices = [devices[0], values(f"{table}.KA"), devices[2]]
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
        ends = [problem.at(p + sign * step * d) for sign in (1, -1)]
        for value, slope, where in zip(rows.value, rows.slope, rows.where, strict=True):
            pair = [again(end, where) for end in ends]
            checked += 1
            found, want = slope @ d, (pair[0] - pair[1]) / (2 * step)
            assert found == pytest.approx(want, rel=1e-5, abs=1e-5 * max(0.1, np.abs(slope).max())), where
            assert abs(sum(pair) / 2 - value) < 1e-4
    assert checked > 6 * 6


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
            for i in range(loop.nu):
                for shift in (0.0, 0.5):
                    direct = loop.N[i, i] - shift
                    own = control.ss(loop.A, loop.B[:, [i]], loop.out[[i]], [[direct]])
                    want = control.norm(own, p="inf", tol=1e-4)
                    w = np.geomspace(0.1, 200, 20001)
                    want = max(want, np.abs(own(1j * w)).max()) if np.isfinite(want) else np.abs(own(1j * w)).max()
                    alone = [one for one in [highest_of(loop, shift, i)]]
                    assert alone[0] == pytest.approx(want, rel=0.01)
            checked += 1
    assert checked >= 8


def highest_of(loop, shift, i):
    """The largest |S - shift| of one loop."""
    peak = Peak(1.0, shift)
    w = frequencies(loop)
    edge = float(np.abs(loop.alone(w)[:, i] - shift).max())
    return max([edge, *(size for size, _, k in summits(loop, peak, 0.5) if k == i)])

"""Counting the modes of a band: as many as the dense matrix has, and the search goes on until they are found."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from mixed import mixed_point
from systems import KINDS, small
from uneven import uneven

from stabctl import io
from stabctl.cli import app
from stabctl.dynamics import operating_point
from stabctl.model.replicate import replicate
from stabctl.smallsignal import analyze, descriptor, eigen, linearize
from stabctl.smallsignal._argument_principle import (
    TERMS,
    Area,
    Member,
    Network,
    OnBoundaryError,
    Sector,
    Units,
    _balance,
    count,
    series,
)
from stabctl.smallsignal._dissection import network

BANDS = [((0.1, 2.5), (-0.1, 0.3)), ((0.05, 1.2), (-0.5, 0.9)), ((1.0, 1.7), (0.05, 0.5)), ((20.0, 25.0), (-0.1, 0.3))]


def slope(ratio):
    return -ratio / np.sqrt(1 - ratio**2)


def inside(values, band, damping):
    hz, size = values.imag / (2 * np.pi), np.abs(values)
    ratio = np.divide(-values.real, size, out=np.ones(len(values)), where=size > 0)
    return (hz >= band[0]) & (hz <= band[1]) & (ratio >= damping[0]) & (ratio <= damping[1])


def check(point, every, band, damping):
    """Modes of the band, which are certified and those of the dense matrix."""
    few = analyze(descriptor(point), band, damping)
    wanted = every[inside(every, band, damping)]
    assert few.certified
    assert few.counted == len(few) == len(wanted)
    assert np.abs(np.sort_complex(few.eigenvalues) - np.sort_complex(wanted)).max(initial=0.0) < 1e-9  # 5e-14
    return few


@pytest.mark.parametrize(("band", "damping"), BANDS)
@pytest.mark.parametrize("name", ["two_area_thyristor", "ieee39"])
def test_sparse_is_dense_in_the_band(point, modes, name, band, damping):
    check(point(name), modes(name).eigenvalues, band, damping)


@pytest.mark.parametrize("kind", ["classical", "bare", "converter", "open rotor circuit", "exst3 bus-fed"])
def test_the_smallest_systems_too(kind):
    """From four states on."""
    point = operating_point.solve(small(KINDS[kind]))
    check(point, analyze(linearize(point)).eigenvalues, (0.05, 5.0), (-0.3, 0.9))


@pytest.mark.slow
@pytest.mark.parametrize(("band", "damping"), BANDS)
def test_sparse_is_dense_in_the_band_of_a_larger_system(point, modes, band, damping):
    check(point("wnaps"), modes("wnaps").eigenvalues, band, damping)


@pytest.mark.parametrize("edge", [0.99, 1 - 1e-9, 1 + 1e-9, 1.01])
def test_the_edges_of_the_band_and_of_the_damping_ratios(point, modes, edge):
    """Each edge 1 % below and above a known mode, and so near that modes are counted in a wider band."""
    every = modes("ieee39")
    k = every.swings()[3]
    hz, ratio = every.frequency_hz[k], every.damping_ratio[k]
    bands = {
        "lowest frequency": ((edge * hz, 2.5), (-0.1, 0.3), edge < 1),
        "highest frequency": ((0.1, edge * hz), (-0.1, 0.3), edge > 1),
        "lowest ratio": ((0.1, 2.5), (edge * ratio, 0.3), edge < 1),
        "highest ratio": ((0.1, 2.5), (-0.1, edge * ratio), edge > 1),
    }
    for name, (band, damping, belongs) in bands.items():
        few = check(point("ieee39"), every.eigenvalues, band, damping)
        assert (np.abs(few.eigenvalues - every.eigenvalues[k]).min() < 1e-9) == belongs, name


def test_a_small_sector_around_each_mode_holds_one(point, modes):
    system = network(descriptor(point("two_area")))
    values = modes("two_area").eigenvalues
    for s in values[(values.imag > 1) & (np.abs(values) < 30)]:
        tilt, w = s.real / s.imag, s.imag
        around = Sector(w * 0.999, w * 1.001, tilt - 1e-3, tilt + 1e-3)
        assert count(system, around) == around.holds(values).sum() == 1
    with pytest.raises(OnBoundaryError):
        count(system, Sector(w, w * 1.1, tilt - 1e-3, tilt + 1e-3))


@pytest.mark.parametrize("most", [8, 16, 1000])
def test_the_count_does_not_depend_on_the_areas(point, modes, most):
    """Areas joined through separators, and the whole network as one."""
    system = network(descriptor(point("ieee39")), most)
    assert (len(system.areas) > 1) == (most < 1000)
    assert max(len(area.Y) for area in system.areas) <= max(most, 20)
    sector = Sector(np.pi, 4 * np.pi, slope(0.4), slope(0))
    assert count(system, sector) == sector.holds(modes("ieee39").eigenvalues).sum() > 5


def between():
    """Equal machines at one bus, with the records of another bus between theirs."""
    case = uneven(()).classical()
    rows = case.devices["gencls"]
    return operating_point.solve(replace(case, devices={"gencls": {k: rows[k] for k in (7, 12, 3, 5)}}))


@pytest.mark.parametrize("name", ["two_area", "machines of a bus apart"])
def test_the_fronts_have_the_determinant_of_the_pencil(point, name):
    """det(fx - s) det(N(s)) of all units and fronts is that of the whole pencil, up to a constant factor."""
    d = descriptor(point(name) if name == "two_area" else between())
    system, n = network(d, 4), len(d.rows)

    def phase(s):
        units_ = sum(np.angle(np.linalg.det(u.F - s * np.eye(u.F.shape[1]))).sum() for u in system.groups)
        pencil = np.block([[(d.fx.toarray() - s * np.eye(n)), d.fv.toarray()], [d.gx.toarray(), d.gv.toarray()]])
        return np.exp(1j * (units_ + system.fronts(s).phase.sum())) / np.linalg.slogdet(pencil)[0]

    ratios = np.array([phase(s) for s in (1j, -1 + 3j, -0.4 + 9j, 2 - 5j)])
    assert np.abs(ratios - ratios[0]).max() < 1e-9  # 5e-14


def test_what_a_series_leaves_out_is_within_its_bound(point):
    for group in network(descriptor(point("ieee39"))).groups:
        s = -0.3 + 5j
        found = series(group, s)
        for part in (0.2, 0.6, 0.9):
            r = part * float((found.root ** (-1 / 8)).min())
            h = r * np.exp(0.7j)
            exact = -group.C @ np.linalg.solve(group.F - (s + h) * np.eye(group.F.shape[1]), group.B.astype(complex))
            taken = np.tensordot(h ** np.arange(TERMS + 1), found.terms, 1)
            miss = np.linalg.norm(exact - taken, axis=(1, 2))
            assert (miss <= found.rest(r) + 1e-12 * np.linalg.norm(exact, axis=(1, 2))).all()
        assert np.isinf(found.rest(2 * float((found.root ** (-1 / 8)).max()))).all()


def test_of_two_divisions_that_with_less_work_is_taken(point):
    """The cube of the size of every front, whichever comes first."""

    def sizes(*most):
        system = network(descriptor(point("wnaps")), *most)
        return [len(area.Y) for area in system.areas] + [len(system.Y)]

    few, many = sizes(10), sizes(80)
    assert sum(n**3 for n in few) < 0.5 * sum(n**3 for n in many)  # 0.11
    assert sizes(10, 80) == sizes(80, 10) == few


@pytest.mark.parametrize("most", [6, 1000])
@pytest.mark.parametrize("name", ["two_area", "mixed"])
def test_phases_between_points_are_within_their_bounds(point, name, most):
    """Up to the reach of a point: the change of phase followed in small steps against the prediction, front by front.

    Units of several groups stand at one bus of the mixed system.
    """
    system = network(descriptor(mixed_point() if name == "mixed" else point(name)), most)
    for s in (-0.5 + 3j, 0.1 + 0.7j, -3 + 9j):
        start = system.fronts(s)
        r = start.reach()
        for way in (1, 1j, -1, -1j):
            path = start.phase
            for h in np.linspace(0, r, 21)[1:]:
                now = system.fronts(s + h * way).phase
                path = now - 2 * np.pi * np.round((now - path) / (2 * np.pi))
                miss = np.abs(start.turn(h * way) - (path - start.phase))
                assert (miss <= start.slack(h) + 1e-9).all()
            assert start.slack(r).max() <= 1.5 + 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("always", [True, False])
def test_a_mode_withheld_is_noticed(point, modes, monkeypatch, always):
    """A search that loses a mode: found later, the result is complete; otherwise the place is named."""
    every, search = modes("ieee39"), eigen.near
    lost = every.eigenvalues[every.swings()[2]]
    calls = []

    def near(*arguments):
        calls.append(arguments)
        found = search(*arguments)
        keep = np.abs(found.modes.values - lost) > 1e-6 * (always or len(calls) == 1)
        return found._replace(modes=found.modes.some(keep))

    monkeypatch.setattr(eigen, "near", near)
    few = analyze(descriptor(point("ieee39")), (0.1, 2.5))
    assert few.counted == 9 - 1
    assert len(calls) > 1
    if always:
        assert not few.certified
        assert len(few) == few.counted - 1
        assert len(few.incomplete) == 1
        assert few.incomplete[0].holds(np.array([lost])).all()
        assert few.incomplete[0].high < 1.01 * few.incomplete[0].low
        assert "not complete: 8 eigenvalues counted in the band, 7 found; some are missing from " in str(few)
    else:
        assert few.certified
        assert str(few).endswith("certified: 8 eigenvalues counted in the band.")


def test_a_mode_found_again_is_not_another_one(point, modes, monkeypatch):
    """If rounding leads back to modes known already, they do not make up the number counted."""
    monkeypatch.setattr(eigen, "_without", lambda *_: lambda x: x)
    monkeypatch.setattr("stabctl.smallsignal._band_search.BLOCK", 3)
    monkeypatch.setattr("stabctl.smallsignal._band_search.VECTORS", 18)
    check(point("ieee39"), modes("ieee39").eigenvalues, (0.1, 2.5), (-0.1, 0.3))


@pytest.mark.slow
def test_more_than_forty_coincident_modes():
    """Fifty equal copies, hardly tied: of each swing within a copy there are as many, all the same."""
    point = operating_point.solve(replicate(io.load("two_area"), 50, x=1e6))
    few = analyze(descriptor(point), (1.25, 1.3), (0.3, 0.4))
    assert few.certified
    distance = np.abs(few.eigenvalues[:, None] - few.eigenvalues)
    assert (distance < 1e-6).sum(axis=1).max() > 40
    assert (
        np.abs(few.left.conj().T @ few.right - np.eye(len(few))).max() < 1e-9
    )  # 1e-13, of modes from several searches


def run(*words):
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0
    return result.output


def test_the_command_says_that_the_modes_are_certified():
    out = run("modes", "ieee39", "--sparse", "--band", "0.5", "2.0")
    assert "certified: 8 eigenvalues counted in the band." in " ".join(out.split())
    record = json.loads(run("modes", "ieee39", "--sparse", "--json"))
    assert record["certified"] is True
    assert record["counted"] == len(record["modes"]) == 8
    assert record["proof"] == "certified: 8 eigenvalues counted in the band"


def test_the_method_takes_sparse(point, modes):
    few = point("ieee39").modes("0.5..2Hz", sparse=True)
    assert few.certified
    assert len(few) == few.counted == 8
    assert len(point("ieee39").modes(sparse=False)) == len(modes("ieee39"))


def test_couplings_that_grow_weaker_have_no_scales_of_any_size():
    """Beside stronger couplings the scales of a chain do not matter, and would enlarge what goes through its ends."""
    n = 16
    chain = np.diag(np.full(n - 1, 1e-3), 1) + np.diag(np.full(n - 1, 1e-11), -1) + 1e-13 * np.eye(n)
    size = np.zeros((1, n + 2, n + 2))
    size[0, :n, :n], size[0, n:, n:] = chain**2, [[0.5, 0.4], [0.3, 0.5]]
    scale = _balance(size)
    assert scale.max() / scale.min() < 1e6  # balanced in full: 1e41
    assert size[0] @ scale**2 @ scale**-2 < 2
    scale = _balance(size[:, :n, :n])  # alone it is balanced in full, to the norm of the couplings both ways
    assert np.sqrt(size[0, :n, :n] @ scale**2 @ scale**-2) < 1e-4  # 2e-5, and 4e-3 without


def test_couplings_almost_in_one_direction_do_not_stop_the_count():
    """A chain of devices that act on the next one far more than on the one before."""
    rng, n = np.random.default_rng(5), 14
    F = rng.uniform(-0.5, -0.05, n)[:, None, None] * np.eye(2) + rng.uniform(2, 9, n)[:, None, None] * [[0, 1], [-1, 0]]
    B, C = rng.uniform(0.1, 0.4, (2, n, 2, 1))
    Y = np.diag(rng.uniform(0.4, 0.5, n + 1)) + np.diag(rng.uniform(1, 2, n), 1)
    Y[np.arange(1, n), np.arange(n - 1)] = -1e-10
    Y[n] = Y[:, n] = 0.3
    Y[n, n] = 3
    group = Units(F, B, C.transpose(0, 2, 1), np.arange(n)[:, None])
    area = Area(Y[:n, :n], Y[:n, n:], Y[n:, :n], np.array([0]), [Member(0, np.arange(n), np.arange(n)[:, None])])
    system = Network([group], [area], Y[n:, n:], [])
    x, v = np.arange(2 * n).reshape(n, 2), np.arange(n)
    A, into, out = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n + 1)), np.zeros((n + 1, 2 * n))
    A[x[:, :, None], x[:, None, :]], into[x, v[:, None]], out[v[:, None], x] = F, B[:, :, 0], C[:, :, 0]
    values = np.linalg.eigvals(A - into @ np.linalg.solve(Y, out))
    assert system.fronts(1 + 5j).reach() > 0.05
    sector = Sector(1.0, 12.0, -0.4, 0.2)
    assert count(system, sector) == sector.holds(values).sum() > 5

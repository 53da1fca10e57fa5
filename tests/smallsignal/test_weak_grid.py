"""Weak-grid operation: the map against a state matrix written by hand, and against simulation on both sides."""

from dataclasses import replace

import numpy as np
import pytest
from systems import PLANT, REEC, REGC, REGC_C, small

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.simulation import simulation
from stabctl.simulation.events import LoadStep
from stabctl.smallsignal import weak_grid
from stabctl.smallsignal.analysis import modes
from stabctl.view.pages.document import svg

CASE = small({"regc_c": REGC_C._replace(Re=0.01)}, p=320.0)
AT = {"P": 320.0, "V": 1.02, "x_over_r": 10.0, "voltage": 1.0}


def alone(scr, factor=1.0):
    """The operating point of the converter at an infinite bus."""
    one = weak_grid.at_infinite_bus(CASE, CASE.machines[0], scr, **AT)
    return weak_grid.with_gain(one.initialize(), "regc_c", factor)


def by_hand(point, scr, factor):
    """Eigenvalues of the converter's equations, linearized with complex phasors in its frame.

    i = (E - Vg exp(-j theta))/(Ze + Zg), u = Kip (r - i) + x, x' = Kii (r - i), E' = Ze (u - i)/Te, V = E - Ze i,
    theta' = Kppll Im V + w, w' = Kipll Im V; the references and the voltage filter are lags of their own.
    """
    p = CASE.devices["regc_c"][1]
    Ze = complex(p.Re, p.Xe)
    x = 1 / scr / np.hypot(1, 0.1)
    Zg = complex(x / 10, x)
    V = point.V[0] * np.exp(-1j * np.angle(point.V[0]))
    S = point.flow.S[0] * point.case.base_mva / 400.0
    Vg = V - Zg * (S / V).conjugate()

    def rates(z):
        theta, w, x, E = z[0], z[1], complex(*z[2:4]), complex(*z[4:6])
        i = (E + 1j * Vg * theta) / (Ze + Zg)
        vq = (E - Ze * i).imag
        e, dx = Ze * (x - (1 + p.Kip) * i) / p.Te, -p.Kii * i
        return factor * p.Kppll * vq + w, factor**2 * p.Kipll * vq, dx.real, dx.imag, e.real, e.imag

    A = np.array([rates(column) for column in np.eye(6)]).T
    return np.r_[np.linalg.eigvals(A), -1 / p.Tg, -1 / p.Tg, -1 / p.Tfltr]


def in_order(values):
    return sorted(values.tolist(), key=lambda s: (round(s.real, 6), round(s.imag, 6)))


@pytest.mark.parametrize(("scr", "factor"), [(1.2, 0.5), (1.5, 3.0), (3.0, 8.0)])
def test_the_eigenvalues_are_those_of_a_state_matrix_written_by_hand(scr, factor):
    point = alone(scr, factor)
    found = modes(point).eigenvalues
    wanted = by_hand(point, scr, factor)
    assert in_order(found[found != 0]) == pytest.approx(in_order(wanted), rel=1e-8)


@pytest.fixture(scope="module")
def found():
    return CASE.weak_grid(1, scr=(0.7, 1.2, 1.5, 1.9, 2.5, 4.0), gain=(0.5, 2.0, 5.0))


def test_the_map_holds_the_least_damped_mode_of_every_point(found):
    for i in range(1, 6):
        for j, factor in enumerate((0.5, 2.0, 5.0)):
            values = by_hand(alone(found.scr[i], factor), found.scr[i], factor)
            assert found.damping_ratio[i, j] == pytest.approx((-values.real / np.abs(values)).min(), rel=1e-8)
            assert found.growth[i, j] == pytest.approx(values.real.max(), rel=1e-7)
    assert found.gain == pytest.approx([10.0, 40.0, 100.0])
    assert (found.labels[1:, 1:] == "PLL of REGC_C 1").all()


def test_beyond_the_power_that_the_grid_carries_there_is_no_operating_point(found):
    """P = 0.8 pu at 1.02 against 1 pu: below an SCR of about 0.8 nothing carries it."""
    assert np.isnan(found.growth[0]).all()
    assert not found.stable[0].any()
    assert set(found.labels[0]) == {"no operating point"}


def test_the_boundary_is_where_the_growth_crosses_zero(found):
    boundary = found.boundary
    assert boundary[0] == 1.2  # the first ratio with an operating point
    assert 1.5 < boundary[1] < 1.9
    assert boundary[2] > boundary[1]
    for critical, factor in zip(boundary[1:], (2.0, 5.0), strict=True):
        growth = [by_hand(alone(critical * k, factor), critical * k, factor).real.max() for k in (0.95, 1.05)]
        assert growth[0] > 0 > growth[1]


@pytest.mark.parametrize("side", [0.9, 1.1])
def test_the_simulation_agrees_on_both_sides_of_the_boundary(found, side):
    """A step of 0.4 kW of 400 MW: frequency and rate of what follows are those of the least damped mode."""
    scr = side * found.boundary[1]
    point = alone(scr, 2.0)
    values = modes(point).eigenvalues
    mode = values[np.argmax(values.real * (values != 0) - 1e9 * (values.imag <= 0))]
    assert (mode.real > 0) == (side < 1)
    run = simulation.run(point, [LoadStep("1", 0.05, 4e-4)], 2.05, step=5e-4)
    w = run.rows[:, run.point.layout.signals[0, "wpll"]]
    t, y = run.time, w - 1
    late = t > 0.6
    t, y = t[late], y[late]
    top = 1 + np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:]))
    rate = np.polyfit(t[top], np.log(y[top]), 1)[0]
    assert rate == pytest.approx(mode.real, rel=0.02, abs=0.02)
    assert 2 * np.pi / np.diff(t[top]).mean() == pytest.approx(mode.imag, rel=0.01)


def test_controls_of_the_unit_come_along():
    """REEC and REPC are in the eigenvalues; a remote bus becomes the converter's own."""
    controls = {"regc_c": REGC_C, "reec_b": REEC._replace(Imax=1.2), "repc_a": PLANT._replace(bus=3)}
    found = small(controls).weak_grid(1, scr=(1.5, 4.0), gain=(1.0,))
    assert not np.isnan(found.growth).any()
    bare = small({"regc_c": REGC_C}).weak_grid(1, scr=(1.5, 4.0), gain=(1.0,))
    assert np.abs(found.eigenvalues - bare.eigenvalues).min() > 0.1


def test_numbering_and_bases_do_not_matter(found):
    renumbered = replace(CASE, base_mva=250.0, branches=tuple(
        b._replace(r=2.5 * b.r, x=2.5 * b.x, b=b.b / 2.5) for b in CASE.branches
    ))  # fmt: skip
    other = renumbered.initialize().weak_grid(1, scr=(1.9,), gain=(2.0,))
    assert other.eigenvalues[0, 0] == pytest.approx(found.eigenvalues[3, 1], rel=1e-7)


def test_the_table_and_the_figure_show_the_map(found):
    table = found.df
    assert len(table) == 18
    row = table[(table.scr == 1.5) & (table.pll_gain == found.gain[2])].iloc[0]
    assert (row.damping_ratio, row.stable) == (found.damping_ratio[2, 2], bool(found.stable[2, 2]))
    ax = found.plot()
    assert ax.lines[0].get_ydata() == pytest.approx(found.boundary)
    assert "points are stable; fastest growing at SCR 1.2, gain 100 rad/s: PLL of REGC_C 1" in str(found)


@pytest.mark.parametrize("ratios", [(0.7, 1.5, 4.0), (4.0,)])
@pytest.mark.parametrize("gains", [(1.0, 2.0, 5.0), (2.0,)])
def test_every_point_of_the_figure_is_a_cell_of_its_color(ratios, gains):
    """Also the only one; gray without an operating point, on pages too, whose figures have no background."""
    found = CASE.weak_grid(1, scr=ratios, gain=gains)
    ax = found.plot()
    (mesh,) = ax.collections
    edges = mesh.get_coordinates()
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), np.nan), found.damping_ratio)
    for k, points in enumerate((found.gain[None, :], found.scr[:, None])):
        assert ((edges[:-1, :-1, k] < points) & (points < edges[1:, 1:, k])).all()
    assert (*ax.get_xlim(), *ax.get_ylim()) == pytest.approx((*edges[0, [0, -1], 0], *edges[[0, -1], 0, 1]))
    drawn = svg(ax, "map")
    assert "<filter" not in drawn
    assert drawn.count("#cccccc") >= np.isnan(found.growth).sum() == (len(gains) if 0.7 in ratios else 0)


def test_what_has_no_map():
    with pytest.raises(StudyError, match=r"REGC_A of machine 1 in small has no phase-locked loop; give it one"):
        small({"regc_a": REGC}).weak_grid(1)
    with pytest.raises(StudyError, match="Machine 1 in two_area has no phase-locked loop"):
        st.weak_grid(st.load("two_area"), 1)
    for wrong in ({"scr": (0, 1)}, {"gain": "x"}, {"scr": ()}):
        with pytest.raises(StudyError, match="give numbers above 0"):
            CASE.weak_grid(1, **wrong)
    with pytest.raises(StudyError, match="x_over_r = 0"):
        CASE.weak_grid(1, x_over_r=0)

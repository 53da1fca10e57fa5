"""One-line diagrams: every bus apart from the others, the same each time, nothing over each other in the figure."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest
from labels import crowded
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.quiver import Quiver
from scipy.spatial import cKDTree

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.placement.siting import Costs, Site, Siting
from stabctl.placement.siting_rows import CandidateSite
from stabctl.smallsignal import areas
from stabctl.view.diagram import _layout, one_line
from stabctl.view.diagram._layout import backbone, graph, node_positions, stress_majorization
from stabctl.view.figures import one_line as drawing
from stabctl.view.figures.palette import CLEARING, GRAY

CASES = "ieee39", "two_area", "wnaps", "wscc9"


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr("stabctl._util.object_code.folder", lambda: tmp_path)
    return tmp_path


def moved(case, places):
    """The case with coordinates of some buses."""
    at = {bus: {"x": x, "y": y} for bus, (x, y) in places.items()}
    return replace(case, buses=tuple(b._replace(**at.get(b.bus, {})) for b in case.buses))


def test_points_on_a_plane_are_found_from_their_distances():
    """A path and a grid have a stress of zero at the distances of the plane."""
    points = np.array([(i, j) for i in range(6) for j in range(3)], float)
    D = np.linalg.norm(points[:, None] - points[None], axis=2)
    found = stress_majorization(D)
    assert np.linalg.norm(found[:, None] - found[None], axis=2) == pytest.approx(D, abs=1e-2)
    assert np.ptp(found[:, 0]) > np.ptp(found[:, 1])


@pytest.mark.parametrize("name", CASES)
def test_nodes_are_apart_and_the_same_every_time(cases, name):
    case = cases(name)
    X = node_positions(case)
    assert cKDTree(X).query(X, k=2)[0][:, 1].min() > 0.35
    assert (X == node_positions(case)).all()


def test_stubs_are_not_in_the_backbone(cases):
    """Machines and their transformers are leaves; every node of the rest has two neighbors in it."""
    near = graph(cases("wnaps")).neighbors()
    core = set(backbone(near).tolist())
    assert len(core) == 65
    assert not any(n in core for n in range(122, 156))


def test_a_few_branches_cross(cases):
    """Crossings of lines that share no bus; 8 on wnaps, as many as a force-directed layout, without its overlaps."""
    line = one_line(cases("wnaps"))
    ends = {(k.from_bus, k.to_bus): e for k, e in zip(line.case.branches, line.ends, strict=True)}
    turn = lambda a, b, c: np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))  # noqa: E731
    listed, crossings = list(ends.items()), 0
    for i, (one, (a, b)) in enumerate(listed):
        for other, (c, d) in listed[:i]:
            if not set(one) & set(other):
                crossings += turn(a, b, c) != turn(a, b, d) and turn(c, d, a) != turn(c, d, b)
    assert crossings <= 8


@pytest.mark.parametrize("name", CASES)
def test_labels_are_apart(cases, name):
    ax = cases(name).with_storage("20MW").plot()
    assert crowded(ax) == []
    texts = {t.get_text() for t in ax.texts}
    assert np.mean([str(b.bus) in texts for b in cases(name).buses]) > 0.9
    assert np.mean([f"G{m.called}" in texts for m in cases(name).machines]) > 0.9


@pytest.mark.parametrize("name", CASES)
def test_storage_is_drawn_where_it_is_free(cases, name):
    """Beside its machine, clear of the circles of other machines (radius 0.19) and of buses (0.09)."""
    case = cases(name).with_storage("20MW")
    line, row = one_line(case), {m.machine: i for i, m in enumerate(case.machines)}
    own = [row[s.machine] for s in case.storage]
    assert np.linalg.norm(line.storage - line.machines[own], axis=1) == pytest.approx(0.3)
    far = np.linalg.norm(line.storage[:, None] - line.machines, axis=2)
    far[np.arange(len(own)), own] = np.inf
    assert far.min() > 0.31  # 0.39 on wnaps
    assert np.linalg.norm(line.storage[:, None] - line.buses, axis=2).min() > 0.21  # 0.23


def test_voltages_and_loading_are_those_of_the_power_flow(cases):
    case = cases("ieee39")
    flow, line = case.power_flow(), case.one_line()
    assert line.voltage == pytest.approx(flow.df.v_pu.to_numpy())
    most = np.hypot(flow.branches.p_from_mw, flow.branches.q_from_mvar)
    least = np.hypot(flow.branches.p_to_mw, flow.branches.q_to_mvar)
    assert line.loading == pytest.approx(np.maximum(most, least).to_numpy())
    assert str(line).startswith("one-line diagram of ieee39: 39 buses, 46 branches")
    assert list(line.df.index) == [b.bus for b in case.buses]


def test_a_transformer_has_a_ratio_or_joins_two_voltages(cases):
    case = cases("two_area")
    buses = tuple(b._replace(rated=20.0 if b.bus == 7 else 230.0) for b in case.buses)
    branches = [k._replace(tap=1.0, phase=0.0) for k in case.branches]
    branches[0], branches[1] = branches[0]._replace(tap=0.98), branches[1]._replace(phase=3.0)
    line = replace(case, buses=buses, branches=tuple(branches)).one_line()
    between = [7 in (k.from_bus, k.to_bus) for k in branches]
    assert line.transformer.tolist() == [True, True, *between[2:]]


def test_parallel_circuits_are_beside_each_other(cases):
    line = one_line(cases("two_area"))
    rows = [k for k, name in enumerate(line.circuits) if name.startswith("8-9")]
    gaps = [np.linalg.norm(line.ends[b] - line.ends[a], axis=1) for a, b in pairwise(rows)]
    assert len(rows) == 2
    assert np.allclose(gaps, 0.07)


def test_given_coordinates_are_kept(cases):
    """Distances keep their ratios, and a bus without coordinates is between its neighbors."""
    case = cases("wscc9")
    places = {4: (0, 2), 5: (-1, 1), 6: (1, 1), 7: (-2, 0.5), 8: (0.1, -1), 9: (2, 0), 1: (0, 3), 2: (-3, -0.5)}
    line = one_line(moved(case, places))
    at = {b.bus: x for b, x in zip(case.buses, line.buses, strict=True)}
    scale = np.linalg.norm(at[7] - at[9]) / np.linalg.norm(np.subtract(places[7], places[9]))
    assert at[4] - at[8] == pytest.approx(scale * np.subtract(places[4], places[8]))
    assert np.linalg.norm(at[3] - at[9]) < 1.0
    free = {b: p for b, p in places.items() if b != 8}
    between = one_line(moved(case, free))
    at = {b.bus: x for b, x in zip(case.buses, between.buses, strict=True)}
    assert at[8] == pytest.approx((at[7] + at[9]) / 2, abs=1e-3)


def test_coordinates_survive_a_case_folder(tmp_path, cases):
    given = moved(cases("wscc9"), {b.bus: (float(b.bus), 2.5) for b in cases("wscc9").buses})
    st.write(given, tmp_path / "case")
    assert [(b.x, b.y) for b in st.load(str(tmp_path / "case")).buses] == [(b.bus, 2.5) for b in given.buses]


def test_the_layout_is_calculated_once(cases, own_cache, monkeypatch):
    case = cases("ieee39")
    first = _layout.cached_layout(case)
    monkeypatch.setattr(_layout, "node_positions", lambda case: pytest.fail("calculated again"))
    (file,) = own_cache.iterdir()
    monkeypatch.setattr(_layout, "_name", lambda case: file.name.removeprefix("diagram-"))
    assert (_layout.cached_layout(case) == first).all()


def test_islands_and_small_systems_have_a_layout(cases):
    case = cases("two_area")
    swing = tuple(b._replace(kind="swing") if b.bus == 1 else b for b in case.buses)
    apart = replace(case, buses=swing, branches=tuple(k for k in case.branches if {k.from_bus, k.to_bus} != {8, 9}))
    assert np.isfinite(node_positions(apart)).all()
    X = node_positions(apart)
    assert cKDTree(X).query(X, k=2)[0][:, 1].min() > 0.35


def test_results_are_drawn_on_it(cases, points):
    found = points("ieee39").modes()
    k = found.swings()[0]
    ax = cases("ieee39").plot(found.mode(k), areas(found, 3))
    arrows = next(c for c in ax.collections if isinstance(c, Quiver))
    shape = found.shapes[:, k]
    large = np.abs(shape) >= 0.03
    assert np.hypot(arrows.U, arrows.V) == pytest.approx(0.9 * np.abs(shape[large]))
    assert [t.get_text() for t in ax.get_legend().texts] == ["area 1", "area 2", "area 3"]
    assert crowded(ax) == []


@pytest.mark.parametrize("name", ["a name of many words " * 5, "one_word" * 12])
def test_a_long_name_of_the_system_is_whole_and_clear_of_its_mode(cases, points, name):
    mode = points("wscc9").modes().mode(0)
    for results in ((), (mode,)):
        ax = replace(cases("wscc9"), name=name.strip()).plot(*results)
        assert crowded(ax) == []
        assert "".join(ax.get_title(loc="left").split()).startswith("".join(name.split()))


def test_a_screen_colors_each_end_of_a_line(cases, points):
    found = st.screen(points("wscc9"), resolution="2cyc", limit="20cyc", observe="1s", longest=0)
    ax = cases("wscc9").plot(found)
    halves = [c for c in ax.collections if isinstance(c, LineCollection) and len(c.get_segments()) == len(found.pairs)]
    assert halves
    critical = min(p.cycles for p in found.pairs if p.cycles is not None)
    assert f"{critical:g}" in {t.get_text() for t in ax.texts}
    with pytest.raises(StudyError, match="draw the screen on the diagram of its own case"):
        cases("two_area").plot(found)


def test_only_critical_times_have_a_color_and_a_number(cases, points):
    """Lines that are stable up to the limit are gray; a single time is the darkest, that of the shortest."""

    def drawn(limit):
        found = st.screen(points("two_area"), resolution="1cyc", limit=limit, observe="3s", longest=0)
        ax = cases("two_area").plot(found)
        numbers = {f"{p.cycles:g}" for p in found.pairs if p.cycles is not None}
        assert numbers == {text.get_text() for text in ax.texts if text.get_weight() == "bold"}
        (halves,) = (c for c in ax.collections if c.get_zorder() == 1.2)
        ends = {
            tuple(np.round(segment[0], 6)): to_hex(c)
            for segment, c in zip(halves.get_segments(), halves.get_colors(), strict=True)
        }
        return list(ends.values()), len(ax.figure.axes) - 1

    colors, bars = drawn("5cyc")
    assert (set(colors), bars) == ({GRAY}, 0)
    colors, bars = drawn("12cyc")
    assert (Counter(colors), bars) == ({GRAY: len(colors) - 1, CLEARING[0].lower(): 1}, 1)


def test_a_placement_has_squares_of_its_ratings(cases):
    """The area of a square beyond the smallest grows with the rating; the largest ratings are written."""
    sites = (Site(5, 1, 90.0, 0.1), Site(10, 3, 10.0, 0.1))
    found = Siting("two_area", sites, Costs(), 1.0, None, None, None, None, (), (), (), (), 5.0, 1, 1.0)
    ax = cases("two_area").plot(found)
    sizes = next(c.get_sizes() for c in ax.collections if len(c.get_offsets()) == 2 and c.get_zorder() == 4)
    assert sizes[0] > 2 * sizes[1]
    assert {s.size for s in sites} <= {t.get_text() for t in ax.texts}
    assert crowded(ax) == []
    with pytest.raises(StudyError, match="There is no machine 10"):
        cases("wscc9").plot(replace(found, sites=(Site(5, 10, 1.0, 0.0),)))


def test_bars_of_a_placement_lie_in_the_row_of_their_place():
    """The largest first: the fleet found above the middle of the row, the uniform one below it."""
    sites = (Site(5, 1, 90.0, 0.1), Site(10, 3, 10.0, 0.1))
    places = [CandidateSite(*at, 300.0, mw) for at, mw in (((10, 3), 55.0), ((6, 2), 40.0), ((5, 1), 20.0))]
    record = "two_area", sites, Costs(), 1.0, None, 115.0, 5.0, None, (), (), (), (), 5.0, 1, 1.0, tuple(places)
    ax = Siting(*record).plot()
    bars = [(round(bar.get_y() + bar.get_height() / 2, 6), bar.get_width()) for bar in ax.patches]
    assert bars == [(-0.2, 90), (0.8, 10), (1.8, 0), (0.2, 20), (1.2, 55), (2.2, 40)]
    assert [t.get_text() for t in ax.get_yticklabels()] == [
        f"machine {m}, bus {b}" for b, m in ((5, 1), (10, 3), (6, 2))
    ]


def test_a_square_does_not_cover_the_name_of_its_machine(cases):
    sites = (Site(22, 6, 200.0, 0.1), Site(29, 9, 50.0, 0.01))
    found = Siting("ieee39", sites, Costs(), 1.0, None, None, None, None, (), (), (), (), 5.0, 1, 1.0)
    ax = cases("ieee39").plot(found)
    names = {t.get_text(): t.get_position() for t in ax.texts}
    line = one_line(cases("ieee39"))
    for row, name, side in ((5, "G6", 0.55), (8, "G9", 0.2 + 0.35 * 0.5)):
        assert np.abs(names[name] - line.machines[row]).max() > side / 2


def test_what_cannot_be_drawn_is_refused(cases):
    with pytest.raises(StudyError, match="cannot be drawn on a one-line diagram; give one of Mode"):
        cases("wscc9").plot(3)
    with pytest.raises(StudyError, match="is not a system"):
        one_line(None)


def test_places_of_a_label_lie_around_its_symbol():
    """Each is as far away as the symbol and a gap; the one on the other side is its reflection."""
    label = drawing.Label("G30/1", np.array([1.0, -2.0]), 0.3)
    boxes = {d: np.reshape(box, (2, 2)) for d, box in zip(drawing.DIRECTIONS, drawing._places(label, 0.1), strict=True)}
    for (x, y), (low, high) in boxes.items():
        near = np.clip(label.at, low, high)
        assert np.hypot(*(near - label.at)) == pytest.approx(0.32)
        (other,) = [box for d, box in boxes.items() if np.allclose(d, (-x, -y))]
        assert 2 * label.at - other[::-1] == pytest.approx(np.array([low, high]))

"""Every kind of figure: labels apart and inside it, curves that are the result's numbers."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from labels import crowded

from stabctl._util.errors import StudyError
from stabctl.clearing import clearing_time as critical
from stabctl.clearing import screen as screened
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.estimation.estimate import estimate
from stabctl.model import fleet
from stabctl.simulation.channels import QUANTITIES
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run
from stabctl.smallsignal import analyze, linearize
from stabctl.theory.feedback_laws import compare
from stabctl.theory.minimum_time import by_shooting
from stabctl.theory.omib import OMIB
from stabctl.theory.phase_plane import portrait
from stabctl.theory.two_machine import Equivalent
from stabctl.view.figures import clearing, estimates, modes, style, trajectory
from stabctl.view.figures.modes import spread
from stabctl.view.figures.palette import GRAY


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def runs(points, cases):
    """Three seconds of the paper's Case 1 without and with storage."""
    case, fault = cases("two_area"), Contingency("7-8@0.4", "21cyc")
    equipped = operating_point.solve(case.with_storage(fleet.everywhere(case, "50MW")))
    bare, held = run(points("two_area"), fault, 3.0), run(equipped, fault, 3.0, BangBang())
    return {"without storage": bare, "with 50 MW storage": held}


def legend(ax):
    return [text.get_text() for text in ax.get_legend().texts]


def named(ax):
    """The names at the ends of curves, in order."""
    return sorted((text.get_text() for text in ax.texts), key=lambda text: int(text.split()[-1]))


def curves(ax, found):
    """The curves of signals, without the lines at events."""
    return [line for line in ax.lines if len(line.get_xdata()) >= len(found.time)]


def test_the_check_sees_labels_that_overlap_or_reach_out():
    figure, _ = style.subplots(4, 3)
    assert crowded(figure) == []
    for place in ((0.5, 0.5), (0.52, 0.5), (0.97, 0.3)):
        figure.text(*place, "a label")
    assert crowded(figure) == [("a label", "a label"), "a label"]


@pytest.mark.slow
def test_simulations(runs):
    bare, held = runs.values()
    drawn = [trajectory.plot(held, signal) for signal in QUANTITIES]
    for figure in (*drawn, trajectory.compare(runs), trajectory.storage(held), trajectory.overview(held)):
        assert crowded(figure) == []
    speed = trajectory.plot(bare, machines=[2, 4])
    assert np.array_equal([line.get_ydata() for line in curves(speed, bare)], 60 * bare.speed[:, [1, 3]].T)
    assert named(speed) == ["machine 2", "machine 4"]
    assert legend(speed) == ["fault on", "clearing"]


def test_the_unstable_machine_stands_out_among_many(points):
    found = run(points("wnaps"), Contingency("83", "6cyc", "83-33"), 3.0)
    figure = trajectory.overview(found)
    assert crowded(figure) == []
    assert named(figure.axes[0]) == ["machine 14"]
    assert legend(figure.axes[-1]) == ["the others", "fault on", "clearing"]
    assert not figure.axes[0].get_legend(), "one legend"
    own, *others = curves(figure.axes[0], found)
    assert own.get_color() != GRAY
    assert {line.get_color() for line in others} == {GRAY}
    fault = figure.axes[0].patches[0].get_extents().transformed(figure.axes[0].transData.inverted())
    assert (fault.x0, fault.x1) == pytest.approx((1.0, 1.1))


def test_all_machines_of_the_group_that_is_lost_stand_out(points):
    found = run(points("wnaps"), Contingency("102", "40cyc", "84-28"), 6.0)
    assert found.outcome.machine in found.unstable_machines
    angle, numbers = found.arrays.angle[-1] - found.arrays.angle[0], found.point.rotor_numbers
    out = np.isin(numbers, found.unstable_machines)
    gap = min(angle[out].min() - angle[~out].max(), 9.0) if angle[out].min() > angle[~out].min() else 0.0
    assert gap == pytest.approx(min(np.diff(np.sort(angle)).max(), 9.0))
    assert named(trajectory.plot(found)) == [f"machine {n}" for n in found.unstable_machines]


def test_ten_machines_are_told_apart(points):
    """Those that swing most have a color and a name at their end, the same for every quantity."""
    found = run(points("ieee39"), Contingency("26", "4cyc", "26-29"), 3.0)
    figure = trajectory.overview(found)
    assert crowded(figure) == []
    largest = [found.point.rotor_names[k] for k in np.argsort(-found.peak)[:5]]
    looks = [{text.get_text(): text.get_color() for text in ax.texts} for ax in figure.axes]
    assert looks[0] == looks[1]
    assert {*looks[0]} == {f"machine {name}" for name in largest}
    assert [*looks[0].values()] == [*dict.fromkeys(looks[0].values())]
    for line in curves(figure.axes[0], found):
        swings = [k for k, y in enumerate(60 * found.arrays.speed.T) if np.array_equal(line.get_ydata(), y)]
        assert (found.point.rotor_names[swings[0]] in largest) == (line.get_color() != GRAY)


@pytest.mark.parametrize("size", [(4, 3), (8, 4), (16, 9)])
def test_labels_keep_apart_at_every_size(points, size):
    found = run(points("wnaps"), Contingency("83", "6cyc", "83-33"), 3.0)
    _, ax = plt.subplots(figsize=size, layout="constrained")
    assert crowded(trajectory.plot(found, ax=ax)) == []


def test_no_slope_before_a_fault_and_no_curve_of_a_machine_that_is_off(runs, points):
    bare = runs["without storage"]
    for line in curves(trajectory.plot(bare, "voltage"), bare):
        x, y = line.get_data()
        rows = (bare.time < 1 - 1e-9).sum()
        assert x[rows] == x[rows + 1] == pytest.approx(1.0)  # the value before the fault, held up to it
        assert np.ptp(y[: rows + 1]) < 1e-6
        assert abs(y[rows + 1] - y[rows]) > 0.05
    tripped = run(points("wnaps"), "14@1s", 2.0)
    row = tripped.point.rotor_numbers.index(14)
    off = tripped.time >= 1.0
    for shown in (
        curves(trajectory.plot(tripped), tripped)[row].get_ydata(),
        tripped.df["speed_pu:14"].to_numpy(),
        tripped.angle.sel(machine=14).to_numpy(),
    ):
        assert np.isnan(shown[off]).all()
        assert np.isfinite(shown[~off]).all()
    assert np.isfinite(tripped.speed.sel(machine=13)).all()


def test_a_signal_that_is_not_there_is_a_sentence(runs):
    with pytest.raises(StudyError, match="'voltages' is not a quantity of a run; did you mean voltage"):
        trajectory.plot(runs["without storage"], "voltages")
    with pytest.raises(StudyError, match="two_area has no storage to show; give storage='50MW'"):
        trajectory.plot(runs["without storage"], "storage")


def test_axes_of_the_user_are_drawn_on(runs):
    _, axes = plt.subplots(1, 2)
    assert trajectory.plot(runs["without storage"], ax=axes[1]) is axes[1]
    assert not axes[0].lines


def test_clearing_times(points):
    found = critical(points("two_area"), "7-8@0.4")
    ax = clearing.plot_clearing_time(found)
    assert crowded(ax) == []
    tried = sorted(cycles for line in ax.lines[:2] for cycles in line.get_xdata())
    assert tried == [r.cycles for r in found.runs]
    places, curves = np.linspace(0, 0.5, 6), {"without": np.arange(6), "with": np.arange(6) + 3}
    assert crowded(clearing.compare(places, curves, xlabel="location")) == []
    sweeps = dict.fromkeys(("latency (ms)", "noise (mrad)"), (places, curves))
    assert crowded(clearing.panels(sweeps, {"without": 12.25, "with": 6.5})) == []


def test_screen(points, cases):
    found = screened(points("two_area"), below="12cyc")
    ax = clearing.plot_screen(found)
    assert crowded(ax) == []
    assert [bar.get_width() for bar in ax.patches] == [p.cycles for p in found.pairs[:25]]
    assert crowded(clearing.plot_screen(found.below("0.1cyc"))) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_area", "ieee39", "wnaps", "two_area_thyristor"])
def test_modes(name, points):
    found = analyze(linearize(points(name)))
    ax = modes.plot_modes(found)
    assert crowded(ax) == []
    labels = [text.get_text() for text in ax.get_legend().texts]
    assert ("unstable" in labels) == (not found.stable)
    for k in found.swings():
        assert crowded(found.mode(k).plot()) == []
        plt.close("all")


@pytest.mark.parametrize("s", [complex(2, 0), complex(1e-3, 0.08), complex(3, 300)])
def test_every_mode_that_grows_is_in_view(points, s):
    found = analyze(linearize(points("two_area")))
    values = found.eigenvalues.copy()
    values[np.argmax(values.imag)] = s
    ax = modes.plot_modes(replace(found, eigenvalues=values))
    marks = next(line for line in ax.lines if line.get_label() == "unstable")
    assert marks.get_xydata() == pytest.approx(np.array([[s.real, s.imag / (2 * np.pi)]]))
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left < s.real < right
    assert bottom < s.imag / (2 * np.pi) - 0.01 * top < top


def test_frequency_response(points):
    model = linearize(points("two_area"), "vref:2", "speed:2, voltage:7")
    assert crowded(model.plot()) == []
    with pytest.raises(StudyError, match="A frequency response needs inputs and outputs"):
        linearize(points("two_area")).plot()


def test_numbers_around_a_mode_shape_keep_their_distance():
    placed = spread([0.0, 1.0, 2.0, 180.0, 359.0, 90.0], 17.0)
    gaps = np.diff(np.sort(np.mod(placed, 360)))
    assert min(*gaps, 360 - np.ptp(np.mod(placed, 360))) >= 17 - 1e-9
    assert [placed[3] % 360, placed[5] % 360] == [180.0, 90.0]
    around = [(p + 180) % 360 - 180 for p in (placed[4], placed[0], placed[1], placed[2])]
    assert around == sorted(around)


@pytest.mark.slow
def test_theory():
    pair = Equivalent()
    laws = compare(OMIB())
    control = by_shooting(pair.minimum_time_problem(6))
    for result in (portrait(OMIB()), pair.equal_area(8), pair.equal_area(8, 0.5), laws, control):
        assert crowded(result.plot()) == []
    with pytest.raises(StudyError, match="There is nothing to plot"):
        by_shooting(pair.minimum_time_problem(10)).plot()


@pytest.mark.slow
def test_estimates(runs):
    point = runs["with 50 MW storage"].point
    found = estimate(point, Contingency("7", "6cyc", "7-8"), 1.5, seeds=range(1, 3))
    for figure in (found.plot(), estimates.commands(found)):
        assert crowded(figure) == []


def test_a_figure_replaces_the_old_one_only_when_it_is_whole(tmp_path, monkeypatch):
    path = style.save(style.subplots(4, 3)[0], tmp_path / "a.png")
    before = path.read_bytes()
    assert plt.get_fignums() == []

    def fail(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("stabctl._util.files.os.fsync", fail)
    with pytest.raises(StudyError, match=r"a\.png cannot be written: No space left on device"):
        style.save(style.subplots(5, 3)[0], path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1

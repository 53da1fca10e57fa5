"""Curves, bars and arrows read back from the figures: they are the numbers of the record."""

import re
from dataclasses import replace
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.clearing import clearing_time as critical
from stabctl.clearing import screen as screened
from stabctl.controllers import BangBang
from stabctl.estimation.estimate import estimate
from stabctl.simulation.channels import QUANTITIES
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulate import simulate
from stabctl.smallsignal import analyze, linearize
from stabctl.theory.feedback_laws import FeedbackLaw, compare, paper_laws
from stabctl.theory.minimum_time import by_shooting
from stabctl.theory.omib import OMIB
from stabctl.theory.phase_plane import portrait
from stabctl.theory.two_machine import Equivalent
from stabctl.view.figures import clearing, estimates, one_machine, style, trajectory
from stabctl.view.figures.palette import COLORS, GRAY

FAULT = Contingency("7-8@0.4", "6cyc", at=0.1)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def held(cases):
    """Half a second of a fault, with storage of different sizes."""
    return simulate(cases("two_area"), FAULT, 0.5, storage="1=50MW,3=20MW", control=BangBang())


def data(line):
    return np.array(line.get_data())


def assert_curves(lines, x, columns, **tolerance):
    """The lines are the columns against x."""
    assert len(lines) == len(columns.T)
    for line, column in zip(lines, columns.T, strict=True):
        assert data(line)[0] == pytest.approx(x, **tolerance)
        assert data(line)[1] == pytest.approx(column, **tolerance)


def labeled(drawn):
    """Every axis says what it shows and in which unit, the lowest ones also against what."""
    axes = style.whole(drawn).axes
    low = min(ax.get_position().y0 for ax in axes)
    for ax in axes:
        assert ax.get_ylabel() or ax.get_title() or ax.get_title(loc="left")
        assert re.search(r"\(.+\)", ax.get_xlabel()) or ax.get_position().y0 > low + 0.05
    return True


def vertical(ax):
    """Places of the vertical lines."""
    return sorted({float(x[0]) for x, y in map(data, ax.lines) if len(x) == 2 and x[0] == x[1] and list(y) == [0, 1]})


def test_signals_of_a_run_have_their_units(held):
    a, case = held.arrays, held.point.case
    H = held.point.inertia
    coi = (a.angle @ H / H.sum())[:, None]
    expected = {"speed": 60 * a.speed, "angle": np.degrees(a.angle - coi), "storage": a.storage}
    for signal, values in expected.items():
        ax = trajectory.plot(held, signal)
        assert labeled(ax)
        assert_curves(ax.lines[: values.shape[1]], held.time, values)
        assert vertical(ax) == [pytest.approx(0.2)]  # clearing
        (fault,) = ax.patches
        box = fault.get_extents().transformed(ax.transData.inverted())
        assert (box.x0, box.x1) == pytest.approx((0.1, 0.2))
    assert np.abs(a.storage).max(0) == pytest.approx([50, 20])
    buses = [[b.bus for b in case.buses].index(m.storage_bus) for m in case.machines]
    for signal, values in {"voltage": np.abs(a.V[:, buses]), "electrical_power": a.P}.items():
        for line, column in zip(trajectory.plot(held, signal).lines, values.T, strict=False):
            x, y = data(line)
            assert np.interp(held.time[::7] + 1e-6, x, y) == pytest.approx(
                np.interp(held.time[::7] + 1e-6, held.time, column), rel=1e-3
            )
            assert len(x) == len(held.time) + 2  # the values before two events are held up to them


def test_machines_with_names_are_chosen_by_number_or_name():
    case = st.load("two_area")
    case = replace(case, machines=tuple(m._replace(name=f"{m.bus}/G") for m in case.machines))
    run = simulate(case, None, 0.1)
    for machines in ([2], ["2/G"], [2, "2/G"]):
        assert [text.get_text() for text in trajectory.plot(run, machines=machines).texts] == ["machine 2/G"]
    with pytest.raises(StudyError, match="There is no machine 9 in two_area; its machines are 1/G"):
        trajectory.plot(run, machines=[9])


def test_the_power_of_storage_stands_device_by_device(held):
    figure = trajectory.storage(held, machines=[3])
    (ax,) = figure.axes
    assert labeled(figure)
    assert_curves(ax.lines, held.time, held.arrays.storage[:, [1]])
    assert ax.get_title(loc="left") == f"storage of machine 3 at bus {held.point.case.machine(3).storage_bus}"
    assert len(trajectory.storage(held).axes) == 2
    assert len(trajectory.overview(held).axes) == 4
    assert len(trajectory.overview(simulate(held.point.case.with_storage(()), None, 0.1)).axes) == 3


def test_a_signal_that_hardly_moves_is_not_blown_up(cases):
    still = simulate(cases("two_area"), None, 0.1)
    for signal, quantity in QUANTITIES.items():
        if quantity.of != "device":
            low, high = trajectory.plot(still, signal).get_ylim()
            assert high - low > 0.999 * trajectory.LEAST.get(signal, trajectory.STILL)
    low, high = trajectory.plot(still).get_ylim()
    assert (low + high) / 2 == pytest.approx(60, abs=1e-3)


def test_colors_mark_the_machines_that_are_lost_or_move_most():
    def colors(owners, unstable, swings):
        point = SimpleNamespace(rotor_names=tuple(range(20)))
        outcome = SimpleNamespace(off_frequency=())
        run = SimpleNamespace(unstable_machines=unstable, outcome=outcome, point=point, peak=np.array(swings))
        return trajectory._colors(np.outer([0.0, 1.0], swings[: len(owners)]), owners, run)

    swings = [(7 * k) % 20 for k in range(20)]
    assert colors([1, 2, 3, 4], (2,), swings) == list(COLORS[:4])
    one = colors(range(20), (3, 5), swings)
    assert [k for k, color in enumerate(one) if color != GRAY] == [3, 5]
    assert len({*one}) == 3
    moving = colors(range(20), (), swings)
    assert [k for k, color in enumerate(moving) if color != GRAY] == sorted(np.argsort(swings)[-5:])
    assert colors(range(19, -1, -1), (), swings) == moving[::-1], "a machine has one color"
    assert [k for k, c in enumerate(colors([""] * 20, (), swings)) if c != GRAY] == sorted(np.argsort(swings)[-5:])
    most = colors(range(20), tuple(range(12)), swings)
    assert most == [COLORS[1]] * 12 + [trajectory.MANY] * 8


@pytest.mark.parametrize("storage", ["3@11=50MW,4@10=50MW", "1@5=20MW,1@6=30MW,3@5=10MW"])
def test_storage_has_the_color_of_its_machine(cases, storage):
    """A second device of a machine has a color that no machine has, as buses without a machine."""
    figure = trajectory.overview(
        simulate(cases("two_area"), None, 0.1, storage=storage), "speed,voltage:7,voltage:8,storage"
    )
    speed, voltage, power = ({text.get_text(): text.get_color() for text in ax.texts} for ax in figure.axes)
    seen = []
    for name, color in sorted(power.items()):
        machine = f"machine {re.search('[0-9]+', name)[0]}"
        assert (color == speed[machine]) == (machine not in seen)
        assert (color in speed.values()) == (machine not in seen)
        seen.append(machine)
    assert len({*power.values()}) == len(power)
    assert {*voltage.values()}.isdisjoint(speed.values())


def test_machines_of_an_island_that_loses_its_frequency_are_colored(cases):
    found = simulate(cases("ieee39"), [st.Open("16-19", at=2.0), st.TripMachine(3, at=4.0)], 8.0)
    assert found.outcome.off_frequency == (4, 5)
    assert "of the island of machines 4, 5 was" in found.outcome.message
    assert [text.get_text() for text in trajectory.plot(found).texts] == ["machine 4", "machine 5"]


def test_channels_of_an_overview_are_those_of_the_table(held):
    text = "voltage:8,speed:2,voltage:7,storage:3,field_voltage"
    voltage, speed, storage, field = trajectory.overview(held, text).axes
    frame = held.table(text)
    for ax, columns in (
        (speed, ["speed_pu:2"]),
        (storage, ["storage_mw:3@11"]),
        (field, [f"efd_pu:{m}" for m in range(1, 5)]),
    ):
        factor = 60 if ax is speed else 1
        assert_curves(ax.lines[: len(columns)], held.time, factor * frame[columns].to_numpy())
    names = [[text.get_text() for text in ax.texts] for ax in (voltage, speed, storage)]
    assert [sorted(one) for one in names] == [["bus 7", "bus 8"], ["machine 2"], ["storage 3@11"]]
    with pytest.raises(StudyError, match="One plot shows one quantity, but 4 are given"):
        trajectory.plot(held, text)


def test_estimates_and_commands(cases):
    found = estimate(cases("two_area"), FAULT, 0.6, storage="50MW", seeds=(3, 5))
    figure = estimates.plot(found, machines=[2, 4], seed=5)
    assert len(figure.axes) == 2
    assert labeled(figure)
    for ax, i in zip(figure.axes, (1, 3), strict=True):
        seen, true = ax.lines
        assert data(true)[1] == pytest.approx(60e3 * found.deviation[:, 1, i])
        assert data(seen)[1] == pytest.approx(60e3 * found.deviation_estimated[:, 1, i])
        (band,) = ax.collections
        low, high = band.get_paths()[0].vertices[:, 1].min(), band.get_paths()[0].vertices[:, 1].max()
        mid, sigma = found.deviation_estimated[:, 1, i], found.sigma[:, 1, i]
        assert (low, high) == pytest.approx((60e3 * (mid - 3 * sigma).min(), 60e3 * (mid + 3 * sigma).max()))
    assert "seed 5" in figure.get_suptitle()
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["machine 2", "machine 4"]
    assert not np.array_equal(found.estimated_commands[:, 0], found.estimated_commands[:, 1])
    for row, seed in enumerate((3, 5)):
        drawn = estimates.commands(found, seed=seed).axes
        assert labeled(drawn[0])
        assert len(drawn) == 4
        for i, ax in enumerate(drawn):
            assert_curves(ax.lines[:1], found.time, found.true_commands[:, row, [i]])
            assert_curves(ax.lines[1:], found.time, found.estimated_commands[:, row, [i]])


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({"machines": [9]}, "no machine 9"), ({"machines": [1, 9]}, "no machine 9"), ({"machines": []}, "is empty"),
        ({"seed": 1}, "no seed 1; choose one of 5"),
    ],
)  # fmt: skip
def test_what_was_not_estimated_is_not_drawn(cases, how, says):
    found = estimate(cases("two_area").classical(), None, 0.1, seeds=5, record=False)
    for draw in (estimates.plot, estimates.commands):
        with pytest.raises(StudyError, match=says):
            draw(found, **how)
        assert len(draw(found, machines=3, seed=5).axes) == 1


def test_runs_of_a_search_and_bars_of_a_screen(points):
    found = critical(points("two_area"), "7-8@0.1", scan=0, resolution="1cyc")
    ax = clearing.plot_clearing_time(found)
    assert labeled(ax)
    for line, stable in zip(ax.lines, (True, False), strict=False):
        runs = [r for r in found.runs if r.stable is stable]
        assert data(line).T == pytest.approx(np.array([(r.cycles, r.time_s) for r in runs]))
    assert vertical(ax) == [found.cycles]
    assert ax.get_ylim()[0] == 0
    whole = screened(points("two_area"), limit="9cyc", resolution="1cyc")
    ax = clearing.plot_screen(whole, most=3)
    assert labeled(ax)
    assert [bar.get_width() for bar in ax.patches] == [p.cycles or 9.0 for p in whole.pairs[:3]]
    colors = ["gray" if p.status == "stable_at_limit" else "blue" for p in whole.pairs[:3]]
    assert [bar.get_facecolor()[0] > 0.3 for bar in ax.patches] == [color == "gray" for color in colors]
    notes = [text.get_text() for text in ax.texts]
    assert notes == [f"machine {p.machine}" if p.cycles else "stable at the search limit" for p in whole.pairs[:3]]
    assert ax.get_title() == f"two_area: 3 of {whole.screened} faults"


def test_eigenvalues_and_lines_of_constant_damping(points):
    modes = analyze(linearize(points("two_area_thyristor")))
    ax = modes.plot()
    assert labeled(ax)
    marked = {line.get_label(): data(line) for line in ax.lines if not line.get_label().startswith("_")}
    s = modes.eigenvalues[modes.eigenvalues.imag > 0]
    drawn = np.concatenate([xy.T for xy in marked.values()])
    assert sorted(map(tuple, drawn)) == sorted(zip(s.real, s.imag / (2 * np.pi), strict=True))
    x, y = marked["unstable"]
    assert (x > 0).all()
    assert len(x) == (s.real > 0).sum() == 1
    swings = modes.eigenvalues[modes.swings()]
    stable = swings[swings.real < 0]
    assert sorted(marked["electromechanical mode"][0]) == sorted(stable.real)
    left, right = ax.get_xlim()
    assert left < stable.real.min()
    assert right > s.real.max()
    assert ax.get_ylim() == (0, pytest.approx(1.2 * swings.imag.max() / (2 * np.pi)))
    rays = [data(line) for line in ax.lines if line.get_linestyle() == "--"]
    for (x, y), text in zip(rays, ax.texts, strict=True):
        ratio = -x[1] / np.hypot(x[1], 2 * np.pi * y[1])
        assert float(text.get_text().removesuffix(" %")) == pytest.approx(100 * ratio)


def test_every_unstable_oscillation_lies_inside(points):
    """Also one that is neither a swing nor the least damped."""
    modes = analyze(linearize(points("two_area")))
    others = np.flatnonzero((modes.eigenvalues.imag > 0) & ~modes.electromechanical)[:2]
    values = modes.eigenvalues.copy()
    values[others] = 0.8 + 1j, 1.5 + 6j
    made = replace(modes, eigenvalues=values)
    assert others[1] not in [*made.swings(), *made.least_damped()]
    ax = made.plot()
    (unstable,) = (line for line in ax.lines if line.get_label() == "unstable")
    assert data(unstable).T == pytest.approx(np.array([[0.8, 1 / (2 * np.pi)], [1.5, 6 / (2 * np.pi)]]))
    for (low, high), at in zip((ax.get_xlim(), ax.get_ylim()), data(unstable), strict=True):
        assert (low < at).all()
        assert (at < high).all()


def test_a_frequency_response(points):
    model = linearize(points("two_area"), "vref:2, vref:3", "speed:2, voltage:7")
    magnitude, phase = model.plot(band=(0.1, 2.0)).axes[:2]
    assert labeled(phase)
    hz = data(magnitude.lines[0])[0]
    assert (hz[0], hz[-1]) == pytest.approx((0.1, 2.0))
    response = model.response(hz)
    pairs = [(i, j) for i in range(2) for j in range(2)]
    for (i, j), size, angle in zip(pairs, magnitude.lines, phase.lines, strict=True):
        assert data(size)[1] == pytest.approx(np.abs(response[:, i, j]))
        turned = np.deg2rad(data(angle)[1])
        assert np.exp(1j * turned) == pytest.approx(response[:, i, j] / np.abs(response[:, i, j]))
        assert np.abs(np.diff(turned)).max() < 1
        assert size.get_label() == f"{model.inputs[j]} to {model.outputs[i]}"


def test_arrows_of_a_mode_shape(points):
    modes = analyze(linearize(points("ieee39")))
    mode = modes.mode(modes.swings()[0])
    ax = mode.plot()
    tips = sorted((float(x[0]), float(y[0])) for x, y in map(data, ax.lines) if len(x) == 1)
    parts = [p for p in mode.shape if p.magnitude >= 0.02]
    expected = sorted((np.deg2rad(p.angle_deg), p.magnitude) for p in parts)
    assert np.array(tips) == pytest.approx(np.array(expected))
    assert max(size for _, size in tips) == 1
    named = {int(text.get_text()) for text in ax.texts}
    lead = max(parts, key=lambda p: p.magnitude)
    assert lead.machine in named
    for sign in (1, -1):
        side = [p for p in parts if sign * np.cos(np.deg2rad(p.angle_deg - lead.angle_deg)) >= 0 and p.magnitude >= 0.1]
        largest = sorted(side, key=lambda p: -p.magnitude)[:4]
        assert {p.machine for p in largest} <= named


def test_one_machine():
    m = OMIB()
    found = portrait(m)
    ax = one_machine.plot_phase_plane(found)
    assert labeled(ax)
    boundary = [data(line) for line in ax.lines if line.get_linestyle() == ":"]
    assert boundary[0][1] == pytest.approx(found.separatrix.speed)
    assert boundary[1][1] == pytest.approx(-found.separatrix.speed)
    dots = [tuple(data(line)[:, 0]) for line in ax.lines if line.get_marker() == "o"]
    assert dots == [*((c.angle, c.speed) for c in found.cleared), (found.start, 0)]
    assert [text.get_text() for text in ax.texts] == ["B", "C", "D", "A"]
    curve = found.curves[0]
    whole = [data(line) for line in ax.lines if line.get_linestyle() == "-" and line.get_marker() == "None"][:2]
    after, during = whole
    assert len(after[0]) + len(during[0]) == len(curve.t)
    assert during[0] == pytest.approx(curve.angle[curve.t <= curve.clearing])
    swing = curve.plot()
    assert labeled(swing)
    for ax, values in zip(swing.axes, (curve.angle, curve.speed, curve.power), strict=True):
        assert_curves(ax.lines[:1], curve.t, values[:, None])
        assert vertical(ax) == [curve.clearing]


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_every_feedback_law_has_its_axes(number):
    laws = compare(OMIB(), laws=(*paper_laws(), FeedbackLaw("both, larger", 0.03, 0.002))[:number])
    drawn = [ax for ax in one_machine.feedback(laws).axes if ax.lines]
    for ax, response in zip(drawn, laws.responses, strict=True):
        assert data(ax.lines[2])[1] == pytest.approx(response.curve.speed)
        assert ax.get_title() == f"{response.name}: peak {response.peak_angle:.3f} rad"


@pytest.mark.parametrize("absorbed", [0.0, 0.5])
def test_areas_are_between_the_curves(absorbed):
    area = Equivalent().equal_area(8, absorbed)
    ax = one_machine.plot_equal_area(area)
    assert labeled(ax)
    lines = {line.get_label(): data(line) for line in ax.lines}
    assert lines["$P_e$"] == pytest.approx(np.array([area.angle, area.Pe]))
    assert ("$P_e + P_C$" in lines) == (absorbed > 0)
    if absorbed:
        assert lines["$P_e + P_C$"][1] == pytest.approx(area.Pe + 6 / 7 * absorbed)  # the share that acts on the angle
    assert lines["$P_m$"][1] == pytest.approx([area.Pm] * 2)
    assert vertical(ax) == pytest.approx(sorted((area.start, area.clearing, area.stop)))
    for filled, size in zip(ax.collections, (area.A1, area.A2), strict=True):
        x, y = filled.get_paths()[0].vertices.T
        shoelace = abs(np.sum(x * np.roll(y, 1) - y * np.roll(x, 1))) / 2
        assert shoelace == pytest.approx(size, rel=2e-3)
    assert f"= {area.A1:.4f}" in ax.get_title(loc="left")


def test_areas_side_by_side_share_an_axis_that_holds_them_all():
    areas = {"without": Equivalent().equal_area(8), "with": Equivalent().equal_area(8, 0.5)}
    figure = one_machine.compare(areas)
    highest = max((area.Pe + area.absorbed).max() for area in areas.values())
    assert [ax.get_ylim() for ax in figure.axes] == [(0, pytest.approx(1.1 * highest))] * 2
    assert [ax.get_title(loc="left").split("$")[0] for ax in figure.axes] == list(areas)


def test_minimum_time():
    control = by_shooting(Equivalent().minimum_time_problem(6))
    figure = one_machine.plot(control)
    assert labeled(figure)
    rows = control.x1, control.x2, control.lambda1, control.lambda2
    for ax, values in zip(figure.axes[:4], rows, strict=True):
        assert_curves(ax.lines[:1], 1e3 * control.t, values[:, None])
        assert vertical(ax) == pytest.approx([1e3 * t for t in control.switches])
    assert_curves(figure.axes[4].lines[:1], 1e3 * control.t, control.Pc[:, None])

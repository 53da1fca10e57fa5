"""Criteria of performance: runs around each limit are judged right on both sides; packaged criteria; wrong files."""

import re
from dataclasses import replace

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.judgment import packaged
from stabctl.judgment.judged import spells

BESIDE = 1e-6
HEAD = 'title = "ours"\n'


@pytest.fixture(scope="module")
def run():
    """Nine seconds with a fault from 1 to 1.1 s, one bus of which is rewritten by each test."""
    return st.load("two_area").simulate(st.Contingency("7", clear="0.1s"), until="9s")


def with_voltage(run, bus, knots):
    """The run with a voltage at a bus that is linear between knots (s, pu), constant outside."""
    layout, k = run.point.layout, run.point.case.row_of_bus[bus]
    times, values = np.array(knots).T
    time = np.union1d(run.time, times)
    rows = np.stack([np.interp(time, run.time, column) for column in run.rows.T], axis=1)
    V = np.ascontiguousarray(rows[:, layout.voltages]).view(complex)
    V[:, k] = np.interp(time, times, values)
    rows[:, layout.voltages] = V.view(float)
    return replace(run, time=time, rows=rows)


def rules(tmp_path, text):
    path = tmp_path / "ours.toml"
    path.write_text(HEAD + text, encoding="utf-8")
    return st.criteria(path)


def judged(run, bus, criteria):
    """The violations at a bus."""
    return [v for v in run.judge(criteria).violations if v.where == f"bus {bus}"]


@pytest.mark.parametrize("seed", range(25))
def test_levels_and_times_are_judged_right_on_both_sides(run, tmp_path, seed):
    """200 voltages around the limit of a level and a time, 1e-6 on both sides: eight for each of 25 draws."""
    rng = np.random.default_rng(seed)
    level, longest = rng.uniform(0.5, 0.9), rng.uniform(0.1, 1.5)
    begin, slope = rng.uniform(1.3, 4.0), rng.uniform(0.01, 0.1)
    low = level - rng.uniform(0.05, 0.3)

    def dip(length, bottom):
        """A trapezoid that is below the level for a length."""
        out = slope * (1.0 - level) / (level - bottom)
        return [
            (0.0, 1.0),
            (begin - out, 1.0),
            (begin, level),
            (begin + slope, bottom),
            (begin + length - slope, bottom),
            (begin + length, level),
            (begin + length + out, 1.0),
        ]

    for since in ("start", "clearing"):
        text = f'[[voltage]]\nname = "a"\nbelow = {level!r}\nlongest = "{longest!r}s"\nbuses = "loads"\n'
        text += f'since = "{since}"\n'
        criteria = rules(tmp_path, text)
        for change, violated in ((BESIDE, True), (-BESIDE, False)):
            found = judged(with_voltage(run, 9, dip(max(longest, 2.5 * slope) + change, low)), 9, criteria)
            assert bool(found) == (violated or longest < 2.5 * slope), (since, change)
        if found := judged(with_voltage(run, 9, dip(longest + 0.5, low)), 9, criteria):
            assert found[0].from_s == pytest.approx(begin + longest, abs=1e-6)
            assert found[0].extreme == pytest.approx(low, abs=1e-9)
    text = f'[[voltage]]\nname = "b"\nbelow = {level!r}\nbuses = "loads"\nsince = "clearing"\n'
    for change, violated in ((BESIDE, True), (-BESIDE, False)):
        touching = [(0.0, 1.0), (begin, 1.0), (begin + 1, level - change), (begin + 2, 1.0)]
        assert bool(judged(with_voltage(run, 9, touching), 9, rules(tmp_path, text))) == violated
    above = f'[[voltage]]\nname = "c"\nabove = {2 - level!r}\nbuses = "loads"\nsince = "clearing"\n'
    for change, violated in ((BESIDE, True), (-BESIDE, False)):
        touching = [(0.0, 1.0), (begin, 1.0), (begin + 1, 2 - level + change), (begin + 2, 1.0)]
        assert bool(judged(with_voltage(run, 9, touching), 9, rules(tmp_path, above))) == violated


@pytest.mark.parametrize(("change", "violated"), [(BESIDE, True), (-BESIDE, False)])
def test_recovery_and_what_comes_after_it(run, tmp_path, change, violated):
    recover = rules(tmp_path, '[[voltage]]\nname = "r"\nof = "before"\nbelow = 0.8\nrecover = "3s"\nbuses = "loads"\n')
    late = [(0.0, 1.0), (1.0, 1.0), (1.01, 0.3), (3.0, 0.3), (4.0 + change, 0.8), (5.0, 1.0)]
    before = abs(run.point.V[run.point.case.row_of_bus[9]])
    traced = with_voltage(run, 9, [(t, v * before) for t, v in late])
    found = judged(traced, 9, recover)
    assert bool(found) == violated
    assert not violated or found[0].from_s == pytest.approx(4.0)
    early = rules(tmp_path, '[[voltage]]\nname = "r"\nof = "before"\nbelow = 0.8\nrecover = "1cyc"\nbuses = "loads"\n')
    assert judged(traced, 9, early)[0].extreme == pytest.approx(0.3 * before, abs=1e-6), (
        "the lowest from then on, in the fault too"
    )
    second = (
        '[[voltage]]\nname = "s"\nbelow = 0.8\nlongest = "1s"\nsince = "recovery"\nrecovered = 0.9\nbuses = "loads"\n'
    )
    dips = [(0.0, 1.0), (1.0, 0.2), (3.0, 0.2), (3.5, 1.0), (5.0, 1.0), (5.2, 0.8), (5.3, 0.5), (6.1, 0.5)]
    dips += [(6.2 + change, 0.8), (6.5, 1.0)]
    found = judged(with_voltage(run, 9, dips), 9, rules(tmp_path, second))
    assert bool(found) == violated, "the long dip before the recovery does not count"


@pytest.mark.parametrize("clear", ["0.05s", "0.3s"])
def test_a_level_that_is_never_crossed_is_never_violated(tmp_path, clear):
    """Whether the fault is shorter or longer than what is allowed, 0.1 s."""
    run = st.load("two_area").simulate(st.Contingency("7", clear=clear, impedance=0.05j), until="3s")
    voltage, hertz = run.values("voltage"), 60 * run.values("speed")
    levels = [
        (kind, side, level)
        for kind, values in (("voltage", voltage), ("frequency", hertz))
        for side, level in (("below", values.min() - BESIDE), ("above", values.max() + BESIDE))
    ]
    spans = 'recover = "0.1s"', 'longest = "0.1s"', 'longest = "0.1s"\ntotal = true', ""
    text = "".join(
        f'[[{kind}]]\nname = "{kind} {side} {n}"\n{side} = {float(level)!r}\n{span}\n'
        for kind, side, level in levels
        for n, span in enumerate(spans)
        if "recover" not in span or (kind, side) == ("voltage", "below")
    )
    found = run.judge(rules(tmp_path, text))
    assert found.violations == ()
    assert found.undecided == ()


def test_a_level_that_is_reached_during_the_fault_has_recovered(run, tmp_path):
    """The fault is cleared 0.1 s after its beginning, when the level has been exceeded for some time."""
    ours = rules(tmp_path, '[[voltage]]\nname = "r"\nbelow = 0.8\nrecover = "50ms"\nbuses = "loads"\n')
    for at, violated in ((1.05 - BESIDE, False), (1.05 + BESIDE, True), (1.1, True)):
        traced = with_voltage(
            run, 9, [(0.0, 1.0), (1.0, 1.0), (1.0 + BESIDE, 0.5), (at - BESIDE, 0.5), (at, 0.8), (1.2, 1.0)]
        )
        assert bool(judged(traced, 9, ours)) == violated, at


@pytest.mark.parametrize(("change", "violated"), [(BESIDE, True), (-BESIDE, False)])
def test_times_are_added_up(run, tmp_path, change, violated):
    total = rules(tmp_path, '[[voltage]]\nname = "t"\nbelow = 0.8\nlongest = "1s"\ntotal = true\nbuses = "loads"\n')
    twice = [(0.0, 1.0), (2.0, 0.8), (2.1, 0.5), (2.4, 0.5), (2.5, 0.8), (3.0, 1.0), (4.0, 0.8), (4.1, 0.5), (4.4, 0.5)]
    twice += [(4.5 + change, 0.8), (5.0, 1.0)]
    found = judged(with_voltage(run, 9, twice), 9, total)
    assert bool(found) == violated


def test_a_value_before_an_event_is_held_up_to_it():
    time, held = np.array([0.0, 1.0, 2.0, 3.0]), np.array([False, True, False, False])
    assert spells(time, np.array([-1.0, -1.0, 1.0, -1.0]), held) == [(2.0, 2.5)]
    assert spells(time, np.array([-1.0, 1.0, -1.0, -1.0]), held) == [(0.5, 2.0)]
    assert spells(time, np.array([-1.0, 0.0, 0.0, -1.0]), held) == []
    assert spells(time, np.array([-1.0, 1.0, np.nan, np.nan])) == [(0.5, 2.0)], "a machine that is tripped"


def test_frequency_angle_and_swings(run, tmp_path):
    fastest = float(60 * run.arrays.speed.max())
    for change, violated in ((-BESIDE, True), (BESIDE, False)):
        text = f'[[frequency]]\nname = "f"\nabove = {fastest + change!r}\n'
        found = run.judge(rules(tmp_path, text)).violations
        assert bool(found) == violated
        if found:
            assert found[0].extreme == pytest.approx(fastest)
    angle = run.angle_from_coi_deg
    widest = float((angle.max(axis=1) - angle.min(axis=1)).max())
    for change, violated in ((-BESIDE, True), (BESIDE, False)):
        text = f'[[angle]]\nname = "d"\nseparation = "{widest + change!r}deg"\n'
        assert bool(run.judge(rules(tmp_path, text)).violations) == violated
    text = '[[swings]]\nname = "s"\nmust = "not grow"\n'
    growing = st.load("two_area_thyristor").simulate(st.Contingency("7", clear="1cyc"), until="10s")
    assert [v.rule for v in growing.judge(rules(tmp_path, text)).violations] == ["s"]
    assert run.judge(rules(tmp_path, text)).kept


def test_angles_are_judged_before_a_machine_is_tripped_too(tmp_path):
    """37 degrees between machines 1 and 4 until 1 s, then between 2 and 4 less."""
    run = st.load("two_area").simulate(st.TripMachine(1, 1.0), until="2s")
    text = '[[angle]]\nname = "d"\nseparation = "31.7deg"\n'
    (found,) = run.judge(rules(tmp_path, text)).violations
    assert found.from_s == 0
    assert "machines 1 and 4" in str(found)


def test_what_a_run_is_too_short_for_is_said(run, tmp_path):
    text = '[[voltage]]\nname = "r"\nbelow = 0.8\nrecover = "20s"\nbuses = "loads"\n'
    found = with_voltage(run, 9, [(0.0, 1.0), (1.0, 0.2), (9.0, 0.2)]).judge(rules(tmp_path, text))
    assert found.kept
    assert found.undecided == ("r: bus 9 has not recovered when the run ends at 9.000 s; simulate longer.",)


def test_a_bus_that_the_contingency_cuts_off_has_no_voltage_to_recover(tmp_path):
    """Its load is lost with it: only its voltage before counts, and the page does not show 0 as the lowest one."""
    ours = rules(tmp_path, '[[voltage]]\nname = "r"\nof = "before"\nbelow = 0.8\nrecover = "1s"\nbuses = "all"\n')
    run = st.load("ieee39").simulate(st.Contingency("12", clear="6cyc", trip="12-11, 12-13"), until="4s")
    last = run.values("voltage")[-1]
    assert run.outcome.stable
    assert [b.bus for b, v in zip(run.point.case.buses, last, strict=True) if v == 0] == [12]
    assert (run.energized[:, 11] == (run.time < 1.1 - 1e-9)).all()
    assert run.energized.sum(axis=1)[-1] == 38
    assert run.judge(ours).kept
    late = run.judge(rules(tmp_path, '[[voltage]]\nname = "d"\nbelow = 0.5\nlongest = "80ms"\nbuses = "all"\n'))
    assert "bus 12" in [v.where for v in late.violations], "what came before counts"


def test_an_unstable_run_keeps_no_criteria(tmp_path):
    lost = st.load("two_area").simulate(st.Contingency("7", clear="30cyc"), until="5s")
    found = lost.judge(rules(tmp_path, '[[frequency]]\nname = "f"\nbelow = 11.0\n'))
    assert not lost.outcome.stable
    assert not found.violations
    assert not found.kept
    assert str(found) == "ours: not kept, the run is unstable; 0 violations."


@pytest.mark.parametrize("name", packaged())
def test_packaged_criteria_say_where_they_are_from(name):
    found = st.criteria(name)
    assert found.source
    assert found.unverified
    assert len({rule.name for rule in found.rules}) == len(found.rules)


def test_packaged_criteria_judge_runs():
    base = st.load("two_area").initialize()
    short, long = (base.simulate(st.Contingency("7", clear=c), until="5s") for c in ("6cyc", "12cyc"))
    assert short.judge("wecc-tpl-001").kept
    assert short.judge("nerc-prc-024").kept
    found = long.judge("nerc-prc-024")
    assert {v.rule for v in found.violations} <= {rule.name for rule in st.criteria("nerc-prc-024").rules}
    with pytest.raises(StudyError, match="is for 50 Hz, but two_area has 60 Hz"):
        short.judge("entso-e")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "has no rules"),
        ('[[voltage]]\nname = "a"\n', "voltage rule 1: give either below or above"),
        ('[[voltage]]\nname = "a"\nbelow = 0.8\nabove = 1.1\n', "either below or above"),
        ("[[voltage]]\nbelow = 0.8\n", "voltage rule 1: name is missing"),
        ('[[voltage]]\nname = "a"\nbelwo = 0.8\n', "did you mean 'below'"),
        ('[[voltage]]\nname = "a"\nbelow = -1.0\n', "below = -1.0: it must be a voltage in pu"),
        ('[[voltage]]\nname = "a"\nbelow = 0.8\nlongest = "soon"\n', "voltage rule 1: 'soon' is not a time"),
        ('[[voltage]]\nname = "a"\nbelow = 0.8\nsince = "recovery"\n', "belong together"),
        ('[[angle]]\nname = "a"\nseparation = "0deg"\n', "not above 0"),
        ('[[angle]]\nname = "a"\nseparation = "120"\n', "'120' is not an angle; write it as 120deg"),
        ('[[swings]]\nname = "a"\nmust = "stop"\n', "must = 'stop'"),
        ("[[currents]]\n", "'currents' is not a known key"),
        ("title = 1", "is not valid TOML"),
    ],
)
def test_wrong_files_are_told(tmp_path, text, said):
    with pytest.raises(StudyError, match=re.escape(said)):
        rules(tmp_path, text)


def test_unknown_criteria_are_told(run, tmp_path):
    with pytest.raises(StudyError, match="did you mean wecc-tpl-001"):
        st.criteria("wecc-tpl")
    with pytest.raises(StudyError, match="cannot be read"):
        st.criteria(tmp_path / "none.toml")


def test_the_command(stabctl):
    words = "simulate", "two_area", "--fault", "7", "--until", 5, "--criteria"
    code, out, _ = stabctl(*words, "nerc-prc-024", "--clear", "6cyc")
    assert (code, "kept" in out) == (0, True)
    code, _, err = stabctl(*words, "prc", "--clear", "6cyc")
    assert (code, "There are no criteria 'prc'" in err) == (2, True)


@pytest.fixture(scope="module")
def undamped():
    return st.load("ieee39").classical().initialize()


def test_swings_that_must_decay_do(tmp_path):
    """Below the ratio of the criterion, whatever their size; before 5 s after the last event that is not judged."""
    rule = rules(tmp_path, '[[swings]]\nname = "s"\nmust = "decay"\n')
    for case in (st.load("two_area"), st.load("two_area").classical()):
        for cycles in (1, 3, 5):
            run = case.simulate(st.Contingency("7", clear=f"{cycles}cyc"), until="10s")
            assert run.judge(rule).kept == run.outcome.swings.decaying
    fault = st.Contingency("7", clear="3cyc", at=0.0)
    for until, kept in ((2.0, True), (5.0, True), (5.05, False)):
        found = case.simulate(fault, until=until).judge(rule)
        assert found.kept == kept
        assert bool(found.undecided) == kept
        assert not kept or f"5 s after the last event, but the run ends at {until:.3f} s" in found.undecided[0]
    lost = case.simulate(st.Contingency("7", clear="30cyc"), until="5s").judge(rule)
    assert (lost.kept, lost.undecided) == (False, ())


def test_a_violation_of_swings_is_that_of_the_machine_named(undamped, tmp_path):
    run = undamped.simulate(st.Contingency("1", clear="5cyc"), until=12)
    (found,) = run.judge(rules(tmp_path, '[[swings]]\nname = "s"\nmust = "not grow"\n')).violations
    k = [f"machine {name}" for name in run.point.rotor_names].index(found.where)
    angle = run.angle_from_coi_deg[:, k]
    assert found.from_s == pytest.approx(9.5)
    late, before = (np.ptp(angle[(run.time >= t - 1e-9) & (run.time <= t + 2.5 + 1e-9)]) for t in (9.5, 7.0))
    assert late == pytest.approx(found.extreme)
    assert late > 1.05 * before


def test_growing_swings_are_as_large_as_the_outcome_says(tmp_path):
    """The largest swing of all grows, and another machine has the largest ratio."""
    run = st.load("two_area_thyristor").simulate(st.Contingency("10", clear="2cyc"), until=7)
    (found,) = run.judge(rules(tmp_path, '[[swings]]\nname = "s"\nmust = "not grow"\n')).violations
    swing = np.ptp(run.angle_from_coi_deg[run.time >= 4.5 - 1e-9], axis=0)
    assert found.where == f"machine {run.point.rotor_names[swing.argmax()]}"
    assert found.extreme == pytest.approx(swing.max())
    assert f"the largest is {found.extreme:.3g} degrees" in run.outcome.message
    assert found.where != f"machine {run.outcome.swings.machine}"


def test_a_violation_of_angles_is_that_of_the_pair_named(undamped, tmp_path):
    """Their greatest distance; from the instant on at which they pass the limit, between two rows."""
    run = undamped.simulate(st.Contingency("2", clear="5cyc"), until=8)
    (found,) = run.judge(rules(tmp_path, '[[angle]]\nname = "a"\nseparation = "60deg"\n')).violations
    i, j = (list(run.point.rotor_names).index(int(name)) for name in re.findall(r"\d+", found.where))
    apart = run.angle_from_coi_deg[:, i] - run.angle_from_coi_deg[:, j]
    assert found.extreme == pytest.approx(apart.max())
    assert np.interp(found.from_s, run.time, apart) == pytest.approx(60)
    assert apart[run.time < found.from_s].max() < 60
    every = run.angle_from_coi_deg
    assert found.extreme < (every.max(axis=1) - every.min(axis=1)).max()


def test_a_violation_says_from_when_on_and_how_far(undamped, tmp_path):
    """The frequency is at its limit where it is first not allowed; its extreme is later."""
    run = undamped.simulate(st.Contingency("2", clear="5cyc"), until=8)
    for one in run.judge(rules(tmp_path, '[[frequency]]\nname = "f"\nabove = 60.3\n')).violations:
        hz = 60 * run.values("speed")[:, [f"machine {m}" for m in run.point.rotor_names].index(one.where)]
        assert np.interp(one.from_s, run.time, hz) == pytest.approx(60.3)
        assert one.extreme == hz.max()
        assert f"{one.extreme:.4g} Hz at worst, not allowed from {one.from_s:.3f} s on; not longer" in str(one)


@pytest.fixture(scope="module")
def twice(cases):
    """Two faults, the second one the worse."""
    mild, bad = st.Contingency("9", clear="4cyc", impedance=0.05j), st.Contingency("7", clear="6cyc", at="4s")
    return cases("two_area").simulate([mild, bad], until="9s")


def test_the_worst_is_that_of_all_times_and_not_of_the_first_that_is_too_long(twice, tmp_path):
    text = '[[voltage]]\nname = "v"\nbelow = 0.95\nlongest = "0.05s"\nbuses = "loads"\n'
    found = {one.where: one for one in twice.judge(rules(tmp_path, text)).violations}
    rows = [b.bus for b in twice.point.case.buses]
    for bus in (7, 9):
        assert found[f"bus {bus}"].from_s == pytest.approx(1.05)
        assert found[f"bus {bus}"].extreme == twice.values("voltage")[:, rows.index(bus)].min()


@pytest.mark.parametrize(("recover", "late"), [("0.5s", []), ("0.09s", [4.09])])
def test_each_fault_has_its_own_recovery(twice, tmp_path, recover, late):
    """The first lasts 4 cycles, the second 6."""
    text = f'[[voltage]]\nname = "v"\nbelow = 0.5\nrecover = "{recover}"\nbuses = "loads"\n'
    found = twice.judge(rules(tmp_path, text)).violations
    assert [one.from_s for one in found if one.where == "bus 7"] == pytest.approx(late)


def test_a_pair_that_an_island_keeps_is_told_once(cases, tmp_path):
    run = cases("two_area").simulate([st.Open("7-8", 1.0), st.Open("7-8#2", 1.0)], until="5s")
    found = run.judge(rules(tmp_path, '[[angle]]\nname = "a"\nseparation = "3deg"\n')).violations
    assert len({one.where for one in found}) == len(found) >= 2

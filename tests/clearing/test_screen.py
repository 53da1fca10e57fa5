"""The screen of line faults: the same answers as the clearing times one by one, in fewer runs."""

import csv
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.clearing import Run, Trial, clearing_time, lines, screen, trial
from stabctl.clearing.critical_time import last_stable
from stabctl.clearing.trial import Margin, Scan
from stabctl.controllers import BangBang
from stabctl.design.law import spread
from stabctl.dynamics import operating_point
from stabctl.model.fleet import everywhere
from stabctl.model.naming import Circuit
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.outcome import Kind
from stabctl.view.live import answers
from stabctl.view.live.commands import Source
from stabctl.view.live.state import Points, State

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
HALF = Scan(4, 1)  # one fault half a cycle shorter, on a grid of an eighth


@pytest.fixture(scope="module")
def classical(cases):
    return operating_point.solve(cases("ieee39").classical())


@pytest.fixture(scope="module")
def screens(points, classical):
    """name -> screen of a packaged case, made once."""
    return cache(lambda name: screen(classical if name == "classical" else points(name)))


def answer(found):
    """What a pair and a clearing time must agree on."""
    return found.status, found.cycles, found.machine


def grid(critical, slope=None, lost=()):
    """A system that survives up to a point but not those in `lost`; its margins where they grow by a slope."""
    asked = []

    def attempt(k):
        asked.append(k)
        if k <= critical and k not in lost:
            return Run(k, True, Kind.STABLE, None, 5.0)
        excess = None if slope is None else slope * (k**2 - (critical + 0.5) ** 2)
        return Run(k, False, Kind.LOST_SYNCHRONISM, 7, 1.0, excess and Margin(excess, slope * k**2))

    return attempt, asked


@pytest.mark.parametrize("slope", [None, 1e-6, 3.0])
@pytest.mark.parametrize("guess", [-5, 0, 3, 60, 479, 480, 9999])
@pytest.mark.parametrize("critical", [0, 1, 2, 31, 64, 200, 478, 479])
def test_search_finds_the_last_survivor_and_proves_it(critical, guess, slope):
    attempt, asked = grid(critical, slope)
    found = last_stable(attempt, 480, guess, 4, always=HALF)
    assert found[:2] == ("found", critical)
    assert found.machine == 7
    assert sorted(found.runs) == sorted(asked)
    assert {critical, critical + 1} <= set(asked)
    assert len(set(asked)) == len(asked)


def test_search_with_margins_asks_few_questions():
    attempt, asked = grid(73, 1e-6)
    last_stable(attempt, 480, 110, 4, always=HALF)
    assert len(asked) <= 6  # 5


@pytest.mark.parametrize("guess", [0, 7, 480])
def test_search_ends_at_the_ends(guess):
    always, never = (last_stable(grid(critical)[0], 480, guess, 4, always=HALF) for critical in (999, -1))
    assert (*always[:2], always.machine) == ("stable_at_limit", 480, None)
    assert (*never[:2], never.machine) == ("unstable_at_zero", 0, 7)


def test_an_answer_above_faults_that_are_lost_is_not_given():
    attempt, _ = grid(91, 1e-6, lost=range(85, 91))
    assert last_stable(attempt, 480, 120, 4, always=HALF).critical == 84


@pytest.mark.slow
def test_margins_foretell_the_critical_time(points):
    trial = Trial(points("ieee39"), Contingency("29", trip="26-29"))
    near, far = (trial.attempt(k).margin for k in (34, 40))
    assert 0 < near.excess < far.excess < far.given
    zero = np.sqrt(34**2 - near.excess * (40**2 - 34**2) / (far.excess - near.excess))
    assert abs(zero - 30.5) < 2  # 0.6   stable at 30, lost at 31: 3.75 cycles


def test_lines_bridges_and_twins(cases):
    found = lines(cases("ieee39"))
    assert len(found.screened) == 33  # of 34 lines; the other 12 branches are transformers
    assert found.bridges == (Circuit(16, 19),)
    named = [" ".join(map(str, part)) for part in lines(cases("two_area"))]
    assert named == ["7-8 8-9", "5-6 10-11 6-7 9-10", "7-8#2 8-9#2"]
    large = lines(cases("wnaps"))
    assert (len(large.screened), len(large.bridges)) == (96, 6)  # with the series capacitor 122-89


def test_a_parallel_circuit_written_from_its_other_end_is_a_twin_too(cases):
    case = cases("two_area")
    ends, turned = [(k.from_bus, k.to_bus) for k in case.branches], list(case.branches)
    for row in (k for k, one in enumerate(ends) if one in ends[:k]):
        turned[row] = turned[row]._replace(from_bus=ends[row][1], to_bus=ends[row][0])
    found = lines(replace(case, branches=tuple(turned)))
    assert found.screened == lines(case).screened
    assert " ".join(map(str, found.twins)) == "8-7#2 9-8#2"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "every"), [("two_area", 2), ("ieee39", 22), pytest.param("classical", 4, marks=pytest.mark.slow)]
)
def test_pairs_as_clearing_time_finds_them(screens, points, classical, name, every):
    point, found = classical if name == "classical" else points(name), screens(name)
    later_swings = [p for p in found.pairs if (p.fault, p.trip) in {("2", ("2-3",)), ("24", ("23-24",))}]
    for pair in [*found.pairs[::every], *later_swings]:
        assert answer(pair) == answer(clearing_time(point, pair.contingency)), pair


@pytest.mark.slow
def test_a_sample_of_wnaps_as_clearing_time_finds_it(points):
    point = points("wnaps")
    found = screen(point, buses=[84, 102])
    assert len(found.pairs) == 5
    for pair in found.pairs:
        assert answer(pair) == answer(clearing_time(point, pair.contingency)), pair
    lost = {p.trip: p.machine for p in found.pairs[:2]}
    assert lost == {("84-28",): 13, ("77-102",): 32}
    assert {p.status for p in found.pairs[:2]} == {"unstable_at_zero"}
    assert "even without a fault: 84-28, 77-102" in str(found)


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """A system from a PSS/E file, which names circuits by identifiers, one of them with the sign of a position."""
    text = (EXAMPLES / "three.raw").read_text()
    for old, new in (("102, 103, '1', 0.015", "102, 103, '@1', 0.011"), ("102, 103, '2'", "103, 102, '2'")):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path_factory.mktemp("three") / "three.raw"
    path.write_text(text)
    point = st.load(path, dyr=EXAMPLES / "three.dyr", loads="impedance").initialize()
    return point, screen(point, resolution="1cyc", longest="0s")


def test_circuits_with_identifiers_are_screened(identified):
    point, found = identified
    ends = {"101-102": "101 102", "101-103": "101 103", "102-103 ckt @1": "102 103", "103-102 ckt 2": "102 103"}
    assert {(p.fault, p.trip) for p in found.pairs} == {(b, (k,)) for k, e in ends.items() for b in e.split()}
    for pair in found.pairs[:3]:
        one = clearing_time(point, pair.contingency, resolution="1cyc", longest="0s", scan=0)
        assert answer(pair) == answer(one)
    assert found.pairs[0].cycles == 18  # of 18 to 20


def test_what_reads_a_screen_knows_circuits_with_identifiers(identified, tmp_path):
    point, found = identified
    for contingency in spread(found, 4):
        contingency.with_clear("6cyc").check(point.case)
    assert found.report(tmp_path, base=point).read_text().count("<title>") >= 2 * len(found.pairs)
    told = []
    answers.landscape(Points(point.case), State("101"), Source("", ()), told.append)
    rows = [row for message in told for row in message.get("pairs", ())]
    assert {(row[0], row[1]) for row in rows} == {(p.fault, p.trip[0]) for p in found.pairs}


def test_pairs_are_ranked_and_cut(screens):
    found = screens("ieee39")
    times = [-1 if p.status == "unstable_at_zero" else p.cycles or np.inf for p in found.pairs]
    assert times == sorted(times)
    assert len(found.pairs) == found.screened == 66
    cut = found.below("8cyc")
    assert cut.pairs == tuple(p for p in found.pairs if p.cycles is not None and p.cycles < 8)
    for time in {p.cycles for p in found.pairs if p.cycles}:  # a pair of that time is not below it
        assert max((p.cycles for p in found.below(f"{time}cyc").pairs if p.cycles), default=0) < time
        assert time in {p.cycles for p in found.below(f"{time + 0.01}cyc").pairs}
    assert "66 fault and trip pairs" in str(found)
    assert "16-19" in str(found)
    assert str(cut).count("machine 9 loses synchronism first") == 9


def test_below_gives_the_same_pairs_in_fewer_runs(screens, points):
    whole, cut = screens("ieee39"), screen(points("ieee39"), below="8cyc")
    assert cut.rows() == whole.below("8cyc").rows()
    assert cut.simulations < whole.simulations / 2  # 0.36


@pytest.mark.parametrize("apart", [-0.01, 0.0, 0.01, 0.06, 0.124])
def test_below_cuts_between_points_of_the_grid_too(points, apart):
    """A pair whose clearing time is just below the limit is listed, one at the limit is not."""
    whole = screen(points("two_area"))
    limit = f"{min(p.cycles for p in whole.pairs) + apart}cyc"
    assert screen(points("two_area"), below=limit).rows() == whole.below(limit).rows()
    assert bool(whole.below(limit).pairs) == (apart > 0)


def test_nothing_below_is_said(cases):
    point = operating_point.solve(cases("two_area").classical())
    short = screen(point, below="3cyc")
    assert not short.pairs
    assert "all 4 fault and trip pairs are stable for 3 cycles" in str(short)
    with pytest.raises(StudyError, match="below 0 cycles"):
        screen(point, below=0)


def test_a_fine_grid_costs_few_questions():
    attempt, asked = grid(31_415_926_535)
    found = last_stable(attempt, 480_000_000_000, 10**9, 10**9, always=Scan(4 * 10**9, 1))
    assert found.critical == 31_415_926_535
    assert len(asked) < 50  # 43


@pytest.mark.slow
def test_threads_change_nothing(points):
    alone, several = (screen(points("ieee39"), below="6cyc", workers=n) for n in (1, 3))
    assert alone.rows() == several.rows()
    assert alone.simulations == several.simulations


def test_every_simulation_is_counted(points, monkeypatch):
    """Those of every search, and one with a lasting fault at every bus, from which the first search begins."""
    simulated, made = trial.run_of, []
    monkeypatch.setattr(trial, "run_of", lambda *what, **how: made.append(what) or simulated(*what, **how))
    found = screen(points("two_area"), resolution="2cyc", longest="0s")
    assert {p.fault for p in found.pairs} == {"7", "8", "9"}
    assert found.simulations == len(made) == sum(len(p.runs) for p in found.pairs) + 3


def test_storage_lengthens_what_is_screened(cases, screens):
    case = cases("two_area")
    stored = operating_point.solve(case.with_storage(everywhere(case, "50MW")))
    held = {p.contingency: p.cycles for p in screen(stored, control=BangBang()).pairs}
    without = {p.contingency: p.cycles for p in screens("two_area").pairs}
    assert all(held[k] > without[k] for k in without)


def test_impossible_screens_are_refused(points, tmp_path, screens):
    with pytest.raises(StudyError, match="resolution"):
        screen(points("two_area"), resolution=0)
    with pytest.raises(StudyError, match="two_area has no branch at bus 1 that counts as a line"):
        screen(points("two_area"), buses=[1])
    for wrong in (99, "7 99", [7.5], 3.5, ["x"]):
        with pytest.raises(StudyError, match="bus"):
            screen(points("two_area"), buses=wrong)
    for wrong, said in (([], r"faults = \[\] is not allowed; give 'lines'"), (7, "7 has no fault whose clearing time")):
        with pytest.raises(StudyError, match=said):
            screen(points("two_area"), faults=wrong)
    with pytest.raises(StudyError, match="workers"):
        screen(points("two_area"), workers=0)
    with pytest.raises(StudyError, match=r"\.csv"):
        screens("two_area").save(tmp_path / "screen.xls")


@pytest.mark.slow
def test_command(stabctl, tmp_path):
    path = tmp_path / "screen.csv"
    code, out, _ = stabctl("screen", "ieee39", "--classical", "--below", "5cyc", "--json", "--out", path)
    record = json.loads(out)
    assert code == 0
    keys = {"case", "pairs", "bridges", "simulations", "wall_s", "observed_s", "resolution_cycles"}
    assert keys <= set(record)
    assert record["bridges"] == ["16-19"]
    first = record["pairs"][0]
    found = {"fault": "29", "trip": "28-29", "cycles": 3.125, "status": "found", "machine": 9}
    assert first == found | {"limited_by": "synchronism"}
    rows = list(csv.DictReader(path.open()))
    assert [r["fault"] for r in rows] == [p["fault"] for p in record["pairs"]]
    assert [p.name for p in tmp_path.iterdir()] == ["screen.csv"]
    code, out, _ = stabctl("screen", "two_area")
    assert code == 0
    assert "7-8#2" in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--out", "screen.xls"), "screen.xls"),
        (("--out", "nowhere/screen.csv"), "nowhere"),
        (("--below", "soon"), "soon"),
        (("--below", "0cyc"), "0"),
        (("--resolution", "0cyc"), "resolution"),
        (("--workers", "0"), "workers"),
        (("--observe", "0"), "observation"),
    ],
)
def test_a_mistake_is_one_line(stabctl, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = stabctl("screen", "two_area", *words)
    assert (code, out) == (2, "")
    assert said in err.splitlines()[-1]
    assert len(err.splitlines()) == 1


def test_a_clearing_time_that_frequency_limits_says_so_everywhere(stabctl, points, tmp_path):
    """The frequency of two_area leaves a range up to 60.5 Hz before synchronism is lost."""
    narrow, base = Criterion(max_frequency="60.5Hz", frequency_delay_s=0.1), points("two_area")
    alone = base.clearing_time("7", criterion=narrow, resolution="1cyc")
    assert (alone.machine, alone.limited_by) == (None, "frequency")
    assert " cycles (0.1833 s); limited by frequency, not by loss of synchronism (" in str(alone)
    assert base.clearing_time("7", resolution="1cyc").limited_by == "synchronism"
    found = base.screen(criterion=narrow, resolution="1cyc", buses=[7])
    assert set(found.df.limited_by) == {"frequency"}
    assert "cycles; limited by frequency, not by loss of synchronism" in str(found)
    page = found.report(tmp_path / "page").read_text()
    assert '<td class="text">frequency</td>' in page
    options = "--max-frequency", "60.5Hz", "--frequency-delay", "0.1s", "--resolution", "1cyc"
    path = tmp_path / "screen.csv"
    screened = "screen", "two_area", *options
    assert "\tfrequency\n" in stabctl(*screened, "--out", path)[1]
    assert {row["limited_by"] for row in csv.DictReader(path.open())} == {"frequency"}
    for command in (screened, ("clearing-time", "two_area", "--fault", "7", *options)):
        record = json.loads(stabctl(*command, "--json")[1])
        assert record.get("pairs", [record])[0]["limited_by"] == "frequency"

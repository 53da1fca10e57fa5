"""A stability study: every number is that of the single study; limits are judged right on both sides."""

import html
import json
import re
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from systems import OWN, registered

import stabctl as st
from stabctl import io
from stabctl._util.errors import StudyError
from stabctl.assessment import study as study_function
from stabctl.assessment.remedies import applicable
from stabctl.clearing import Severity
from stabctl.judgment import criteria
from stabctl.smallsignal import Selected
from stabctl.view.pages import study_page

study_module = sys.modules[study_function.__module__]
QUICK = {"resolution": "0.5cyc", "observe": "3s", "longest": "0s", "scan": "0s", "limit": "20cyc"}


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize()


@pytest.fixture(scope="module")
def study(base):
    return base.study("10cyc", worst=2, remedies="none", **QUICK)


@pytest.mark.slow
@pytest.mark.parametrize(("damping", "more"), [(0.05, ""), (0.4, ", damping=(-0.5, 0.4)")])
def test_the_page_asks_for_the_modes_that_are_judged(study, tmp_path, damping, more):
    wanted = replace(study, wanted=study.wanted._replace(damping=damping))
    assert f"base.modes((0.1, 3){more})" in wanted.report(tmp_path).read_text("utf-8")


def test_every_part_is_that_of_the_single_study(base, study):
    assert study.screen.rows() == base.screen(faults="lines, buses", **QUICK).rows()
    assert np.array_equal(study.modes.eigenvalues, base.modes((0.1, 3.0)).eigenvalues)
    assert np.array_equal(study.flow.V, base.power_flow().V)
    assert str(study.unusual) == str(base.case.check())
    for margin, run in zip(study.margins, study.worst, strict=False):
        alone = base.simulate(margin.found.contingency.with_clear("10cyc"), until=f"{1 + 10 / 60 + 3}s")
        assert np.array_equal(run.rows, alone.rows)
        assert run.outcome == alone.outcome
        assert run.outcome.stable == margin.secure


def test_the_worst_are_simulated_with_the_control(base):
    point, law = base.case.initialize(storage="400MW"), st.BangBang()
    found = point.study("5cyc", faults="lines", worst=1, control=law, remedies="none", **QUICK)
    ((contingency, until),) = found.runs
    (run,) = found.worst
    with_law, without = (point.simulate(contingency, until, control=one) for one in (law, None))
    assert np.array_equal(run.rows, with_law.rows)
    assert np.abs(with_law.arrays.angle - without.arrays.angle).max() > 0.1


def test_margins_are_sorted_and_judged(study):
    required = study.wanted.cycles
    assert required == 10
    assert [m.cycles for m in study.margins] == sorted(m.cycles for m in study.margins)
    for m in study.margins:
        critical = {"stable_at_limit": 20.0, "unstable_at_zero": 0.0}.get(m.found.status, m.found.cycles)
        assert m.cycles == critical - required
        assert m.secure == (critical >= required)
    assert study.insecure == tuple(m for m in study.margins if not m.secure)
    assert not study.secure
    assert "1 of 15 contingencies is lost with a clearing time of at most 10 cycles" in str(study)


@pytest.mark.parametrize(("beyond", "secure"), [(0.0, True), (1e-6, False)])
def test_the_limits_themselves_are_allowed(study, beyond, secure):
    """Clearing time, damping and voltage at their limit, and beyond it by 1e-6."""
    first = study.margins[0].found.cycles
    at = replace(study, wanted=study.wanted._replace(cycles=first + beyond))
    assert bool(at.insecure) != secure
    least = min(study.modes.damping_ratio[k] for k in study.modes.within(0.1, 3.0))
    at = replace(study, wanted=study.wanted._replace(damping=least + beyond))
    assert bool(at.poorly_damped) != secure
    low = float(np.abs(study.flow.V).min())
    at = replace(study, wanted=study.wanted._replace(voltages=(low + beyond, 2.0)))
    assert bool(at.low_or_high) != secure
    assert secure or at.low_or_high == ((8, low),)


@pytest.mark.parametrize("damping", [0.2, 0.4])
def test_of_a_large_system_every_oscillation_below_the_damping_wanted_is_told(base, monkeypatch, damping):
    """Modes of a band are found up to that ratio: those that are poorly damped are the same as of all modes."""

    def poorly():
        found = base.study("1cyc", faults=["8"], damping=damping, worst=0, remedies="none", **QUICK)
        values = found.modes.eigenvalues
        return isinstance(found.modes, Selected), np.sort_complex(values[list(found.poorly_damped)])

    few, whole = poorly()
    assert not few
    assert (-whole.real / np.abs(whole) > 0.3).any() == (damping > 0.3)
    monkeypatch.setattr("stabctl.smallsignal.analysis.LARGE", 10)
    few, found = poorly()
    assert few
    assert found == pytest.approx(whole, rel=1e-9)


def test_an_oscillation_outside_the_band_is_not_the_least_damped_one(study):
    """One of 5 Hz with a damping ratio of 0.01 is not judged, in no sentence."""
    fast = int(np.argmax(study.modes.eigenvalues.imag))
    s = study.modes.eigenvalues.copy()
    s[fast] = 2 * np.pi * 5 * complex(-0.01, 1)
    other = replace(study, modes=replace(study.modes, eigenvalues=s))
    assert other.modes.least_damped()[0] == fast
    assert other.oscillations[0] == study.modes.least_damped()[0]
    assert str(other) == str(study)
    assert "least damped: 0.611 Hz, damping ratio 0.1198" in str(other)
    assert [*study_page._numbers(other)] == [*study_page._numbers(study)]


@pytest.mark.parametrize("s", [complex(1e-3, 0.08), complex(2, 0), complex(1e-3, 300)])
def test_a_system_with_a_mode_that_grows_is_not_secure_whatever_its_frequency(study, s):
    """It is said first, and the mode is in the tables and on the page: the same study but for one eigenvalue."""
    stable = replace(study, wanted=study.wanted._replace(cycles=5.0))
    values = study.modes.eigenvalues.copy()
    values[np.argmax(values.imag)] = s
    other = replace(stable, modes=replace(study.modes, eigenvalues=values))
    assert (stable.secure, stable.unstable) == (True, "")
    assert not other.secure
    assert other.remarks()[0].startswith(f"two_area: the operating point is unstable: eigenvalue {s.real:.4g}")
    assert other.tables()["modes"]["real"].max() == s.real
    assert bool(applicable(other, ["stabilizers", "storage"])) == (s.imag > 0)
    page = study_page.page(other)
    assert page.numbers[0] == ("not secure", "unstable at the operating point")
    assert page.html().count('<tr class="unstable">') == 1


@pytest.mark.slow
def test_a_governor_that_is_unstable_on_its_own_is_found_by_the_command(stabctl, tmp_path):
    """Every contingency is survived for the seconds observed, while 0.013 Hz grow."""
    slow = [
        word for n in range(1, 5) for x in ("T4=0", "T5=20", "Tc=20", "Ts=3") for word in ("--set", f"tgov.{n}.{x}")
    ]
    words = "study", "two_area", *slow, "--clear", "3cyc", "--faults", "lines", "--worst", 0, "--remedies", "none"
    code, out, _ = stabctl(*words, "--resolution", "0.5cyc", "--json")
    found = json.loads(out)
    assert (code, found["secure"]) == (1, False)
    assert {one["margin_cycles"] > 0 for one in found["contingencies"]} == {True}
    assert "the operating point is unstable: eigenvalue 0.004798 +- 0.08065j 1/s" in found["remarks"][0]
    assert "damping ratio -0.0594" in found["remarks"][2]
    assert min(found["modes"], key=lambda mode: mode["damping_ratio"])["frequency_hz"] < 0.1


def test_it_is_told_while_parts_are_missing(base):
    parts, shares = [], []
    tell = {"each": parts.append, "progress": lambda *told: shares.append(told)}
    whole = base.study("8cyc", faults="lines", worst=1, **tell, **QUICK)
    assert [(p.modes is not None, len(p.ranking), p.screen is not None, len(p.worst)) for p in parts] == [
        (False, 0, False, 0),
        (True, 0, False, 0),
        (True, 4, False, 0),
        (True, 0, True, 0),
        (True, 0, True, 1),
    ]
    assert [share for share, _ in shares] == sorted(share for share, _ in shares)
    assert whole.secure
    with pytest.raises(StudyError, match="not complete"):
        _ = parts[1].secure
    for part in parts:
        assert part.report


@pytest.mark.slow
def test_the_page_and_the_workbook_have_the_numbers(study, tmp_path):
    import openpyxl

    page = study.report(tmp_path).read_text("utf-8")
    assert "not secure" in page
    assert page.count('<tr class="unstable">') == len(study.insecure) + len(study.poorly_damped)
    for m in study.margins:
        assert f"<td>{m.shown}</td>" in page
    book = openpyxl.load_workbook(study.save(tmp_path / "all.xlsx"))
    assert book.sheetnames == list(study.tables())
    rows = list(book["contingencies"].values)
    assert list(rows[0]) == list(study.df.columns)
    assert [row[5] for row in rows[1:]] == [m.known_cycles for m in study.margins]


def test_without_a_critical_time_there_is_no_margin_in_the_tables(base, study):
    """At the limit of the search it is at least what is shown; a higher limit finds one that is not less."""
    both = study.df.merge(study.screen.df, on=["fault", "trip"], suffixes=("", "_screen"))
    assert both["critical_cycles"].equals(both["cycles"])
    assert both["status"].equals(both["status_screen"])
    assert (both["margin_cycles"].isna() == (both["status"] != "found")).all()
    low = base.study("6cyc", faults="lines", worst=0, remedies="none", **QUICK | {"limit": "8cyc"})
    high = base.study("6cyc", faults="lines", worst=0, remedies="none", **QUICK)
    assert {m.shown for m in low.margins} == {"+2 or more"}
    assert low.margins[0].cycles <= high.margins[0].cycles == high.margins[0].known_cycles == 3
    assert "the smallest margin is at least 2 cycles." in str(low)
    assert "the smallest margin is 3 cycles." in str(high)
    assert next(number for number, _ in study_page._numbers(low)) == "+2 or more"


@pytest.mark.slow
def test_the_page_says_the_clearing_times_that_the_sentences_say(base):
    own = st.Contingency("7", trip="7-8", clear="5cyc")
    for given, said in (
        ([own], "a clearing time of its own"),
        ([own, "8"], "a clearing time of 14 cycles, or their own"),
        (["8"], "a clearing time of 14 cycles"),
    ):
        found = base.study("14cyc", faults=given, **ALONE, **QUICK)
        page = study_page.page(found)
        assert page.numbers[0] == ("secure", f"with {said}")
        assert (f"0 of {len(given)}", f"contingencies lost with {said.replace('of', 'of at most')}") in page.numbers
        assert f"survived with {said}, none lost" in str(found)
        assert f"Simulated with {said}." in page.html()


def test_text_of_a_case_is_no_formula_in_a_workbook(study, tmp_path):
    import openpyxl

    pair = study.screen.pairs[0]
    named = replace(pair, contingency=replace(pair.contingency, name="=1+1"))
    other = replace(study, screen=replace(study.screen, pairs=(named,)))
    (_, row) = openpyxl.load_workbook(other.save(tmp_path / "x.xlsx"))["contingencies"].values
    assert row[0] == "'=1+1"


@pytest.mark.slow
def test_a_system_that_cannot_be_linearized_is_studied_all_the_same(base, stabctl, tmp_path):
    """Every other part is that of the single study, and why there are no modes is said."""
    case = base.case.set({"pss.2.Vmax": 0.0})
    found = case.study("6cyc", worst=1, faults="lines", **QUICK)
    assert found.modes is None
    assert found.complete
    assert not found.insecure
    assert not found.secure
    assert found.screen.rows() == case.screen(faults="lines", **QUICK).rows()
    assert "Oscillations are not judged" in str(found)
    assert "exactly at its limit Vmax = 0 pu" in str(found)
    page = found.report(tmp_path).read_text("utf-8")
    assert "undecided" in page
    assert "still computed" not in page
    strict = tmp_path / "strict.toml"
    strict.write_text('title = "Strict"\n[[voltage]]\nname = "dip"\nof = "nominal"\nbelow = 0.99\nlongest = "1ms"\n')
    missed = replace(found, how=found.how._replace(criteria=criteria(strict)))
    assert study_page.page(missed).numbers[0][0] == "not secure"
    words = "--faults", "lines", "--worst", 1, "--limit", "20cyc", "--resolution", "0.5cyc"
    code, out, err = stabctl("study", "two_area", "--set", "pss.2.Vmax=0", *words)
    assert (code, err) == (1, "")
    assert "Oscillations are not judged" in " ".join(out.split())
    lost = case.study("12cyc", worst=0, faults="lines", remedies="redispatch", **QUICK)
    assert "It is not enough. Oscillations are not judged." in str(lost)


def test_an_interrupted_study_goes_on(base, study, tmp_path):
    def stop(share, part):
        if part == "faults" and share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        base.study("10cyc", worst=2, remedies="none", store=tmp_path, progress=stop, workers=1, **QUICK)
    again = base.study("10cyc", worst=2, remedies="none", store=tmp_path, **QUICK)
    assert again.remarks() == study.remarks()
    assert again.df.equals(study.df)


@pytest.mark.slow
def test_the_command(stabctl, tmp_path):
    words = "two_area", "--resolution", "0.5cyc", "--observe", 3, "--longest", 0, "--scan", 0, "--limit", "20cyc"
    code, out, _ = stabctl("study", *words, "--worst", 1, "--json", "--clear", "10cyc")
    record = json.loads(out)
    assert code == 1
    assert record["secure"] is False
    assert len(record["contingencies"]) == 15
    code, out, _ = stabctl(
        "study", *words, "--clear", "6cyc", "--worst", 1, "--report", tmp_path, "--out", tmp_path / "s.csv"
    )
    assert code == 0
    assert out.splitlines()[0].split("\t")[:4] == ["fault at", "trip", "critical, cycles", "margin, cycles"]
    assert {p.name for p in tmp_path.iterdir()} == {"s.csv", "two_area_study.html"}
    page = (tmp_path / "two_area_study.html").read_text("utf-8")
    assert "base = st.load(&#39;two_area&#39;).initialize()" in page
    code, _, err = stabctl("study", *words, "--faults", "lines", "--contingencies", "x.toml")
    assert (code, "cannot be used together" in err) == (2, True)


@pytest.mark.slow
def test_a_long_screen_tells_what_it_has(base, monkeypatch):
    """Partial studies have some contingencies, no verdict, and a page that says so; the last has all."""
    monkeypatch.setattr(study_module, "EVERY", 0.0)
    monkeypatch.setattr(study_module, "AT_FIRST", ())
    parts = []
    whole = base.study("8cyc", faults="lines, buses", worst=0, each=parts.append, workers=1, **QUICK)
    counts = [len(p.screen.pairs) for p in parts if p.screen]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1] == len(whole.screen.pairs)
    first = next(p for p in parts if p.screen)
    assert not first.complete
    assert "This page is not complete: contingencies are still computed" in study_page.page(first).html()
    number = len(first.screen.pairs)
    assert f"{number} contingencies screened so far (15 in all)" in str(first)
    assert f"{number} of 15 contingencies are screened. Next come" in study_page.page(first).html()
    assert "not complete" not in study_page.page(whole).html()


@pytest.mark.slow
def test_before_the_screen_the_page_says_what_looks_worst(base):
    parts = []
    whole = base.study("8cyc", worst=0, each=parts.append, **QUICK)
    (first,) = (p for p in parts if p.ranking and not p.screen)
    html = study_page.page(first).html()
    assert "0 of 15 contingencies are screened. Next come" in html
    assert all(one.contingency.label in html and str(one) in html for one in first.ranking)
    assert {one.contingency for one in first.ranking} == {m.found.contingency for m in whole.margins}
    assert whole.margins[0].found.contingency in [one.contingency for one in first.ranking[:3]]
    assert "Next come" not in study_page.page(whole).html()


def test_pauses_between_partial_studies_become_longer(base, study, monkeypatch):
    """Told with every result, a page is written after 2, 5, 10, 30 and 50 s."""
    now, told = [0.0], []
    monkeypatch.setattr(study_module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    partly = study_module.Partly(replace(study, screen=None, worst=()), lambda _: told.append(now[0]))
    ranking = [Severity(p.contingency, True, 2.0, 30.0) for p in study.screen.pairs]
    partly.begin(ranking * 5)
    for second in range(1, 61):
        now[0] = float(second)
        partly(study.screen.pairs[:1])
    assert told == [0, 2, 5, 10, 30, 50]


@pytest.mark.slow
def test_the_worst_are_judged_by_criteria(base, tmp_path):
    """A study is not secure if a rule is violated, and says what, where and when; its clearing times keep the rule."""
    path = tmp_path / "own.toml"
    path.write_text('title = "ours"\n[[voltage]]\nname = "dip"\nbelow = 0.9\nsince = "clearing"\n')
    given = {"clear": "5cyc", "faults": "lines", "worst": 2, "remedies": "none"} | QUICK
    plain, strict = base.study(**given), base.study(**given, criteria=path)
    assert plain.secure
    assert not strict.secure
    screened = base.screen(faults="lines", criteria=path, **QUICK)
    assert {(p.contingency, p.cycles, p.limit) for p in strict.screen.pairs} == {
        (p.contingency, p.cycles, p.limit) for p in screened.pairs
    }
    assert [one.violations for one in strict.judged] == [run.judge(path).violations for run in strict.worst]
    assert "ours, by the 2 contingencies simulated: violated by 2; the first, dip: bus" in str(strict)
    assert set(strict.tables()["violations"]["contingency"]) == {m.found.contingency.label for m in strict.margins[:2]}
    assert "Violations of ours." in study_page.page(strict).html()
    assert base.study(**given, criteria="wecc-tpl-001").secure


def test_the_controls_that_take_damping_are_named():
    """In ieee39 the stabilizer of machine 8 works against the least damped swing."""
    study = st.load("ieee39").study("3cyc", damping="9%", faults=["16"], worst=0, remedies="none")
    (k,) = study.poorly_damped
    assert study.contributions(k).undamping[0].name == "PSS 8"
    assert "undamped most by PSS 8, EXST3 8, EXST3 4." in str(study)
    assert "PSS 8 -0.11" in study_page.page(study).html()


@pytest.mark.slow
@pytest.mark.parametrize("storage", [None, "5%mva"])
def test_every_number_of_a_large_study_is_that_of_the_single_command(storage):
    """With the usual settings; the study is told of while it runs, so its screen begins with the worst faults."""
    base = st.load("ieee39").initialize(storage=storage)
    law = st.BangBang() if storage else None
    study = base.study("5cyc", faults="lines, buses", remedies="none", control=law, each=lambda _: None)
    assert study.screen.rows() == base.screen(faults="lines, buses", control=law).rows()
    assert np.array_equal(study.modes.eigenvalues, base.modes((0.1, 3.0)).eigenvalues)
    for (contingency, until), run in zip(study.runs, study.worst, strict=True):
        assert np.array_equal(base.simulate(contingency, until, control=law).rows, run.rows)
    for margin in study.margins[:3]:
        alone = base.clearing_time(margin.found.contingency, control=law)
        assert (alone.cycles, alone.status) == (margin.found.cycles, margin.found.status)


@pytest.mark.slow
def test_the_lines_of_the_page_compute_its_numbers(stabctl, tmp_path):
    """Of a file with options: the system, the search and the criterion are those of the study."""
    raw = Path(__file__).parents[2] / "docs" / "examples" / "three.raw"
    words = "--loads", "impedance", "--set", "loads.103.p=240", "--clear", "3cyc", "--worst", 1, "--faults", "lines"
    words += "--limit", "30cyc", "--observe", 2, "--scan", 0, "--resolution", "1cyc", "--max-angle", "120deg"
    code, out, _ = stabctl("study", raw, *words, "--remedies", "none", "--report", tmp_path, "--json")
    page = (tmp_path / "three_study.html").read_text("utf-8")
    (lines,) = re.findall(r"(base = .*?)</pre>", html.unescape(page), re.DOTALL)
    found = {}
    for line in lines.strip().splitlines():
        exec(line if line.startswith("base = ") else f"last = {line.split('; ')[0]}", {"st": st}, found)
        if "base.screen" in line:
            times = Counter(p.cycles for p in found["last"].pairs)
    record = json.loads(out)
    assert times == Counter(row["critical_cycles"] for row in record["contingencies"])
    assert found["last"].outcome.message == record["worst"][0]["message"]
    assert f"max_angle={float(np.deg2rad(120))!r}" in lines


@pytest.mark.slow
def test_the_lines_of_the_page_register_the_devices_of_the_user_first(stabctl, tmp_path):
    words = "--faults", "lines", "--worst", 0, "--remedies", "none", "--clear", "3cyc", "--limit", "4cyc", "--scan", 0
    with registered(OWN / "wide_area.py"):
        io.write(st.load("two_area").with_device("wide_area", 1, bus=7, other=2), tmp_path / "own")
    with registered():
        stabctl("study", tmp_path / "own", "--device", OWN / "wide_area.py", *words, "--report", tmp_path)
    (page,) = tmp_path.glob("*.html")
    first = next(line for line in html.unescape(page.read_text("utf-8")).splitlines() if "base = " in line)
    with registered():
        exec(first[first.index("st.") :], {"st": st}, found := {})
        assert [*found["base"].case.devices["wide_area"]] == [1]


def test_a_clearing_time_beyond_the_search_is_no_verdict(base, stabctl):
    """With a limit of 5 cycles all four counted as lost with 9 cycles, though three survive 15 cycles and more."""
    common = {"faults": "lines", "worst": 0, "remedies": "none"}
    with pytest.raises(StudyError, match="shorter than the clearing time that protection guarantees, clear = 9 cycles"):
        st.study(base, clear="9cyc", limit="5cyc", **common)
    own = [st.Contingency("9", clear="12cyc", trip="8-9")]
    with pytest.raises(StudyError, match="ends at limit = 8 cycles, but 9 trip 8-9 is cleared after 12 cycles"):
        st.study(base, clear="4cyc", limit="8cyc", **common | {"faults": own})
    assert st.study(base, clear="70cyc", **common | {"faults": own[:1]}).screen.search.limit_cycles == 70
    words = "study two_area --clear 70cyc --faults lines --worst 0 --remedies none --json"
    code, out, _ = stabctl(*words.split())
    assert code == 1
    assert all(row["required_cycles"] == 70 for row in json.loads(out)["contingencies"])


def test_a_clearing_time_between_two_points_of_the_search_is_said(base):
    found = st.study(base, clear="9cyc", resolution="2cyc", faults="lines", worst=0, remedies="none")
    assert "critical after 8 cycles (only multiples of 2 cycles were tried)" in str(found)


ALONE = {"worst": 1, "remedies": "none"}


def test_what_is_lost_even_if_cleared_at_once_is_not_survived():
    """With a clearing time of 0 its margin is 0, too."""
    own = [st.Contingency(bus, trip="84-28", clear="0cyc") for bus in ("84", "28")]
    own.append(st.Contingency("85", clear="0cyc"))
    study = st.load("wnaps").study(damping=0.04, faults=own, **ALONE)
    assert {m.cycles for m in study.margins if not m.secure} == {0.0}
    assert [m.secure for m in study.margins] == [m.found.status != "unstable_at_zero" for m in study.margins]
    assert [m.secure for m in study.margins] == [False, False, True]
    assert not study.worst[0].outcome.stable
    assert not study.secure
    assert "lost even if cleared at once, limited by" in str(study)
    assert [m.shown for m in study.margins[:2]] == ["+0 or less"] * 2
    assert study.df["critical_cycles"].isna().tolist()[:2] == [True, True]


@pytest.fixture(scope="module")
def undamped():
    return st.load("ieee39").classical().initialize()


def test_the_worst_are_observed_as_in_the_screen(undamped):
    """A machine that is lost after 19 s is lost in the run that is shown, too."""
    lost = st.Contingency("22", trip="21-22", clear="5.75cyc")
    study = undamped.study(faults=[lost], **ALONE)
    (contingency, until), run = study.runs[0], study.worst[0]
    (screened,) = [r for r in study.margins[0].found.runs if r.cycles == 5.75]
    assert not study.margins[0].secure
    assert not run.outcome.stable
    assert run.outcome.time_s - 1.0 == pytest.approx(screened.time_s)
    assert run.outcome.time_s > 15
    assert undamped.simulate(contingency, until).outcome.message == run.outcome.message


@pytest.mark.slow
def test_a_damping_ratio_that_is_zero_has_no_sign(undamped):
    """Without damping the real parts are rounding, of either sign."""
    modes = undamped.modes()
    ratios = modes.damping_ratio[modes.swings()]
    assert abs(ratios).max() < 1e-9
    assert ratios.min() < 0 < ratios.max()
    study = undamped.study("1cyc", faults=[st.Contingency("21", trip="21-22")], limit="2cyc", **ALONE)
    for told in (study, study.remedies, *(modes.contributions(float(hz)) for hz in modes.frequency_hz[modes.swings()])):
        assert "-0.0000" not in str(told)
    assert "damping ratio 0.0000" in str(study)
    assert "-0.00" not in study_page.page(study).html()


@pytest.mark.slow
def test_a_contingency_that_only_a_shorter_fault_loses_is_said(undamped):
    """Fault 21, trip 21-22 is survived with 6 and with 7 cycles, but not with 6.125."""
    study = undamped.study("7cyc", faults=[st.Contingency("21", trip="21-22")], **ALONE)
    assert study.worst[0].outcome.stable
    assert "1 of 1 contingency is lost with a clearing time of at most 7 cycles" in str(study)
    assert "21 trip 21-22 is survived then, but not with 6.125 cycles." in study_page.page(study).html()


def test_the_lowest_voltage_is_that_after_clearing(base):
    """Not that after the last event, which comes 3 s later."""
    study = base.study("4cyc", faults=[st.Contingency("8", trip="7-8", after="7:-50MW@3s")], **ALONE | QUICK)
    (run,) = study.worst
    size = np.abs(run.arrays.V)[run.time >= 1 + 4 / 60 - 1e-9].min()
    assert f"<td>{size:.3f}</td>" in study_page.page(study).html()
    assert f"lowest voltage after clearing {size:.2f} pu" in run.outcome.message


def test_the_worst_that_keep_the_criteria_are_judged_as_long_as_any_run(base, tmp_path):
    """A rule may be for later times."""
    path = tmp_path / "own.toml"
    path.write_text('title = "ours"\n[[frequency]]\nname = "late"\nbelow = 59.0\n')
    study = base.study("4cyc", faults=[st.Contingency("8", trip="7-8")], criteria=path, **ALONE)
    assert study.judged[0].kept
    assert study.worst[0].outcome.time_s == pytest.approx(1 + 4 / 60 + 20)


def test_a_contingency_is_written_as_python_that_makes_it_again():
    events = "7:+50MW@2s", st.TripMachine(2, "1.5s")
    one = st.Contingency("7-8@0.4", trip="7-8", impedance=0.01j, at="0.5s", events=events, after=events[::-1])
    assert eval(study_page._written(one, 4.5), {"st": st}) == one.with_clear("4.5cyc")

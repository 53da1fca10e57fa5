"""The page of a siting study, of records made by hand."""

import math
import re
from dataclasses import replace
from html import unescape

import pytest
from labels import crowded

from stabctl._util.errors import StudyError
from stabctl.placement.siting import CandidateSite, Costs, Evidence, Infeasible, Iteration, Site, Siting, Survived
from stabctl.simulation.contingency import Contingency
from stabctl.view.figures import siting as figures
from stabctl.view.pages import siting_page

FIRST, SECOND, THIRD = (Contingency("7-8@0.4", 0.2, "7-8"), Contingency("<9>", 0.1), Contingency("3", 0.3))


@pytest.fixture
def siting():
    """34 candidates, two of them chosen; two contingencies and one that is infeasible."""
    places = tuple(CandidateSite(100 + k, k, 300.0 - k, 5.0 + k) for k in range(1, 35))
    sites = (Site(103, 3, 40.0, 0.0123), Site(131, 31, 20.0, 0.004))
    survived = (Survived(FIRST, 12.0, 12.25, 31, True, True), Survived(SECOND, 6.0, 7.5, None, True, False))
    evidence = (
        Evidence(60.0, (12.25, 7.5), (True, True)),
        Evidence(54.0, (11.75, 6.0), (False, True), scale=0.9),
        Evidence(20.0, (None, 12.875), (False, False), without="3@103"),
        Evidence(64.0, (), (True, False), scale=1.1, site="3@103"),
    )
    history = (Iteration(10.0, math.inf, math.inf, 0), Iteration(50.0, 62.0, 62.0, 3), Iteration(59.0, 60.0, 60.0, 2))
    return Siting(
        "some",
        sites,
        Costs(),
        60.0,
        57.0,
        765.0,
        5.0,
        90.0,
        survived,
        (Infeasible(THIRD, 18.0, 15.0, 35),),
        evidence,
        history,
        5.0,
        321,
        1.5,
        places,
        "A system & more",
        cuts_mw=57.0,
    )


@pytest.fixture
def with_converters(plain):
    """The same sites behind converters, one at its current limit."""
    first, second = plain.sites
    first = first._replace(mva=48.0, current=1.11, limit=1.11, voltage=0.75, worst="7-8@0.4 trip 7-8")
    second = second._replace(mva=24.0, current=0.999, limit=1.11, voltage=0.9, worst="<9>")
    return replace(plain, sites=(first, second))


@pytest.fixture
def plain(siting):
    """The same without figures, which take most of the time of a page."""
    return replace(siting, candidates=(), history=())


def cells(page, heading):
    """Rows of the table below a heading, as text."""
    part = page[page.index(f"<h2>{heading}</h2>") :]
    body = re.search(r"<tbody>(.*?)</tbody>", part, re.DOTALL)[1]
    rows = re.findall(r"<tr>(.*?)</tr>", body)
    return [[unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)] for row in rows]


def test_the_headline_names_what_no_fleet_survives_and_targets_by_default_are_said(siting):
    head = siting.remarks()[0]
    assert "survive 2 contingencies of 3" in head
    assert head.endswith("No fleet within the caps was found that survives 3.")
    assert "No fleet" not in replace(siting, infeasible=()).remarks()[0]
    assert str(siting).startswith(head)
    chosen = replace(siting, targets="Chosen by default.")
    assert chosen.remarks()[1] == "Chosen by default."
    assert "Chosen by default." in siting_page.page(replace(chosen, candidates=(), history=())).html()


def test_a_single_iteration_is_no_chart(siting):
    assert "Cost by iteration" in siting_page.page(siting).html()
    assert (
        "Cost by iteration" not in siting_page.page(replace(siting, candidates=(), history=siting.history[:1])).html()
    )


def test_the_page_says_what_the_record_holds(siting, tmp_path):
    path = siting_page.write(siting, tmp_path / "new")
    page = path.read_text(encoding="utf-8")
    assert path == tmp_path / "new" / "some_place.html"
    assert all(remark in unescape(page) for remark in siting.remarks())
    assert "A system &amp; more" in page
    assert re.findall(r'"card"><b>([\d.]+)', page) == ["60.0", "765.0", "90.0", "57.0"]
    assert cells(page, "Sites") == [
        ["bus 103", "3", "40.00", "297.0", "12.3"],
        ["bus 131", "31", "20.00", "269.0", "4.0"],
    ]
    assert cells(page, "Contingencies") == [
        ["7-8@0.4 trip 7-8", "12.000", "12.250", "+0.250", "yes", "31"],
        ["<9>", "6.000", "7.500", "+1.500", "", ""],
        ["3", "18.000", "", "lost with every fleet tried", "", ""],
    ]
    lost = "\N{NO-BREAK SPACE}×"
    assert cells(page, "Variations of the fleet") == [
        ["x1", "60.0", "+0.250", "+1.500"],
        ["x0.9", "54.0", "-0.250" + lost, "+0.000"],
        ["without 3@103", "20.0", "none" + lost, "+6.875" + lost],
        ["3@103 x1.1", "64.0", "stable", "unstable" + lost],
    ]
    assert page.count('class="unstable"') == 4


def test_converters_have_mva_and_what_sets_them(with_converters, plain):
    page = siting_page.page(with_converters).html()
    assert [row[3:5] for row in cells(page, "Sites")] == [
        ["48.00", "current limit of 1.11 pu at 0.75 pu"],
        ["24.00", "power rating; current 1.00 of 1.11 pu"],
    ]
    text = " ".join(str(with_converters).split())
    assert "103 3 40.00 48.00 12.3 current limit of 1.11 pu at 0.75 pu" in text
    assert "The converters have 72.0 MVA in all, 120 % of the MW." in text
    assert "reached at 1 of 2 sites, down to voltages of 0.75 pu, at which it allows 100 % of the MW" in text
    assert "The others have at least 10 % of the current to spare" in text
    assert not any("MVA set by" in said for said in (str(plain), siting_page.page(plain).html()))
    assert list(with_converters.df.mva) == [48, 24]
    assert list(with_converters.df.columns[5:9]) == ["current", "limit", "voltage", "worst"]


def test_the_page_needs_no_network_and_holds_its_figures(siting, tmp_path):
    page = siting_page.write(siting, tmp_path).read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!#)', page)
    assert page.count("<script") == 1
    assert page.count("<svg ") == 2
    assert [p.name for p in tmp_path.iterdir()] == ["some_place.html"]


@pytest.mark.slow
def test_the_page_in_a_browser(siting, tmp_path, browse):
    wrong = "beyond", "overlapping", "broken", "unnamed", "dead", "fetched", "console"
    page = siting_page.write(siting, tmp_path)
    for width, dark in ((390, True), (1280, False)):
        seen = browse(page, width, dark)
        assert seen["scroll"] <= seen["width"]
        assert not any(seen[name] for name in wrong)
        ink, paper = (sum(map(int, re.findall(r"\d+", seen[name])[:3])) for name in ("ink", "paper"))
        assert (ink > paper) == dark


def test_without_a_uniform_fleet_rounds_or_places(siting, tmp_path):
    bare = replace(siting, uniform_mw=None, uniform_percent=None, linear_mw=None, candidates=(), history=(), sites=())
    page = siting_page.write(bare, tmp_path, "other").read_text(encoding="utf-8")
    assert "No uniform fleet" in page
    assert page.count('"card"><b>none</b>') == 2
    assert [p.name for p in tmp_path.iterdir()] == ["other_place.html"]


def test_reservations_are_among_the_sentences(siting):
    spared = replace(siting, evidence=(*siting.evidence, Evidence(40.0, (12.0, 6.0), (True, True), without="31@131")))
    infeasible, other, less = spared.reservations()
    assert other.endswith("10 % more at one site alone, the fleet is not sufficient for 1 of 1 site: 3@103 loses <9>.")
    assert infeasible.startswith("Not survived: 3 at 18.00 cycles: none of the 35 fleets")
    assert less == "The fleet without 31@131 survives every other contingency too, so a smaller fleet is possible."
    assert spared.remarks()[-3:] == (infeasible, other, less)


def test_what_survives_all_but_what_is_lost_survives_every_other_contingency(siting):
    """Where one is lost with every fleet tried, nothing survives every contingency."""
    every, refined = (True, True), Evidence(60.0, (12.25, 7.5), (True, True), refined=True)
    held = (refined, Evidence(54.0, (), every, scale=0.9), Evidence(64.0, (), every, scale=1.1, site="3@103"))
    some = replace(siting, uniform_mw=0.0, evidence=held)
    for one, words in (
        (some, "survives every other contingency"),
        (replace(some, infeasible=()), "survives every contingency"),
    ):
        said = [remark for remark in one.remarks() if "survives every" in remark]
        assert len(said) == 4
        assert all(words in remark for remark in said)


def test_labels_of_the_figures_stand_apart(siting):
    uneven = tuple(p._replace(uniform_mw=None) for p in siting.candidates)
    for figure in (
        figures.plot(siting),
        figures.plot(replace(siting, candidates=uneven[:2], uniform_mw=None)),
        figures.convergence(siting),
        figures.convergence(replace(siting, history=siting.history[:2], costs=Costs(site=1))),
    ):
        assert crowded(figure) == []


def test_sites_stand_largest_first_beside_the_uniform_fleet(siting):
    ax = figures.plot(siting)
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert labels[:3] == ["machine 3, bus 103", "machine 31, bus 131", "machine 34, bus 134"]
    found, even = ([bar.get_width() for bar in bars] for bars in ax.containers)
    assert found == [40.0, 20.0] + 32 * [0.0]
    assert even == [8.0, 36.0] + [5.0 + k for k in range(34, 0, -1) if k not in (3, 31)]


def test_what_the_solver_missed_is_said(plain):
    rows = (
        Iteration(50.0, 62.0, 62.0, 2),
        Iteration(55.0, 61.0, 61.0, 2, "optimal_inaccurate"),
        Iteration(58.0, 60.0, 60.0, 2, slack=0.034),
        Iteration(math.nan, math.inf, 60.0, 2, "InsufficientProgress", math.nan),
    )
    said = replace(plain, history=rows, cuts_cost=None).remarks()
    assert "Cost 60; what the cuts allow is unknown, because the solver failed." in said
    solver = [sentence for sentence in said if "iteration" in sentence]
    assert [word in sentence for word, sentence in zip(("iteration 4 (Insuff", "1 of 4", "3.4 %"), solver, strict=True)]
    page = unescape(siting_page.page(replace(plain, history=rows, cuts_cost=None)).html())
    assert all(sentence in page for sentence in solver)
    assert not [s for s in plain.remarks() if "solver" in s or "iteration" in s]


def test_a_folder_that_cannot_be_is_told_in_a_sentence(plain, tmp_path):
    (tmp_path / "file").write_text("kept")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(StudyError, match=r"^The report some_place.html cannot be written to .* Give another"):
            siting_page.write(plain, folder)
    assert (tmp_path / "file").read_text() == "kept"


def test_a_page_stands_until_the_new_one_is_whole(plain, tmp_path, monkeypatch):
    path = siting_page.write(plain, tmp_path)
    before = path.read_bytes()

    def fail(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("stabctl._util.files.os.fsync", fail)
    with pytest.raises(StudyError, match="No space left on device"):
        siting_page.write(replace(plain, cost=1.0), tmp_path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("name", ["../../x", "/etc/passwd", "..", "a/b\\c", "line\nbreak", "x" * 300, "\N{SNOWMAN}"])
def test_no_name_of_a_case_leads_out_of_the_folder(plain, tmp_path, name):
    folder = tmp_path / "reports"
    path = siting_page.write(replace(plain, case=name), folder)
    assert [path] == list(folder.iterdir())
    assert [folder] == list(tmp_path.iterdir())
    assert re.fullmatch(r"[\w.-]+\.html", path.name)


def test_a_siting_is_a_table_and_saves_itself(siting, tmp_path):
    table = siting.df
    assert list(table.columns) == ["bus", "machine", "mw", "mwh", "mva", "cap_mw", "lost_if_smaller", "lost_if_larger"]
    assert table.mw.tolist() == [40.0, 20.0]
    assert table.cap_mw.tolist() == [297.0, 269.0]
    times = siting.clearing_times
    assert times.margin_cycles.tolist() == pytest.approx([0.25, 1.5, math.nan], nan_ok=True)
    assert times.machine.isna().tolist() == [False, True, True]
    assert siting.save(tmp_path / "sites.csv").read_text().splitlines()[1].startswith("103,3,40.0")
    assert siting.report(tmp_path / "new").name == "some_place.html"
    assert "the cuts allow" in siting._repr_html_()


def test_the_percentages_are_those_of_the_record(plain):
    """What the cuts allow below the cost in percent of the cost, and the fleet in percent of the uniform one."""
    page = unescape(siting_page.page(plain).html())
    said = re.search(r"Cost ([\d.]+); the cuts allow ([\d.]+) \(([\d.]+) % less\)", page)
    cost, bound, gap = map(float, said.groups())
    assert (cost, bound) == (plain.cost, plain.cuts_cost) == (60.0, 57.0)
    assert gap == pytest.approx(100 * (cost - bound) / cost) == 100 * plain.gap
    uniform, share, percent = map(
        float, re.search(r"at least ([\d.]+) MW \(([\d.]+) % of .* needs ([\d.]+) % of that", page).groups()
    )
    assert (uniform, share) == (plain.uniform_mw, plain.uniform_percent)
    assert percent == round(100 * 60.0 / 765.0) == round(plain.percent_of_uniform)
    assert bound < cost
    kwh = float(re.search(r"([\d.]+) MW and ([\d.]+) kWh", page)[2])
    assert kwh == round(1e3 * (0.0123 + 0.004)) == round(1e3 * plain.total_mwh)


KINDS = {  # what is said of each kind of variation
    "x": "x0.9: every device with nine tenths of its rating.",
    "without": "Without 3@103: all devices except that of machine 3 at bus 103.",
    "site": "3@103 x1.1: only that device with 1.1 times its rating",
}


@pytest.mark.parametrize("shown", ["", "x", "without", "site", "x without", "x site", "without site", "x without site"])
def test_only_the_variations_that_there_are_are_explained(siting, shown):
    rows = dict(zip(KINDS, siting.evidence[1:], strict=True))
    chosen = (siting.evidence[0], *(row for name, row in rows.items() if name in shown.split()))
    said = siting_page._on_variations(replace(siting, evidence=chosen))
    assert [name for name, text in KINDS.items() if text in said] == shown.split()
    none = siting_page._on_variations(replace(siting, evidence=chosen, sites=()))
    assert [name for name, text in KINDS.items() if text in none] == [name for name in shown.split() if name == "x"]

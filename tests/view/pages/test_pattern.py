"""The pages of all results: one pattern, what they say, axe-core, print."""

import re
from html import unescape
from pathlib import Path

import axe_playwright_python
import numpy as np
import pytest
from live_page import browser

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.view.pages import pattern, run_pages
from stabctl.view.pages.pattern import Section, Text, table

AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
FAULT = st.Contingency("7-8@0.4", clear="21cyc")


def cells(page, heading):
    """Rows of the table below a heading, as text."""
    part = page[page.index(f"<h2>{heading}</h2>") :]
    body = re.search(r"<tbody>(.*?)</tbody>", part, re.DOTALL)[1]
    return [
        [unescape(c) for c in re.findall(r"<td[^>]*>(.*?)</td>", row)]
        for row in re.findall(r"<tr[^>]*>(.*?)</tr>", body)
    ]


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize()


@pytest.fixture(scope="module")
def run(base):
    return base.simulate(FAULT, storage="50MW", control=st.BangBang())


def test_columns_hold_numbers_or_words_and_blank_ones_are_left_out():
    rows = [("a", "1.5", "", "none", "7-8", "1.2 MW (bus 3)"), ("b", "-2", "", "3 to 4", "9", "0 pu")]
    made = table(("name", "x", "blank", "y", "line", "text"), rows)
    assert made.heads == ["name", "x", "y", "line", "text"]
    assert made.words == [True, False, False, True, True]
    long = table(("k",), [(str(k),) for k in range(pattern.MOST + 5)], "Note.")
    assert len(long.rows) == pattern.MOST
    assert long.note == f"The first {pattern.MOST} of {pattern.MOST + 5} rows. Note."


def test_a_section_without_parts_and_markup_of_a_case_do_not_reach_the_page():
    page = pattern.Page(
        "x", "<i>", ["a & b"], [], [Section("no parts", []), Section("full", [Text("<script>1</script>")])]
    )
    assert "no parts" not in page.html()
    assert "&lt;i&gt;" in page.html()
    assert "&lt;script&gt;1" in page.html()


def test_the_page_of_a_run_has_its_numbers(run, tmp_path):
    path = run.report(tmp_path)
    page = path.read_text("utf-8")
    assert path.name == "two_area_simulate.html"
    assert run.outcome.message in unescape(page)
    assert cells(page, "Events") == [
        ["1.000", "fault at 7-8@0.4"],
        ["1.350", "the fault at 7-8@0.4 is cleared; 7-8 opened"],
    ]
    hz, largest = 60 * run.arrays.speed, np.rad2deg(run.peak)
    rows = [[str(k + 1), f"{largest[k]:.1f}", f"{hz[:, k].min():.3f}", f"{hz[:, k].max():.3f}"] for k in range(4)]
    assert cells(page, "Machines") == rows
    after = run.time >= 1.35 - 1e-9
    size = np.abs(run.arrays.V[after])
    lowest = cells(page, "Lowest voltages")
    assert [float(row[1]) for row in lowest] == pytest.approx(sorted(size.min(axis=0)), abs=6e-5)
    assert lowest[0][0] == "8"
    energy = 1e3 * np.ptp(run.arrays.energy, axis=0)
    assert [float(row[4]) for row in cells(page, "Storage")] == pytest.approx(energy, abs=6e-3)


def test_events_are_told(base, tmp_path):
    words = [
        st.Open("8-9", 0.1),
        st.TripMachine(3, 0.2),
        st.LoadStep(7, 0.3, 50.0),
        st.Fault("9", 0.4),
        st.Clear("9", 0.45),
    ]
    page = base.simulate(st.Contingency(events=words), until="0.6s").report(tmp_path).read_text("utf-8")
    assert [what for _, what in cells(page, "Events")] == [
        "8-9 opened",
        "machine 3 tripped",
        "load at bus 7 changed by +50 MW and +0 Mvar",
        "fault at bus 9",
        "the fault at bus 9 is cleared",
    ]
    assert cells(page, "Machines")[2][-1] == "0.200"


@pytest.mark.slow
def test_the_breaker_that_opens_is_told(base):
    """One end, the other one later, or both at once; a contingency names the end, too."""

    def page(run):
        return run_pages.simulation(run).html()

    opened = st.Open("8-9", 0.1, end=9), st.Open("8-9", 0.2, end=8), st.Open("8-9#2", 0.3)
    run = base.simulate(opened[:2], until="0.4s")
    assert [what for _, what in cells(page(run), "Events")] == ["8-9 at bus 9 opened", "8-9 at bus 8 opened"]
    at_once = base.simulate([st.Open("8-9", 0.1, end=9), st.Open("8-9", 0.1, end=8)], until="0.2s")
    assert [what for _, what in cells(page(at_once), "Events")] == ["8-9 opened"]
    assert str(st.Contingency(events=opened[1:])) == "opening of 8-9 at bus 8 at 0.2 s, opening of 8-9#2 at 0.3 s"


@pytest.mark.slow
def test_the_pages_of_network_and_search_have_their_numbers(base, tmp_path):
    flow = base.power_flow()
    page = flow.report(tmp_path).read_text("utf-8")
    assert [float(row[1]) for row in cells(page, "Buses")] == pytest.approx(np.abs(flow.V), abs=6e-6)
    assert [float(row[-1]) for row in cells(page, "Branches")] == pytest.approx(flow.branches["loss_mw"], abs=6e-3)
    found = base.clearing_time("7-8@0.4", limit="24cyc")
    page = found.report(tmp_path).read_text("utf-8")
    assert str(found) in unescape(page)
    assert cells(page, "Runs") == [list(row) for row in found.grouped()]
    assert sum(int(row[1]) for row in cells(page, "Runs")) == len(found.runs)
    power = base.short_circuit()
    page = power.report(tmp_path).read_text("utf-8")
    assert [float(row[1]) for row in cells(page, "Buses")] == pytest.approx(power.mva, abs=0.06)


@pytest.mark.slow
def test_pages_of_estimates_and_imports(base, tmp_path, monkeypatch):
    found = base.estimate(st.Contingency("7", clear="6cyc"), "2s", storage="50MW", seeds=3)
    page = found.report(tmp_path).read_text("utf-8")
    assert [row[1] for row in cells(page, "Accuracy")][:3] == [
        f"{value:.1f}" for value in (found.accuracy.rmse_mhz, found.accuracy.p99_mhz, found.accuracy.delay_ms)
    ]
    report = st.import_report(Path(__file__).parents[3] / "docs" / "examples" / "three.raw")
    page = report.report(tmp_path).read_text("utf-8")
    assert "The import is complete" in page
    assert [row[0] for row in cells(page, "Dynamic models")] == [k.kind for k in report.kinds]
    assert all(one.split(":")[0] in page for one in ("three.dyr line 4, IEEET1 of 102/1",))


def test_a_run_without_rows_has_no_page_and_leaves_no_file(base, tmp_path):
    bare = base.simulate(FAULT, record=False)
    with pytest.raises(StudyError, match="no rows to show"):
        bare.report(tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.fixture(scope="module")
def written(base, run, tmp_path_factory):
    """Pages of many results."""
    tmp_path, stored = tmp_path_factory.mktemp("pages"), base.case.with_storage("50MW").initialize()
    results = [
        run,
        base.clearing_time("7-8@0.4"),
        base.power_flow(),
        base.short_circuit(),
        base.estimate(st.Contingency("7", clear="6cyc"), "2s", storage="50MW", seeds=3),
        st.import_report(Path(__file__).parents[3] / "docs" / "examples" / "three.raw"),
        st.design.optimum(stored, st.Contingency("7", trip="7-8"), iterations=2),
    ]
    paths = [one.report(tmp_path) for one in results]
    paths.append(base.screen(resolution="1cyc", observe="1s", longest="0s", limit="12cyc").report(tmp_path, base=base))
    paths.append(st.design.pss(st.load("two_area_thyristor"), damping=0.1).report(tmp_path, ["7-8@0.4"]))
    from stabctl.smallsignal import areas
    from stabctl.view.pages import modes_page

    modes = base.modes()
    return [*paths, modes_page.write(tmp_path, modes, areas(modes), (0.1, 2.5))]


ALL = ("light", "axe.run(document)")
COLORS = ("dark", 'axe.run(document, {runOnly: ["color-contrast", "link-in-text-block"]})')  # rules that colors decide


@pytest.mark.slow
def test_no_finding_of_axe(written):
    """Nothing serious or critical at two widths, nor in dark colors; nothing too wide, nor in print."""
    found, wide = {}, []
    with browser() as chromium:
        for width, checks in ((390, (COLORS, ALL)), (768, ()), (1280, (ALL,))):
            sizes = {"viewport": {"width": width, "height": 900}}
            context = chromium.new_context(**sizes, color_scheme="light", bypass_csp=True)
            page = context.new_page()
            for path in written:
                page.goto(path.as_uri())
                page.evaluate(AXE)
                for scheme, rules in checks:
                    page.emulate_media(color_scheme=scheme)
                    for v in page.evaluate(rules)["violations"]:
                        if v["impact"] in ("serious", "critical"):
                            found[path.stem, scheme, v["id"]] = v["nodes"][0]["html"]
                for media, most in (("screen", width), ("print", max(width, 700))):
                    page.emulate_media(media=media)
                    wide += [(path.stem, width, media)] * (page.evaluate("document.documentElement.scrollWidth") > most)
                page.emulate_media(media="screen")
            context.close()
    assert (found, wide) == ({}, [])

"""The page of a design: in a browser, and its numbers read back."""

import re
from dataclasses import replace
from html import unescape

import control
import pytest
from labels import crowded

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.design import Tuned, outages, pss
from stabctl.design.evidence import evidence
from stabctl.view.figures import design as figures
from stabctl.view.pages import design_page


@pytest.fixture(scope="module")
def found(cases):
    return evidence(pss(outages(cases("two_area_thyristor")), damping=0.13), ["7-8@0.4"])


@pytest.mark.slow
def test_in_a_browser(found, tmp_path, browse):
    path = tmp_path / "design.html"
    path.write_text(design_page.page(found).html(), encoding="utf-8")
    for width, dark in ((390, True), (1280, False)):
        seen = browse(path, width, dark)
        assert seen["title"] == "Controllers of two_area_thyristor"
        assert seen["scroll"] <= seen["width"]
        wrong = "beyond", "overlapping", "broken", "dead", "fetched", "console"
        assert {key: seen[key] for key in wrong} == {key: [] for key in wrong}


@pytest.mark.slow
def test_the_page_says_what_was_found(found):
    page = design_page.page(found).html()
    design = found.design
    first, second = re.findall(r'"card"><b>(-?[\d.]+)', page)[:2]
    assert (float(first), float(second)) == pytest.approx((design.worst_before, design.worst_after), abs=6e-5)
    assert all(c.name in page for c in design.controllers)
    points = re.search(r"<h2>Operating points</h2>.*?<tbody>(.*?)</tbody>", page, re.DOTALL)[1]
    rows = [
        [unescape(x) for x in re.findall(r"<td[^>]*>(.*?)</td>", row)] for row in re.findall(r"<tr>(.*?)</tr>", points)
    ]
    assert [row[0] for row in rows] == design.worst.case.tolist()
    assert [float(row[2]) for row in rows] == pytest.approx(100 * design.worst.after, abs=6e-3)
    checks = re.search(r"<h2>Contingencies</h2>.*?<tbody>(.*?)</tbody>", page, re.DOTALL)[1]
    label, before, after, _ = re.findall(r"<td[^>]*>(.*?)</td>", checks)
    (check,) = found.checks
    assert (label, float(before), float(after)) == ("7-8@0.4", check.before.cycles, check.after.cycles)
    assert page.count("<svg ") == 5 + isinstance(design, Tuned)
    assert ("<h2>Ring-down</h2>" in page) == isinstance(design, Tuned)


def test_margins_and_controllers_are_shown_in_milliseconds(found):
    assert found.margins
    known = replace(found, margins=replace(found.margins, delay=0.0123, gain_up=3.4))
    cards = [(what, value) for value, what in design_page._numbers(known)][2:]
    assert cards == [("delay margin", "12.3 ms"), ("times the gains are still stable", "3.4")]
    late = control.ss(-1, 1, [[2.0]], 0)
    one = st.Controller.from_control(late, "speed:1", "vs:2", rate=50, delay="40ms", limits=0.05, name="mine")
    shown = design_page._controller(one, None)
    assert shown[:6] == ("mine", "speed:1", "vs:2", "1", "50/s", "40 ms")
    assert "-0.05 to 0.05" in shown


@pytest.mark.slow
def test_labels_stand_apart(found):
    for draw in (figures.locus, figures.bode, figures.steps, figures.own_steps):
        assert crowded(draw(found)) == []
    assert crowded(found.design.plot()) == []


@pytest.mark.slow
def test_the_whole_phase_is_on_its_axis(found):
    size, phase = figures.bode(found).axes
    assert (size.get_yscale(), phase.get_yscale()) == ("log", "linear")
    low, high = phase.get_ylim()
    assert all(low <= min(y) and max(y) <= high for y in (line.get_ydata() for line in phase.lines))
    assert min(min(line.get_ydata()) for line in phase.lines) < 0


@pytest.mark.slow
def test_the_command_writes_the_page(stabctl, tmp_path):
    code, text, _ = stabctl("design", "pss", "two_area_thyristor", "--damping", "0.13", "--report", tmp_path)
    assert code == 0
    assert "two_area_thyristor_design.html" in text.replace("\n", "")
    assert (tmp_path / "two_area_thyristor_design.html").exists()
    code, _, said = stabctl("design", "pss", "two_area_thyristor", "--fault", "7-8@0.4")
    assert code != 0
    assert "give --report" in said


def test_a_fault_that_does_not_exist_is_said(found, tmp_path):
    with pytest.raises(StudyError):
        found.design.report(tmp_path, ["77-99"])

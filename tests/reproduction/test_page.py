import re

import pytest
from test_study import NUMBER, RECORD

from reproduction.comparison import Printed
from reproduction.page import About, Ran, page
from reproduction.paper import RESULTS
from reproduction.study import Picture, Study, Table, draw
from stabctl.view.figures.style import subplots
from stabctl.view.pages import document

ABOUT = About("2026-01-01", "one processor", 12.3, ("sims/long.py",))


@pytest.fixture
def whole(tmp_path):
    """A page with everything that can stand on one."""
    wide, _ = subplots(14, 3)
    picture = draw(
        wide, tmp_path / "wide.png", "A wide picture", alt="nothing but axes", caption="Its caption.", of="5a, 5b"
    )
    (tmp_path / "more.html").write_text("<!doctype html>")
    long = "anumberlongerthananyphone" * 3
    rows = (
        NUMBER.compare(0.652, "First note."),
        Printed("Table 1, B", "a statement", "of very many words in a row without end").compare(long, "Second note."),
        Printed("Table 1, C", "another", "1.5", "pu").compare(1.6, "First note."),
        Printed("Table 1, D", "given", "3", "s", given=True).compare(3),
    )
    table = Table("A wide table", ("first",) + ("column",) * 12, (("row",) + (long,) * 12,))
    study = Study("Numbers & <angles>", "10", (f"Words. {long}",), rows, (table,), (picture,), {"more": "more.html"})
    beyond = Study("Beyond it", pictures=(Picture("nowhere.png", "Lost", "nothing"),))
    ran = (Ran("sims/b.py", 3, (beyond,)), Ran("sims/a.py", 2, (study, Study("Earlier", "9.2"))))
    return page((*ran, Ran("sims/bad.py", 1, failure="It <fell>.")), tmp_path, ABOUT)


def test_sections_stand_in_the_order_of_the_paper(whole):
    titles = re.findall(r"<section.*?<h2>(.*?)</h2>", whole)
    assert titles == ["Section 9.2: Earlier", "Section 10: Numbers &amp; &lt;angles&gt;", "Beyond the paper: Beyond it"]


def test_the_top_counts_and_lists_what_differs(whole):
    cards = re.findall(r'<div class="card"><b>(\d+)</b>([^<]*)', whole)
    assert [int(n) for n, _ in cards] == [0, 1, 2, 1]
    assert cards[1][1] == "more agree within 0.015 %"
    top = whole[: whole.index("<nav>")]
    assert "First note." in top
    assert "Second note." in top
    assert "0.6519" not in top


def test_what_differs_without_a_reason_says_so(tmp_path):
    study = Study("It", comparisons=(NUMBER.compare(1.0),))
    assert "Not explained yet." in page([Ran("sims/it.py", 1, (study,))], tmp_path, ABOUT)


def test_a_remark_is_one_note_however_often_it_is_made(whole):
    notes = re.search(r'<ol class="notes">(.*?)</ol>', whole)[1]
    assert notes == "<li>First note.</li><li>Second note.</li>"
    assert re.findall(r"<sup>(\d)</sup>", whole) == ["1", "2", "1"]


def test_failures_and_missing_pictures_are_told(whole):
    assert "<b>sims/bad.py failed.</b> It &lt;fell&gt;." in whole
    assert "The picture nowhere.png is missing." in whole
    assert "Not run without --full: sims/long.py." in whole


def test_results_of_the_paper_that_no_study_shows_are_told(whole):
    missing = re.findall(r"<li>([^<]*?) \(not shown\)", whole)
    assert "Table 1" not in missing
    assert "Figure 5a" not in missing
    assert "Figure 5b" not in missing
    assert "Table 4" in missing
    assert len(missing) == len(RESULTS) - 3


def test_nothing_is_fetched(whole):
    assert not re.search(r'src="(?!data:)|url\(|@import|<link|https?:', whole)


def test_a_page_without_studies_is_a_page(tmp_path):
    assert "Summary" in page([], tmp_path, ABOUT)


@pytest.mark.slow
def test_in_a_browser(whole, tmp_path, browse):
    path = tmp_path / "index.html"
    path.write_text(whole, encoding="utf-8")
    for width, dark in ((390, True), (1280, False)):
        found = browse(path, width, dark)
        assert found["title"] == "Reproduction of the paper"
        assert found["scroll"] == found["width"] <= width
        assert found["pictures"] == 1
        assert found["console"] == []
        wrong = "beyond", "overlapping", "broken", "dead", "fetched"
        assert {key: found[key] for key in wrong} == {key: [] for key in wrong}
        assert found["unnamed"] == 0
        ink, paper = (sum(map(int, re.findall(r"\d+", found[key])[:3])) for key in ("ink", "paper"))
        assert (paper < ink) == dark


def test_the_browser_sees_what_is_wrong(tmp_path, browse):
    """The check itself: a page that asks the network, is too wide and has a broken picture."""
    body = '<p style="width:900px">wide</p><img src="https://example.invalid/x.png"><a href="#no">dead</a>'
    template = '{% extends "base.html" %}{% block body %}' + body + "{% endblock %}"
    path = tmp_path / "bad.html"
    path.write_text(document.environment().from_string(template).render(title="Bad"), encoding="utf-8")
    found = browse(path)
    assert found["scroll"] > found["width"]
    assert any("wide" in e for e in found["beyond"])
    assert found["broken"] == [""]
    assert found["unnamed"] == 1
    assert found["dead"] == ["#no"]
    assert any("Content Security Policy" in line for line in found["console"])


def test_the_record_of_a_study_prints_itself():
    assert str(RECORD).splitlines()[0] == "A title"
    assert "close" in str(RECORD)


@pytest.mark.parametrize(
    ("text", "ours", "shown", "difference", "percent"),
    [
        ("0.6519", 0.6584, "0.6584", "+0.0065", 100 * 0.0065 / 0.6519),
        ("-20", -25.4, "-25", "-5", -100 * 5.4 / 20),
        ("60", 75.0, "75", "+15", 25.0),
        ("0", 3.0, "3", "+3", None),
        ("60", 60.3, "60", None, None),
    ],
)
def test_a_difference_stands_beside_our_number_absolute_and_in_percent(
    tmp_path, text, ours, shown, difference, percent
):
    study = Study("It", comparisons=(Printed("Table 9", "it", text).compare(ours),))
    whole = page([Ran("sims/it.py", 1, (study,))], tmp_path, ABOUT)
    section = whole[whole.index("<section") :]
    row = re.search(r"<td>([^<]*)</td><td>([^<]*)<small>([^<]*)</small></td></tr>", section).groups()
    assert row[:2] == (text, shown)
    found = re.fullmatch(r"([+-]\d+(?:\.\d+)?)(?: \(([+-][\d.e+]+) %\))?|", row[2])
    assert found[1] == difference
    assert (found[2] and float(found[2])) == (percent and pytest.approx(percent, rel=0.05))

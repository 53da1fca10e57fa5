"""The script of the pages: tables that sort, figures that zoom, names of their parts; and nothing else runs."""

import matplotlib.pyplot as plt
import pytest
from live_page import browser, page_of

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.smallsignal import areas
from stabctl.view.figures import modes as eigenvalue_map
from stabctl.view.figures import one_line, style
from stabctl.view.pages import document, modes_page
from stabctl.view.pages.document import svg


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture(scope="module")
def found():
    return st.load("two_area").initialize().modes()


@pytest.fixture
def two_area(chromium, found, tmp_path):
    """The page of the modes of two_area, opened at 1280 pixels."""
    return page_of(chromium, modes_page.write(tmp_path, found, areas(found), (0.1, 2.5)).as_uri())


def column(page, number):
    return [cell.strip() for cell in page.locator(f"tbody td:nth-child({number})").all_inner_texts()]


def test_a_table_sorts_by_numbers_and_by_words_and_back(two_area):
    ratios, names = column(two_area, 3), column(two_area, 1)
    heads = two_area.locator("thead th")
    heads.nth(2).click()
    assert column(two_area, 3) == sorted(ratios, key=float)
    assert heads.nth(2).get_attribute("aria-sort") == "ascending"
    heads.nth(2).press("Enter")
    assert column(two_area, 3) == sorted(ratios, key=float, reverse=True)
    heads.nth(2).press(" ")
    assert column(two_area, 1) == names
    assert heads.nth(2).get_attribute("aria-sort") is None
    heads.nth(0).click()
    assert column(two_area, 1) == sorted(names, key=str.casefold)


def test_a_mark_tells_its_name(two_area):
    marks = two_area.locator("figure").first.locator("use[data-tip]")
    texts = marks.evaluate_all("all => all.map((e) => e.dataset.tip)")
    assert "1, 2 against 3, 4: 0.611 Hz, damping ratio 11.98 %" in texts
    mark = marks.nth(texts.index("1, 2 against 3, 4: 0.611 Hz, damping ratio 11.98 %"))
    mark.scroll_into_view_if_needed()
    box = mark.bounding_box()
    two_area.mouse.move(box["x"] + box["width"] / 2 + 4, box["y"] + box["height"] / 2)
    assert two_area.locator(".tip").inner_text() == "1, 2 against 3, 4: 0.611 Hz, damping ratio 11.98 %"
    two_area.mouse.move(2, 2)
    assert not two_area.locator(".tip").is_visible()


def test_a_figure_is_enlarged_moved_and_whole_again(two_area):
    figure = two_area.locator("figure").first
    box = lambda: [float(x) for x in figure.locator("svg").get_attribute("viewBox").split()]  # noqa: E731
    whole = box()
    figure.get_by_label("Zoom in").click()
    near = box()
    assert near[2] == pytest.approx(whole[2] / 1.5)
    assert near[0] == pytest.approx(whole[2] / 6)
    at = figure.locator("svg").bounding_box()
    two_area.mouse.move(at["x"] + 200, at["y"] + 150)
    two_area.mouse.down()
    two_area.mouse.move(at["x"] + 160, at["y"] + 150)
    two_area.mouse.up()
    assert box()[0] == pytest.approx(near[0] + 40 / at["width"] * near[2])
    for _ in range(12):
        figure.get_by_label("Zoom in").click()
    assert box()[2] == pytest.approx(whole[2] / 20)
    figure.get_by_label("Whole figure").click()
    assert box() == pytest.approx(whole)


def test_no_other_script_runs(chromium, tmp_path):
    text = document.environment().from_string(
        '{% extends "base.html" %}{% block body %}<p onclick="document.title=2">a</p>'
        "<script>document.title='run'</script>{% endblock %}"
    )
    path = document.write(tmp_path, "other", text.render(title="unchanged"))
    page = page_of(chromium, path.as_uri())
    page.locator("p").click()
    assert page.title() == "unchanged"


@pytest.mark.slow
def test_every_mark_of_a_figure_has_its_own_name():
    found = st.load("wnaps").initialize().modes()
    case = found.linear.point.case
    for drawn in (eigenvalue_map.plot_modes(found), one_line.plot(found.linear.point)):
        parts = style.named(drawn.figure.findobj())
        expected = sum(len(texts) for _, texts in parts)
        assert expected == svg(drawn, "a figure").count("<title>")
    names = [text for _, texts in parts for text in texts]
    assert {f"machine {m.called} at bus {m.bus}: {m.base:g} MVA" for m in case.machines} <= set(names)
    assert sum(text.startswith("bus ") for text in names) == len(case.buses)


def test_names_are_text_even_if_they_look_like_elements():
    ax = plt.figure().add_subplot()
    style.name(ax.plot([1, 2], [1, 2], "o", ls="none")[0], ["<b>&one", "two"])
    assert svg(ax, "a figure").count("<title>&lt;b&gt;&amp;one</title>") == 1


@pytest.mark.slow
def test_a_diagram_of_another_system_is_refused(found):
    with pytest.raises(StudyError, match="cannot be drawn on a one-line diagram"):
        one_line.plot(found.linear.point, 7)

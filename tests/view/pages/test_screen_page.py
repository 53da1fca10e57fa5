"""The page of a screen."""

import re
from dataclasses import replace

import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.view.pages import clearing_pages


@pytest.fixture(scope="module")
def screened():
    base = st.load("two_area").initialize()
    return base, base.screen(resolution="1cyc", observe="1s", longest="0s", limit="12cyc")


def test_the_page_has_every_pair_and_every_remark(screened, tmp_path):
    base, found = screened
    page = found.report(tmp_path, base=base).read_text(encoding="utf-8")
    assert all(remark in page for remark in found.remarks())
    assert len(re.findall("<tr>", page)) == 1 + len(found.pairs)
    assert page.count("<svg role") == 2
    for p in found.pairs:
        assert page.count(f"<title>{p.brief()}</title>") == 2, "in the bars and on the diagram"
    assert page.count("<svg role") - clearing_pages.screen(found).html().count("<svg role") == 1
    assert "<figure" not in clearing_pages.screen(replace(found, pairs=())).html()


def test_the_shortest_time_at_the_top_is_that_of_the_first_row(screened):
    """Also where it is a bound: unstable even without a fault, or stable up to the limit."""
    found = screened[1]
    first = found.pairs[0]
    for status, cycles, shown in (
        ("found", 9.0, "9"),
        ("unstable_at_zero", None, "0"),
        ("stable_at_limit", None, "12 or more"),
    ):
        pairs = (replace(first, status=status, cycles=cycles), *found.pairs[1:])
        page = clearing_pages.screen(replace(found, pairs=pairs))
        assert page.numbers[0] == (shown, "cycles, the shortest critical clearing time")


def test_lines_that_are_not_in_the_table_are_not_said_to_be_left_out(screened):
    base, found = screened
    page = clearing_pages.screen(replace(found, pairs=found.pairs[:1]), base).html()
    assert "Thin gray: not in the table." in page
    assert "not screened" not in page


def test_a_screen_of_another_system_has_no_place_on_the_diagram(screened, tmp_path):
    with pytest.raises(StudyError, match="has no line"):
        screened[1].report(tmp_path, base=st.load("wnaps"))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_page_in_a_browser(screened, tmp_path, browse):
    base, found = screened
    path = found.report(tmp_path, base=base)
    for width, dark in ((390, False), (1280, True)):
        seen = browse(path, width, dark)
        assert seen["scroll"] <= seen["width"]
        assert not any(seen[name] for name in ("beyond", "overlapping", "broken", "unnamed", "fetched", "console"))

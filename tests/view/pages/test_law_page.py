"""The page of a storage law, of records made by hand."""

import re
from html import unescape

import pytest
from labels import crowded

from stabctl.controllers import BangBang, StorageLaw
from stabctl.design import LawDesign, LawLimits
from stabctl.design.critical_machines import Group
from stabctl.design.law_measurement import Duty, Later, Measured
from stabctl.design.law_result import Judged
from stabctl.simulation.contingency import Contingency
from stabctl.view.figures import storage_control as figures
from stabctl.view.pages import law_page


def measured(cycles, kwh, later=None, status="found"):
    return Measured(cycles, status, 4, 9, Duty(kwh, 2, 0.25, 0.95), later)


@pytest.fixture
def design():
    group = Group((3, 4), 4, (3, 4), (3, 4), 10.125)
    after = Later(True, 60.0, 0.5)
    rows = (
        Judged(
            Contingency("7", trip="7-8"), True, measured(10.0, 0.0), measured(12.0, 30.0), measured(14.5, 50.0), group
        ),
        Judged(Contingency("<9>"), False, measured(20.0, 0.0), measured(22.0, 40.0), measured(21.5, 45.0, after), None),
        Judged(
            Contingency("8"),
            False,
            measured(9.0, 0.0),
            measured(30.0, 1.0),
            measured(40.0, 2.0, None, "stable_at_limit"),
            None,
        ),
    )
    law = StorageLaw(groups="3+4", angle_gain=0.5, slope=0.05)
    return LawDesign("some", law, BangBang(), rows, LawLimits(), False, 12, 345, 6.7, True)


def cells(page, heading):
    part = page[page.index(f"<h2>{heading}</h2>") :]
    body = re.search(r"<tbody>(.*?)</tbody>", part, re.DOTALL)[1]
    return [
        [unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", body)
    ]


def test_the_gain_is_that_of_the_unseen_contingencies(design):
    gain = design.gain
    assert (gain.number, gain.median, gain.least, gain.most, gain.below) == (2, 4.75, -0.5, 10.0, 1)
    assert "unseen contingencies: median gain +4.75" in str(design)
    assert "1 of them more than 0.125 cycles below it" in str(design)
    assert "exceeds a limit" in str(design)
    assert design.df["gain_cycles"].tolist() == [2.5, -0.5, 10.0]


def test_the_page_says_what_the_record_holds(design, tmp_path):
    path = design.report(tmp_path)
    page = path.read_text(encoding="utf-8")
    assert path.name == "some_law.html"
    assert all(remark in unescape(page) for remark in design.remarks())
    assert cells(page, "Law")[0][:2] == ["groups", "3+4"]
    assert cells(page, "Clearing times") == [
        ["<9>", "20.000", "22.000", "21.500", "-0.500", ""],
        ["8", "9.000", "30.000", "over 40", "+10.000", ""],
        ["7, trip 7-8 (training)", "10.000", "12.000", "14.500", "+2.500", "3+4"],
    ]
    assert cells(page, "Operation of the devices")[0] == [
        "<9>",
        "40.0 / 60.0",
        "2 / 2",
        "0.250 / 0.250",
        "0.950 / 0.950",
        "0.5",
    ]
    assert not re.search(r'(src|href)="(?!#)', page)


@pytest.mark.slow
def test_the_page_in_a_browser(design, tmp_path, browse):
    page = law_page.write(design, tmp_path)
    for width, dark in ((390, True), (1280, False)):
        seen = browse(page, width, dark)
        assert seen["scroll"] <= seen["width"]
        assert not any(seen[k] for k in ("beyond", "overlapping", "broken", "unnamed", "dead", "fetched", "console"))


def test_the_labels_of_the_figure_do_not_overlap(design):
    assert not crowded(figures.plot_law_design(design).figure)

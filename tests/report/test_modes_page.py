from dataclasses import replace

from stabctl.dynamics import operating_point
from stabctl.report import modes_page
from stabctl.smallsignal import analyze, areas, linearize


def test_in_a_browser(points, tmp_path, browse):
    modes = analyze(linearize(points("two_area")))
    page = modes_page.write(tmp_path, modes, areas(modes), (0.1, 2.5))
    for dark in (False, True):
        found = browse(page, 390, dark)
        assert found["title"] == "Modes of two_area"
        assert found["scroll"] == found["width"] <= 390
        wrong = "beyond", "overlapping", "broken", "dead", "fetched", "console"
        assert {key: found[key] for key in wrong} == {key: [] for key in wrong}


def test_text_of_a_case_is_text_on_the_page(points):
    case = replace(points("two_area").case, title="<script>alert(1)</script>", source="A & B")
    page = modes_page.page(analyze(linearize(operating_point.solve(case))), None, (0.1, 2.5))
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert "Data: A &amp; B" in page


def test_no_name_of_a_case_leads_out_of_the_folder(points, tmp_path):
    case = replace(points("two_area").case, name="../../x")
    modes = analyze(linearize(operating_point.solve(case)))
    path = modes_page.write(tmp_path / "reports", modes, None, (0.1, 2.5))
    assert path == tmp_path / "reports" / "x_modes.html"
    assert [p.name for p in tmp_path.iterdir()] == ["reports"]

import pytest

from stabctl.report import modes_page
from stabctl.smallsignal import analyze, areas, linearize


@pytest.mark.parametrize("dark", [False, True])
def test_in_a_browser(points, tmp_path, browse, dark):
    modes = analyze(linearize(points("two_area")))
    found = browse(modes_page.write(tmp_path, modes, areas(modes), (0.1, 2.5)), 390, dark)
    assert found["title"] == "Modes of two_area"
    assert found["scroll"] == found["width"] <= 390
    wrong = "beyond", "overlapping", "broken", "dead", "fetched", "console"
    assert {key: found[key] for key in wrong} == {key: [] for key in wrong}

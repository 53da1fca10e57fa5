"""The page and the commands: complete, self-contained, and one sentence for a mistake."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from click.testing import CliRunner
from systems import one_of

from stabctl._util.errors import StabctlError
from stabctl._util.wording import number
from stabctl.cli import app
from stabctl.smallsignal import areas
from stabctl.view.pages import modes_page


def run(*words):
    result = CliRunner().invoke(app, [str(w) for w in words], catch_exceptions=True)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


class Balanced(HTMLParser):
    """Fails where a tag is closed that is not open."""

    void = frozenset({"meta", "line", "circle"})

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in self.void:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.void:
            assert self.open.pop() == tag


@pytest.mark.parametrize("name", one_of("two_area_thyristor", "two_area", "ieee39", "wnaps"))
def test_the_page_is_whole_and_needs_no_network(modes, name):
    m = modes(name)
    page = modes_page.page(m, areas(m), (0.1, 2.5)).html()
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    assert not re.search(r"""(src|href)="(?!#)|url\((?!#)|@import""", page)
    assert page.count('aria-label="Mode shape') == len(m.swings())
    assert not re.search(r"\bnan\b", page)
    for k in m.swings():
        assert m.label(k) in page
    assert ('class="unstable"' in page) == (not m.stable)


def test_json_holds_every_eigenvalue(modes):
    record = json.loads(run("modes", "two_area", "--json").output)
    m = modes("two_area")
    assert record["states"] == 56
    assert len(record["modes"]) == 56
    found = np.array([complex(r["real"], r["imag"]) for r in record["modes"]])
    assert np.array_equal(found, m.eigenvalues)
    inter = next(r for r in record["modes"] if r["label"] == "1, 2 against 3, 4")
    assert inter["electromechanical"]
    assert inter["frequency_hz"] == pytest.approx(0.6114, abs=1e-4)
    assert inter["damping_ratio"] == pytest.approx(0.1198, abs=1e-4)
    assert len(inter["participation"]) == 10
    assert set(inter["participation"][0]) == {"state", "share"}
    assert [s["machine"] for s in inter["shape"]] == [1, 2, 3, 4]
    assert set(inter["shape"][0]) == {"machine", "magnitude", "angle_deg"}


def test_the_band_filters_the_table_only():
    narrow = run("modes", "two_area", "--band", 0.5, 0.7).output
    assert "0.6114" in narrow
    assert "1.2631" not in narrow
    assert len(json.loads(run("modes", "two_area", "--band", 0.5, 0.7, "--json").output)["modes"]) == 56


def test_report_open_and_classical(tmp_path):
    out = run("modes", "two_area", "--classical", "--report", tmp_path, "--open", "7-8#2").output
    zeros = next(line for line in out.splitlines() if line.startswith("2 zero eigenvalues, no instabilities: "))
    assert "angle reference" in zeros
    assert "frequency reference" in zeros
    assert (tmp_path / "two_area_modes.html").is_file()


def test_table_shows_no_negative_zero(modes):
    assert number(-1e-9, 4) == "0.0000"


def test_linearize_exports_named_matrices(tmp_path):
    out = tmp_path / "m.npz"
    words = "--inputs", "storage:5,vref", "--outputs", "speed,flow:7-8#2", "--out", out, "--json"
    record = json.loads(run("linearize", "two_area", *words).output)
    saved = np.load(out)
    assert record["inputs"][:2] == ["P storage bus 5", "reference SEXS 1"]
    assert record["outputs"][-1] == "P line 7-8#2"
    assert saved["B"].shape == (56, 5)
    assert list(saved["states"]) == record["states"]
    assert saved["name"] == "two_area"


@pytest.mark.parametrize(
    "words",
    [
        ("modes", "nowhere"),
        ("modes", "two_area", "--band", 2, 1),
        ("modes", "two_area", "--areas", 9),
        ("modes", "two_area", "--open", "1-2"),
        ("linearize", "two_area", "--inputs", "valve", "--out", "x.npz"),
        ("linearize", "two_area", "--out", "x.txt"),
    ],
)
def test_a_mistake_is_one_sentence(words):
    with pytest.raises(StabctlError) as error:
        run(*words)
    assert "\n" not in str(error.value)

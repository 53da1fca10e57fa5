"""One file has the fonts, colors and labels of figures, reports and the interactive page."""

import re
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from stabctl.view.figures import style
from stabctl.view.figures.palette import COLORS, FONTS, LABELS, LOOK, css
from stabctl.view.live import page
from stabctl.view.pages.document import environment

PACKAGE = Path(style.__file__).parents[2]
SCHEMES = "light", "dark", "print"
CURVES = "a", "b", "c", "d", "e"
SEEN = {  # linear RGB as seen without one kind of cones: G. Machado et al., IEEE TVCG 15(6), 2009
    "all cones": np.eye(3),
    "no long cones": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "no middle cones": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
}


def linear(color):
    """Linear RGB of #rrggbb (IEC 61966-2-1)."""
    v = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def contrast(one, other):
    """Ratio of the luminances of two colors (WCAG 2.2)."""
    dark, light = sorted(float(linear(c) @ [0.2126, 0.7152, 0.0722]) for c in (one, other))
    return (light + 0.05) / (dark + 0.05)


def lab(rgb):
    """CIELAB of linear RGB, white D65."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ np.clip(rgb, 0, 1)
    x, y, z = np.cbrt(np.maximum(xyz / [0.9505, 1.0, 1.089], 1e-4))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_text_and_curves_stand_out_from_the_page(scheme):
    """WCAG 2.2 asks for 4.5 of text and 3 of graphics; the least here are 4.6 and 3.0 (good, e; both light)."""
    look = LOOK[scheme]
    for paper in (look["paper"], look["card"]):
        assert all(contrast(look[name], paper) >= 4.5 for name in ("ink", "soft", "bad", "good"))
        assert all(contrast(look[name], paper) >= 3 for name in CURVES)


@pytest.mark.parametrize("cones", SEEN)
def test_color_blind_readers_tell_the_first_curves_apart(cones):
    """Differences in CIELAB, of which 2 can just be seen; the least is 12.0 (b and d, light, no middle cones)."""
    for colors in (COLORS[:7], *([LOOK[scheme][c] for c in CURVES] for scheme in SCHEMES)):
        seen = [lab(np.array(SEEN[cones]) @ linear(c)) for c in colors]
        assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > 11


def test_colors_are_in_the_style_file_only():
    sheets = [
        *PACKAGE.glob("view/live/static/*.css"),
        *PACKAGE.glob("view/live/static/*.js"),
        *PACKAGE.glob("view/pages/templates/*"),
    ]
    found = [
        f"{path.name}: {color}"
        for path in (*sheets, *PACKAGE.glob("view/figures/*.py"))
        if not path.name.startswith("uPlot")
        for color in re.findall(
            r"(?<=[\s:,(\"'])#(?:[\da-f]{3}|[\da-f]{6}|[\da-f]{8})(?=[\s;,)}\"'])", path.read_text("utf-8")
        )
    ]
    assert not found


def test_reports_and_interactive_page_have_its_variables():
    assert css() in environment().get_template("base.html").render(title="")
    assert page.file("style.css")[0].decode() == css()
    used = {
        n for p in PACKAGE.glob("view/live/static/page.css") for n in re.findall(r"var\(--([\w-]+)\)", p.read_text())
    }
    used |= set(re.findall(r"var\(--([\w-]+)\)", (PACKAGE / "view/pages/templates/style.css").read_text()))
    assert used <= {"font", *LOOK["light"]}
    assert LOOK["light"].keys() == LOOK["dark"].keys() == LOOK["print"].keys()


def test_figures_have_its_fonts_and_leave_those_of_others(caplog):
    before, ours = dict(mpl.rcParams), style.single(None, 3, 2)
    ours.set_xlabel(LABELS["time"])
    given = ours.text(0.5, 0.5, "x", family="monospace")
    ours.figure.canvas.draw()
    family = ours.xaxis.label.get_fontfamily()
    assert family == [name for name in FONTS if name in family]
    assert family[-1] == FONTS[-1]
    assert not caplog.messages
    assert given.get_fontfamily() == ["monospace"]
    theirs = plt.figure().add_subplot()
    style.single(theirs, 3, 2)
    theirs.figure.canvas.draw()
    assert theirs.xaxis.label.get_fontfamily() == mpl.rcParams["font.family"]
    assert dict(mpl.rcParams) == before
    plt.close("all")

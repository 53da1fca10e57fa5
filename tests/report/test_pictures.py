"""The cheap studies as they are, and every kind of picture: labels inside it, none over another."""

import importlib.util
import json
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.estimation.loop import Driven, watch
from stabctl.model import fleet
from stabctl.plotting import clearing, estimates, style, trajectories
from stabctl.report import paper
from stabctl.report.study import Study, Verdict
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.simulation import run

ROOT = Path(__file__).parents[2]
SLACK = 0.5  # pixels


def crowded(figure):
    """Labels that lie over each other or reach out of the picture, as drawn."""
    drawn, original = [], Text.draw

    def draw(text, renderer):
        if text.get_visible() and text.get_text():
            drawn.append((text.get_text(), Text.get_window_extent(text, renderer)))
        original(text, renderer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw)
        figure.canvas.draw()
    pairs = ((a, b) for a, b in combinations(drawn, 2) if over(a[1], b[1]))
    return [(a[0], b[0]) for a, b in pairs] + [s for s, box in drawn if out(box, figure.bbox)]


def over(a, b):
    return min(a.x1, b.x1) - max(a.x0, b.x0) > SLACK and min(a.y1, b.y1) - max(a.y0, b.y0) > SLACK


def out(box, page):
    return box.x0 < page.x0 - SLACK or box.y0 < page.y0 - SLACK or box.x1 > page.x1 + SLACK or box.y1 > page.y1 + SLACK


def test_the_check_sees_labels_that_overlap_or_reach_out():
    figure, axes = style.figure(4, 3)
    assert crowded(figure) == []
    for place in ((0.5, 0.5), (0.52, 0.5), (0.97, 0.3)):
        figure.text(*place, "a label")
    assert crowded(figure) == [("a label", "a label"), "a label"]


def study(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "sims" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.study


@pytest.mark.parametrize(
    ("name", "pictures", "differ"), [("omib", 3, 1), ("feedback", 1, 1), ("minimum_time", 3, 0), ("law", 0, 0)]
)
def test_a_study_of_the_paper(name, pictures, differ, tmp_path, monkeypatch):
    crowds, save = [], Figure.savefig

    def savefig(figure, path, **options):
        crowds.extend(crowded(figure))
        save(figure, path, **options)

    monkeypatch.setattr(Figure, "savefig", savefig)
    found = study(name)(tmp_path)
    assert crowds == []
    assert len(found.pictures) == len(list(tmp_path.glob("*.png"))) == pictures
    assert all(p.alt and p.of for p in found.pictures)
    assert {name for p in found.pictures for name in p.of} <= paper.RESULTS.keys()
    verdicts = [c.verdict for c in found.comparisons]
    assert verdicts.count(Verdict.DIFFERS) == differ
    assert all(c.remark for c in found.comparisons if c.verdict in (Verdict.DIFFERS, Verdict.CLOSE))
    assert all(abs(c.relative) < 2e-3 for c in found.comparisons if c.verdict is Verdict.CLOSE)  # 1.5e-3
    assert Study.from_dict(json.loads(json.dumps(found.to_dict()))) == found


def test_a_study_runs_alone(tmp_path):
    done = subprocess.run(
        [sys.executable, ROOT / "sims" / "law.py", tmp_path / "new"], check=True, capture_output=True, text=True
    )
    assert "The controller" in done.stdout
    assert "machine faster than the rest" in done.stdout
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["sims_law.json"]


@pytest.fixture(scope="module")
def runs(points, cases):
    """Three seconds of the paper's Case 1 without and with storage."""
    case, events = cases("two_area"), Contingency("7-8@0.4", 21 / 60)
    equipped = operating_point.solve(case.with_storage(fleet.everywhere(case, "50MW")))
    bare, held = run(points("two_area"), events, 3.0), run(equipped, events, 3.0, BangBang())
    return {"without storage": bare, "with 50 MW storage": held}


def test_pictures_of_runs(runs):
    held = runs["with 50 MW storage"]
    for figure in (trajectories.speeds(runs), trajectories.storage(held), trajectories.overview(held)):
        assert crowded(figure) == []


def test_pictures_of_estimates(runs):
    point = runs["with 50 MW storage"].point
    found = watch(point, Contingency("7", 0.1, ["7-8"]), 1.5, Driven(engine="batched"), range(1, 3))
    sizes = np.linspace(12.25, 6.5, 5)
    panels = {label: (range(5), {"two_area": sizes, "wnaps": sizes - 1}) for label in ("latency, ms", "noise, mrad")}
    ideal = {"two_area": 12.25, "wnaps": 6.5}
    for figure in (estimates.speeds(found), estimates.commands(found), estimates.clearing(panels, ideal)):
        assert crowded(figure) == []


def test_pictures_of_clearing_times():
    places = np.linspace(0, 0.5, 6)
    curves = {"without storage": 9 + 30 * places, "with 50 MW storage": 12.25 + 38 * places}
    assert crowded(clearing.against_place(places, curves, 21, (0.28, 0.42), "7-8")) == []
    assert crowded(clearing.against_size(range(6), {"whole cycles": range(6), "1/8 cycle": range(6)}, "size")) == []

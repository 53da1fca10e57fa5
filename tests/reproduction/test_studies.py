"""The cheap studies as they are, and their pictures: labels inside it, none over another."""

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from labels import crowded
from matplotlib.figure import Figure

from reproduction import paper
from reproduction.comparison import Verdict
from reproduction.study import Study

ROOT = Path(__file__).parents[2]


def study(name, folder=ROOT / "sims"):
    return script(name, folder).study


def script(name, folder):
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("file", sorted([*ROOT.glob("sims/*.py"), *ROOT.glob("analysis/*.py")]), ids=lambda s: s.stem)
def test_every_study_finds_what_it_imports(file, monkeypatch):
    monkeypatch.syspath_prepend(file.parent)
    assert callable(study(file.stem, file.parent))


@pytest.mark.slow
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
    command = [sys.executable, ROOT / "sims" / "law.py", tmp_path / "new"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert "The controller" in done.stdout
    assert "machine faster than the rest" in done.stdout
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["sims_law.json"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rows", "given"),
    [("data", ("two_area",)), ("data", ("ieee39",)), ("literature", ())],
    ids=["two_area", "ieee39", "literature"],
)
def test_numbers_of_the_estimation_page_are_those_of_its_study(rows, given):
    """Its tables of wrong data and of a filter from the literature; that of NEES and NIS is tested with its bands."""
    page = (ROOT / "docs" / "estimation.md").read_text(encoding="utf-8")
    shown = [[float(x) for x in re.findall(r"(?<=\| )[\d.]+(?= \|)", line)] for line in page.splitlines()]
    module = script("estimator_consistency", ROOT / "sims")
    for row in getattr(module, rows)(*given):
        cells = row[-8:]
        assert any(len(n) == 8 and matches(cells, n) for n in shown), row


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ieee39", "ieee39, storage"])
def test_a_screen_begins_with_its_worst_faults(name):
    """All of the ten worst are among the first thirty, as the page says."""
    module = script("screening_index", ROOT / "sims")
    found = module.measured(*module.SYSTEMS[name])
    assert found.by_index.found == found.by_index.worst >= 10
    page = (ROOT / "docs" / "screening.md").read_text(encoding="utf-8")
    assert " | ".join(("| " + name, *module.counts(found))) in page


def matches(cells, numbers):
    """Whether the numbers are the rounded ones of the cells; large ones are whole numbers."""
    return all(abs(float(a) - b) <= (0.501 if b == int(b) else 0.0501) for a, b in zip(cells, numbers, strict=True))

"""The cheap studies as they are, and their pictures: labels inside it, none over another."""

import importlib.util
import json
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
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.study


@pytest.mark.parametrize("script", sorted([*ROOT.glob("sims/*.py"), *ROOT.glob("analysis/*.py")]), ids=lambda s: s.stem)
def test_every_study_finds_what_it_imports(script, monkeypatch):
    monkeypatch.syspath_prepend(script.parent)
    assert callable(study(script.stem, script.parent))


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

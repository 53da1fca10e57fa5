"""Figures of the gallery and notebooks of the documentation are what their code gives."""

import re
from copy import deepcopy
from pathlib import Path

import matplotlib.pyplot as plt
import nbclient
import nbformat
import numpy as np
import pytest

import gallery

ROOT = Path(__file__).resolve().parents[2]


def test_every_script_and_notebook_is_shown():
    docs = ROOT / "docs"
    text = "".join(page.read_text("utf-8") for page in docs.glob("*.md"))
    named = set(re.findall(r"\]\(((?:gallery|notebooks|figures/gallery)/[^)]+)\)", text))
    for stem in (p.stem for p in docs.glob("gallery/*.py")):
        assert {f"gallery/{stem}.py", f"figures/gallery/{stem}.png"} <= named
    assert {f"notebooks/{p.name}" for p in docs.glob("notebooks/*.ipynb")} <= named


@pytest.mark.slow
@pytest.mark.parametrize("script", sorted((ROOT / "docs" / "gallery").glob("*.py")), ids=lambda path: path.stem)
def test_a_picture_of_the_gallery_is_what_its_script_draws(script, tmp_path):
    """The fonts of machines differ. With the same fonts the mean difference of the colors (0 to 1) is 0."""
    pictures = [gallery.draw(script, tmp_path), ROOT / "docs" / "figures" / "gallery" / f"{script.stem}.png"]
    new, kept = (plt.imread(picture)[..., :3] for picture in pictures)
    assert abs(new.shape[0] / kept.shape[0] - 1) < 0.02
    assert abs(new.shape[1] / kept.shape[1] - 1) < 0.02
    rows, columns = map(min, new.shape[:2], kept.shape[:2])
    assert np.abs(new[:rows, :columns] - kept[:rows, :columns]).mean() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("notebook", sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_gives_the_outputs_that_it_shows(notebook, tmp_path, monkeypatch):
    """Texts and tables of all cells, executed again; pictures are there but not compared."""
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel shows figures in the notebook
    kept = nbformat.read(notebook, 4)
    again = nbclient.NotebookClient(deepcopy(kept), timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    for old, new in zip(kept.cells, again.cells, strict=True):
        assert shown(old) == shown(new)


def shown(cell):
    """Kinds of the outputs of a cell, with their text and HTML; without computing times and stderr."""
    found = []
    for output in cell.get("outputs", []):
        if output.get("name") != "stderr":
            data = output.get("data", {"text/plain": output.get("text", "")})
            text = {} if "image/png" in data else {kind: untimed(data[kind]) for kind in data}
            found.append((sorted(data), text))
    return found


def untimed(text):
    return re.sub(r"\b[\d.]+ (?=s\b)", "", text)

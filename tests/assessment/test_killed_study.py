"""A study that is killed at random moments: nothing it leaves is damaged, and in the end its answers are the same."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from random import Random

import openpyxl
import pytest

import stabctl
from stabctl.clearing.index import INDEX
from stabctl.clearing.screen import PLACE
from stabctl.jobs.store import rows

KILLS = 4
INSECURE = 1


def start(folder):
    words = ["study", "ieee39", "--clear", "4cyc", "--remedies", "redispatch", "--json", "--workers", "1"]
    words += ["--observe", "2", "--longest", "0", "--resolution", "0.25cyc"]
    words += ["--store", "store", "--report", "page", "--out", "all.xlsx"]
    env = os.environ | {"PYTHONPATH": str(Path(stabctl.__file__).parents[1])}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, "-m", "stabctl", *words], cwd=folder, text=True, env=env, **pipes)


def ended(process):
    """What a study that ends has printed, without its computing time."""
    out, err = process.communicate(timeout=600)
    assert process.returncode in (0, INSECURE), err
    return json.loads(out) | {"wall_s": None}


def check(folder):
    """Every file there is complete; returns the number of places screened."""
    page, book = folder / "page" / "ieee39_study.html", folder / "all.xlsx"
    if page.exists():
        assert page.read_text("utf-8").rstrip().endswith("</html>")
    if book.exists():
        assert "contingencies" in openpyxl.load_workbook(book).sheetnames
    kept: list[dict] = []
    for kind in (INDEX, PLACE):
        path = folder / "store" / f"{kind.table}.db"
        kept = rows(path, kind) if path.exists() else []
        assert all(row["status"] == "ok" for row in kept)
    return len(kept)


@pytest.mark.slow
def test_a_killed_study_goes_on(tmp_path):
    alone, killed = tmp_path / "alone", tmp_path / "killed"
    alone.mkdir()
    killed.mkdir()
    began = time.monotonic()
    whole = ended(start(alone))
    lasted, rng, kept = time.monotonic() - began, Random(7), [0]
    for _ in range(KILLS):
        process = start(killed)
        try:
            process.wait(rng.uniform(0.1, 1.0) * lasted)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
        process.communicate()
        assert process.returncode in (-signal.SIGKILL, 0, INSECURE)
        kept.append(check(killed))
    assert kept == sorted(kept)
    assert ended(start(killed)) == whole
    assert check(killed) == check(alone) > 30
    assert {p.name for p in killed.iterdir() if p.name[0] != "."} == {"store", "page", "all.xlsx"}

"""The runner on small studies: failures are sentences, the page is written, long studies wait for --full."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GOOD = """
from reproduction.study import Study
from reproduction.study import present
{line}
if __name__ == "__main__":
    present(lambda reports: [Study("Study {n}", text=("Words of {n}.",)), Study("Another of {n}")])
"""
MISTAKE = """
from stabctl._util.errors import StudyError
from reproduction.study import present

def study(reports):
    raise StudyError("the line 7-9 does not exist: give another.")

present(study)
"""
LONG = """
from reproduction.study import present
from reproduction.study import Kept
from reproduction.study import Study
from stabctl._util.errors import StudyError

def study(reports):
    kept = Kept(__file__, reports)
    answer = kept("the first half", lambda tell: 7)
    if not (reports / "second").exists():
        raise StudyError("the second half failed.")
    return Study(f"Halves of {answer}")

present(study)
"""
KILLED = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
SILENT = "print('no record')"


@pytest.fixture
def reproduce(tmp_path):
    """Runs the tool on scripts given by name -> text; (exit code, stdout, the page)."""

    def go(scripts, *words):
        folder, out = tmp_path / "sims", tmp_path / "out"
        folder.mkdir(exist_ok=True)
        for name, text in scripts.items():
            (folder / name).write_text(text)
        command = [sys.executable, ROOT / "tools" / "reproduce.py", "--out", out, folder, *words]
        done = subprocess.run(command, capture_output=True, text=True)
        return done.returncode, done.stdout, (out / "index.html").read_text()

    return go


@pytest.mark.slow
def test_studies_that_fail_are_sentences_on_the_page(reproduce):
    scripts = {
        "good.py": GOOD.format(n="one", line=""),
        "mistake.py": MISTAKE,
        "crash.py": "1 / 0",
        "killed.py": KILLED,
        "silent.py": SILENT,
    }
    code, out, page = reproduce(scripts)
    assert code == 1
    assert "wrote" in out
    for sentence in (
        "<b>sims/mistake.py failed.</b> the line 7-9 does not exist: give another.",
        "<b>sims/crash.py failed.</b> ZeroDivisionError: division by zero",
        "<b>sims/killed.py failed.</b> It was killed by signal 9.",
        "<b>sims/silent.py failed.</b> sims_silent.json does not contain records",
        "Words of one.",
        "Another of one",
    ):
        assert sentence in page


@pytest.mark.slow
def test_long_studies_wait_for_full_and_old_records_do_not_stand_in(reproduce, tmp_path):
    scripts = {"a.py": GOOD.format(n="one", line=""), "b.py": GOOD.format(n="two", line="FULL = True")}
    code, _, page = reproduce(scripts)
    assert code == 0
    assert "Words of two." not in page
    assert "Not run without --full: sims/b.py." in page
    code, _, page = reproduce(scripts, "--full")
    assert code == 0
    assert "Words of two." in page
    assert "Not run" not in page
    (tmp_path / "sims" / "a.py").write_text(SILENT)
    code, _, page = reproduce({})
    assert code == 1
    assert "Words of one." not in page


@pytest.mark.slow
def test_a_long_study_says_how_far_it_is_and_continues_where_it_failed(reproduce, tmp_path):
    code, out, page = reproduce({"long.py": LONG})
    assert code == 1
    assert "long: the first half: 0 s" in out.splitlines()
    assert "<b>sims/long.py failed.</b> the second half failed." in page
    (tmp_path / "out" / "second").touch()
    code, out, page = reproduce({})
    assert code == 0
    assert "long: the first half: kept" in out.splitlines()
    assert "Halves of 7" in page
    assert not list((tmp_path / "out").glob("kept-*"))

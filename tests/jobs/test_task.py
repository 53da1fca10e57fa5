"""What identifies a job: everything that changes its answer, the code of a law from outside included."""

import sys
from importlib import import_module, reload

import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.jobs.task import text

LAW = """
from dataclasses import dataclass
from stabctl.controllers import BangBang

@dataclass(frozen=True)
class Own(BangBang):
    gain: float = GAIN
    def twice(self): return 2
"""


def test_an_edited_law_of_ones_own_is_another_law(tmp_path, monkeypatch):
    """Also where none of its settings changes."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    path, found = tmp_path / "own_law_of_a_test.py", []
    for written in (LAW, LAW, LAW.replace("return 2", "return 3")):
        path.write_text(written.replace("GAIN", "1.0"))
        module = reload(import_module(path.stem))
        found.append(text([module.Own()]))
    assert found[0] == found[1] != found[2]
    assert text([st.BangBang()]) == text([st.BangBang()])
    assert "source" not in text([st.BangBang()])


def test_a_law_that_is_in_no_file_is_refused():
    scope = {"__name__": "nowhere"}
    exec(LAW.replace("GAIN", "1.0"), scope)
    with pytest.raises(StudyError, match="Own is not in a file"):
        text([scope["Own"]()])

"""What identifies a job: everything that changes its answer, the code of a law from outside included."""

import sys
from importlib import import_module, reload

import pytest
from systems import OWN, registered

import stabctl as st
from stabctl._util import jit
from stabctl._util.errors import StudyError
from stabctl.jobs.task import fingerprint, text

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


HELPER = """
from stabctl._util.jit import inline

@inline
def limited(x):
    return min(x, 1.0)
"""


def test_what_a_law_and_a_device_import_belongs_to_them(tmp_path, monkeypatch):
    """Also where it is in another folder, imported by what they import, or no function."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        monkeypatch.syspath_prepend(tmp_path / folder)
    law, device, helper, table = (
        tmp_path / name
        for name in ("a/law_of_a_test.py", "a/pss_of_a_test.py", "b/help_of_a_test.py", "b/table_of_a_test.py")
    )
    law.write_text("import help_of_a_test\n" + LAW.replace("GAIN", "1.0"))
    wide = OWN / "wide_area.py"
    device.write_text(
        wide.read_text().replace("from stabctl._util.jit", "import help_of_a_test\nfrom stabctl._util.jit", 1)
    )
    helper.write_text("import numpy as np\nfrom table_of_a_test import TABLE\n" + HELPER)
    keys = []
    for written in ("TABLE = [1.0]", "TABLE = [1.0]", "TABLE = [2.0]"):
        table.write_text(written)
        with registered(device) as (found,):
            case = st.load("two_area").with_device("pss_of_a_test", 1, bus=7, machine=2)
            keys.append((text([import_module(law.stem).Own()]), fingerprint(case), jit.own_sources(found.module)))
    assert keys[0] == keys[1]
    assert all(a != b for a, b in zip(keys[1], keys[2], strict=True))
    assert sorted(keys[0][2]) == ["help_of_a_test", "stabctl_device_pss_of_a_test", "table_of_a_test"]


def test_a_law_that_is_in_no_file_is_refused():
    scope = {"__name__": "nowhere"}
    exec(LAW.replace("GAIN", "1.0"), scope)
    with pytest.raises(StudyError, match="Own is not in a file"):
        text([scope["Own"]()])

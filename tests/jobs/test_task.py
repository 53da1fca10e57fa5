"""What identifies a job: everything that changes its answer, the code of a law from outside included."""

import sys
from importlib import import_module, reload
from threading import Lock

import numpy as np
import pytest
from systems import OWN, registered

import stabctl as st
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
def scaled(x):
    return x * TABLE[0]
"""


def test_what_a_law_and_a_device_import_belongs_to_them(tmp_path, monkeypatch):
    """Also where it is in another folder, or imported by what they import; as it was imported, not as it is now."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        monkeypatch.syspath_prepend(tmp_path / folder)
    law, device, helper, table = (
        tmp_path / name
        for name in ("a/law_of_a_test.py", "a/pss_of_a_test.py", "b/help_of_a_test.py", "b/table_of_a_test.py")
    )
    own = LAW.replace("GAIN", "1.0").replace("return 2", "return help_of_a_test.scaled(2.0)")
    law.write_text(f"import help_of_a_test\n{own}")
    wide = (OWN / "wide_area.py").read_text()
    assert "clip(p.Kv * " in wide
    wide = wide.replace("clip(p.Kv * ", "clip(help_of_a_test.scaled(p.Kv) * ")
    device.write_text(wide.replace("from stabctl._util.jit", "import help_of_a_test\nfrom stabctl._util.jit", 1))
    helper.write_text("import numpy as np\nfrom table_of_a_test import TABLE\n" + HELPER)
    keys = []
    for written in ("TABLE = [1.0]", "TABLE = [1.0]", "TABLE = [2.0]"):
        table.write_text(written)
        for module in (law, helper, table):
            sys.modules.pop(module.stem, None)
        with registered(device):
            case = st.load("two_area").with_device("pss_of_a_test", 1, bus=7, other=2)
            imported = import_module(law.stem)
            table.write_text("TABLE = [3.0]")
            keys.append((text([imported.Own()]), fingerprint(case)))
    assert keys[0] == keys[1]
    assert all(a != b for a, b in zip(keys[1], keys[2], strict=True))


SETTING = """
from dataclasses import dataclass
import numpy as np
from stabctl.controllers import BangBang

SETTINGS = np.array([1.0])

@dataclass(frozen=True)
class Read(BangBang):
    def twice(self): return SETTINGS[0]

@dataclass(frozen=True)
class Marked(BangBang):
    def twice(self): return self.K
Marked.K = 1.0

class Extended(BangBang):
    def __init__(self, k):
        super().__init__()
        object.__setattr__(self, "k", k)

def made(k):
    @dataclass(frozen=True)
    class Made(BangBang):
        def twice(self): return k
    return Made()

@dataclass(frozen=True)
class Locked(BangBang):
    def twice(self): return LOCK
"""


def test_what_changes_a_law_beside_its_source_and_its_fields_belongs_to_it():
    """Data of its module, values of the function that made it, attributes of the object and of the class."""
    scope = {"__name__": "nowhere"}
    exec(SETTING, scope)

    def keys(k):
        scope["SETTINGS"], scope["Marked"].K = np.array([k]), k
        return [text([law]) for law in (scope["Read"](), scope["Marked"](), scope["Extended"](k), scope["made"](k))]

    assert keys(1.0) == keys(1.0)
    assert all(a != b for a, b in zip(keys(1.0), keys(2.0), strict=True))


def test_a_law_is_the_same_where_only_comments_differ():
    def key(source):
        scope = {"__name__": "nowhere"}
        exec(source, scope)
        return text([scope["Own"]()])

    law = LAW.replace("GAIN", "1.0")
    assert key(law) == key(f"# one more line\n{law}") != key(law.replace("return 2", "return 3"))


def test_a_law_that_uses_what_cannot_be_read_is_refused():
    scope = {"__name__": "nowhere", "LOCK": Lock()}
    exec(SETTING, scope)
    with pytest.raises(StudyError, match="Locked uses an object of type lock"):
        text([scope["Locked"]()])

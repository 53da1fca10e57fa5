"""What is compiled is compiled once, and again when a source that it is made from changes."""

import ast
import json
import os
import re
import shutil
import stat
import subprocess
import sys
from importlib.util import resolve_name
from pathlib import Path

import numpy as np
import platformdirs
import pytest
from systems import ROUND, registered, small

import stabctl
from stabctl import devices, io
from stabctl._util import jit
from stabctl.controllers import BangBang, Feedback
from stabctl.dynamics import evaluate, operating_point
from stabctl.model.case import Storage
from stabctl.model.network import UNSWITCHED
from stabctl.simulation import simulation, stepper, voltages
from stabctl.simulation.events import Clear, Fault, TripMachine
from stabctl.simulation.topology import stage
from stabctl.simulation.wired import wired

PACKAGE = Path(stabctl.__file__).parent


def everything(case):
    """A run of the case that meets every kind of table: with and without storage, law, record, trip."""
    number, bus = case.machines[0].machine, case.machines[0].storage_bus
    events = [Fault(str(bus), 0.01), Clear(str(bus), 0.02), TripMachine(number, 0.03)]
    for rows in ([], [Storage(number, bus, 10.0, "conductance", energy=1.0, lag=0.05, ramp=100.0)]):
        point = operating_point.solve(case.with_storage(rows))
        for control, record in ((None, True), (BangBang(), False), (Feedback(1.0), True)) if rows else ((None, True),):
            simulation.run(point, events, 0.05, control=control, record=record)


def test_every_case_and_option_runs_on_one_compilation():
    for name in io.packaged():
        everything(io.load(name))
        everything(io.load(name).classical())
    assert len(stepper.advance.signatures()) == 1
    assert len(evaluate.evaluate.signatures()) == 1
    assert len(voltages.newton_from.signatures()) <= 1


def arrays(record):
    """Name and array of every array in a record and the records in it."""
    for name, part in record._asdict().items():
        if isinstance(part, np.ndarray):
            yield name, part
        elif hasattr(part, "_asdict"):
            yield from arrays(part)


@pytest.mark.parametrize("control", [None, BangBang()])
def test_tables_for_compiled_code_are_contiguous_and_writeable(points, control):
    """Others are another type to numba, and would be compiled for anew."""
    case = points("wnaps").case
    point = operating_point.solve(case.with_storage([Storage(1, case.machines[0].storage_bus, 10.0)]))
    made = wired(point, control)
    for record in (made.program, made.frame, stage(point, UNSWITCHED).net, point.equations.program):
        for name, array in arrays(record):
            assert array.flags.c_contiguous, name
            assert array.flags.writeable, name


NAMES = """
import json
from pathlib import Path
from stabctl import devices
from stabctl.controllers import BangBang, Feedback, hold
from stabctl.dynamics import adder, evaluate, family
from stabctl.simulation import stepper, voltages
laws = {"hold": hold, "bang_bang": BangBang().module, "feedback": Feedback().module}
modules = {**devices.every(), **laws, "adder": adder}
names = {
    name: [family._module(name, device, scalar).__module__ for scalar in (float, complex)]
    for name, device in modules.items()
}
names |= {entry.name: entry._place().name for entry in (stepper.advance, voltages.newton_from, evaluate.evaluate)}
print(json.dumps(names))
"""
ENTRIES = {"advance", "newton_from", "evaluate"}
STEPPER = {"advance", "newton_from"}


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """Names of all machine code of a copy of the package, one file of which is edited."""
    root = tmp_path_factory.mktemp("edited")
    shutil.copytree(PACKAGE, root / "stabctl", ignore=shutil.ignore_patterns("__pycache__"))
    where = os.environ | {"PYTHONPATH": str(root), "XDG_CACHE_HOME": str(root / "cache")}

    def names(edited=None, old="", new=""):
        """Names after `old` has become `new` in a file, else after a comment has been added to it."""
        path = root / "stabctl" / (edited or "__main__.py")
        before = path.read_text()
        assert old in before
        if edited:
            path.write_text(before.replace(old, new) if old else before + "\n# edited\n")
        command = [sys.executable, "-c", NAMES]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=where, cwd=root)
        path.write_text(before)
        return json.loads(done.stdout)

    names.plain = names()
    return names


EDITS = {
    "devices/machines/genrou.py": {"genrou"},
    "devices/stabilizers/pss.py": {"pss"},
    "controllers/bang_bang.py": {"bang_bang"},
    "controllers/feedback.py": {"feedback"},
    "controllers/signals.py": {"bang_bang", "feedback"},
    "controllers/hold.py": {"hold"},
    "dynamics/adder.py": {"adder"},
    "dynamics/evaluate.py": {"evaluate"},
    "dynamics/perform.py": ENTRIES,
    "dynamics/call.py": ENTRIES,
    "simulation/stepper.py": {"advance"},
    "simulation/voltages.py": STEPPER,
    "simulation/substitution.py": STEPPER,
    "model/powerflow.py": set(),
    "dynamics/start.py": set(),
}


@pytest.mark.parametrize("edited", EDITS)
def test_an_edit_leads_to_other_machine_code_where_it_is_used_and_nowhere_else(named, edited):
    after = named(edited)
    assert {name for name, code in after.items() if code != named.plain[name]} == EDITS[edited]


SHARED = ("machines/stator", "exciters/signals", "blocks/limits", "blocks/lags", "blocks/curves", "blocks/phasors")


@pytest.mark.parametrize("shared", SHARED)
def test_an_edit_of_what_devices_share_reaches_every_device_that_uses_it(named, shared):
    after, home = named(f"devices/{shared}.py"), f"stabctl.devices.{shared.replace('/', '.')}"
    changed = {name for name, code in after.items() if code != named.plain[name]}
    users = {name for name, device in devices.every().items() if home in map(_home, vars(device).values())}
    assert users <= changed
    assert len(users) > 1
    assert not changed & {"adder", "hold", "evaluate"}
    assert (STEPPER <= changed) == (shared == "blocks/phasors")


def _home(value):
    return getattr(value, "__module__", None)


def test_an_edit_of_how_loops_are_written_reaches_every_device(named):
    after = named("dynamics/family.py", "TINY = 1e-30", "TINY = 1e-31")
    assert not [name for name, code in after.items() if code == named.plain[name] and name in devices.every()]
    assert all(after[entry] != named.plain[entry] for entry in ENTRIES)


def test_an_edited_device_of_the_user_is_compiled_anew(tmp_path):
    """Registered a second time, in the same process, and with a file beside it that has changed."""
    source = (PACKAGE / "devices" / "exciters" / "sexs.py").read_text().replace("from .signals", "from my_signals")
    assert "from my_signals" in source
    (tmp_path / "my_signals.py").write_text((PACKAGE / "devices" / "exciters" / "signals.py").read_text())
    path, found = tmp_path / "my_exciter.py", []
    sys.path.insert(0, str(tmp_path))
    try:
        for text in (source, source.replace("return Output(clip(", "return Output(0.5 * clip(")):
            path.write_text(text)
            with registered(path) as (device,):
                kind = {"genrou": ROUND, "my_exciter": device.Par(0.01, 200.0, 0.05)}
                point = operating_point.solve(small(kind))
                state = next(i for i, p in enumerate(point.layout.states) if p.name == "efd")
                found.append(point.s[state] / point.s[point.layout.signals[0, "Efd"]])
        assert found == pytest.approx([1.0, 2.0])
        with registered(path) as (device,):
            before = jit.sources(device)
        sys.modules.pop("my_signals")
        (tmp_path / "my_signals.py").write_text((tmp_path / "my_signals.py").read_text() + "\n# edited\n")
        with registered(path) as (device,):
            assert jit.sources(device) != before
    finally:
        sys.path.remove(str(tmp_path))
        sys.modules.pop("my_signals", None)


@pytest.mark.parametrize("module", [*devices.every().values(), stepper, voltages, evaluate], ids=lambda m: m.__name__)
def test_every_file_that_machine_code_is_made_from_is_in_its_name(module):
    """Also one of which only a constant is taken."""
    tree, package = ast.parse(Path(module.__file__).read_text()), module.__name__.rpartition(".")[0]
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    used = {n.id for f in functions for n in ast.walk(f) if isinstance(n, ast.Name)}
    for node in (n for n in tree.body if isinstance(n, ast.ImportFrom)):
        home = resolve_name("." * node.level + (node.module or ""), package)
        for name in {alias.name for alias in node.names} & used if home.startswith("stabctl") else ():
            assert any(text in jit.sources(module) for text in _defining(home, name)), (home, name)


def _defining(home, name):
    """Texts of the module, or of those in it if it is a package, that define a name."""
    near = [m for key, m in sys.modules.items() if key == home or key.startswith(f"{home}.")]
    texts = [Path(m.__file__).read_text() for m in near if m.__file__]
    return [
        text for text in texts if re.search(rf"^ *((def|class) {name}\b|({name}|.*, {name}|{name}, .*) = )", text, re.M)
    ]


class TestFolder:
    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        """`jit.folder` as in a new process whose cache folder and temporary files lie in tmp_path; what it leaves."""
        monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: str(tmp_path / "cache" / name))
        monkeypatch.setattr(jit.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
        monkeypatch.setattr(jit.tempfile, "tempdir", str(tmp_path / "tmp"))
        (tmp_path / "tmp").mkdir()
        return jit.folder.__wrapped__

    def test_it_lies_outside_the_package(self):
        assert PACKAGE not in jit.folder().parents
        assert not list(PACKAGE.rglob("*.nb?"))

    def test_it_is_in_the_users_cache_folder_and_private(self, folder, tmp_path):
        assert folder() == tmp_path / "cache" / "stabctl" == folder()
        assert stat.S_IMODE(folder().stat().st_mode) == 0o700
        assert not list((tmp_path / "tmp").iterdir())

    def test_a_user_without_a_writable_cache_folder_has_a_private_one_among_the_temporary_files(self, folder, tmp_path):
        (tmp_path / "cache").write_text("")
        found = folder()
        assert found == tmp_path / "tmp" / f"stabctl-{os.getuid()}" == folder()
        assert stat.S_IMODE(found.stat().st_mode) == 0o700

    @pytest.mark.parametrize("planted", ["folder of another", "open to all", "link", "file"])
    def test_a_planted_folder_is_not_used(self, folder, tmp_path, monkeypatch, planted):
        places = tmp_path / "cache" / "stabctl", tmp_path / "tmp" / f"stabctl-{os.getuid()}"
        places[0].parent.mkdir()
        for place in places:
            if planted == "file":
                place.write_text("")
            elif planted == "link":
                target = tmp_path / "elsewhere"
                target.mkdir(exist_ok=True)
                place.symlink_to(target)
            else:
                place.mkdir(mode=0o700)
            if planted == "open to all":
                place.chmod(0o777)
        if planted == "folder of another":
            stranger = os.getuid() + 1
            monkeypatch.setattr(jit.os, "getuid", lambda: stranger)
            (tmp_path / "tmp" / f"stabctl-{os.getuid()}").mkdir(mode=0o700)
        ends = []
        monkeypatch.setattr(jit.atexit, "register", lambda f, *a, **k: ends.append((f, a, k)))
        found = folder()
        assert found not in places
        assert found.parent == tmp_path / "tmp"
        assert stat.S_IMODE(found.stat().st_mode) == 0o700
        for place in places:
            assert planted == "file" or not list(place.iterdir())
        for f, a, k in ends:
            f(*a, **k)
        assert not found.exists()  # it is of no use to the next run


def loaded(code, *modules):
    """Those of the modules that are loaded after the code."""
    code += f"\nimport sys; print([m for m in {modules} if m in sys.modules])"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_importing_the_core_imports_nothing_slow():
    code = "import stabctl.dynamics.operating_point, stabctl.io, stabctl.simulation.simulation"
    assert loaded(code, "pandas", "xarray", "matplotlib", "cvxpy", "control", "rich") == "[]"


def test_reading_a_case_loads_no_compiler():
    assert loaded("import stabctl", "numba", "numpy", "scipy") == "[]"
    assert loaded("import stabctl as st; st.load('two_area'); st.cases()", "numba", "llvmlite") == "[]"


PLAIN = """
import sys
import numpy as np
import stabctl as st
case = st.load("two_area").with_storage([st.Storage(1, 5, 50.0)])
result = case.simulate(st.Contingency("7-8", 0.05, at=0.05), 0.3, control=st.BangBang(0.01))
np.save(sys.argv[1], result.rows)
"""


def test_plain_python_gives_the_same_and_meets_no_index_out_of_range(tmp_path):
    rows = []
    for disable in ("0", "1"):
        where, out = os.environ | {"NUMBA_DISABLE_JIT": disable}, tmp_path / f"{disable}.npy"
        subprocess.run([sys.executable, "-c", PLAIN, out], check=True, env=where)
        rows.append(np.load(out))
    assert np.abs(rows[0] - rows[1]).max() < 1e-10  # 5.5e-13

"""Machine code has another name when a source that it is made from changes, and only then."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import resolve_name
from pathlib import Path

import pytest
from systems import ROUND, registered, small

import stabctl
from stabctl import devices
from stabctl._util import jit
from stabctl.dynamics import operating_point, perform
from stabctl.dynamics._codegen import made_of
from stabctl.simulation import _newton, stepper

PACKAGE = Path(stabctl.__file__).parent
NAMES = """
import json, sys
from pathlib import Path

sys.dont_write_bytecode = True


def names():
    for module in [name for name in sys.modules if name.partition(".")[0] == "stabctl"]:
        del sys.modules[module]
    from stabctl import devices
    from stabctl.controllers import BangBang, Feedback, hold
    from stabctl.devices import of
    from stabctl.dynamics import _codegen, adder, perform
    from stabctl.simulation import _newton, stepper

    laws = {"hold": of(hold), "bang_bang": BangBang().device, "feedback": Feedback().device}
    modules = {**devices.every(), **laws, "adder": of(adder)}
    entries = stepper.advance, _newton.newton, perform.evaluate
    return {
        name: [_codegen._module(name, device, scalar).__module__ for scalar in (float, complex)]
        for name, device in modules.items()
    } | {entry.name: entry._stem() for entry in entries}


found = {"": names()}
for file, (old, new) in json.load(sys.stdin).items():
    path = Path("stabctl") / file
    before = path.read_text()
    assert old in before
    path.write_text(before.replace(old, new) if old else before + new)
    found[file] = names()
    path.write_text(before)
print(json.dumps(found))
"""
ENTRIES = {"advance", "newton", "evaluate"}
STEPPER = {"advance", "newton"}
EDITS = {
    "devices/machines/genrou.py": {"genrou", "genroe", "gentpj1"},
    "devices/stabilizers/pss.py": {"pss"},
    "controllers/bang_bang.py": {"bang_bang"},
    "controllers/feedback.py": {"feedback"},
    "controllers/signals.py": {"bang_bang", "feedback"},
    "controllers/hold.py": {"hold"},
    "dynamics/adder.py": {"adder"},
    "dynamics/perform.py": ENTRIES,
    "simulation/stepper.py": {"advance"},
    "simulation/_voltages.py": STEPPER,
    "simulation/_newton.py": {"newton"},
    "simulation/_newton_factors.py": {"newton"},
    "simulation/_substitution.py": STEPPER,
    "model/powerflow.py": set(),
    "dynamics/newton.py": set(),
    "_util/jit.py": set(),
    "_util/object_code.py": set(),
}
SHARED = tuple(
    f"devices/{name}.py"
    for name in (
        "machines/stator",
        "exciters/shared",
        "blocks/limits",
        "blocks/lags",
        "blocks/curves",
        "blocks/phasors",
    )
)
WRITERS = {"dynamics/family.py": ("TINY = 1e-30", "TINY = 1e-31"), "_util/compiler.py": ("", "\n# edited\n")}


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """File of a copy of the package -> what has other machine code after the file is edited."""
    root = tmp_path_factory.mktemp("edited")
    shutil.copytree(PACKAGE, root / "stabctl", ignore=shutil.ignore_patterns("__pycache__"))
    where = os.environ | {"PYTHONPATH": str(root), "XDG_CACHE_HOME": str(root / "cache")}
    edits = dict.fromkeys((*EDITS, *SHARED), ("", "\n# edited\n")) | WRITERS
    command, told = [sys.executable, "-c", NAMES], json.dumps(edits)
    done = subprocess.run(command, input=told, capture_output=True, text=True, check=True, env=where, cwd=root)
    found = json.loads(done.stdout)
    plain = found.pop("")
    return {file: {name for name in plain if names[name] != plain[name]} for file, names in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("edited", EDITS)
def test_an_edit_leads_to_other_machine_code_where_it_is_used_and_nowhere_else(changed, edited):
    assert changed[edited] == EDITS[edited]


@pytest.mark.slow
@pytest.mark.parametrize("shared", SHARED)
def test_an_edit_of_what_devices_share_reaches_every_device_that_uses_it(changed, shared):
    home = f"stabctl.{shared.removesuffix('.py').replace('/', '.')}"
    users = {name for name, device in devices.every().items() if home in map(_home, vars(device.module).values())}
    assert users <= changed[shared]
    assert len(users) > 1
    assert not changed[shared] & {"adder", "hold", "evaluate"}
    assert (STEPPER <= changed[shared]) == shared.endswith("phasors.py")


def _home(value):
    return getattr(value, "__module__", None)


@pytest.mark.slow
@pytest.mark.parametrize("writer", WRITERS)
def test_an_edit_of_how_code_is_written_reaches_every_device(changed, writer):
    assert {*devices.every(), *ENTRIES} <= changed[writer]


def test_an_edited_device_of_the_user_is_compiled_anew(tmp_path):
    """Registered a second time, in the same process, and with a file beside it that has changed."""
    source = (PACKAGE / "devices" / "exciters" / "sexs.py").read_text().replace("from .shared", "from my_shared")
    assert "from my_shared" in source
    (tmp_path / "my_shared.py").write_text((PACKAGE / "devices" / "exciters" / "shared.py").read_text())
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
            before = made_of(device)
        sys.modules.pop("my_shared")
        (tmp_path / "my_shared.py").write_text("# edited\n" + (tmp_path / "my_shared.py").read_text())
        with registered(path) as (device,):
            assert made_of(device) == before  # a comment
    finally:
        sys.path.remove(str(tmp_path))
        sys.modules.pop("my_signals", None)


MODULES = [*(device.module for device in devices.every().values()), stepper, _newton, perform]


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__)
def test_every_file_that_machine_code_is_made_from_is_in_its_name(module):
    """Also one of which only a constant is taken."""
    tree, package = ast.parse(Path(module.__file__).read_text()), module.__name__.rpartition(".")[0]
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    used = {n.id for f in functions for n in ast.walk(f) if isinstance(n, ast.Name)}
    for node in (n for n in tree.body if isinstance(n, ast.ImportFrom)):
        home = resolve_name("." * node.level + (node.module or ""), package)
        inside = home.startswith("stabctl") and not home.startswith("stabctl._util")
        for name in {alias.name for alias in node.names} & used if inside else ():
            assert any(text in jit.sources(module) for text in _defining(home, name)), (home, name)


def _defining(home, name):
    """Texts of the module, or of those in it if it is a package, that are or define what has a name."""
    if f"{home}.{name}" in sys.modules:
        return [Path(sys.modules[f"{home}.{name}"].__file__).read_text()]  # a module itself
    near = [m for key, m in sys.modules.items() if key == home or key.startswith(f"{home}.")]
    texts = [Path(m.__file__).read_text() for m in near if m.__file__]
    return [text for text in texts if re.search(rf"^ *((def|class) {name}\b|(.*, )?{name}(, .*)? = )", text, re.M)]

"""What is compiled is compiled once, and again when a source of a kernel changes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stabctl
from stabctl import io
from stabctl._util import jit
from stabctl.controllers import BangBang, Feedback
from stabctl.dynamics import jacobian, operating_point
from stabctl.model.case import Storage
from stabctl.simulation import simulation, stepper
from stabctl.simulation.events import Clear, Fault, TripMachine


def everything(case):
    """A run of the case that meets every kind of table: with and without storage, law, record, trip."""
    number, bus = case.machines[0].machine, case.machines[0].storage_bus
    events = [Fault(str(bus), 0.01), Clear(str(bus), 0.02), TripMachine(number, 0.03)]
    for devices in ([], [Storage(number, bus, 10.0, "conductance", energy=1.0, lag=0.05, ramp=100.0)]):
        point = operating_point.solve(case.with_storage(devices))
        for control, record in ((None, True), (BangBang(), False), (Feedback(1.0), True)):
            simulation.run(point, events, 0.05, control=control, record=record)


def test_every_case_and_option_runs_on_one_compilation():
    for name in io.packaged():
        everything(io.load(name))
        everything(io.load(name).classical())
    assert len(stepper.advance.signatures) == 1
    assert len(jacobian.jacobian.signatures) == 1


def test_tables_of_the_plant_are_contiguous_writeable_copies(points):
    plant = points("wnaps").plant
    for name, table in plant._asdict().items():
        assert table.flags.c_contiguous, name
        assert table.flags.writeable, name


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the sources whose hash is taken instead of the package's."""
    copy = Path(shutil.copytree(Path(stabctl.__file__).parent, tmp_path / "stabctl"))
    monkeypatch.setattr(jit, "_PACKAGE", copy)
    return copy


@pytest.mark.parametrize(
    "source",
    ["models/blocks.py", "models/stator.py", "models/pss.py", "system.py", "jacobian.py", "compiled.py",
     "simulate/stepper.py", "simulate/voltages.py", "simulate/substitution.py",
     "controllers/bang_bang.py", "controllers/feedback.py", "controllers/laws.py", "controllers/signals.py"],
)  # fmt: skip
def test_the_cache_is_another_after_an_edit_of_a_kernel(package, source):
    before = jit._source_hash()
    assert before == jit._source_hash()
    (package / source).write_text((package / source).read_text() + "\n# edited\n")
    assert jit._source_hash() != before


def test_the_cache_stays_after_an_edit_elsewhere(package):
    before = jit._source_hash()
    (package / "powerflow.py").write_text("# edited\n")
    assert jit._source_hash() == before


def test_the_cache_lies_outside_the_package():
    package = Path(stabctl.__file__).parent
    assert package not in jit.FOLDER.parents
    assert not list(package.rglob("*.nbc"))


def test_a_user_without_a_writable_cache_folder_still_has_one(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setattr(jit.platformdirs, "user_cache_dir", lambda *_: str(blocked))
    assert blocked not in jit._cache_folder().parents


def test_importing_the_core_imports_nothing_slow():
    code = (
        "import sys, stabctl.equilibrium, stabctl.read, stabctl.simulate.simulation; "
        "print([m for m in ('pandas', 'xarray', 'matplotlib', 'cvxpy', 'control', 'rich') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


PLAIN = """
import sys
import numpy as np
from stabctl import equilibrium, read
from stabctl.case import Storage
from stabctl.controllers import BangBang
from stabctl.simulate.events import contingency
from stabctl.simulate.simulation import run
case = io.load("two_area").with_storage([Storage(1, 5, 50.0)])
result = run(operating_point.solve(case), contingency("7-8", 0.05, at=0.05), 0.3, BangBang(0.01))
np.save(sys.argv[1], result.rows)
"""


def test_plain_python_gives_the_same_and_meets_no_index_out_of_range(tmp_path):
    rows = []
    for disable in ("0", "1"):
        where, out = os.environ | {"NUMBA_DISABLE_JIT": disable}, tmp_path / f"{disable}.npy"
        subprocess.run([sys.executable, "-c", PLAIN, out], check=True, env=where)
        rows.append(np.load(out))
    assert np.abs(rows[0] - rows[1]).max() < 1e-10  # 5.5e-13

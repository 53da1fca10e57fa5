"""Machine code that is kept on disk: damaged files are made again, and nobody waits for code that is whole."""

import fcntl
import importlib.util
import random
import sys
import threading

import numpy as np
import pytest
from starts import DAMAGE, KINDS, Starts

from stabctl import devices
from stabctl._util import files, object_code
from stabctl.devices.blocks import phasors
from stabctl.dynamics import _codegen
from stabctl.view.diagram._layout import cached_layout

SOURCE = """
from stabctl._util import jit

@jit.entry
def twice(x):
    x[0] = 2.0 * x[1]

@jit.entry
def thrice(x):
    x[0] = 3.0 * x[1]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder for machine code."""
    (tmp_path / "kept").mkdir(mode=0o700)
    monkeypatch.setattr(object_code, "folder", lambda: tmp_path / "kept")
    return tmp_path / "kept"


@pytest.fixture
def compiled(tmp_path, folder):
    """Calls a function as a new process does: fails if its value is wrong, and says whether files were written."""

    def call(name="twice", factor=2.0):
        (tmp_path / "multiples.py").write_text(SOURCE)
        spec = importlib.util.spec_from_file_location("multiples", tmp_path / "multiples.py")
        sys.modules["multiples"] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        before, x = contents(folder), np.array([1.0, 5.0])
        getattr(module, name)(x)
        assert x[0] == 5.0 * factor
        return contents(folder) != before

    yield call
    sys.modules.pop("multiples", None)


def test_code_is_here_if_there_is_a_file_of_its_own_name(folder):
    for name in ("genrou-1234.obj", "gensal-1234.txt"):
        (folder / name).touch()
    assert [object_code.here(stem) for stem in ("genrou", "gensal", "genr")] == [True, False, False]


def contents(folder):
    """File -> time and content, of the machine code."""
    return {file: (file.stat().st_mtime_ns, file.read_bytes()) for file in folder.rglob("*.obj") if file.is_file()}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_file_is_made_again(compiled, folder, damage):
    assert compiled()
    assert not compiled()
    for file in contents(folder):
        file.write_bytes(DAMAGE[damage](file.read_bytes(), random.Random(1)))
        assert compiled()
        assert not compiled()


def test_a_file_of_another_function_is_made_again(compiled, folder):
    assert compiled()
    assert compiled("thrice", 3.0)
    twice, thrice = sorted(contents(folder), key=lambda file: "thrice" in file.name)
    twice.write_bytes(thrice.read_bytes())
    assert compiled()
    assert not compiled()


def test_a_family_whose_file_is_damaged_is_made_again(folder, monkeypatch):
    for turn in range(3):
        monkeypatch.setattr(_codegen, "_compiled", {})
        before = contents(folder)
        assert _codegen.address("zip_load", devices.every()["zip_load"], float)
        assert (contents(folder) == before) is (turn == 1)
        for file in contents(folder) if turn == 1 else ():
            file.write_bytes(DAMAGE["cut"](file.read_bytes(), random.Random(1)))


def test_a_folder_in_the_place_of_a_file_costs_only_time(compiled, folder):
    assert compiled()
    for file in contents(folder):
        file.unlink()
        file.mkdir()
    assert not compiled()
    assert all(file.is_dir() for file in folder.rglob("*.obj"))


def test_a_full_disk_costs_only_time(compiled, folder, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    assert not compiled()
    assert all(file.name.endswith("lock") for file in folder.rglob("*") if file.is_file())


def test_a_damaged_layout_is_made_again(cases, folder):
    wanted = cached_layout(cases("two_area"))
    (file,) = (file for file in folder.rglob("*") if file.is_file())
    whole = file.read_bytes()
    for damage in DAMAGE.values():
        file.write_bytes(damage(whole, random.Random(1)))
        assert (cached_layout(cases("two_area")) == wanted).all()
        assert file.read_bytes() == whole


@pytest.fixture
def hold():
    """Hold the locks of a folder as another process does."""
    held = []

    def each(folder):
        for path in [*folder.rglob("*lock")]:
            held.append(path.open("w"))
            fcntl.flock(held[-1], fcntl.LOCK_EX)
        assert held

    def release():
        while held:
            held.pop().close()

    each.release = release
    yield each
    release()


def in_time(work, *arguments):
    """What `work` returns; fails if it has not in 20 s."""
    found = []
    thread = threading.Thread(target=lambda: found.append(work(*arguments)), daemon=True)
    thread.start()
    thread.join(20)
    assert found, "it waits for a lock"
    return found[0]


def test_code_on_disk_is_loaded_while_its_lock_is_held(compiled, folder, hold):
    assert compiled()
    hold(folder)
    assert in_time(compiled) is False


def test_the_lock_of_another_function_delays_nobody(compiled, folder, hold):
    assert compiled()
    hold(folder)
    assert in_time(compiled, "thrice", 3.0)


def test_a_function_that_another_process_compiles_is_awaited(compiled, folder, hold):
    """It is then loaded, not compiled again."""
    assert compiled()
    whole = contents(folder)
    hold(folder)
    for file in whole:
        file.unlink()
    found = []
    thread = threading.Thread(target=lambda: found.append(compiled()), daemon=True)
    thread.start()
    thread.join(1.0)
    assert not found
    for file, (_, data) in whole.items():
        file.write_bytes(data)
    written = contents(folder)
    hold.release()
    thread.join(20)
    assert found
    assert contents(folder) == written


@pytest.mark.slow
def test_a_command_answers_the_same_whatever_happens_to_its_machine_code(tmp_path):
    """Every kind of damage once; `starts.py` makes as many starts as wanted."""
    started = Starts(tmp_path, seed=98)
    told = [started.damaged(number) for number in range(len(KINDS))]
    assert [one for one in told if one[1] is not None] == []
    assert {kind for kind, _ in told} == {*KINDS}


@pytest.mark.slow
def test_functions_of_the_user_are_compiled_as_ever(compiled):
    """Also one that calls what was linked into ours before."""
    from numba import njit

    source = devices.every()["sexs"]
    _codegen.jit.compiler().callback(_codegen._module("sexs", source, complex), complex, "again")
    assert compiled()
    assert njit(lambda a, b: phasors.magnitude(a, b))(3.0, 4.0) == 5.0
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        njit(lambda a, b: a / b)(1.0, 0.0)
    assert njit(lambda z, n: np.exp(z) ** n)(1j, 2) == pytest.approx(np.exp(2j))

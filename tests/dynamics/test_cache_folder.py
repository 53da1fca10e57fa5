"""The folder of the machine code: in the user's cache, private, never a planted one."""

import os
import stat
from pathlib import Path

import platformdirs
import pytest

import stabctl
from stabctl._util import object_code

PACKAGE = Path(stabctl.__file__).parent


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder as in a new process whose cache folder and temporary files lie in tmp_path; what it leaves."""
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: str(tmp_path / "cache" / name))
    monkeypatch.setattr(object_code.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    monkeypatch.setattr(object_code.tempfile, "tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    return object_code.folder.__wrapped__


def test_it_lies_outside_the_package():
    assert PACKAGE not in object_code.folder().parents
    assert not list(PACKAGE.rglob("*.obj"))


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_it_is_in_the_users_cache_folder_and_private(folder, tmp_path, umask):
    before = os.umask(umask)
    try:
        folder()
    finally:
        os.umask(before)
    assert folder() == tmp_path / "cache" / "stabctl" == folder()
    assert stat.S_IMODE(folder().stat().st_mode) == 0o700
    assert not list((tmp_path / "tmp").iterdir())


def test_a_user_without_a_writable_cache_folder_has_a_private_one_among_the_temporary_files(folder, tmp_path):
    (tmp_path / "cache").write_text("")
    found = folder()
    assert found == tmp_path / "tmp" / f"stabctl-{os.getuid()}" == folder()
    assert stat.S_IMODE(found.stat().st_mode) == 0o700


@pytest.mark.parametrize("planted", ["folder of another", "open to all", "link", "file"])
def test_a_planted_folder_is_not_used(folder, tmp_path, monkeypatch, planted):
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
        monkeypatch.setattr(object_code.os, "getuid", lambda: stranger)
        (tmp_path / "tmp" / f"stabctl-{os.getuid()}").mkdir(mode=0o700)
    ends = []
    monkeypatch.setattr(object_code.atexit, "register", lambda f, *a, **k: ends.append((f, a, k)))
    found = folder()
    assert found not in places
    assert found.parent == tmp_path / "tmp"
    assert stat.S_IMODE(found.stat().st_mode) == 0o700
    for place in places:
        assert planted == "file" or not list(place.iterdir())
    for f, a, k in ends:
        f(*a, **k)
    assert not found.exists()  # it is of no use to the next run

"""The wheel carries the cases: built, installed alone into a clean environment, run from another folder."""

import json
import os
import re
import shlex
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from test_docs import commands, same, tokens

ROOT = Path(__file__).parents[2]
ALONE = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Python of a clean environment in which only the wheel and its dependencies are installed."""
    folder = tmp_path_factory.mktemp("wheel")
    python = folder / "venv" / "bin" / "python"
    told = {"check": True, "capture_output": True, "env": ALONE}
    subprocess.run([sys.executable, "-m", "build", "--outdir", folder, ROOT], **told)  # the wheel from the archive
    subprocess.run([sys.executable, ROOT / "tools" / "make_venv.py", folder / "venv"], **told)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-compile", wheel], **told)
    return python


def test_the_wheel_holds_templates_and_not_the_reproduction(installed):
    (wheel,) = installed.parents[2].glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {f"stabctl/view/pages/templates/{name}" for name in ("base.html", "page.html", "style.css")} <= set(names)
    assert {name.split("/")[0] for name in names if "dist-info" not in name} == {"stabctl"}
    assert not [name for name in names if "reproduction" in name]


def test_a_case_runs_from_the_wheel(installed, tmp_path):
    """Also with the package read-only, as a system-wide installation is: the machine code goes to the user's cache."""
    program = installed.parent / "stabctl"
    environment = ALONE | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    told = {"capture_output": True, "text": True, "cwd": tmp_path, "env": environment}
    find = "import stabctl, pathlib; print(pathlib.Path(stabctl.__file__).parent)"
    done = subprocess.run([installed, "-c", find], check=True, **told)
    package = Path(done.stdout.strip())
    assert not package.is_relative_to(ROOT)
    for path in (package, *package.rglob("*")):
        if path.is_dir():
            path.chmod(0o555)
    words = ["simulate", "two_area", "--classical", "--fault", "7-8@0.4", "--clear", "10cyc", "--json"]
    done = subprocess.run([program, *words], **told)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "stable"
    assert "compiling" in done.stderr
    assert list((tmp_path / "cache").rglob("*.obj"))
    again = subprocess.run([program, *words], **told)
    assert "compiling" not in again.stderr


WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = sys.modules["llvmlite"] = None  # an import of them is an error
from stabctl.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A folder with the files of a wheel that has the machine code of the lowest level, of what the studies need."""
    folder = tmp_path_factory.mktemp("compiled")
    where = ALONE | {"STABCTL_LEVELS": "x86-64-v2", "STABCTL_DEVICES": "gencls", "STABCTL_PYTHON": sys.executable}
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", folder, ROOT]
    subprocess.run(command, check=True, capture_output=True, env=where)
    (wheel,) = folder.glob("*-py3-none-linux_x86_64.whl")
    zipfile.ZipFile(wheel).extractall(folder / "files")
    return folder / "files"


@pytest.fixture
def simulated(compiled, tmp_path):
    """What a command prints without numba and without a cache."""

    def run(code, *how):
        words = ["simulate", "two_area", "--fault", "7-8@0.4", "--clear", "10cyc", "--json", *how]
        where = ALONE | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": str(compiled)}
        command = [sys.executable, "-c", code, *words]
        return subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=where)

    return run


def test_a_wheel_with_machine_code_runs_without_numba(simulated, tmp_path):
    done = simulated(WITHOUT_NUMBA, "--storage", "50MW")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "stable"
    assert "compiling" not in done.stderr
    assert not list((tmp_path / "cache").rglob("*.obj"))


def test_a_library_that_is_cut_is_not_opened(compiled, simulated):
    """Its pages would be read beyond the end of the file, which no error tells; the code is compiled instead."""
    library = compiled / "stabctl" / "_machine_code" / "x86-64-v2.so"
    whole = library.read_bytes()
    library.write_bytes(whole[: len(whole) // 2])
    try:
        code = WITHOUT_NUMBA.partition("sys.modules")[0] + "from stabctl.__main__ import main\nmain()"
        done = simulated(code, "--classical")
    finally:
        library.write_bytes(whole)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["outcome"] == "stable"
    assert "compiling" in done.stderr


def test_the_tour_of_the_readme_runs_without_numba(installed, compiled, tmp_path):
    """In a clean environment and an empty cache; nothing is compiled."""
    blocked = "import sys\nsys.modules['numba'] = sys.modules['llvmlite'] = None\n"
    (tmp_path / "sitecustomize.py").write_text(blocked)
    where = ALONE | {
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
        "PYTHONPATH": f"{tmp_path}:{compiled}",
        "COLUMNS": "100",
        "TTY_COMPATIBLE": "1",
        "TERM": "xterm",
        "NO_COLOR": "1",
    }

    def run(*words):
        done = subprocess.run([installed, *words], capture_output=True, text=True, cwd=tmp_path, env=where)
        assert done.returncode == 0, done.stderr
        return re.sub(r"\x1b\[[\d;]*m", "", done.stdout) + done.stderr

    blocks = [(fence.info, fence.content) for fence in tokens(ROOT / "README.md") if fence.type == "fence"]
    code, shown = ("".join(text for info, text in blocks if info == kind) for kind in ("python", "text"))
    same(shown, run("-c", code), "README.md")
    for command, printed in (pair for info, text in blocks if info == "console" for pair in commands(text)):
        same(printed, run("-m", *shlex.split(command)), command)
    assert not list((tmp_path / "cache").rglob("*.obj"))

"""Devices of the user's own files: in other processes, replaced, broken."""

import pickle
import subprocess
import sys

import pytest
from systems import OWN, ROUND, SEXS, registered, small

import stabctl as st
from stabctl import devices
from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point
from stabctl.dynamics._codegen import made_of
from stabctl.jobs.task import fingerprint

ECHO = '''"""ECHO: a stabilizer that reads its own output."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.ports import At

NAME = "ECHO"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    other: Annotated[int, "-", "machine"]


class Input(NamedTuple):
    """Signals."""

    far: Annotated[float, "pu", "signal", At("Vs", "other")]


class Output(NamedTuple):
    """Signal."""

    Vs: Annotated[float, "pu", "signal"]


@inline
def output(far):
    """The same again (pu)."""
    return Output(far)
'''


@pytest.fixture
def wide():
    """The wide-area stabilizer, registered."""
    with registered(OWN / "wide_area.py"):
        yield devices.every()["wide_area"].Par


@pytest.mark.parametrize("kind", ["case", "point", "system"])
def test_devices_of_ones_own_are_known_where_a_pickle_is_read(tmp_path, wide, kind):
    case = small({"genrou": ROUND, "sexs": SEXS, "wide_area": wide(2, 0, 0.5)})
    point = operating_point.solve(case)
    file = tmp_path / "pickled"
    file.write_bytes(pickle.dumps({"case": case, "point": point, "system": point.system}[kind]))
    code = (
        "import pickle; from stabctl import devices; "
        f"pickle.load(open({str(file)!r}, 'rb')); print(list(devices.every()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "wide_area" in done.stdout


def test_a_device_file_that_breaks_leaves_the_one_registered_before(tmp_path):
    file = tmp_path / "echo_pss.py"
    file.write_text(ECHO)
    with registered(file):
        before = devices.every()["echo_pss"]
        file.write_text("1 / 0")
        with pytest.raises(StudyError, match="ZeroDivisionError"):
            devices.register(file)
        assert sys.modules["stabctl_device_echo_pss"] is before.module
        assert devices.every()["echo_pss"] is before


NUMPY = "import numpy as np; TABLE = np.array("
READ = "TABLE = tuple(map(float, open({data!r}).read().split()))"
USES = (  # how a device uses the file beside it; two contents of that file, and of data.txt
    ("from beside import twice: twice(far)", "def twice(x): return 2 * x", "def twice(x): return 3 * x", "", ""),
    ("from beside import GAIN: GAIN * far", "GAIN = 2.0", "GAIN = 3.0", "", ""),
    ("from beside import TABLE: TABLE[0] * far", "TABLE = (2.0,)", "TABLE = (3.0,)", "", ""),
    ("import beside: beside.TABLE[0][1] * far", "TABLE = ((1.0, 2.0),)", "TABLE = ((1.0, 3.0),)", "", ""),
    ("from beside import TABLE: TABLE[0] * far", f"{NUMPY}[2.0])", f"{NUMPY}[3.0])", "", ""),
    ("from beside import TABLE: TABLE[1] * far", READ, READ, "1 2", "1 3"),
)


@pytest.mark.parametrize(("use", "first", "second", "before", "after"), USES)
def test_machine_code_is_another_when_what_a_device_uses_changes_and_only_then(
    tmp_path, monkeypatch, use, first, second, before, after
):
    """What is compiled is filed: a file counts as it was imported, not as it is now."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # whose files tell seconds apart, not less
    line, _, equation = use.partition(": ")
    file, beside, data = (tmp_path / name for name in ("echo_pss.py", "beside.py", "data.txt"))
    file.write_text(f"{line}\n{ECHO.replace('Output(far)', f'Output({equation})')}")
    found = []
    for text, number in ((first, before), (first, before), (second, after)):
        beside.write_text(text.format(data=str(data)))
        data.write_text(number)
        sys.modules.pop("beside", None)
        with registered(file) as (device,):
            beside.write_text("")  # edited before the first use
            found.append((made_of(device), fingerprint(st.load("two_area").with_device("echo_pss", 1, other=1))))
    assert found[0] == found[1]
    assert all(a != b for a, b in zip(found[1], found[2], strict=True))


def test_what_a_device_computes_and_keeps_is_none_of_it(tmp_path):
    """Workers compare its content as it was registered."""
    file = tmp_path / "echo_pss.py"
    kept = "_known = {}\n\n\ndef prepare(p):\n    _known[p.other] = p\n    return p\n\n\n"
    file.write_text(ECHO.replace("@inline", kept + "@inline"))
    with registered(file) as (device,):
        before = devices.registered()[device.file]
        device.prepare(device.Par(other=7))
        assert devices.registered()[device.file] == before
    with registered(file) as (device,):
        assert devices.registered()[device.file] == before


def test_the_files_of_these_tests_are_devices():
    for path in sorted(OWN.glob("*.py")):
        if not path.name.startswith(("test_", "conftest")):
            with registered(path) as (device,):
                assert device.name

"""Devices of the user's own files: in other processes, replaced, broken."""

import pickle
import subprocess
import sys

import pytest
from systems import OWN, ROUND, SEXS, registered, small

from stabctl import devices
from stabctl._util import jit
from stabctl._util.errors import StudyError
from stabctl.dynamics import operating_point

ECHO = '''"""ECHO: a stabilizer that reads its own output."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl.devices.ports import At

NAME = "ECHO"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    machine: Annotated[int, "-", "machine"]


class Input(NamedTuple):
    """Signals."""

    far: Annotated[float, "pu", "signal", At("Vs", "machine")]


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


def test_machine_code_is_another_when_a_file_or_a_constant_beside_the_device_changes(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # whose files tell seconds apart, not less
    (tmp_path / "beside.py").write_text("GAIN = 2.0\n\n\ndef twice(x):\n    return 2 * x\n")
    texts = []
    for line in ("from beside import twice\n", "from beside import GAIN\n"):
        file = tmp_path / "echo_pss.py"
        file.write_text(line + ECHO)
        for before, after in (
            (("2 * x", "3 * x"), ("3 * x", "2 * x")) if "twice" in line else (("2.0", "3.0"), ("3.0", "2.0"))
        ):
            helper = tmp_path / "beside.py"
            helper.write_text(helper.read_text().replace(before, after))
            sys.modules.pop("beside", None)
            with registered(file):
                texts.append(jit.digest(jit.sources(devices.every()["echo_pss"].module)))
    assert texts[0] != texts[1]
    assert texts[2] != texts[3]


def test_the_files_of_these_tests_are_devices():
    for path in sorted(OWN.glob("*.py")):
        if not path.name.startswith(("test_", "conftest")):
            with registered(path) as (device,):
                assert device.name

"""The record of a device: nothing looks past it, each of its parts is known to the page, and it travels."""

import ast
import inspect
import pickle
import re
from dataclasses import MISSING, FrozenInstanceError, fields
from pathlib import Path

import pytest

from stabctl import devices
from stabctl.devices.device import CONSTANTS, EQUATIONS, RECORDS, Device, misspelt, of
from stabctl.simulation import center, frame, gate, line, lti

ROOT = Path(__file__).parents[2]
LOOKS = {"hasattr", "getattr"}
PARTS = [f for f in fields(Device) if "meaning" in f.metadata]
DEFAULTS = {f.name: {} if f.default is MISSING else f.default for f in PARTS}


def looked_up():
    """Places that ask whether a device has a part by its name: on a record the answer is always yes."""
    for path in [*(ROOT / "stabctl").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in LOOKS and len(node.args) > 1:
                whom, what = ast.unparse(node.args[0]), node.args[1]
                named = isinstance(what, ast.Constant) and what.value in {*CONSTANTS, *EQUATIONS, *RECORDS}
                if named or whom.split(".")[-1] == "device":
                    yield f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)}"


@pytest.mark.slow
def test_no_file_looks_past_the_record():
    assert list(looked_up()) == []


@pytest.mark.parametrize("name", devices.every())
def test_every_part_of_a_file_is_in_its_record(name):
    """What the file defines is what the record holds, and no name in it is nearly one with a meaning."""
    device = devices.every()[name]
    inside = vars(device.module)
    assert device.table == name
    assert (device.name, device.role) == (inside["NAME"], inside["ROLE"])
    for part in (*RECORDS, *EQUATIONS):
        assert vars(device)[part] is inside.get(part, DEFAULTS[part])
    for constant, part in CONSTANTS.items():
        assert vars(device)[part] == inside.get(constant, DEFAULTS[part])
    assert misspelt(device.module) is None


@pytest.mark.parametrize("module", [center, frame, gate, line, lti], ids=lambda module: module.__name__.split(".")[-1])
def test_loops_written_by_hand_are_devices_too(module):
    device = of(module)
    assert device is of(module)
    assert device.role in ("controller", "sensor")


def test_a_record_cannot_be_changed_and_is_the_same_after_a_pickle():
    device = devices.every()["genrou"]
    with pytest.raises(FrozenInstanceError):
        device.name = "GENROE"
    assert pickle.loads(pickle.dumps(device)) is device


def test_arguments_are_those_of_the_functions():
    for device in devices.every().values():
        for name in EQUATIONS:
            found = vars(device)[name]
            assert device.has(name) == (found is not None)
            assert device.arguments(name) == (tuple(inspect.signature(found).parameters) if found else ())


def test_the_page_lists_every_part_of_a_record():
    """docs/extending.md: a row for each, with what it may read and what it gives."""
    page = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)(?:\([^`]*\))?` \| (.*) \|$", page, re.MULTILINE))
    meaning = {f.metadata.get("constant", f.name): f.metadata["meaning"] for f in PARTS}
    assert {name: rows.get(name) for name in meaning} == meaning

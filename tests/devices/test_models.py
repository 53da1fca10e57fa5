"""`stabctl models`, the page of models, and devices of a user's own in commands and worker processes."""

import json
import re

import pytest
from click.testing import CliRunner
from systems import OWN, registered

from stabctl import devices, io
from stabctl._util.errors import StudyError
from stabctl.cli import app
from stabctl.devices.describe import describe
from stabctl.devices.storage import STORES
from stabctl.sweep import pool, sweep
from stabctl.sweep.job import Job
from tools import models_page

MINE = '''"""SLOW: a stabilizer with a gain alone, Vs = K (omega - 1)."""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline

NAME = "SLOW"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    K: Annotated[float, "pu", "gain"]


class Input(NamedTuple):
    """Signals."""

    omega: Annotated[float, "pu", "speed"]


class Output(NamedTuple):
    """Signal."""

    Vs: Annotated[float, "pu", "stabilizing signal"]


@inline
def output(omega, p):
    """Stabilizing signal (pu)."""
    return Output(p.K * (omega - 1))
'''


@pytest.fixture
def mine(tmp_path):
    """A case folder whose machine 1 has a stabilizer of the user's, and the file of the device."""
    file = tmp_path / "slow.py"
    file.write_text(MINE)
    case = io.load("two_area")
    io.write(case, tmp_path / "case")
    (tmp_path / "case" / "pss.csv").unlink(missing_ok=True)
    (tmp_path / "case" / "slow.csv").write_text("machine,K_pu\n1,10\n")
    with registered():
        yield tmp_path / "case", file


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_the_page_holds_every_device_with_all_its_fields():
    text = models_page.page()
    assert text == models_page.page()
    for name, device in devices.every().items():
        assert f"### {name}\n" in text
        for record in ("Par", "State", "Input", "Output"):
            for field in device.fields(record):
                assert f"| {field} |" in text.partition(f"### {name}\n")[2].partition("\n### ")[0], (name, field)


@pytest.mark.parametrize("name", devices.every())
def test_every_device_describes_itself(name):
    """What it is in the first line; what every table needs besides."""
    found = describe(name)
    assert len(found.title) > 15
    assert found.role in devices.ROLES
    assert all(s.meaning for part in (found.states, found.inputs, found.outputs) for s in part)
    assert describe(devices.every()[name].name).name == name


def test_models_lists_all_and_shows_one():
    listed = json.loads(run("models", "--json").output)["models"]
    assert {row["name"] for row in listed} >= set(devices.every())
    one = json.loads(run("models", "GENROU", "--json").output)["model"]
    assert [p["name"] for p in one["parameters"]] == list(devices.every()["genrou"].Par._fields)
    assert [i["reads"][:6] for i in one["inputs"]] == ["output", "output"]
    shown = run("models", "exdc2").output
    assert "The state vr has the non-windup limits VRmin x vt and VRmax x vt." in shown
    assert "kA" not in shown
    stores = {f"{store}_regfm_b1" for store in STORES}
    assert {row["name"] for row in listed if row["unverified"]} == {"regfm_b1"} | stores
    with pytest.raises(StudyError, match="There is no model 'genru'; did you mean genrou"):
        describe("genru")


def test_what_is_not_verified_says_so_wherever_it_is_shown():
    """A docstring that says that a source was not at hand has the mark of the tables; so has storage that reuses it."""
    for name, device in devices.every().items():
        shown = [run("models", name).output, "".join(models_page._section(describe(name)))]
        within = name.partition("_")[2] if name.partition("_")[0] in STORES else name
        borrowed = within in devices.every() and describe(within).unverified
        assert bool(describe(name).unverified) == bool("not at hand" in (device.__doc__ or "") or borrowed)
        assert all(("not verified against its source" in text) == bool(describe(name).unverified) for text in shown)
    listed = re.sub(r"\s+", " ", run("models").output)
    assert listed.count("not verified") == 1 + len(STORES)


def test_a_device_file_serves_the_commands(mine):
    case, file = mine
    found = run("modes", case, "--device", file, "--json")
    assert found.exit_code == 0, found.output
    assert describe("slow").title == "SLOW: a stabilizer with a gain alone, Vs = K (omega - 1)"
    assert run("models", "slow", "--device", file).exit_code == 0


def test_without_its_device_file_a_case_is_refused(mine):
    assert "slow" in str(run("powerflow", mine[0]).exception)


def test_workers_know_the_devices_of_the_user_and_keys_hold_their_text(mine):
    case, file = mine
    devices.register(file)
    job = Job("simulate", str(case), fault="8", clear="0.05s", at=0.1, until=0.5)
    (one,) = sweep.tasks([job], case.parent / "study.toml")
    (row,) = list(pool.rows([one], 1))
    assert row.found["outcome"] == "stable", row
    file.write_text(MINE.replace("p.K *", "2 * p.K *"))
    devices.register(file)
    assert sweep.tasks([job], case.parent / "study.toml")[0].key != one.key


def test_devices_of_a_test_are_gone_after_it():
    with registered(OWN / "wide_area.py"):
        assert "wide_area" in devices.every()
    assert "wide_area" not in devices.every()

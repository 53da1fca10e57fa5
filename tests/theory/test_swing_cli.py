import json
import subprocess
import sys

import pytest
from click.testing import CliRunner

from stabctl._util.errors import StudyError
from stabctl.cli import app

COMMANDS = ("table1", "equal-area", "feedback", "minimum-time")


def run(*words):
    return CliRunner().invoke(app, ["swing", *words])


def record(*words):
    result = run(*words, "--json")
    assert result.exit_code == 0
    return json.loads(result.stdout)


def test_json_has_exactly_its_keys():
    keys = {"critical_angle_rad", "critical_time_s", "critical_cycles"}
    assert set(record("equal-area")) == keys | {"clearing_angle_rad", "unstable_angle_rad", "a1_pu_rad", "a2_pu_rad"}
    keys = {"duration_s", "lambda1_start", "lambda2_start", "angle_end_rad", "switches"}
    found = record("minimum-time")
    assert set(found) == keys
    assert found["switches"] == 0
    rows = record("table1")["rows"]
    assert [r["cycles"] for r in rows] == [6, 12, 15]
    assert set(rows[0]) == {"cycles", "angle_rad", "speed_rad_s"}
    laws = record("feedback")["laws"]
    assert len(laws) == 4
    keys = {"name", "stable", "peak_angle_rad", "min_angle_rad", "max_speed_rad_s", "min_speed_rad_s"}
    assert all(set(law) == keys for law in laws)
    assert all(law["stable"] is True for law in laws)


@pytest.mark.slow
def test_options_reach_the_model():
    assert record("equal-area", "--H", "12")["critical_time_s"] == pytest.approx(2 * 0.2437528, rel=1e-6)
    assert record("equal-area", "--Pc", "0.2")["critical_time_s"] > 0.2438
    shown = record("equal-area", "--cycles", "12", "--Pc", "0.2")
    assert shown["clearing_angle_rad"] == pytest.approx(record("table1", "--cycles", "12")["rows"][0]["angle_rad"])
    assert shown["a1_pu_rad"] < shown["a2_pu_rad"] or shown["a1_pu_rad"] == pytest.approx(shown["a2_pu_rad"])
    assert record("minimum-time", "--Pc", "1")["duration_s"] < 0.0566
    assert [r["cycles"] for r in record("table1", "--cycles", "3")["rows"]] == [3]
    assert not record("feedback", "--Kv", "0", "--Ka", "0")["laws"][1]["stable"]


def test_a_fault_too_short_to_move_the_machine_is_one_sentence():
    refusal = run("minimum-time", "--cycles", "1e-9").exception
    assert isinstance(refusal, StudyError)
    assert "practically zero" in str(refusal)


def test_infeasible_is_a_sentence_and_no_error():
    found = record("minimum-time", "--cycles", "10")
    assert found["duration_s"] is None
    assert "cannot be brought to zero" in found["outcome"]
    assert "cannot be brought to zero" in run("minimum-time", "--cycles", "10").stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_table_and_picture(command, tmp_path):
    file = tmp_path / "picture.png"
    result = run(command, "--plot", str(file))
    assert result.exit_code == 0
    assert len(result.stdout.splitlines()) > 4
    assert not result.stdout.lstrip().startswith("{")
    assert file.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    "wrong",
    [["--Pm", "5"], ["--X", "0"], ["--cycles", "-1"], ["--cycles", "nan"], ["--cycles", "1e9"], ["--Pm", "inf"]],
)
def test_bad_input_is_one_sentence(command, wrong):
    result = run(command, *wrong)
    assert isinstance(result.exception, StudyError)
    assert len(str(result.exception).splitlines()) == 1
    assert result.stdout == ""


@pytest.mark.parametrize("place", ["missing/picture.png", "picture.nonsense"])
def test_picture_that_cannot_be_written(place, tmp_path):
    assert isinstance(run("table1", "--plot", str(tmp_path / place)).exception, StudyError)


def test_help_imports_nothing_heavy():
    heavy = "('numpy', 'scipy', 'matplotlib', 'cvxpy')"
    code = f"import sys, stabctl.cli.swing; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.slow
def test_gains_that_throw_the_machine_out_of_range_are_told():
    """With a negative gain the speed grows as exp(-Kv t / (M + Ka)), by a thousand at most."""
    assert not record("feedback", "--Kv", "-0.015")["laws"][1]["stable"]
    for gain in ("-0.05", "-10", "1e308"):
        assert isinstance(run("feedback", "--Kv", gain).exception, StudyError)

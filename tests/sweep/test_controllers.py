"""Sweeps with controllers: a job is the call with the controllers, and their content is in its key."""

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.sweep import study_file
from stabctl.sweep.job import run_job
from stabctl.sweep.sweep import run_sweep, tasks

STUDY = """
kind = "clearing-time"
case = "two_area"
machines = "classical"
fault = "7-8@0.2"
trip = "7-8"
resolution = "0.5cyc"
observe_s = 3
storage = "50MW"
controller = ["", "gain.toml"]
"""


def gain(k):
    return st.Controller.from_control(control.tf(k, 1), "deviation:1", "order:1@5", rate=60, name="gain")


def test_a_job_with_a_controller_is_that_of_the_call(write, tmp_path, cases):
    gain(2e3).save(tmp_path / "gain.toml")
    path = write(STUDY)
    law, own = (run_job(task) for task in tasks(study_file.read(path), path))
    base = cases("two_area").classical().initialize(storage="50MW")
    fault = st.Contingency("7-8@0.2", trip="7-8")
    options = {"resolution": "0.5cyc", "observe": 3}
    assert law.message == str(base.clearing_time(fault, control=st.BangBang(), **options))
    assert own.message == str(base.clearing_time(fault, control=gain(2e3), **options))
    assert own.values["cycles"] < law.values["cycles"]  # one device instead of four


def test_a_clearing_time_has_the_instant_of_a_simulation(write, tmp_path):
    """It matters to a gate with a start and an end."""
    gate = st.Gate(start=1.02, end=1.4)
    st.Controller("deviation", "order", [], [], [], 200 * np.eye(4), gate=gate).save(tmp_path / "gated.toml")
    head = 'case = "two_area"\nfault = "7"\nstorage = "50MW"\ncontroller = "gated.toml"\n'
    path = write(head + 'kind = "clearing-time"\nresolution = "1cyc"\nscan = "0cyc"\nlongest_s = 0\n')
    (found,) = (run_job(task) for task in tasks(study_file.read(path), path))
    longest = round(found.values["cycles"])
    path = write(head + f'kind = "simulate"\nuntil_s = 6\nclear = ["{longest}cyc", "{longest + 1}cyc"]\n')
    ends = [run_job(task).values["outcome"] for task in tasks(study_file.read(path), path)]
    assert ends == ["stable", "lost_synchronism"]


@pytest.mark.slow
def test_a_changed_controller_is_run_again(write, tmp_path):
    gain(2e3).save(tmp_path / "gain.toml")
    study, out = write(STUDY), tmp_path / "results.db"
    assert run_sweep(study, out, workers=1).done == 2
    assert run_sweep(study, out, workers=1).done == 0
    gain(1e3).save(tmp_path / "gain.toml")
    again = run_sweep(study, out, workers=1)
    assert (again.before, again.done) == (1, 1)


def test_the_key_has_the_content_and_not_the_place_of_a_file(write, tmp_path):
    """The same controller, named in the study or given beside it."""
    gain(2e3).save(tmp_path / "gain.toml")
    path = write(STUDY.replace('["", "gain.toml"]', '"gain.toml"'))
    (named,) = tasks(study_file.read(path), path)
    (folder := tmp_path / "elsewhere").mkdir()
    gain(2e3).save(folder / "other.toml")
    (moved,) = tasks([named.job._replace(controller=str(folder / "other.toml"))], path)
    (none,) = tasks([named.job._replace(controller="")], path)
    (twice,) = tasks([named.job._replace(controller="gain.toml, gain.toml")], path)
    assert named.key == moved.key
    assert len({named.key, none.key, twice.key}) == 3


@pytest.mark.parametrize(
    ("reads", "text", "says"),
    [
        ("deviation:1", '"nothing.toml"', "controller = .nothing.toml.: .*nothing.toml"),
        ("speed:9", '"gain.toml"', "controller = .gain.toml.: There is no machine 9"),
    ],
)
def test_what_is_refused_before_the_first_job(write, tmp_path, reads, text, says):
    st.Controller.from_control(control.tf(1, 1), reads, "order:1@5").save(tmp_path / "gain.toml")
    with pytest.raises(StudyError, match=says):
        run_sweep(write(STUDY.replace('["", "gain.toml"]', text)), tmp_path / "results.db", workers=1)


@pytest.mark.slow
def test_controllers_of_the_command_act_in_every_job(stabctl, write, tmp_path):
    gain(2e3).save(tmp_path / "gain.toml")
    out = tmp_path / "results.db"
    study = write(STUDY.replace('controller = ["", "gain.toml"]\n', ""))
    assert stabctl("sweep", "run", study, "--out", out, "--controller", tmp_path / "gain.toml")[0] == 0
    code, shown, _ = stabctl("sweep", "show", out)
    assert code == 0
    assert "gain.toml" in "".join(shown.split())  # a long path is folded


def test_thresholds_of_a_law_that_is_in_use_in_no_job_are_refused(write, tmp_path):
    """Those of a grid in which some jobs use it are not."""
    gain(2e3).save(tmp_path / "gain.toml")
    text = STUDY + "deadband_hz = 0.3\n"
    assert len(tasks(study_file.read(path := write(text)), path)) == 2
    path = write(text.replace('["", "gain.toml"]', '"gain.toml"'))
    with pytest.raises(StudyError, match="deadband_hz: it has no effect without storage under the bang-bang law"):
        tasks(study_file.read(path), path)

"""Study files: what is crossed, what is not, what is refused before anything runs, and the keys of the jobs."""

import copy
import math
import os
import subprocess
import sys
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from stabctl import io
from stabctl._util.errors import StudyError
from stabctl._util.schema import fields
from stabctl.jobs.task import fingerprint
from stabctl.model.tables import TABLES, Link
from stabctl.sweep import study_file
from stabctl.sweep.job import JOB, Job, columns
from stabctl.sweep.sweep import key_of, tasks

ROOT = Path(__file__).parents[2]
HEAD = 'kind = "simulate"\ncase = "two_area"\nfault = "7"\nclear = "6cyc"\n'
NOTHING = HEAD.replace('fault = "7"\n', "")
CLEARING = 'kind = "clearing-time"\ncase = "two_area"\nfault = "7"\n'


def test_a_scan_of_nothing_needs_no_unit(write):
    path = write(CLEARING + "scan = 0")
    assert [task.job.scan for task in tasks(study_file.read(path), path)] == ["0cyc"]


def test_options_of_some_jobs_alone_are_no_mistake(write):
    path = write(
        HEAD + "deadband_hz = 0.2\nlatency_ms = 100\nstorage = ['none', '50MW']\nestimator = ['ideal', 'kalman']"
    )
    assert len(tasks(study_file.read(path), path)) == 4
    path = write(HEAD + "storage = '50MW'\ndeadband_hz = [0.1, 0.2]\ncontrol = ['none', 'bang-bang']")
    assert len(tasks(study_file.read(path), path)) == 4


def test_circuits_may_open_without_a_fault(write):
    path = write(NOTHING + "trip = '7-8'")
    assert len(tasks(study_file.read(path), path)) == 1


def test_too_many_changes_of_a_case_are_refused_before_a_job_is_made(write, monkeypatch):
    monkeypatch.setattr(study_file, "Job", None)
    grid = "{from = 1, to = 9, count = 1001}"
    with pytest.raises(StudyError, match="more than 1000000 jobs"):
        study_file.read(write(HEAD + f'set."genrou.1.H" = {grid}\nset."genrou.2.H" = {grid}'))


@pytest.mark.parametrize(
    "key", ["characteristic", "lag_s", "storage_model", "storage_energy_mwh", "storage_mva", "converter"]
)
def test_columns_of_new_devices_are_refused_for_those_of_the_case(write, cases, tmp_path, key):
    io.write(cases("two_area").with_storage("50MW"), tmp_path / "mine")
    value = {"characteristic": "'current'", "storage_model": "'regc'", "storage_mva": "'120%'", "converter": "'Imax=2'"}
    path = write(HEAD.replace("two_area", "mine") + f"{key} = {value.get(key, 0.02)}\n")
    with pytest.raises(StudyError, match=rf"{key}: it has no effect without devices given with the key storage"):
        tasks(study_file.read(path), path)


def test_lists_and_grids_are_crossed(write):
    jobs = study_file.read(
        write(
            'kind = "clearing-time"\ncase = "two_area"\n'
            'fault = [83, { text = "7-8@{}", from = 0.0, to = 0.3, step = 0.1 }]\n'
            "lag_s = { from = 0, to = 1, count = 3 }\nseed = { from = 5, to = 3, step = -1 }\n"
        )
    )
    places = ("83", "7-8@0", "7-8@0.1", "7-8@0.2", "7-8@0.3")
    assert [(j.fault, j.lag, j.seed) for j in jobs] == [
        (f, lag, s) for f in places for lag in (0.0, 0.5, 1.0) for s in (5, 4, 3)
    ]
    assert {type(j.seed) for j in jobs} == {int}
    assert jobs[0]._replace(fault="", lag=0.0, seed=1) == Job("clearing-time", "two_area")  # the rest are defaults


def test_groups_belong_together_and_lie_over_what_stands_above(write):
    jobs = study_file.read(
        write(
            HEAD + "deadband_hz = [0.1, 0.2]\n"
            '[[job]]\nstorage = "none"\n'
            '[[job]]\nstorage = "50MW"\nclear = ["6cyc", "7cyc"]\n'
            '[[job]]\nstorage = "50MW"\ndeadband_hz = 0.2\n'  # in the study already
        )
    )
    pairs = [(j.storage, j.clear, j.deadband) for j in jobs]
    assert pairs == [("none", "6cyc", d) for d in (0.1, 0.2)] + [
        ("50MW", c, d) for c in ("6cyc", "7cyc") for d in (0.1, 0.2)
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind = ", "TOML"),
        ('case = "two_area"', "kind is missing; it must be one of clearing-time, simulate"),
        ('kind = "dance"', "kind = 'dance'"),
        ('kind = "simulate"\ncase = "two_area"', "clear is missing; it must be text (clearing time"),
        (HEAD + 'falt = "7"', "'falt' is not a known key; did you mean 'fault'?"),
        (HEAD + "observe_s = 3", "'observe_s' is not a known key"),
        (HEAD + "seed = 1.5", "seed = 1.5: it must be a whole number from 0"),
        (HEAD + "seed = true", "seed = True"),
        (HEAD + f"seed = 1{'0' * 400}", "it must be a whole number"),
        (HEAD + f"seed = 1{'0' * 5000}", "is not valid TOML"),
        (HEAD + f"lag_s = {{from = 0, to = 1{'0' * 400}, count = 2}}", "a grid has from, to"),
        (HEAD + 'lag_s = "slow"', "lag_s = 'slow': it must be a number of at least 0 (time constant"),
        (HEAD + 'lag_s = "5Hz"', "lag_s = '5Hz': it must be a number of at least 0"),
        (HEAD + "lag_s = -1", "lag_s = -1"),
        (HEAD + "until_s = inf", "until_s = inf"),
        (HEAD + "until_s = nan", "until_s = nan"),
        (HEAD + "control = 'magic'", "one of bang-bang, none"),
        (HEAD + "storage = [['50MW']]", "storage = ['50MW']: it must be text"),
        (HEAD + "seed = []", "seed = []: it must be a whole number"),
        (HEAD + "seed = {from = 1, to = 3}", "a grid has from, to, and either count"),
        (HEAD + "seed = {from = 1, to = 3, step = 1, count = 3}", "a grid has"),
        (HEAD + "seed = {from = 1, to = 3, stop = 1}", "a grid has"),
        (HEAD + "seed = {from = 1, to = 3, step = -1}", "the step must lead from 1 to 3"),
        (HEAD + "seed = {from = 1, to = 3, step = 0}", "the step must lead"),
        (HEAD + "seed = {from = 1, to = 3, step = 'x'}", "a grid has"),
        (HEAD + "seed = {from = 1, to = 2, count = 4}", "whole number"),
        (HEAD + "lag_s = {from = 0, to = 1, count = 1}", "count (at least 2)"),
        (HEAD + "lag_s = {from = 0, to = 1, count = 2, text = '{}'}", "text must contain {} once"),
        (HEAD + "storage = {from = 0, to = 1, count = 2, text = 'MW'}", "text must contain {} once"),
        (HEAD + "seed = {from = 1, to = 1e12, step = 1}", "more than 1000000 values"),
        (HEAD + "seed = {from = 1, to = 2e3, step = 1}\nlag_s = {from = 0, to = 1, count = 1000}", "more than 1000000"),
        (HEAD + "[job]\nseed = 1", "[[job]]"),
        (HEAD + "[[job]]\nseed = 1\n[[job]]\nseed = 'x'", "job 2, seed = 'x'"),
        (HEAD.replace("two_area", "nowhere"), "case = 'nowhere'"),
        (HEAD.replace('"7"', '["7", "99"]'), "fault = '99': There is no bus 99"),
        (HEAD.replace("6cyc", "soon"), "clear = 'soon'"),
        (HEAD + "trip = '7-8, 7-99'", "trip = '7-8, 7-99': There is no branch 7-99"),
        (HEAD + "storage = '50'", "storage = '50'"),
        (HEAD + "storage = '9=50MW'", "no machine 9"),
        (HEAD + "estimator = 'kalman'\npmu_rate = 61", "not possible; choose one of"),
        (HEAD + "latency_ms = [50, 100]", "latency_ms: it has no effect without an estimator"),
        (HEAD + "deadband_hz = [0.1, 0.2]\nstorage = 'none'", "deadband_hz: it has no effect without storage"),
        (
            HEAD + "storage = '50MW'\ncontrol = 'none'\nmin_voltage_pu = 0.7",
            "min_voltage_pu: it has no effect without st",
        ),
        (NOTHING, "a job needs a fault or a trip"),
        (HEAD + "control = ['bang-bang', 'none']\nestimator = 'kalman'", "The estimator 'kalman' needs a control law"),
        (NOTHING + "trip = '7-8'\nfault_x_pu = 0.1", "The impedance is that of a fault, and there is none"),
        (HEAD.replace("6cyc", ""), "The fault at 7 is never cleared"),
        (CLEARING.replace('"7"', '""') + "trip = '7-8'", "a job needs a fault; give a location"),
        (HEAD + "storage = '50MW'\nstorage_model = 'flywheel'", "energy, which must be limited"),
        (HEAD + "machines = 'classical'\nset.'pss.1.K' = [1, 2]", "set.pss.1.K = 1: it has no effect with machines"),
        (HEAD + "until_s = 1.1", "until_s = 1.1: the fault is not cleared before that"),
        (CLEARING + "limit = '1cyc'\nresolution = '2cyc'", "limit = '1cyc': it is below the resolution"),
        (HEAD + "set = 3", 'write it as set."pss.1.K"'),
        (HEAD + 'set."pss.1.K" = []', "set.pss.1.K = []: it must have at least one value"),
        (HEAD + 'set."pss.1.K" = [[1]]', "set.pss.1.K = [1]: it must be a number or text"),
        (HEAD + 'set."loads.7.p" = 9\nset."loads.7.p_mw" = 8', "loads.7.p and loads.7.p_mw are the same value"),
        (HEAD + 'set."loads.7.p" = 900\nset."loads.7".p = 967', "set: loads.7.p is there twice; give it once"),
        (HEAD + 'set."name" = "a\\u000bb"', "must be one line of text without control characters"),
        (HEAD.replace("two_area", "a\\u000bb"), "must be one line of text without control characters"),
        (HEAD + 'set."pss.1.K" = "soon"', "set.pss.1.K = 'soon'"),
        (HEAD + 'set."pss.1.Kp" = 1', "pss has no column 'Kp'"),
        (HEAD + 'set."pss.9.K" = 1', "set.pss.9.K = 1"),
        (HEAD + 'set."genrou.1.H" = -1', "set.genrou.1.H = -1"),
        (HEAD + 'set."name" = {from = 0, to = 1, count = 1}', "a grid has from, to"),
    ],
)
def test_a_mistake_names_file_key_and_value(write, text, says):
    path = write(text)
    with pytest.raises(StudyError) as caught:
        tasks(study_file.read(path), path)
    sentence = str(caught.value)
    assert says in sentence
    assert str(path) in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize("path", ["missing.toml", "."])
def test_no_study_file(tmp_path, path):
    with pytest.raises(StudyError, match="cannot be read"):
        study_file.read(tmp_path / path)


def test_keys_are_the_same_in_every_process(write):
    path = write(HEAD + 'storage = ["none", "5%mva", "1=50MW,2=20MW"]\nestimator = "kalman"\nseed = [1, 2]')
    here = [t.key for t in tasks(study_file.read(path), path)]
    code = "from stabctl.sweep import study_file, sweep; "
    code += f"[print(t.key) for t in sweep.tasks(study_file.read({str(path)!r}), 'x')]"
    environment = os.environ | {"PYTHONHASHSEED": "7"}
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert there.stdout.split() == here
    assert len(set(here)) == 6


def test_a_key_follows_what_determines_the_result_and_nothing_else(write, cases, tmp_path):
    """Every field of a job and every number of the case count; where a folder lies and how 0.0 is written do not."""
    two_area = cases("two_area")
    io.write(two_area, tmp_path / "mine")
    job = Job("simulate", "two_area", fault="7", clear="6cyc")
    key = key_of(job, fingerprint(two_area))
    own = tasks(study_file.read(write(HEAD.replace('"two_area"', '"mine"') + "lag_s = 0")), tmp_path / "study.toml")
    assert [t.key for t in own] == [key]
    other = {str: "other", int: 77, float: 77.5}
    changed = [
        job._replace(**{name: other[f.kind]})
        for name, f in columns("simulate").items()
        if name not in ("kind", "case", "set", "controller")  # for controllers see test_controllers
    ]
    keys = {key_of(one, fingerprint(two_area)) for one in changed}
    assert len(keys | {key}) == len(changed) + 1
    table = tmp_path / "mine" / "genrou.csv"
    head, first, *rest = table.read_text().splitlines()
    column = head.split(",").index("H_s")
    cells = first.split(",")
    cells[column] = repr(float(cells[column]) * (1 + 1e-12))
    table.write_text("\n".join([head, ",".join(cells), *rest]))
    assert fingerprint(io.load(tmp_path / "mine")) != fingerprint(two_area)


def test_a_key_follows_every_number_and_word_of_the_case(cases):
    """Frequency, base, and every field of one row of every table and of every device model."""
    case = replace(cases("two_area").with_storage("5%mva"), links=(Link("dc", 7, 9, 10.0),))
    changed = [replace(case, frequency_hz=50.0), replace(case, base_mva=case.base_mva * 2), replace(case, name="other")]
    for table, record in TABLES.items():
        rows = getattr(case, table)
        for field, f in fields(record).items():
            for value in _others(getattr(rows[-1], field), f) if rows else ():
                changed.append(_altered(case, table, (*rows[:-1], rows[-1]._replace(**{field: value}))))
    for model, rows in case.devices.items():
        key, par = list(rows.items())[-1]
        for field, f in fields(type(par)).items():
            for value in _others(getattr(par, field), f):
                changed.append(
                    _altered(case, "devices", case.devices | {model: {**rows, key: par._replace(**{field: value})}})
                )
    assert len(changed) > 75
    assert len({fingerprint(one) for one in (case, *changed)}) == len(changed) + 1
    assert fingerprint(replace(case, title="another title", source="elsewhere")) == fingerprint(case)


def _others(value, f):
    """Another value of a field: the next number up, another word."""
    if f.choices:
        return [next(word for word in f.choices if word != value)]
    return (
        [value + "x"] if isinstance(value, str) else [value + 1 if isinstance(value, int) else math.nextafter(value, 9)]
    )


def _altered(case, table, rows):
    """The case with one table changed; whether it makes sense does not matter here."""
    other = copy.copy(case)
    object.__setattr__(other, table, rows)
    return other


@pytest.mark.parametrize(("name", "count"), [("table4", 6), ("fault_place", 42), ("estimator_monte_carlo", 41)])
def test_packaged_studies_are_sound(name, count):
    path = ROOT / "sims" / f"{name}.toml"
    assert len(tasks(study_file.read(path), path)) == count


def test_every_key_stands_in_the_documentation():
    page = (ROOT / "docs" / "sweeps.md").read_text(encoding="utf-8")
    missing = [column for column in JOB if f"| `{column}`" not in page and f", `{column}`" not in page]
    assert missing == []


def test_any_parameter_of_the_case_may_vary(write):
    path = write(
        HEAD + 'set."pss.1.K" = [5, { from = 10, to = 20, count = 2 }]\nset.machines.2.p = "650MW"\n'
        '[[job]]\n[[job]]\nset."frequency_hz" = 50\n'
    )
    found = tasks(study_file.read(path), path)
    values = [
        (t.shared.case.devices["pss"][1].K, t.shared.case.machine(2).p, t.shared.case.frequency_hz) for t in found
    ]
    assert values == [(K, 650.0, hz) for hz in (60.0, 50.0) for K in (5.0, 10.0, 20.0)]
    assert len({t.key for t in found}) == 6
    assert found[0].job.changes == {"machines.2.p": "650MW", "pss.1.K": 5}


def test_how_a_change_is_written_is_a_label_and_not_in_the_key(write):
    path = write(HEAD + 'set."machines.2.p" = ["650MW", 650, 650.0, "0.65GW"]')
    found = tasks(study_file.read(path), path)
    assert [t.job.changes["machines.2.p"] for t in found] == ["650MW", 650, "0.65GW"]
    assert {t.shared.case.machine(2).p for t in found} == {650.0}
    assert len({t.key for t in found}) == 1


def test_changes_of_the_study_and_of_a_group_act_together_however_they_are_written(write):
    """As nested tables, as quoted paths, and in any mixture; a group replaces what stands above."""
    for above in ("set.loads.7.p", 'set."loads.7.p"', 'set.loads."7.p"'):
        for below in ("set.loads.9.p", 'set."loads.9.p"', 'set."loads.9".p'):
            (job,) = study_file.read(write(f"{HEAD}{above} = 1000\n[[job]]\n{below} = 1700\n"))
            assert job.changes == {"loads.7.p": 1000, "loads.9.p": 1700}
        (job,) = study_file.read(write(f'{HEAD}{above} = 1000\n[[job]]\nset."loads.7".p = 900\n'))
        assert job.changes == {"loads.7.p": 900}


def test_the_share_of_motors_is_that_of_the_case_unless_it_is_given(write, cases, tmp_path):
    io.write(cases("two_area").with_motors(0.3), tmp_path / "mine")
    path = write(HEAD.replace("two_area", "mine") + "[[job]]\n[[job]]\nmotor_share = [0, 0.3]\n")
    shares = [{load.model_share for load in t.shared.case.loads} for t in tasks(study_file.read(path), path)]
    assert shares == [{0.3}, {0.0}, {0.3}]


@pytest.mark.parametrize("first", [1, 10**12 + 1, 2**53 - 4])
def test_whole_numbers_of_a_grid_are_exact(write, first):
    for grid in (f"from = {first}, to = {first + 4}, step = 1", f"from = {first}, to = {first + 4}, count = 5"):
        assert [job.seed for job in study_file.read(write(f"{HEAD}seed = {{ {grid} }}"))] == [*range(first, first + 5)]
        path = write(f"{HEAD}case = {{ {grid}, text = 'case_{{}}' }}".replace('case = "two_area"\n', ""))
        assert [job.case for job in study_file.read(path)] == [f"case_{first + k}" for k in range(5)]


@pytest.mark.parametrize("step", ["0.1", "0.7", "1e-9", "0.0000000000125"])
def test_numbers_of_a_grid_are_the_decimals_that_one_would_write(write, step):
    wanted = [float(Decimal("1000000.1") + k * Decimal(step)) for k in range(1001)]
    last = Decimal("1000000.1") + 1000 * Decimal(step)
    for rest in (f"step = {step}", "count = 1001"):
        if step == "0.0000000000125":  # below what floats tell apart
            wanted = [*dict.fromkeys(wanted)]
        jobs = study_file.read(write(f"{HEAD}lag_s = {{ from = 1000000.1, to = {last}, {rest} }}"))
        assert [job.lag for job in jobs] == wanted


def test_changes_come_before_classical_machines(write):
    path = write(HEAD + 'machines = "classical"\nset."genrou.1.H" = 7')
    (task,) = tasks(study_file.read(path), path)
    assert task.shared.case.devices["gencls"][1].H == 7.0


def test_quantities_may_have_units(write):
    given = 'until_s = "5s"\nlag_s = "50ms"\ndeadband_hz = "100mHz"\nmax_angle_rad = "180deg"'
    (job,) = study_file.read(write(HEAD + given))
    assert (job.until, job.lag, job.deadband, job.max_angle) == pytest.approx((5.0, 0.05, 0.1, 3.14159265))


@pytest.mark.parametrize(
    ("given", "said"), [('at_s = "50cyc"', "in cyc .* in s."), ('min_frequency_pu = "58Hz"', "in Hz .* in pu.")]
)
def test_quantities_that_depend_on_the_case_are_refused_with_the_reason(write, given, said):
    said = said.replace(".*", "depends on the frequency of the case, and a study may have several cases; write it")
    with pytest.raises(StudyError, match=said):
        study_file.read(write(HEAD + given))

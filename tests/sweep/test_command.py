"""`stabctl sweep`: exit codes, what is printed, tables."""

import csv
import json
from pathlib import Path

import pytest

import stabctl as st
from stabctl.jobs import task as jobs
from stabctl.jobs.store import Store
from stabctl.sweep import study_file
from stabctl.sweep.job import SWEEP, Job
from stabctl.sweep.results import rows
from stabctl.sweep.sweep import run_sweep, tasks

from .conftest import TINY

SIMS = Path(__file__).parents[2] / "sims"
PAIR = 'kind = "simulate"\ncase = "two_area"\nmachines = "classical"\nfault = "7"\nclear = "3cyc"\n'


@pytest.mark.slow
def test_table_4_of_the_paper(stabctl, tmp_path):
    out = tmp_path / "table4.db"
    assert stabctl("sweep", "run", SIMS / "table4.toml", "--out", out)[0] == 0
    found = json.loads(stabctl("sweep", "show", out, "--json")[1])
    sizes = [f"{percent}%dispatch" for percent in (0, 5, 15, 20, 25, 30)]
    assert [(row["storage"], row["cycles"]) for row in found["rows"]] == list(
        zip(sizes, (5, 6, 7, 8, 8, 8), strict=True)
    )


@pytest.mark.slow
def test_a_sweep_continues_and_reports_errors(stabctl, write, tmp_path):
    study, out = (
        write(PAIR + 'until_s = 1.5\nestimator = "kalman"\n[[job]]\n[[job]]\ncase = "wscc9"\nmachines = "full"'),
        tmp_path / "results.db",
    )
    code, printed, said = stabctl("sweep", "run", study, "--out", out, "--workers", 1)
    assert (code, printed) == (1, "")
    assert "2 of 2 jobs done" in said
    assert "1 ended in an error" in said
    code, _, said = stabctl("sweep", "run", study, "--out", out)
    assert code == 1
    assert "2 of 2 jobs done (2 of them earlier)" in said
    code, _, said = stabctl("sweep", "run", study, "--out", out, "--retry", "--workers", 1)
    assert code == 1
    assert "2 of 2 jobs done (1 of them earlier)" in said
    code, printed, _ = stabctl("sweep", "show", out)
    assert code == 0
    assert "1 ok, 1 with an error" in printed
    assert "The speed of machine 1 at bus 1 of wscc9 cannot be estimated" in printed
    more = write(PAIR + 'until_s = 1.5\nestimator = "kalman"', "more.toml")
    assert stabctl("sweep", "run", more, "--out", out)[0] == 0  # the row is there, and no error


def test_retry_runs_again_what_ended_in_an_error_or_a_bug_and_nothing_else(write, tmp_path):
    study, out = write(PAIR + "until_s = [1.5, 1.6, 1.7, 1.8]"), tmp_path / "results.db"
    path = tuple(tasks(study_file.read(study), study))
    with Store(out, SWEEP) as kept:
        for task, status in zip(path, ("ok", "error", "bug"), strict=False):
            kept.add(jobs.row(task, {}, status, "of the first sweep"))
    first = run_sweep(study, out, workers=1)
    assert (first.before, first.done, first.errors) == (3, 1, 2)
    again = run_sweep(study, out, workers=1, retry=True)
    assert (again.jobs, again.before, again.done, again.errors) == (4, 2, 2, 0)
    found = {row["until_s"]: (row["status"], row["message"] == "of the first sweep") for row in rows(out)}
    assert found == {1.5: ("ok", True), 1.6: ("ok", False), 1.7: ("ok", False), 1.8: ("ok", False)}
    assert run_sweep(study, out, workers=1, retry=True).done == 0


def test_show_prints_what_varies_and_writes_everything(stabctl, undisturbed, tmp_path):
    code, printed, err = stabctl("sweep", "show", undisturbed, "--csv", tmp_path / "all.csv")
    assert (code, err) == (0, "")
    assert "12 ok, 0 with an error" in printed
    assert "two_area" in printed.splitlines()[0]
    head = next(line for line in printed.splitlines() if "fault" in line and "storage" in line)
    assert "cycles" in head
    assert "seed" not in head
    record = json.loads(stabctl("sweep", "show", undisturbed, "--json")[1])
    with (tmp_path / "all.csv").open() as file:
        table = list(csv.DictReader(file))
    assert (record["ok"], record["errors"], len(table)) == (12, 0, 12)
    assert set(table[0]) == set(record["rows"][0]) - {"set"}  # changes of the case have columns of their own
    assert [row["storage"] for row in record["rows"][:4]] == ["20MW", "50MW", "100MW", "none"]
    assert [float(row["cycles"]) for row in table] == [row["cycles"] for row in record["rows"]]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("run", "missing.toml", "--out", "x.db"), "missing.toml"),
        (("run", "{study}"), "--out"),
        (("run", "{study}", "--out", "nowhere/x.db"), "cannot be opened or created"),
        (("run", "{study}", "--out", "x.db", "--workers", 0), "0 workers"),
        (("run", "{study}", "--out", "x.db", "--workers", 1, "--scheduler", "tcp://h:1"), "used together"),
        (("run", "{study}", "--out", "{study}"), "not a results file"),
        (("show", "missing.db"), "missing.db"),
        (("show", "{study}"), "not a results file"),
        (("show", "{study}", "--csv", "x.txt"), ".csv"),
        (("dance",), "dance"),
    ],
)
def test_a_mistake_is_one_line(stabctl, write, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    study = write(TINY)
    code, out, err = stabctl("sweep", *(str(word).format(study=study) for word in words))
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert says in err


def test_changes_of_the_case_are_columns(stabctl, write, tmp_path):
    study, out = write(PAIR + 'until_s = 1.5\nset."genrou.1.H" = [6.5, 13]'), tmp_path / "results.db"
    assert stabctl("sweep", "run", study, "--out", out, "--workers", 1)[0] == 0
    printed = stabctl("sweep", "show", out)[1]
    assert "genrou.1.H" in printed
    record = json.loads(stabctl("sweep", "show", out, "--json")[1])
    assert [row["set"] for row in record["rows"]] == [{"genrou.1.H": 6.5}, {"genrou.1.H": 13}]
    assert stabctl("sweep", "show", out, "--csv", tmp_path / "all.csv")[0] == 0
    with (tmp_path / "all.csv").open() as file:
        assert [float(row["genrou.1.H"]) for row in csv.DictReader(file)] == [6.5, 13]


@pytest.mark.parametrize("values", [[6.5, 1500], [1500, 6.5]])
def test_unusual_values_are_those_of_the_changed_case(stabctl, write, tmp_path, values):
    full = PAIR.replace('machines = "classical"\n', "")
    study = write(f'{full}until_s = 1.2\nset."genrou.1.H" = {values}')
    said = stabctl("sweep", "run", study, "--out", tmp_path / "results.db", "--workers", 1)[2]
    assert "1 unusual value: stabctl check two_area --set genrou.1.H=1500\n" in said


def test_rows_of_earlier_data_are_told_apart(stabctl, write, tmp_path):
    """A sweep has the rows of its own jobs; the file has the earlier ones too, which say that they are."""
    folder, out = tmp_path / "mine", tmp_path / "results.db"
    st.write(st.load("two_area").set("name", "mine"), folder)
    study = write(TINY.replace('"two_area"', '"mine"').replace(', "20MW", "50MW", "100MW"', ""))
    loads = folder / "loads.csv"
    first = run_sweep(study, out, workers=1)
    assert "data" not in first.df
    text = loads.read_text()
    assert "967" in text
    loads.write_text(text.replace("967", "990"))
    second = run_sweep(study, out, workers=1)
    assert (second.jobs, second.before) == (3, 0)
    assert second.own.isdisjoint(first.own)
    assert {*second.df["key"]} == {key for key, *_ in second.own}
    assert "data" not in second.df
    loads.write_text(text)
    assert (again := run_sweep(study, out, workers=1)).before == 3
    assert again.df.equals(first.df)
    data = {row["key"]: row["data"] for row in st.read_sweep(out).rows}
    assert data == dict.fromkeys(first.df["key"], "earlier") | dict.fromkeys(second.df["key"], "latest")
    shown = stabctl("sweep", "show", out)[1]
    assert "6 ok, 0 with an error; 3 computed earlier, from other data or by another version" in shown
    assert shown.count("\tearlier\t") == shown.count("\tlatest\t") == 3


def test_every_job_has_a_row_with_its_own_labels(write, tmp_path):
    """Also where the data are those of an earlier row: the result is computed once."""
    head, out = PAIR + "until_s = 1.2\n", tmp_path / "results.db"
    base = run_sweep(write(head), out, workers=1)
    loads = 'set."loads.7.p" = [900, 967, 1000]\n'  # of the case: 967
    more = run_sweep(write(head + loads), out, workers=1)
    assert list(more.df["loads.7.p"]) == [900, 967, 1000]
    assert more.before == 0
    assert more.df["finished"][1] == base.df["finished"][0]
    both = st.read_sweep(out).df
    assert list(both["loads.7.p"].fillna(0)) == [0, 900, 967, 1000]
    assert "data" not in both
    for name in "one", "other":
        st.write(st.load("two_area").set("name", "mine"), tmp_path / name)
    cases = write(head.replace('"two_area"', '["one", "other"]'))
    pair = run_sweep(cases, out, workers=1)
    assert (pair.jobs, pair.done, list(pair.df["case"])) == (2, 2, ["one", "other"])
    assert pair.df["finished"].nunique() == 1
    assert run_sweep(cases, out, workers=1).before == 2


def test_other_changes_with_equal_values_have_their_own_columns(write, tmp_path):
    head, out = PAIR.replace('machines = "classical"\n', "") + "until_s = 1.2\n", tmp_path / "results.db"
    gain, given = 'set."pss.2.K" = {}\n', st.load("two_area").devices["pss"][2].K
    run_sweep(write(head + gain.format([given, given / 2])), out, workers=1)
    second = run_sweep(write(head + 'set."sexs.4.KA" = [100, 200]\n'), out, workers=1)
    assert list(second.df["sexs.4.KA"]) == [100, 200]
    assert "pss.2.K" not in second.df


def test_whole_numbers_and_answers_of_yes_and_no_stay_what_they_are(stabctl, tmp_path):
    """Also where some rows, or rows of another kind of job, have none."""
    out, table = tmp_path / "results.db", tmp_path / "all.csv"
    times = Job("clearing-time", "two_area", fault="7"), {"monotone": 1, "runs": 37, "machine": 4, "cycles": 9.0}
    run = Job("simulate", "two_area", set='{"pss.2.K": 10}', fault="7", clear="6cyc"), {"time_s": 2.0}
    with Store(out, SWEEP) as kept:
        for key, (job, found) in zip("ab", (times, run), strict=True):
            kept.add(jobs.Row(key, job.given(), found, jobs.About("ok")))
    assert stabctl("sweep", "show", out, "--csv", table)[0] == 0
    with table.open() as file:
        first, second = csv.DictReader(file)
    names = "monotone", "runs", "machine", "pss.2.K", "cycles", "time_s"
    assert [first[name] for name in names] == ["True", "37", "4", "", "9.0", ""]
    assert [second[name] for name in names] == ["", "", "", "10", "", "2.0"]


def test_names_are_shown_as_they_are_and_no_error_is_left_out(stabctl, tmp_path):
    out = tmp_path / "results.db"
    with Store(out, SWEEP) as kept:
        for k in range(30):
            about = jobs.About("error", f"mishap {k:02}")
            kept.add(jobs.Row(str(k), Job("simulate", f"my_case_{k:02}", fault="7").given(), {}, about))
    printed = stabctl("sweep", "show", out)[1]
    page = st.read_sweep(out).report(tmp_path).read_text()
    for k in range(30):
        assert printed.count(f"my_case_{k:02}") == 2
        assert f"my_case_{k:02}" in page
        assert f"mishap {k:02}" in page
        assert f"my case {k:02}" not in page + printed

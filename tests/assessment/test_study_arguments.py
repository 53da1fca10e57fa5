"""What a study is asked: faults and contingencies that are given, files of them, and what cannot be."""

import json

import pytest
from test_assessment import QUICK, study_module

import stabctl as st
from stabctl import io
from stabctl._util.errors import StudyError


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize()


def test_contingencies_that_are_given_keep_their_names(base):
    given = [
        st.Contingency("7", trip="7-8", name="line 7-8"),
        st.Contingency("7-8@0.4", impedance=0.01j),
        st.Contingency("9", trip="8-9", events=["3@1.2s"]),
    ]
    found = base.screen(faults=given, **QUICK)
    assert {p.contingency.name for p in found.pairs} == {"line 7-8", None}
    for p in found.pairs:
        alone = base.clearing_time(p.contingency, **QUICK)
        assert (p.cycles, p.status, p.machine) == (alone.cycles, alone.status, alone.machine)
    assert "contingency" in str(found) or "contingencies" in str(found)
    kept = base.study("5cyc", faults=given, worst=0, **QUICK).df
    assert set(kept["name"]) == {"line 7-8", ""}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"faults": "poles"}, "give 'lines', 'buses', P1"),
        ({"faults": [3]}, "has no fault whose clearing time"),
        ({"faults": ["7-99"]}, "no bus 99"),
        ({"faults": [], "buses": "7"}, "several of them, or contingencies"),
    ],
)
def test_faults_that_cannot_be_are_told(base, given, said):
    with pytest.raises(StudyError, match=said):
        base.screen(**given, **QUICK)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"faults": "poles"}, "give 'lines', 'buses', P1"),
        ({"faults": ["7-99"]}, "no bus 99"),
        ({"resolution": "0cyc"}, "resolution"),
        ({"step": "-1ms"}, "is not a time"),
    ],
)
def test_a_study_that_cannot_be_is_refused_before_its_work(base, monkeypatch, given, said):
    monkeypatch.setattr(study_module, "modes", lambda *_, **__: pytest.fail("modes are computed"))
    with pytest.raises(StudyError, match=said):
        base.study(**QUICK | given)


def test_faults_may_be_given_once(base):
    """They are needed twice, as remedies are judged by the same study."""
    given = {"remedies": "none", "worst": 0} | QUICK
    assert base.study(faults=iter(["7-8@0.4", "8"]), **given).how.faults == ("7-8@0.4", "8")


def test_what_a_file_of_contingencies_leaves_out_is_said(base):
    faults = io.contingencies.Contingencies([st.Contingency("8")], ["line 3: branch 7-8 is out of service."])
    found = base.study(faults=faults, remedies="none", worst=0, **QUICK)
    assert found.screen.left_out == faults.left_out
    assert faults.left_out[0] in found.remarks()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"clear": 0}, "clear = 0 cycles is not possible; give a time above 0 and below 1e6cyc"),
        ({"damping": 1.5}, "damping = 1.5 is no damping ratio"),
        ({"voltages": (1.1, 0.9)}, r"voltages = \(1.1, 0.9\) is no range"),
        ({"worst": -1}, "worst = -1 runs are not possible"),
    ],
)
def test_what_cannot_be_wanted_is_told(base, given, said):
    with pytest.raises(StudyError, match=said):
        base.study(**{"clear": "6cyc"} | given)


@pytest.mark.parametrize("monitored", [False, True])
def test_subsystems_are_those_of_both_files(stabctl, tmp_path, monitored):
    """A CON file asks for the lines in one; a MON file may name another."""
    (tmp_path / "x.sub").write_text("SUBSYSTEM 'WEST'\nBUS 7\nBUS 8\nEND\nEND\n")
    (tmp_path / "x.con").write_text("SINGLE BRANCH IN SUBSYSTEM 'WEST'\nEND\n")
    (tmp_path / "x.mon").write_text("MONITOR VOLTAGE RANGE SUBSYSTEM 'WEST' 0.9 1.1\nEND\n")
    words = ["--contingencies", tmp_path / "x.con", "--subsystems", tmp_path / "x.sub", "--resolution", "2cyc"]
    words += ["--monitored", tmp_path / "x.mon"] if monitored else []
    code, out, err = stabctl(
        "study", "two_area", *words, "--worst", 0, "--remedies", "none", "--limit", "8cyc", "--json"
    )
    assert {m["fault"] for m in json.loads(out)["contingencies"]} == {"7", "8"}

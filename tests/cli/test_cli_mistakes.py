"""A mistake on the command line is one line and exit code 2."""

from importlib import import_module

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


def complaint(result):
    """The one line of a mistake."""
    code, out, err = result
    assert code == 2
    assert out == ""
    assert len(err.splitlines()) == 1, err
    assert "Traceback" not in err
    return err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("simulate", "nowhere"), "nowhere"),
        (("simulate", "two_area", "--fault", "99", "--clear", "3cyc"), "99"),
        (("simulate", "two_area", "--fault", "7-9", "--clear", "3cyc"), "7-9"),
        (("simulate", "two_area", "--fault", "7-8#3", "--clear", "3cyc"), "2 circuits"),
        (("simulate", "two_area", "--fault", "7-8@1.5", "--clear", "3cyc"), "1.5"),
        (("simulate", "two_area", "--fault", "7"), "--clear"),
        (("simulate", "two_area", "--clear", "0"), "--clear needs --fault"),
        (
            ("estimate", "two_area", "--fault", "7", "--clear", "6cyc", "--estimator", "ideal", "--loss", "0.1"),
            "no PMUs",
        ),
        (
            (
                "estimate",
                "two_area",
                "--fault",
                "7",
                "--clear",
                "6cyc",
                "--estimator",
                "frequency",
                "--engine",
                "filterpy",
            ),
            "--engine",
        ),
        (("place", "two_area", "--seed", "9"), "--seed is that"),
        (("place", "two_area", "--storage-model", "supercap"), "--storage-energy 5kWh, or"),
        (("modes", "two_area", "--storage", "50MW", "--storage-model", "flywheel_regc"), "--storage-energy 5kWh, or"),
        (("design", "pod", "two_area", "--rank", "--rate", "60"), "--rank only ranks pairs"),
        (("design", "pod", "two_area", "--rank", "--out", "k.toml"), "--rank only ranks pairs"),
        (
            ("design", "tune", "two_area", "--damper", "deviation:1,order:1@5", "--stages", "5"),
            "are those of stabilizers",
        ),
        (("import", "x.m", "--missing", "injection", "--out", "folder"), "belong to a PSS/E file"),
        (("simulate", "two_area", "--clear", "3cyc"), "--fault"),
        (("simulate", "two_area", "--fault", "7", "--clear", "soon"), "soon"),
        (("simulate", "two_area", "--fault", "7", "--clear", "-3cyc"), "-3cyc"),
        (("simulate", "two_area", "--step", "1"), "step"),
        (("simulate", "two_area", "--step", "x"), "--step"),
        (("simulate", "two_area", "--step", "nan"), "step"),
        (("simulate", "two_area", "--until", "-1"), "-1"),
        (("simulate", "two_area", "--storage", "50"), "50MW"),
        (("simulate", "two_area", "--storage", "50MW", "--storage-at", "1=5MW"), "used together"),
        (("simulate", "two_area", "--storage-at", "9=5MW"), "machine 9"),
        (("simulate", "two_area", "--storage-at", "1@99=5MW"), "bus 99"),
        (("simulate", "two_area", "--control", "bang-bang"), "--storage"),
        (("simulate", "two_area", "--control", "magic"), "magic"),
        (("simulate", "two_area", "--lag", "-1", "--storage", "5MW"), "lag"),
        (("simulate", "two_area", "--out", "run.xls"), "run.xls"),
        (("simulate", "two_area", "--out", "nowhere/run.csv"), "nowhere"),
        (("simulate", "two_area", "--fault-impedance", "1"), "R,X"),
        (("clearing-time", "two_area"), "--fault"),
        (("clearing-time", "two_area", "--fault", "7", "--at", "2s"), "--at needs a control"),
        (("clearing-time", "two_area", "--fault", "7", "--resolution", "0cyc"), "resolution"),
        (("clearing-time", "two_area", "--fault", "7", "--observe", "0"), "observation"),
        (("clearing-time", "two_area", "--fault", "7", "--trip", "7"), "circuit"),
        (("place", "ieee39", "--classical", "--observe", "0"), "observation window of 0 s"),
        (("place", "ieee39", "--classical", "--lag", "-1"), "--lag -1 s"),
        (("simulate", "two_area", "--open", "7-8"), "has no time"),
        (("simulate", "two_area", "--open", "7@1s"), "is not a line trip"),
        (("simulate", "two_area", "--open", "7-9@1s"), "no branch 7-9"),
        (("simulate", "two_area", "--trip-machine", "7-8@1s"), "is not a machine trip"),
        (("simulate", "two_area", "--trip-machine", "9@1s"), "machine 9"),
        (("simulate", "two_area", "--load-step", "7:50@1s"), "is not a load step"),
        (("simulate", "two_area", "--load-step", "7:+50MW@20s"), "must end after its last event at 20 s"),
        (("modes", "two_area_pss", "--set", "pss.9.K=10"), "no pss at 9"),
        (("simulate", "two_area", "--set", "loads.7.p"), "PATH=VALUE"),
        (("simulate", "two_area", "--set", "loads.7.p=x"), "x"),
        (("simulate", "two_area", "--deadband", "100MW", "--storage", "5MW"), "--deadband"),
        (("simulate", "two_area", "--max-angle", "-1"), "--max-angle"),
        (("simulate", "two_area", "--until", "1e400"), "--until"),
        (("dance",), "dance"),
    ],
)
def test_a_mistake_is_one_line(stabctl, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    assert said in complaint(stabctl(*words))


@pytest.mark.parametrize(
    ("words", "option", "ending"),
    [
        (("simulate", "two_area", "--until", "0.1"), "--out", ".csv"),
        (("simulate", "two_area", "--until", "0.1"), "--plot", ".png"),
        (("estimate", "two_area", "--fault", "7", "--clear", "3cyc"), "--plot", ".png"),
        (("screen", "two_area", "--classical"), "--out", ".csv"),
        (("linearize", "two_area"), "--out", ".npz"),
    ],
)
def test_a_file_that_cannot_be_written_is_told_before_the_work(stabctl, tmp_path, monkeypatch, words, option, ending):
    monkeypatch.setattr("stabctl.io.load", lambda name, **_: pytest.fail(f"{name} was loaded"))
    there = tmp_path / f"there{ending}"
    there.mkdir()
    assert "is a folder" in complaint(stabctl(*words, option, there))
    assert "There is no folder" in complaint(stabctl(*words, option, tmp_path / "no" / f"x{ending}"))
    assert "must end in" in complaint(stabctl(*words, option, "x.no"))


@pytest.mark.parametrize(
    ("command", "said"), [("modes", "is a file; give a folder"), ("place", "is a file; give a folder")]
)
def test_a_report_folder_that_is_a_file_is_told_before_the_work(stabctl, tmp_path, monkeypatch, command, said):
    monkeypatch.setattr("stabctl.io.load", lambda name, **_: pytest.fail(f"{name} was loaded"))
    taken = tmp_path / "taken"
    taken.write_text("mine")
    for folder in (taken, taken / "below"):
        assert said in complaint(stabctl(command, "two_area", "--report", folder))
    assert taken.read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "writes"),
    [
        (("screen", "two_area", "--classical", "--below", "8cyc", "--out", "x.csv"), "stabctl.clearing.Screen.save"),
        (("modes", "two_area", "--report", "."), "stabctl.view.pages.modes_page.write"),
    ],
)
def test_what_was_found_is_printed_though_it_cannot_be_written(stabctl, tmp_path, monkeypatch, words, writes):
    def full(*_):
        raise OSError(28, "No space left on device", "x")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(writes, full)
    code, out, err = stabctl(*words)
    assert code == 2
    assert "7-8" in out or "1, 2 against 3, 4" in out
    assert err == "stabctl: No space left on device: x; choose another file or folder.\n"


@pytest.mark.parametrize("words", [("powerflow", "two_area"), ("swing", "table1"), ("sweep", "show", "x.db")])
def test_an_interruption_is_one_line(stabctl, monkeypatch, words):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    import_module("stabctl.theory.phase_plane")  # which keeps the function it finds
    for work in ("stabctl.io.load", "stabctl.theory.omib.table1", "stabctl.jobs.store.rows"):
        monkeypatch.setattr(work, interrupt)
    assert stabctl(*words) == (130, "", "stabctl: interrupted.\n")


WORDS = st.sampled_from(
    ["two_area", "--fault", "7", "7-8@0.4", "7-8#2", "--clear", "6cyc", "0.1s", "--trip", "--storage", "5%mva", "-1MW"]
    + [
        "--storage-at",
        "1=5MW",
        "--step",
        "--until",
        "0.2",
        "--control",
        "none",
        "bang-bang",
        "--json",
        "--at",
        "inf",
        "nan",
    ]
    + ["--characteristic", "current", "--lag", "1e308", "--deadband", "--classical", "", "é", "--max-angle", "0", "-"]
)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, derandomize=True)
@given(command=st.sampled_from(["simulate", "powerflow", "cases", "clearing-time"]), words=st.lists(WORDS, max_size=7))
def test_any_words_give_an_answer_or_one_line(stabctl, command, words):
    bounded = ["--until", "0.2"] if command == "simulate" else ["--limit", "1cyc"] if command == "clearing-time" else []
    code, out, err = stabctl(command, "two_area", *words, *bounded)
    assert code in (0, 2)
    assert "Traceback" not in out + err
    if code == 2:
        assert len(err.splitlines()) == 1, err

"""stabctl estimate, and the estimator's options of simulate and clearing-time."""

import json
import re

import pytest

import stabctl as st

FAULT = ("two_area", "--fault", "7", "--trip", "7-8", "--storage", "50MW")


@pytest.mark.slow
def test_estimate_prints_its_measures_and_draws(stabctl, tmp_path):
    picture = tmp_path / "speeds.png"
    words = ("estimate", *FAULT, "--clear", "11cyc", "--observe", 2)
    code, out, err = stabctl(*words, "--json", "--plot", picture)
    record = json.loads(out)
    assert (code, err) == (0, "")
    names = ("rmse_mhz", "p99_mhz", "delay_ms", "wrong_command_share", "opposite_command_share", "cpu_ms_per_frame")
    assert set(names) < set(record)
    assert record["rmse_mhz"] < 15
    assert record["outcome"] == "stable"
    assert picture.read_bytes().startswith(b"\x89PNG")
    again = json.loads(stabctl(*words, "--json")[1])
    assert all(again[k] == record[k] for k in names[:-1])
    assert "mHz" in stabctl(*words, "--classical", "--clear", "8cyc")[1]


@pytest.mark.slow
def test_the_table_says_from_when_on_the_errors_are_taken(stabctl):
    """The fault, and the first 50 ms after its clearing, are left out."""
    base = st.load("two_area").initialize(storage="50MW")
    found = base.estimate(st.Contingency("7", trip="7-8", clear="11cyc"), "2.2s", seeds=1)
    since = 1 + 11 / 60 + 0.05
    assert found.judged_from_s == pytest.approx(since)
    words = ("estimate", *FAULT, "--clear", "11cyc", "--observe", 2.2 - 1 - 11 / 60)
    record = json.loads(stabctl(*words, "--json")[1])
    assert record["judged_from_s"] == pytest.approx(since)
    assert record["rmse_mhz"] == found.accuracy_between(since, 2.2).rmse_mhz != found.accuracy_between(1, 2.2).rmse_mhz
    assert re.search(r"judged from\s+1\.233 s on, 50 ms after the last event", stabctl(*words)[1])


def test_the_shares_of_wrong_commands_are_printed_in_percent(stabctl):
    words = ("estimate", *FAULT, "--clear", "11cyc", "--observe", 1, "--deadband", "3mHz")
    record, printed = json.loads(stabctl(*words, "--json")[1]), stabctl(*words)[1]
    for kind in ("wrong", "opposite"):
        percent = float(re.search(rf"{kind} commands\s+([\d.]+) %", printed)[1])
        assert percent == pytest.approx(100 * record[f"{kind}_command_share"], abs=0.006)
        assert percent > 0
    for row, name in (("error, rms", "rmse_mhz"), ("error, 99th percentile", "p99_mhz"), ("delay", "delay_ms")):
        number = float(re.search(rf"{row}\s+(-?[\d.]+) m", printed)[1])
        assert number == pytest.approx(record[name], abs=0.06)


def test_a_run_ends_after_fault_clearing_and_observation(stabctl):
    words = ("estimate", *FAULT, "--at", 0.5, "--clear", "6cyc", "--observe", "300ms")
    assert "until 0.900 s" in json.loads(stabctl(*words, "--json")[1])["message"]


@pytest.mark.slow
def test_simulate_and_clearing_time_take_an_estimator(stabctl):
    simulate = ("simulate", *FAULT, "--clear", "11cyc", "--until", 3, "--json")
    kalman, ideal = (json.loads(stabctl(*simulate, "--estimator", kind)[1]) for kind in ("kalman", "ideal"))
    assert kalman["stable"]
    assert kalman["max_angle_from_coi_deg"] != ideal["max_angle_from_coi_deg"]
    words = ("clearing-time", *FAULT, "--resolution", "0.5cyc", "--estimator", "kalman", "--latency-ms", 100, "--json")
    assert json.loads(stabctl(*words)[1])["cycles"] == 12.0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("simulate", "two_area", "--fault", "7", "--clear", "6cyc", "--estimator", "kalman"),
            "needs controllers",
        ),
        (("estimate", *FAULT, "--clear", "6cyc", "--pmu-rate", 61), "not possible; choose one of"),
        (("estimate", *FAULT, "--clear", "6cyc", "--loss", 1.5), "loss"),
        (("estimate", *FAULT, "--clear", "6cyc", "--seed", -1), "--seed"),
        (("estimate", *FAULT, "--clear", "6cyc", "--latency-ms", "nan"), "--latency-ms"),
        (("estimate", *FAULT, "--clear", "6cyc", "--plot", "x.pdf"), "must end in"),
        (("estimate", *FAULT, "--clear", "6cyc", "--observe", 0), "--observe"),
        (("estimate", *FAULT, "--clear", "120cyc", "--observe", 5), "but they are judged after the last event"),
    ],
)
def test_a_mistake_is_one_line(stabctl, words, says):
    code, out, err = stabctl(*words)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert says in err

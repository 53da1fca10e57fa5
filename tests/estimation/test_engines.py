"""The two engines of the Kalman filters, on the command line."""

import json

import pytest


@pytest.mark.slow
def test_filterpy_on_request_gives_the_same_estimates(stabctl):
    words = (
        "estimate",
        "two_area",
        "--fault",
        "7",
        "--clear",
        "3cyc",
        "--observe",
        "0.3s",
        "--storage",
        "50MW",
        "--json",
    )
    answers = []
    for more in ((), ("--engine", "filterpy")):
        code, out, err = stabctl(*words, *more)
        assert code == 0, err
        answers.append(json.loads(out))
    for name in ("rmse_mhz", "p99_mhz"):
        assert answers[0][name] == pytest.approx(answers[1][name], rel=1e-9)
    assert answers[0]["outcome"] == answers[1]["outcome"] == "stable"
    code, _, err = stabctl(*words, "--engine", "other")
    assert code == 2
    assert "other" in err

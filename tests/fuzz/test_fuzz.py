"""Inputs that once failed, and new ones: a result or one sentence. `make fuzz` runs them for long."""

import pytest

from . import mutate
from .attempt import corpus, read
from .judge import judge
from .targets import TARGETS, attempt


@pytest.mark.parametrize("path", corpus(), ids=lambda path: path.stem)
def test_what_once_failed(path):
    assert judge(read(path)) is None


@pytest.mark.parametrize("target", TARGETS)
def test_a_few_inputs(target):
    few = range(list(TARGETS).index(target), 4 * len(TARGETS), len(TARGETS))
    for number in few:
        one = attempt(0, number)
        assert judge(one) is None, one.text()


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_many_inputs(part):
    for number in range(100 + 150 * part, 250 + 150 * part):
        one = attempt(0, number)
        assert judge(one) is None, one.text()


def test_a_failure_is_noticed(monkeypatch):
    """The judge sees a traceback, a foreign exit code, a number that is none, and control characters."""
    one = attempt(0, 0)
    for text, code in (("nan MHz", 0), ("\x1b[31m", 0), ("", 3), ("", 2)):
        monkeypatch.setattr("stabctl.cli.main", lambda text=text, code=code: (print(text), exit(code)))
        assert judge(one)
    monkeypatch.setattr("stabctl.cli.main", lambda: 1 / 0)
    assert "ZeroDivisionError" in (judge(one) or "")
    monkeypatch.setattr("stabctl.cli.main", lambda: (print("a result"), exit(0)))
    assert judge(one) is None


def test_an_input_comes_back_from_its_file(tmp_path):
    for number in range(12):
        one = attempt(1, number)
        assert read(one.save(tmp_path)) == one == attempt(1, number)
    assert mutate.ODD

"""Answers of a long study that was interrupted: they are kept, for the same script and code, and not longer."""

import pytest

from reproduction.study import PROGRESS, Kept, clear


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "long.py"
    path.write_text("first text")
    return path


def test_an_interrupted_study_continues_with_what_it_has(script, tmp_path, capsys):
    asked = []

    def answer(tell):
        asked.append(1)
        return 1.5, "a"

    def interrupted(tell):
        raise KeyboardInterrupt

    first = Kept(str(script), tmp_path)
    assert first("one", answer) == [1.5, "a"]
    with pytest.raises(KeyboardInterrupt):
        first("two", interrupted)
    again = Kept(str(script), tmp_path)
    assert again("one", answer) == [1.5, "a"]
    assert again("two", answer) == [1.5, "a"]
    assert len(asked) == 2
    said = capsys.readouterr().err.splitlines()
    assert all(line.startswith(f"{PROGRESS}long: ") for line in said)
    assert f"{PROGRESS}long: one: kept" in said


def test_another_script_asks_anew_and_nothing_is_left_when_all_is_done(script, tmp_path):
    assert Kept(str(script), tmp_path)("one", lambda tell: 1) == 1
    script.write_text("second text")
    assert Kept(str(script), tmp_path)("one", lambda tell: 2) == 2
    clear(tmp_path)
    assert list(tmp_path.iterdir()) == [script]

"""Files written whole or not at all, and errors on one line."""

import os
from pathlib import Path

import pytest

from stabctl._util import files
from stabctl.errors import StudyError, sentence


def test_a_full_disk_leaves_the_old_file_and_a_sentence_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    path, new = tmp_path / "run.csv", tmp_path / "new.csv"
    files.replace(path, "before")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(
        StudyError, match=r"run.csv cannot be written: No space left .*; what it held before is unchang"
    ):
        files.replace(path, "after")
    with pytest.raises(StudyError, match=r"new.csv cannot be written: No space left on device; [a-z ]*\.$"):
        files.replace(new, "after")
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_what_stood_in_a_file_stays_when_writing_fails(tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    files.replace(path, "before")
    with pytest.raises(UnicodeEncodeError):
        files.replace(path, "after \ud800")
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_take_its_place_leaves_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "taken"
    (folder / "inside").mkdir(parents=True)
    with pytest.raises(StudyError, match="taken cannot be written: Is a directory"):
        files.replace(folder, b"content")
    assert list(tmp_path.iterdir()) == [folder]


def test_errors_are_one_line(tmp_path: Path) -> None:
    assert sentence(StudyError("two\n lines")) == "two lines"
    with pytest.raises(FileNotFoundError) as missing:
        (tmp_path / "none").read_text()
    assert sentence(missing.value) == f"No such file or directory: {tmp_path / 'none'}"
    assert sentence(OSError(28, "No space left on device")) == "No space left on device"


def test_no_message_commands_the_terminal() -> None:
    assert sentence(StudyError("there is no " + "9" * 5000)) == f"there is no {'9' * 400}..."
    text = "x\x1b[31m\x07y\u202e\udcff \u00e9\u03b4"
    assert sentence(StudyError(text)) == r"x\x1b[31m\x07y\u202e\udcff " + "\u00e9\u03b4"

"""Files written whole or not at all, and errors on one line."""

from pathlib import Path

import pytest

from stabctl._util import files
from stabctl.errors import StudyError, sentence


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

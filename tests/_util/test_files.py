"""Files written whole or not at all, and errors on one line."""

import os
import stat
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

import stabctl as st
from stabctl._util import files, tabular
from stabctl._util.errors import StudyError, sentence
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.theory.equal_area import equal_area
from stabctl.theory.omib import OMIB
from stabctl.view.figures import style
from stabctl.view.pages import modes_page


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


WRITERS = {  # file -> what writes it, of an operating point
    "run.csv": lambda point, path: point.simulate(until="0.05s").save(path),
    "run.nc": lambda point, path: point.simulate(until="0.05s").save(path),
    "run.png": lambda point, path: style.save(point.simulate(until="0.05s").plot(), path),
    "area.csv": lambda point, path: equal_area(OMIB(), 1.2).save(path),
    "model.npz": lambda point, path: point.linearize("vref:2", "speed:2").save(path),
    "screen.csv": lambda point, path: point.screen(buses=[7], observe=0.1, limit="1cyc").save(path),
    "two_area_modes.html": lambda point, path: modes_page.write(path.parent, point.modes(), None, (0.1, 2)),
    "case.toml": lambda point, path: st.write(point.case, path.parent),
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_file_is_replaced_only_when_the_new_one_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, points: Callable[[str], OperatingPoint], name: str
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    point, path = points("two_area"), tmp_path / name
    WRITERS[name](point, path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    assert path in before
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StudyError, match=r"cannot be written( to .*)?: No space left on device.*unchanged") as caught:
        WRITERS[name](point, path)
    assert any(file.name in str(caught.value) for file in before)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


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


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o027, 0o077])
def test_a_new_file_has_the_permissions_of_any_new_file_and_an_old_one_keeps_its_own(
    tmp_path: Path, umask: int
) -> None:
    new, old = tmp_path / "new.csv", tmp_path / "old.csv"
    old.write_text("before")
    before = os.umask(umask)
    try:
        for mode in (0o600, 0o640, 0o664):
            old.chmod(mode)
            files.replace(old, "after")
            assert stat.S_IMODE(old.stat().st_mode) == mode
        files.replace(new, "content")
    finally:
        os.umask(before)
    assert stat.S_IMODE(new.stat().st_mode) == 0o666 & ~umask


def test_the_file_that_a_link_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "link.csv").symlink_to(tmp_path / "run.csv")
    files.replace(tmp_path / "link.csv", "content")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "run.csv").read_text() == "content"


def test_what_is_no_file_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    files.replace(tmp_path / "pipe", "content")
    assert os.read(reader, 100) == b"content"
    assert [path.is_fifo() for path in tmp_path.iterdir()] == [True]
    os.close(reader)


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


TEXTS = ["=1+1", "'=1", "''=1", "+cmd|' /C calc'!A0", "-x", "@SUM(A1)", "'", "-1.5", "+3", "'-1.5", "7-8", "", "=", "-"]


@pytest.mark.parametrize("text", TEXTS)
def test_no_text_in_a_table_is_a_formula_and_it_is_read_back(text: str) -> None:
    cell = tabular.inert(text)
    assert tabular.plain(cell) == text
    assert cell[:1] not in tuple("=@")
    assert cell[:1] not in tuple("+-") or float(cell)


def test_tables_for_people_have_no_formulas(tmp_path: Path) -> None:
    class Found(tabular.Tabular):
        df = pd.DataFrame({"=name": ["=1+1", "plain", None], "value": [-1.5, 2.0, 3.0], "yes": [True, False, True]})

    Found().save(tmp_path / "found.csv")
    assert (tmp_path / "found.csv").read_text() == "'=name,value,yes\n'=1+1,-1.5,True\nplain,2.0,False\n,3.0,True\n"


def test_names_that_begin_like_a_formula_come_back_from_a_case_folder(
    tmp_path: Path, points: Callable[[str], OperatingPoint]
) -> None:
    case = points("two_area").case
    named = replace(case, buses=tuple(b._replace(name=t) for b, t in zip(case.buses, TEXTS, strict=False)))
    st.write(named, tmp_path / "case")
    assert [b.name for b in st.load(tmp_path / "case").buses] == [b.name for b in named.buses]
    assert "=1+1" not in (tmp_path / "case" / "buses.csv").read_text().replace("'=1+1", "")


@pytest.mark.parametrize("given", ["", " ", "\t", None, 3, b"run.csv"])
def test_what_is_no_name_of_a_file(given: object) -> None:
    with pytest.raises(StudyError, match=r"is not the name of a file or folder; give text, such as 'run.csv'"):
        files.path_of(given)
    assert files.path_of("run.csv") == files.path_of(Path("run.csv")) == Path("run.csv")

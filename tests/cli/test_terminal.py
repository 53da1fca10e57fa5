"""Tables in a pipe and on terminals of several widths, help in panels with examples, completion, and no clutter."""

import os
import re
import shlex
import subprocess
import sys

import click
import pytest

import stabctl as st
from stabctl._util.errors import CaseError
from stabctl._util.wording import ALIKE, together
from stabctl.cli import app
from stabctl.cli.guide import GUIDES, PANEL
from stabctl.cli.parameters import Command, Commands

ESCAPE = re.compile(r"\x1b\[[\d;]*m")
SHOWN = [
    "cases", "models", "tables genrou", "tables loads", "powerflow ieee39 --branches", "scr ieee39", "modes ieee39",
    "simulate two_area --fault 7 --clear 6cyc --storage 50MW", "clearing-time two_area --fault 7", "swing table1",
]  # fmt: skip


def walked(group, path=()):
    """Name and object of every command."""
    for name in group.list_commands(None):
        found = group.get_command(None, name)
        if isinstance(found, Commands):
            yield from walked(found, (*path, name))
        else:
            yield (*path, name), found


def words_of(text):
    return set(ESCAPE.sub("", text).replace("─", " ").split())


@pytest.mark.parametrize("line", SHOWN)
def test_a_pipe_gets_cells_between_tabs(stabctl, monkeypatch, line):
    """Every row has as many cells as the head of its table, none is wrapped or cut, however narrow the terminal is."""
    monkeypatch.setenv("COLUMNS", "40")
    code, out, _ = stabctl(*line.split())
    assert code == 0
    assert not set("│┃━─…") & set(out)
    tables = [[]]
    for row in out.splitlines():
        tables = [*tables[:-1], [*tables[-1], row.split("\t")]] if "\t" in row else [*tables, []]
    tables = [table for table in tables if table]
    assert tables
    assert all(len(row) == len(table[0]) for table in tables for row in table)
    monkeypatch.setenv("COLUMNS", "400")
    wide = re.sub(r"[\d.]+ s$", "", stabctl(*line.split())[1], flags=re.MULTILINE)
    assert wide == re.sub(r"[\d.]+ s$", "", out, flags=re.MULTILINE)


@pytest.mark.parametrize("width", [80, 160])
@pytest.mark.parametrize("line", SHOWN)
def test_a_terminal_shows_whole_words(stabctl, monkeypatch, line, width):
    piped = stabctl(*line.split())[1]
    for name, value in (("COLUMNS", str(width)), ("TTY_COMPATIBLE", "1"), ("TERM", "xterm"), ("NO_COLOR", "1")):
        monkeypatch.setenv(name, value)
    out = stabctl(*line.split())[1]
    times = re.compile(r"^[\d.]+$")  # of computing
    assert {w for w in words_of(piped) - words_of(out) if not times.match(w)} == set()
    assert max(len(ESCAPE.sub("", row)) for row in out.splitlines()) <= width


def test_cut_reads_a_column():
    command = f"{sys.executable} -m stabctl modes two_area | cut -f1,6 | head -3"
    out = subprocess.run(command, shell=True, capture_output=True, text=True, check=True).stdout
    assert out.splitlines() == ["Hz\tmode", "0.6114\t1, 2 against 3, 4", "1.2631\t1 against 2"]


@pytest.mark.parametrize(("path", "command"), [pytest.param(p, c, id=" ".join(p)) for p, c in walked(app)])
def test_help_has_panels_and_examples_that_are_read(path, command, monkeypatch):
    guide = GUIDES[path[-1]]
    assert len(guide.short) <= 58
    for example in guide.examples:
        command.make_context(path[-1], shlex.split(example))  # reads every option and argument
    text = command.get_help(click.Context(command, info_name=" ".join(("stabctl", *path)), max_content_width=80))
    assert text.count(f"stabctl {' '.join(path)}") >= 3  # usage and two examples
    heads = re.findall(r"^(\w+):$", text, re.MULTILINE)
    many = {PANEL.get(p.opts[-1]) for p in command.params if isinstance(p, click.Option)} - {None}
    assert many <= {*heads}
    listed = [p for p in command.params if isinstance(p, click.Option) and PANEL.get(p.opts[-1]) is None]
    assert len(listed) <= 22
    assert isinstance(command, Command)


def test_commands_are_listed_in_whole_lines():
    for group in (app, *(app.get_command(None, name) for name in ("design", "swing", "sweep"))):
        assert "..." not in group.get_help(click.Context(group, max_content_width=80)).partition("Commands:")[2]


@pytest.mark.parametrize(
    ("line", "wanted"), [("sim", "simulate"), ("simulate two_area_", "two_area_pss"), ("modes --ban", "--band")]
)
def test_a_shell_completes(line, wanted):
    words = ["stabctl", *line.split(" ")]
    asked = {"_STABCTL_COMPLETE": "bash_complete", "COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    ran = subprocess.run([sys.executable, "-m", "stabctl"], env=os.environ | asked, capture_output=True, text=True)
    assert wanted in [row.partition(",")[2] for row in ran.stdout.splitlines()]
    assert ran.stderr == ""


def test_equal_sentences_are_one():
    alike = [
        f"x.dyr line {k}, IEEET1 of {k + 90}/1: VRMAX = 0: computed from saturation as {k / 4}." for k in range(52)
    ]
    others = ["x.raw line 9: bus 4 is out.", "The name is 'A 1'."]
    found = together([others[0], *alike, others[1]])
    assert len(found) == 3
    assert found[1].startswith(alike[0])
    assert found[1].endswith(" Alike, 51 more: 1 91/1 0.25; 2 92/1 0.5; 3 93/1 0.75; 4 94/1 1.0; 5 95/1 1.25; "
                             "6 96/1 1.5; 7 97/1 1.75; 8 98/1 2.0; ...")  # fmt: skip
    assert together(alike[: ALIKE - 1]) == alike[: ALIKE - 1]
    assert len(together(alike[:ALIKE])) == 1


def test_many_zero_eigenvalues_are_one_line(stabctl, tmp_path):
    st.write(st.replicate(st.load("two_area"), 1), tmp_path / "one")
    out = stabctl("modes", tmp_path / "one")[1]
    assert len(re.findall("[Zz]ero eigenvalue", out)) == 1
    rows = [row.split("\t") for row in out.splitlines() if row.count("\t") == 5][1:]
    swings = [row[4] == "yes" for row in rows]
    assert swings == sorted(swings, reverse=True)  # first
    others = [float(row[1]) for row in rows if row[4] != "yes"]
    assert others == sorted(others)  # the least damped first


def test_a_header_to_begin_with(stabctl, tmp_path):
    head = stabctl("tables", "machines", "--csv")[1].strip()
    case = st.load("two_area")
    st.write(case, tmp_path / "case")
    text = (tmp_path / "case" / "machines.csv").read_text()
    assert text.splitlines()[0] == head
    assert stabctl("tables", "--csv")[0] == 2
    # without the column of the storage bus it is the terminal bus
    columns = head.split(",")
    at = columns.index("storage_bus")
    rows = [row.split(",") for row in text.splitlines()]
    (tmp_path / "case" / "machines.csv").write_text("\n".join(",".join(r[:at] + r[at + 1 :]) for r in rows))
    assert [m.storage_bus for m in st.load(tmp_path / "case").machines] == [m.bus for m in case.machines]
    # all missing columns at once
    (tmp_path / "case" / "machines.csv").write_text("machine\n1\n")
    with pytest.raises(CaseError, match=r"columns 'bus' \(terminal bus\), 'base_mva' .*, 'p_mw' .* are missing"):
        st.load(tmp_path / "case")

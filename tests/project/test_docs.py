"""Pages and README: their code runs, they show what comes out, their links and paths exist, no symbol is missing.

The first word behind ``` is the language, the next says what the block is:

    python              runs, all blocks of a page in one namespace and one empty folder; `text` below it is its output
    console             each `$ stabctl ...` runs there and ends with exit code 0 (`exit=2` behind the word: with that)
    sh                  each `make ...` names a target of the Makefile
    toml|csv|python|dyr|matlab|con|sub|mon FILE  the file is written

`...` in what a page shows stands for anything, a computing time or a rounding error for any other.
"""

import contextlib
import doctest
import io
import re
import shlex
import shutil
import sys
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from markdown_it import MarkdownIt
from terminal import said

from stabctl import BangBang, Feedback, StorageLaw, devices
from stabctl._util.schema import hints
from stabctl.controllers import Input, storage_law
from stabctl.model.tables import TABLES

ROOT = Path(__file__).resolve().parents[2]
GENERATED = {"docs/models.md"}
WRITTEN = sorted(p for p in (ROOT / "docs").glob("*.md") if f"docs/{p.name}" not in GENERATED)
PAGES = [*(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING")), *WRITTEN]
LONG = {  # pages whose code runs for 2 to 27 s
    "tutorial", "tutorial-damping", "placement", "estimation", "sweeps", "tuning", "screening", "study",
    "contingencies", "storage-and-control", "design", "optimum", "extending", "theory",
}  # fmt: skip
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
each_page_by_length = pytest.mark.parametrize(
    "page",
    [pytest.param(page, id=page.stem, marks=[pytest.mark.slow] * (page.stem in LONG)) for page in PAGES],
)


def tokens(page):
    return MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))


def told(text):
    """The text without notes on compiling, padding, computing times and numbers below 1e-9."""
    text = re.sub(r"(?<= steps in )[0-9.]+(?= s)|[0-9.]+(?= ms per frame)|[0-9.]+e-1\d", "0", said(text).strip("\n"))
    text = re.sub(r"(?<= ms in )[0-9.]+(?= s)", "0", text)
    return "".join(f"{line.rstrip()}\n" for line in text.splitlines())


def same(shown, got, where):
    shown, got = told(shown), told(got)
    assert doctest.OutputChecker().check_output(shown, got, doctest.ELLIPSIS), f"{where} shows\n{shown}\nbut\n{got}"


def commands(text):
    """(command, what is shown below it) of every `$` line, continued after a backslash."""
    for part in re.split(r"^\$ ", text.replace("\\\n", ""), flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        yield command, shown


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    """A folder to work in, with the files of PSS/E in docs/examples; afterwards no device of a page is registered."""
    monkeypatch.chdir(tmp_path)
    for name in ("three.raw", "three.dyr"):
        shutil.copy(ROOT / "docs" / "examples" / name, tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for name, value in (("COLUMNS", "100"), ("TTY_COMPATIBLE", "1"), ("TERM", "xterm"), ("NO_COLOR", "1")):
        monkeypatch.setenv(name, value)  # what a terminal shows
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    monkeypatch.setenv("MPLBACKEND", "agg")
    before, modules = dict(devices._registered), set(sys.modules)
    yield tmp_path
    devices._registered.clear()
    devices._registered.update(before)
    devices.every.cache_clear()
    devices.models.cache_clear()
    for name in set(sys.modules) - modules:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@each_page_by_length
def test_code_of_a_page_runs_and_gives_what_it_shows(page, own_folder, stabctl):
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    names, printed = {"__name__": page.stem}, None
    for fence in (t for t in tokens(page) if t.type == "fence"):
        where = f"{page.name}, line {fence.map[0] + 1},"
        language, _, what = fence.info.partition(" ")
        match language, what:
            case "python", "":
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    exec(compile("\n" * (fence.map[0] + 1) + fence.content, str(page), "exec"), names)
                printed = out.getvalue()
            case "text", "":
                same(fence.content, printed, where)
            case "console", _:
                for command, shown in commands(fence.content):
                    program, *words = shlex.split(command, comments=True)
                    assert program == "stabctl", f"{where} runs {program}"
                    code, out, err = stabctl(*words)
                    out = re.sub(r"\x1b\[[\d;]*m", "", out)
                    assert code == int(what.removeprefix("exit=") or 0), f"{where} {command}: {err}"
                    if shown.strip():
                        same(shown, out + err, f"{where} {command}")
            case "sh", "":
                assert set(re.findall(r"^make (\w+)", fence.content, re.MULTILINE)) <= set(targets), where
            case "toml" | "csv" | "python" | "dyr" | "matlab" | "con" | "sub" | "mon", path:
                assert path, f"{where} names no file"
                (own_folder / path).parent.mkdir(parents=True, exist_ok=True)
                (own_folder / path).write_text(fence.content, encoding="utf-8")
            case _:
                pytest.fail(f"{where} has a block of no known kind: {fence.info!r}")


def anchors(page):
    heads = [b.content for a, b in zip(tokens(page), tokens(page)[1:], strict=False) if a.type == "heading_open"]
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def links(page):
    for token in (child for t in tokens(page) for child in t.children or ()):
        yield from (str(token.attrs[k]) for k in ("href", "src") if k in token.attrs)


@each_page
def test_links_of_a_page_lead_somewhere(page):
    for link in links(page):
        path, _, anchor = link.partition("#")
        if re.match(r"https?://", link):
            continue
        target = page.parent / path if path else page
        assert target.exists(), f"{page.name} links to {link}"
        assert not anchor or anchor in anchors(target), f"{page.name} links to {link}"


def test_the_list_of_pages_is_whole():
    assert {p.name for p in WRITTEN} - {"index.md"} <= set(links(ROOT / "docs" / "index.md"))


@each_page
def test_files_that_a_page_names_exist(page):
    """A path in code font, as `sims/table4.toml`, is one of the repository."""
    for name in re.findall(
        r"`((?:stabctl|docs|sims|analysis|tests|benchmarks|tools)/[\w./]*)`", page.read_text("utf-8")
    ):
        assert page.name == "CHANGELOG.md" or name in GENERATED or (ROOT / name).exists(), f"{page.name} names {name}"


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 150


def records():
    """Section of the list of symbols -> the records whose fields stand there: tables of a case, laws and signals."""
    laws = {law.__name__: [law] for law in (BangBang, Feedback, StorageLaw)}
    return {name: [record] for name, record in TABLES.items()} | laws | {"signals": [Input, storage_law.Output]}


def rows_of_symbols():
    """`| symbol | meaning | unit |` of every field of these records."""
    for name, found in records().items():
        for record in found:
            for f in hints(record).values():
                yield name, f"| `{f.name}` | {f.meaning} | {f.unit} |"


def described(record):
    """Field -> type, unit, meaning."""
    hints = get_type_hints(record, include_extras=True)
    bare = [field for field, hint in hints.items() if get_origin(hint) is not Annotated or len(get_args(hint)) < 3]
    assert not bare, f"{record.__module__}.{record.__name__}: {', '.join(bare)} without unit and meaning"
    return {field: get_args(hint) for field, hint in hints.items()}


@pytest.mark.parametrize("name", devices.every())
def test_every_field_of_a_device_has_unit_and_meaning(name):
    device = devices.every()[name]
    for part in ("Par", "State", "Input", "Output"):
        described(vars(device)[part])
    assert device.module.__doc__


def sections():
    """Name of a section of the list of symbols -> its text."""
    parts = re.split(r"^### ", (ROOT / "docs" / "symbols.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    return {text.partition("\n")[0].split(":")[0].strip("` "): text for text in parts}


def test_every_symbol_of_the_tables_and_laws_is_in_the_list():
    listed = sections()
    missing = [f"{name}: {row}" for name, row in rows_of_symbols() if row not in listed.get(name, "")]
    assert not missing, "\n".join(["docs/symbols.md lacks", *missing])


@pytest.mark.parametrize("law", [BangBang, Feedback, StorageLaw])
def test_every_field_of_a_law_has_unit_and_meaning(law):
    assert [f.name for f in fields(law)] == list(hints(law))
    units = re.findall(r"^    (\w+) : .*?, (\S+)$", law.__doc__, re.MULTILINE)
    assert dict(units).items() <= {f.name: f.unit for f in hints(law).values()}.items()


def test_the_list_has_no_symbol_that_does_not_exist():
    known = {}
    for name, row in rows_of_symbols():
        known.setdefault(name, []).append(row)
    listed = {
        (name, line)
        for name, text in sections().items()
        for line in re.findall(r"^\| `\w+` \| .*? \| .*? \|", text, re.MULTILINE)
    }
    assert listed == {(name, row) for name, rows in known.items() for row in rows}


def test_versions_agree():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text("utf-8")

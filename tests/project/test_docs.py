"""Pages and README: their code runs, what they show comes out, their links lead somewhere, no symbol is missing.

The first word behind ``` is the language, the next says what the block is:

    python              runs, all blocks of a page in one namespace and one empty folder; `text` below it is its output
    console             each `$ stabctl ...` runs there and ends with exit code 0 (`exit=2` behind the word: with that)
    sh                  each `make ...` names a target of the Makefile
    toml|csv|python FILE  the file is written; FILE in stabctl/ is one of a copy of the package
    diff FILE           the lines - and those without sign are found once in FILE of that copy, and replaced
    python edited       runs on that copy, in plain Python (NUMBA_DISABLE_JIT=1)

`...` in what a page shows stands for anything, a computing time or a rounding error for any other.
"""

import contextlib
import doctest
import importlib
import io
import os
import pkgutil
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from markdown_it import MarkdownIt

import stabctl as package
from stabctl import devices
from stabctl.controllers import signals
from stabctl.model.case import TABLES

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def tokens(page):
    return MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))


def told(text):
    """The text without trailing blanks, computing times and numbers below 1e-9."""
    text = re.sub(r"(?<= steps in )[0-9.]+(?= s)|[0-9.]+(?= ms per frame)|[0-9.]+e-1\d", "0", text.strip("\n"))
    return "".join(line.rstrip() + "\n" for line in text.splitlines())


def same(shown, got, where):
    shown, got = told(shown), told(got)
    assert doctest.OutputChecker().check_output(shown, got, doctest.ELLIPSIS), f"{where} shows\n{shown}\nbut\n{got}"


def commands(text):
    """(command, what is shown below it) of every `$` line, continued after a backslash."""
    for part in re.split(r"^\$ ", text.replace("\\\n", ""), flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        yield command, shown


def replaced(path, diff):
    """Apply a diff without line numbers to a file."""
    lines, text = diff.splitlines(keepends=True), path.read_text(encoding="utf-8")
    old, new = ("".join(line[1:] for line in lines if line[0] in signs) for signs in (" -", " +"))
    assert text.count(old) == 1, f"{path.name} has not once:\n{old}"
    path.write_text(text.replace(old, new), encoding="utf-8")


def run_edited(code, folder):
    """Output of a script on the copy of the package in the folder."""
    where = os.environ | {"PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=where, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@each_page
def test_code_of_a_page_runs_and_gives_what_it_shows(page, tmp_path, monkeypatch, stabctl):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    monkeypatch.setenv("MPLBACKEND", "agg")
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    names, printed = {"__name__": page.stem}, None
    for fence in (t for t in tokens(page) if t.type == "fence"):
        where = f"{page.name}, line {fence.map[0] + 1},"
        language, _, what = fence.info.partition(" ")
        if what.startswith("stabctl/") and not (tmp_path / "stabctl").exists():
            shutil.copytree(Path(package.__file__).parent, tmp_path / "stabctl")
        match language, what:
            case "python", "":
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    exec(compile("\n" * (fence.map[0] + 1) + fence.content, str(page), "exec"), names)
                printed = out.getvalue()
            case "python", "edited":
                printed = run_edited(fence.content, tmp_path)
            case "text", "":
                same(fence.content, printed, where)
            case "console", _:
                for command, shown in commands(fence.content):
                    program, *words = shlex.split(command, comments=True)
                    assert program == "stabctl", f"{where} runs {program}"
                    code, out, err = stabctl(*words)
                    assert code == int(what.removeprefix("exit=") or 0), f"{where} {command}: {err}"
                    if shown.strip():
                        same(shown, out + err, f"{where} {command}")
            case "sh", "":
                assert set(re.findall(r"^make (\w+)", fence.content, re.MULTILINE)) <= set(targets), where
            case "diff", path:
                replaced(tmp_path / path, fence.content)
            case "toml" | "csv" | "python", path:
                assert path, f"{where} names no file"
                (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
                (tmp_path / path).write_text(fence.content, encoding="utf-8")
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
    assert {p.name for p in PAGES[1:]} - {"index.md"} <= set(links(ROOT / "docs" / "index.md"))


def rows_of_symbols():
    """`| symbol | meaning | unit |` of every field of every table of a case and record of a model."""
    found = {name: [record] for name, record in TABLES.items()} | {"signals": [signals.Seen, signals.Par]}
    for module in pkgutil.iter_modules(devices.__path__):
        made = vars(importlib.import_module(f"{devices.__name__}.{module.name}")).values()
        found[module.name] = [r for r in made if hasattr(r, "_fields") and r.__module__.endswith("." + module.name)]
    for name, records in found.items():
        for record in records:
            for field, hint in get_type_hints(record, include_extras=True).items():
                assert get_origin(hint) is Annotated, f"{name}.{record.__name__}.{field} has no unit and meaning"
                _, unit, meaning, *_ = get_args(hint)
                yield name, f"| `{field}` | {meaning} | {unit} |"


def test_every_symbol_of_the_models_and_tables_stands_in_the_list():
    sections = re.split(r"^### ", (ROOT / "docs" / "symbols.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    listed = {text.partition("\n")[0].split(":")[0].strip("` "): text for text in sections}
    missing = [f"{name}: {row}" for name, row in rows_of_symbols() if row not in listed.get(name, "")]
    assert not missing, "\n".join(["docs/symbols.md lacks", *missing])

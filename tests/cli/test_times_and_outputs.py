"""Times without a unit are seconds in every option; what cannot be written is refused before anything is computed."""

import json
import os
import re

import pytest

from stabctl import cli

FAULT = "two_area", "--classical", "--fault", "7-8@0.4"
SCREEN = "screen", "two_area", "--classical", "--resolution", "1cyc", "--observe", "1s", "--longest", "0s"
ALIKE = [  # a command, an option, seconds without a unit, the same with one
    (("simulate", *FAULT), "--clear", "0.11", "110ms"),
    (("simulate", *FAULT, "--clear", "6cyc"), "--at", "0.7", "42cyc"),
    (("estimate", *FAULT), "--clear", "0.11", "110ms"),
    (("estimate", *FAULT, "--clear", "6cyc"), "--at", "0.7", "42cyc"),
    (("clearing-time", *FAULT), "--resolution", "0.05", "3cyc"),
    (("clearing-time", *FAULT), "--limit", "0.2", "12cyc"),
    (SCREEN, "--below", "0.2", "12cyc"),
]
VARY = "wall_s", "cpu_ms_per_frame"


def plain(value):
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items() if k not in VARY}
    return [plain(v) for v in value] if isinstance(value, list) else value


@pytest.mark.parametrize(("command", "option", "bare", "named"), ALIKE, ids=[f"{a[0][0]} {a[1]}" for a in ALIKE])
def test_a_time_without_a_unit_is_in_seconds(stabctl, command, option, bare, named):
    found = [stabctl(*command, option, value, "--json") for value in (bare, named)]
    assert [code for code, *_ in found] in ([0, 0], [1, 1]), found
    assert plain(json.loads(found[0][1])) == plain(json.loads(found[1][1]))


@pytest.mark.parametrize("command", ["simulate", "estimate"])
def test_a_clearing_time_without_a_unit_is_said_back_in_seconds_and_cycles(stabctl, command):
    _, said, _ = stabctl(command, *FAULT, "--clear", "0.1")
    assert "cleared after 0.1 s (6 cycles)" in re.sub(r"\s+", " ", said)
    assert "cleared after" not in stabctl(command, *FAULT, "--clear", "6cyc")[1]


def options():
    """Every option of every command, with the command."""

    def of(command, path):
        for name in getattr(command, "where", ()):
            yield from of(command.get_command(None, name), (*path, name))
        if not hasattr(command, "where"):
            yield from ((path, option) for option in command.params)

    return of(cli.app, ())


def test_every_option_that_takes_cycles_takes_seconds():
    times = [(" ".join(path), one) for path, one in options() if re.search(r"\dcyc\b", one.help or "")]
    assert {one.opts[0] for _, one in times} >= {"--clear", "--at", "--observe", "--resolution", "--limit", "--below"}
    assert not [(path, one.opts[0]) for path, one in times if one.metavar != "TIME"]


WRONG = {  # a command with an input that it refuses as soon as it looks at it
    "import": ("none.raw",),
    "simulate": ("none", *FAULT[1:], "--clear", "6cyc"),
    "estimate": ("none", *FAULT[1:], "--clear", "6cyc"),
    "clearing-time": ("none", *FAULT[1:]),
    "design optimum": ("none", *FAULT[1:]),
    "linearize": ("none", "--inputs", "vref:2", "--outputs", "speed:2"),
    "weak-grid": ("none", "--converter", "1"),
    "swing": ("--H", "-1"),
    "swing minimum-time": ("--H1", "-1"),
}
WRITES, ENDINGS = ("--out", "--plot", "--report", "--csv"), (".npz", ".toml", ".png", ".csv")


def written():
    """Every option that names what is written: command, option, its ending if it is a file."""
    for path, one in options():
        if one.opts[0] in WRITES and path[-1] != "run" and not one.is_flag:
            yield " ".join(path), one.opts[0], next((e for e in ENDINGS if e.strip(".") in one.help.lower()), "")


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="has no folder that nobody can write to")
@pytest.mark.parametrize(("command", "option", "ending"), [*written()])
def test_an_output_that_cannot_be_written_is_refused_first(stabctl, command, option, ending):
    wrong = WRONG.get(command) or WRONG.get(command.split()[0]) or ("none",)
    begun = stabctl(*command.split(), *wrong)
    code, out, err = stabctl(*command.split(), *wrong, option, f"/proc/{'x' + ending if ending else 'folder'}")
    assert begun[0] == code == 2
    assert not out
    assert begun[2] != err
    assert re.fullmatch(r"stabctl: (Cannot write to /proc|/proc/x\.\w+ cannot be written).*\n", err)

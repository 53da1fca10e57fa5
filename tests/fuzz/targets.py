"""What is mutated: case folders, overlays, arguments, studies, contingencies, results files."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from psse_replay import DATA, replays

from stabctl.cli import app
from stabctl.io.folder import PACKAGED

from . import kill, mutate
from .attempt import CORPUS, Attempt
from .judge import KEPT

CASES = "two_area", "two_area", "two_area", "two_area_pss", "ieee39"
ON_A_CASE = (  # cheap commands
    ["powerflow", "CASE", "--branches"],
    ["powerflow", "CASE", "--json"],
    ["simulate", "CASE", "--until", "0.2"],
    ["simulate", "CASE", "--fault", "7", "--clear", "3cyc", "--at", "0.05", "--until", "0.3", "--storage", "5%mva"],
    ["modes", "CASE", "--json"],
    ["linearize", "CASE", "--inputs", "vref", "--outputs", "speed", "--out", "x.npz"],
    ["tables", "CASE"],
)
IMPORTS = (
    ["import", "CASE", "--out", "mine"],
    ["import", "CASE", "--json"],
    ["powerflow", "CASE", "--json", "--missing", "injection", "--missing-controls", "fixed"],
)
BRIEF = "--fault 7-8@0.4 --storage 50MW --classical --observe 2 --longest 0s --resolution 1cyc --limit 30cyc"
DESIGNS = (
    ["design", "pss", "CASE", "--machine", "1", "--damping", "0.05", "--out", "kept.toml"],
    ["design", "pod", "CASE", "--input", "deviation:1", "--output", "order:1@5", "--storage", "50MW", "--json"],
    ["design", "pod", "CASE", "--rank", "--storage", "50MW"],
    ["design", "lqr", "CASE", "--classical", "--storage", "50MW", "--input", "angle, speed"],
    ["design", "lqg", "CASE", "--classical", "--storage", "50MW", "--json"],
    f"design law CASE {BRIEF} --scan 0s --return-within 0s".split(),
    f"design optimum CASE {BRIEF} --rate 10 --window 0.3s --iterations 1".split(),
)
COMMANDS = (
    *ON_A_CASE,
    [
        "simulate",
        "CASE",
        "--fault",
        "7",
        "--clear",
        "3cyc",
        "--until",
        "1.3",
        "--storage",
        "50MW",
        "--estimator",
        "kalman",
    ],
    ["simulate", "CASE", "--fault", "7-8@0.4", "--clear", "3cyc", "--until", "1.2", "--out", "kept.csv"],
    ["estimate", "CASE", "--fault", "7", "--clear", "3cyc", "--observe", "0.3", "--storage-at", "1=50MW,2@5=20MW"],
    [
        "clearing-time",
        "CASE",
        "--fault",
        "7",
        "--classical",
        "--observe",
        "0.5",
        "--limit",
        "6cyc",
        "--storage",
        "50MW",
    ],
    [
        "screen",
        "CASE",
        "--classical",
        "--observe",
        "0.3",
        "--limit",
        "3cyc",
        "--resolution",
        "1cyc",
        "--out",
        "kept.csv",
    ],
    ["modes", "CASE", "--band", "0.1", "2"],
    *DESIGNS,
    ["swing", "table1"],
    ["swing", "equal-area"],
    ["swing", "feedback"],
    ["swing", "minimum-time"],
    ["models", "genrou"],
    ["cases"],
)
VALUES = (
    "6cyc",
    "0.1s",
    "100ms",
    "5%mva",
    "5%dispatch",
    "50MW",
    "1=50MW,2@5=20MW",
    "7",
    "7-8",
    "7-8#2",
    "7-8@0.4",
    "1s",
)
VALUES += (
    "7-8@1s",
    "2@1s",
    "7:+50MW@1s",
    "7:-50MW-10Mvar@0.5s",
    "pss.1.K=10",
    "machines.2.p=5%",
    "loads.7.p=0",
    "none",
)
VALUES += (
    "bang-bang",
    "kalman",
    "frequency",
    "ideal",
    "kinematic",
    "filterpy",
    "current",
    "power",
    "conductance",
    "0.5Hz",
)
VALUES += (
    "120deg",
    "0.01,0.05",
    "vref:2",
    "speed:2",
    "storage:7",
    "line_p:7-8",
    "0.1..2Hz",
    "xy.csv",
    "xy.png",
    "no/x.csv",
)
LEFT_OUT = "--scheduler", "--workers", "--device", "--help", "--version"  # the network, processes, code of the user
STUDY = """kind = "simulate"
case = "two_area"
machines = "classical"
fault = ["7", "7-8@0.4"]
clear = "3cyc"
at_s = 0.05
until_s = 0.4
storage = "50MW"
control = "bang-bang"
estimator = "kalman"
seed = { from = 1, to = 3, step = 1 }
set."genrou.1.H" = [6.5, 7]
"""
CLEARING = """kind = "clearing-time"
case = "two_area"
machines = "classical"
fault = "7"
trip = "7-8"
storage = ["none", "20MW"]
observe_s = 0.5
limit = "6cyc"
resolution = "1cyc"
"""
CONTINGENCIES = """[[contingency]]
fault = "7"
clear = "3cyc"
trip = "7-8"

[[contingency]]
fault = "8-9@0.5"
clear = "4cyc"
"""


def _on(folder: str, command: list[str]) -> list[str]:
    return [folder if word == "CASE" else word for word in command]


def case(rng: Random) -> Attempt:
    """A case folder with other cells, tables or entries."""
    name = rng.choice(CASES)
    files: dict[str, str | None] = {}
    for _ in range(rng.choice((1, 1, 1, 2))):
        path = rng.choice(sorted(PACKAGED.joinpath(name).iterdir()))
        given, way = path.read_text(), rng.random()
        if way < 0.02:
            made = None
        elif way < 0.08:
            made = mutate.raw(rng, given.encode()).decode("utf-8", "surrogateescape")
        elif path.suffix == ".toml":
            made = mutate.toml(rng, given)
        else:
            made = mutate.table(rng, given)
        files[f"mine/{path.name}"] = made
    return Attempt("case", _on("mine", rng.choice(ON_A_CASE)), {"mine": name}, _encodable(files))


def overlay(rng: Random) -> Attempt:
    """A folder that extends a case."""
    files: dict[str, str | None] = {"mine/case.toml": 'extends = "two_area"\n'}
    if rng.random() < 0.2:
        files["mine/case.toml"] = mutate.toml(rng, 'extends = "two_area"\ntitle = "changed"\nbase_mva = 100\n')
    for _ in range(rng.choice((1, 2))):
        path = rng.choice(sorted((PACKAGED / "two_area").glob("*.csv")))
        files[f"mine/{path.name}"] = mutate.table(rng, path.read_text())
    return Attempt("overlay", _on("mine", rng.choice(ON_A_CASE)), {}, _encodable(files))


def _options() -> dict[tuple[str, ...], list[Any]]:
    """The options of every command, from the program itself."""
    found: dict[tuple[str, ...], list[Any]] = {}

    def walk(command: Any, path: tuple[str, ...]) -> None:
        for name in getattr(command, "where", ()):
            walk(command.get_command(None, name), (*path, name))
        found[path] = [p for p in command.params if p.opts[0].startswith("--") and p.opts[0] not in LEFT_OUT]

    walk(app, ())
    return found


OPTIONS = _options()


def arguments(rng: Random) -> Attempt:
    """Commands with other options and values."""
    words = _on("two_area", rng.choice(COMMANDS))
    known = OPTIONS.get(tuple(words[:2])) or OPTIONS[(words[0],)]
    for _ in range(rng.choice((1, 1, 2, 3))):
        option = rng.choice(known) if known else None
        if option is None or rng.random() < 0.15:
            i = rng.randrange(1, len(words) + 1)
            words[i:i] = [_value(rng)]
        elif option.opts[0] in words and not option.is_flag and rng.random() < 0.7:
            i = words.index(option.opts[0]) + 1
            words[i : i + 1] = (
                [mutate.text(rng, words[i]) if rng.random() < 0.5 else _value(rng)] if i < len(words) else []
            )
        else:
            flag = getattr(option, "is_flag", False)
            words += [rng.choice(option.opts), *(() if flag else [_value(rng) for _ in range(option.nargs)])]
    words = [word for word in words if not word.startswith(("/", "~"))]
    return Attempt("arguments", [_plain(word) for word in words], {}, {"kept.csv": KEPT})


def _value(rng: Random) -> str:
    way = rng.random()
    if way < 0.3:
        return rng.choice(VALUES)
    return mutate.text(rng, rng.choice(VALUES)) if way < 0.6 else rng.choice(mutate.ODD + mutate.NUMBERS)


def _plain(word: str) -> str:
    return word.replace("\0", "")  # no program can be given one


def study(rng: Random) -> Attempt:
    """Study files; their first jobs are run."""
    return Attempt("study", ["s.toml"], {}, _encodable({"s.toml": mutate.toml(rng, rng.choice((STUDY, CLEARING)))}))


def contingencies(rng: Random) -> Attempt:
    """Contingency files, read by place."""
    words = ["place", "two_area", "--classical", "--contingencies", "c.toml", "--observe", "0.3"]
    return Attempt("contingencies", words, {}, _encodable({"c.toml": mutate.toml(rng, CONTINGENCIES)}))


def results(rng: Random) -> Attempt:
    """Damaged results files."""
    given = (CORPUS / "results.db").read_bytes()
    made = mutate.raw(rng, given).decode("utf-8", "surrogateescape")
    words = ["sweep", "show", "r.db", *rng.choice(([], ["--json"], ["--csv", "kept.csv"]))]
    return Attempt("results", words, {}, {"r.db": made, "kept.csv": KEPT})


def imported(rng: Random) -> Attempt:
    """Files of other programs, of one base name so that one is found beside the other."""
    files: dict[str, str | None] = {
        f"x{path.suffix.lower()}": path.read_text(errors="surrogateescape") for path in rng.choice(_imported())
    }
    for name in {rng.choice(list(files)), rng.choice(list(files))}:
        given = files[name] or ""
        whole = given.encode("utf-8", "surrogateescape")
        spoilt = mutate.raw(rng, whole).decode("utf-8", "surrogateescape")
        files[name] = spoilt if rng.random() < 0.1 else mutate.lines(rng, given)
    command = rng.choice([words for words in (*ON_A_CASE, *IMPORTS) if "--fault" not in words])
    return Attempt("imported", _on("x.raw", command), {}, _encodable(files))


def matpower(rng: Random) -> Attempt:
    """MATPOWER files, some of them with typical machines."""
    path = rng.choice(sorted((DATA / "powermodels").glob("*.m")))
    given = path.read_text().replace("\t", " ")
    way = rng.random()
    if way < 0.1:
        made = mutate.raw(rng, given.encode()).decode("utf-8", "surrogateescape")
    else:
        made = mutate.lines(rng, given) if way < 0.9 else mutate.text(rng, given)
    command = rng.choice([words for words in (*ON_A_CASE, *IMPORTS) if "--fault" not in words])
    options = rng.choice(([], ["--machines", "typical"], ["--frequency", _value(rng)]))
    words = [_plain(word) for word in (*_on("x.m", command), *options)]
    return Attempt("matpower", words, {}, _encodable({"x.m": made}))


@cache
def _imported() -> list[tuple[Path, ...]]:
    """Files that belong together: a network, and its dynamic data, of which every model is there."""
    return [(replay.raw, replay.dyr) for replay in replays().values() if not replay.missing()]


def _encodable(files: dict[str, str | None]) -> dict[str, str | None]:
    """The files with surrogates only where they stand for bytes."""
    return {
        name: content and content.encode("utf-8", "surrogatepass").decode("utf-8", "surrogateescape")
        for name, content in files.items()
    }


TARGETS: dict[str, Callable[[Random], Attempt]] = {
    f.__name__: f for f in (case, overlay, arguments, study, contingencies, results, imported, matpower)
}


KILL = 1000  # one of so many inputs kills a sweep, which takes long


def attempt(seed: int, number: int) -> Attempt:
    """Attempt `number` of a run with this seed."""
    rng = Random(f"{seed} {number}")
    if number % KILL == KILL - 1:
        return kill.kill(rng)
    return list(TARGETS.values())[number % len(TARGETS)](rng)

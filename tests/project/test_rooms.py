"""The files of the package: how many, how long, and which import each other in a circle."""

import ast
import re
from collections import defaultdict
from functools import cache
from importlib.util import resolve_name
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parents[2]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in sorted((ROOT / "stabctl").rglob("*.py"))
}
MOST_LINES, LEAST_LINES = 450, 60
SMALL = {  # shorter files, each a thing of its own; devices are, too
    "a block of the compiled loop": {
        "dynamics.adder", "dynamics.drawn", "simulation.gate", "simulation.line",
    },
    "what others inherit or read": {"_util.verbs", "controllers.signals"},
    "imported before anything that takes long": {"_util.process", "view.figures.palette"},
    "run by name": {"simulation.prepare", "sweep._warm"},
    "a command": {"cli.live"},
}  # fmt: skip


@cache
def imports(name, typing=True):
    """Modules and names that a file imports, with those for type checking only or without."""
    package = name.rpartition(".")[0]
    found, todo = set(), [ast.parse(FILES[name].read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        if not typing and isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            home = resolve_name("." * node.level + (node.module or ""), package)
            found |= {home, *(f"{home}.{alias.name}" for alias in node.names)}
        todo += ast.iter_child_nodes(node)
    return frozenset(found)


def rooms(typing=True):
    """Package -> the packages that it imports."""
    found = defaultdict(set)
    for name in FILES:
        room = name.split(".")[1]
        if not room.startswith("__"):
            names = {other.split(".")[1] for other in imports(name, typing) if other.startswith("stabctl.")}
            found[room] |= names - {room}
    return found


def circles():
    """Files that lead to each other by their imports, group by group."""
    names = [name for name in FILES if not name.endswith("__init__")]
    place = {name: k for k, name in enumerate(names)}
    arrows = [(place[name], place[other]) for name in names for other in imports(name) & place.keys() - {name}]
    graph = sp.csr_matrix((np.ones(len(arrows)), np.array(arrows).T), shape=(len(names),) * 2)
    groups = defaultdict(list)
    for name, group in zip(names, connected_components(graph, connection="strong")[1], strict=True):
        groups[group].append(name)
    return [group for group in groups.values() if len(group) > 1]


def test_files_import_each_other_in_no_circle():
    assert circles() == []


def test_packages_stand_on_twelve_floors():
    """The floor of a package is one above the highest of those that it imports, for type checking only or not."""
    found = rooms()

    def floor(room):
        return 1 + max(map(floor, found[room]), default=0)

    assert max(map(floor, found)) == 12


def test_the_table_of_rooms_is_that_of_the_code():
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| .* \| ([\w, ]+|-) \|$", text, re.MULTILINE)
    assert {room: set(names.split(", ")) - {"-"} for room, names in rows} == rooms(typing=False)


def test_private_files_are_imported_within_their_package_only():
    """Files whose name begins with an underscore; `_util` is everybody's."""
    private = {name for name in FILES if name.rpartition(".")[2].startswith("_") and not name.endswith("__")}
    wrong = [
        f"{name} imports {other}"
        for name in FILES
        for other in private.intersection(imports(name))
        if not name.startswith(other.rpartition(".")[0] + ".")
    ]
    assert len(private) > 30
    assert wrong == []


def test_no_file_is_long_and_few_are_short():
    lines = {name.removeprefix("stabctl."): len(path.read_text("utf-8").splitlines()) for name, path in FILES.items()}
    assert {name: n for name, n in lines.items() if n > MOST_LINES} == {}
    short = {name for name, n in lines.items() if n < LEAST_LINES and not name.endswith("__init__")}
    assert {name for name in short if not name.startswith("devices.")} == set().union(*SMALL.values())


def test_a_file_is_more_than_two_pages_on_average():
    assert len(FILES) <= 442
    assert sum(len(path.read_text("utf-8").splitlines()) for path in FILES.values()) <= 72_538

"""Files with one thing wrong: what is said of each, and of those that are read nevertheless what was understood."""

import hashlib
import json
import re
from pathlib import Path

from described import described, timeless
from recordings.studies import GIVEN, STUDIES

import stabctl as st
from stabctl.assessment.prices import prices
from stabctl.io.contingencies import monitored

NUMBER = re.compile(r"(?<![\w.'])-?\d+(?:\.\d+)?(?!['\w.])")
KINDS = "left out", "twice", "x", "0", "-"
TWICE = 1  # damages of a line


def damaged(text):
    """The same text with another fault in each of its lines; what the fault is, and the text."""
    lines = text.splitlines()
    for k, line in enumerate(lines):
        numbers = list(NUMBER.finditer(line))
        for turn in range(TWICE if line.strip() else 0):
            what = KINDS[(k + 2 * turn) % len(KINDS)]
            if what == "left out" or not numbers:
                yield f"{k + 1} left out", [*lines[:k], *lines[k + 1 :]]
            elif what == "twice":
                yield f"{k + 1} twice", [*lines[: k + 1], *lines[k:]]
            else:
                one = numbers[(7 * k + 3 * turn) % len(numbers)]
                new = what if what != "-" else f"-{one[0]}"
                changed = f"{line[: one.start()]}{new}{line[one.end() :]}"
                yield f"{k + 1}, {one[0]} is {new}", [*lines[:k], changed, *lines[k + 1 :]]


def told(read, path, text):
    """What reading a damaged file says, or a sum of what was read."""
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    try:
        found = read(path)
    except st.StabctlError as error:
        return timeless(str(error))
    return summary(found)


def summary(found):
    """A case by its notes and the sums of its tables, anything else by a sum of what it has."""
    if not isinstance(found, st.Case):
        return digest(found)
    sums = {name: digest(getattr(found, name)) for name in ("buses", "branches", "machines", "loads", "devices")}
    return {"sizes": str(found), "notes": [timeless(note) for note in found.notes], **sums}


def digest(value):
    """A short sum of any value, of numbers with six digits."""
    text = json.dumps(described(value), default=str)
    return hashlib.sha256(re.sub(r"\d+\.\d+(e-?\d+)?", lambda m: f"{float(m[0]):.6g}", text).encode()).hexdigest()[:8]


def folder_case(path):
    """The case of the folder that a table is in."""
    return st.load(path.parent)


def beside(name):
    """Contingencies with the subsystems of another file."""
    return lambda path: st.read_contingencies(path, st.load("two_area"), path.with_name(name))


READ = {
    "five.raw": lambda path: st.read_psse(path, missing="injection", missing_controls="fixed"),
    "five.dyr": lambda path: st.read_psse(
        path.with_suffix(".raw"), path, missing="injection", missing_controls="fixed"
    ),
    "nine.m": st.read_matpower,
    "pair.m": st.read_pst,
    "some.toml": lambda path: st.read_contingencies(path, st.load("two_area")),
    "criteria.toml": st.criteria,
    "prices.toml": prices,
    "grid.con": beside("grid.sub"),
    "grid.sub": lambda path: beside("grid.sub")(path.with_name("grid.con")),
    "grid.mon": lambda path: monitored(path, st.load("two_area"), path.with_name("grid.sub")),
}
TABLES = "case.toml", "buses.csv", "branches.csv", "machines.csv", "loads.csv", "links.csv", "storage.csv", "genrou.csv"


def study(name, read):
    """A study of a given file with damages."""

    def found(folder):
        there = Path(folder) / "damaged"
        there.mkdir(exist_ok=True)
        for file in filter(Path.is_file, GIVEN.iterdir()):
            (there / file.name).write_bytes(file.read_bytes())
        whole = (there / name).read_text(encoding="utf-8")
        return {what: told(read, there / name, text) for what, text in damaged(whole)}

    return found


def tables(folder):
    """A case folder with damages in each of its tables."""
    found = {}
    for name in TABLES:
        path = Path(folder) / "mixed" / name
        whole = path.read_text(encoding="utf-8")
        for what, text in damaged(whole):
            found[f"{name} {what}"] = told(folder_case, path, text)
        path.write_text(whole, encoding="utf-8")
    return found


STUDIES |= {f"damaged {name}": study(name, read) for name, read in READ.items()} | {"damaged tables": tables}

"""Mutated numbers, texts, tables, TOML and bytes, from a seeded generator."""

import csv
import io
from random import Random

ODD = ("nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "5e-324", "0", "-0", "-1", "1e400", "9" * 400, "9" * 5000)
ODD += ("1_0", "\u0663", "\u00b2", "0x10", "1,5", "True", "None", "", " ", "--", "#", '"', "'", "\\", "\0", "\x1b[31m")
ODD += (
    "\n",
    "\r",
    "\u202e",
    "\u2028",
    "\udcff",
    "\u00e9",
    "../../x",
    "/",
    ".",
    "..",
    "*",
    "x" * 5000,
    "%s%n",
    "{0}",
    "[",
)
NUMBERS = ("1e-300", "1e-9", "1e-4", "0.01", "0.5", "1", "2", "3", "7", "60", "1e9", "1e13", "1e300")


def number(rng: Random, text: str) -> str:
    """Another number than the one in the text, if it is one."""
    try:
        value = float(text)
    except ValueError:
        return rng.choice(ODD)
    change = rng.randrange(4)
    if change == 0:
        return repr(value * 10 ** rng.uniform(-9, 9))
    if change == 1:
        return repr(-value)
    return repr(value * rng.uniform(0.5, 2)) if change == 2 else rng.choice(ODD + NUMBERS)


def text(rng: Random, given: str) -> str:
    """The text with a few characters removed, repeated, moved or replaced."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        i, j = sorted(rng.randrange(len(given) + 1) for _ in "ab")
        piece = rng.choice(("", given[i:j] * 2, given[i:j][::-1], rng.choice(ODD), rng.choice(NUMBERS)))
        given = given[:i] + piece + given[j if rng.random() < 0.5 else i :]
    return given[:20_000]


def table(rng: Random, given: str) -> str:
    """A CSV table with other cells, rows or columns."""
    rows = list(csv.reader(io.StringIO(given)))
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        i, j = rng.randrange(len(rows)), rng.randrange(len(rows[0]) or 1)
        change = rng.randrange(8)
        if change == 0:
            rows.insert(rng.randrange(len(rows)), list(rows[i]))
        elif change == 1 and len(rows) > 1:
            del rows[i]
        elif change == 2 and len(rows[0]) > 1:
            rows = [row[:j] + row[j + 1 :] for row in rows]
        elif change == 3:
            rows[i] = rows[i][:j]
        else:
            i = max(1, i) if len(rows) > 1 else 0
            rows[i] += [""] * (j + 1 - len(rows[i]))
            rows[i][j] = number(rng, rows[i][j])
    made = io.StringIO()
    csv.writer(made, lineterminator="\n", escapechar="\\").writerows(rows)
    return made.getvalue() if rng.random() < 0.95 else text(rng, made.getvalue())


def toml(rng: Random, given: str) -> str:
    """Lines `key = value` with another value, key or order."""
    lines = given.splitlines()
    for _ in range(rng.choice((1, 1, 2))):
        i = rng.randrange(len(lines))
        key, equals, value = lines[i].partition(" = ")
        change = rng.randrange(7)
        if change == 0:
            del lines[i]
            lines = lines or [""]
        elif change == 1:
            lines.insert(rng.randrange(len(lines)), lines[i])
        elif change == 2 or not equals:
            lines[i] = text(rng, lines[i])
        elif change == 3:
            lines[i] = (
                f"{key} = {rng.choice(('[]', '{}', '[[]]', 'true', '1979-05-27', '-1', '1e300', 'nan', '0', '[1, 2]'))}"
            )
        elif change == 4:
            lines[i] = f"{key} = [{value}, {value}, {number(rng, value)}]"
        elif value.startswith('"'):
            lines[i] = f'{key} = "{text(rng, value[1:-1])}"'
        else:
            lines[i] = f"{key} = {number(rng, value)}"
    return "\n".join(lines) + "\n"


def lines(rng: Random, given: str) -> str:
    """Lines of fields between commas or blanks with other fields, or in another order."""
    made = given.split("\n")
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        i, change = rng.randrange(len(made)), rng.randrange(10)
        if change == 0:
            made.insert(rng.randrange(len(made)), made[i])
        elif change == 1 and len(made) > 1:
            del made[i]
        elif change == 2:
            made[i] = text(rng, made[i])
        else:
            separator = "," if "," in made[i] else " "
            fields = made[i].split(separator)
            j = rng.randrange(len(fields))
            fields[j : j + 1] = rng.choice(([], [fields[j]] * 2, *[[number(rng, fields[j].strip())]] * 6))
            made[i] = separator.join(fields)
    return "\n".join(made)


def raw(rng: Random, given: bytes) -> bytes:
    """Bytes with some of them flipped, lost or repeated."""
    made = bytearray(given)
    for _ in range(rng.choice((1, 3, 30))):
        i = rng.randrange(len(made) or 1)
        change = rng.randrange(4)
        if change < 2 and made:
            made[i] = rng.randrange(256)
        elif change == 2:
            del made[i : i + rng.randrange(1, 2000)]
        else:
            made[i:i] = made[i : i + rng.randrange(1, 200)]
    return bytes(made)

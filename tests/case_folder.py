"""Case folders to spoil, and what is said of them."""

import csv
import shutil
from pathlib import Path

import pytest

from stabctl import io
from stabctl._util.errors import CaseError
from stabctl.io.folder import PACKAGED


def copied(name, target):
    shutil.rmtree(target, ignore_errors=True)
    return Path(shutil.copytree(PACKAGED / name, target))


def cells(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def put(path, rows):
    with path.open("w", newline="", encoding="utf-8", errors="surrogatepass") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def spoil(folder, table, row, column, value):
    """Put `value` into a cell; `row` counts lines of the file."""
    rows = cells(folder / f"{table}.csv")
    rows[row - 1][rows[0].index(column)] = value
    put(folder / f"{table}.csv", rows)


def complaint(folder):
    with pytest.raises(CaseError) as caught:
        io.load(folder)
    text = str(caught.value)
    assert "\n" not in text
    assert text.endswith((".", "?"))
    return text

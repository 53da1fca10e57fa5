"""The table of docs/placement.md, compared with the record of its fleets; test_cutting_planes has those of today."""

import json
import re
from pathlib import Path

import pytest

from placement_results import RECORD, STUDIES

PAGE = Path(__file__).parents[2] / "docs" / "placement.md"
ROWS = {
    "nine, classical": "`ieee39`, nine, classical machines",
    "six, classical": "the first six of them",
    "nine, full order": "`ieee39`, nine, full-order machines (figure)",
}


@pytest.fixture(scope="module")
def known():
    return json.loads(RECORD.read_text(encoding="utf-8"))


def test_the_table_of_the_page_is_that_of_the_record(known):
    text = PAGE.read_text(encoding="utf-8")
    assert set(known) == set(ROWS) == set(STUDIES)
    kalman = re.search(r"the third fleet must be ([\d.]+) times as large", text)[1]
    assert float(kalman) == known["nine, full order"]["with_kalman"]
    for name, title in ROWS.items():
        cells = re.search(rf"^\| {re.escape(title)} \|(.*)\|$", text, re.MULTILINE)[1].split("|")
        uniform, total, sites, bound, refined = map(float, cells)
        row = known[name]
        assert (uniform, total, bound) == tuple(round(row[key]) for key in ("uniform_mw", "total_mw", "cuts_mw"))
        assert (sites, refined) == (row["sites"], row["refined"])
        assert row["cuts_mw"] < row["total_mw"] < row["uniform_mw"]

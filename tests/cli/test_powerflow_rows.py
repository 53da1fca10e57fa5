"""The tables of `stabctl powerflow` for large systems."""

import json
import re

from stabctl.cli import powerflow


def test_a_long_table_ends_with_the_number_of_rows_left_out(stabctl, monkeypatch):
    monkeypatch.setattr(powerflow, "MOST", 10)
    whole = stabctl("powerflow", "ieee39", "--branches")[1]
    assert "more" not in whole
    assert len(re.findall(r"^\d+\t", whole, re.MULTILINE)) == 39 + 46
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    code, out, _ = stabctl("powerflow", "ieee39", "--branches")
    assert code == 0
    assert "and 29 more buses; in a pipe, and with --json, all of them are printed." in out
    assert "and 36 more branches; in a pipe, and with --json, all of them are printed." in out
    assert len(json.loads(stabctl("powerflow", "ieee39", "--json")[1])["buses"]) == 39

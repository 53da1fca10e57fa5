"""The tables of `stabctl powerflow` for large systems."""

import json

from stabctl.cli import powerflow


def test_a_long_table_ends_with_the_number_of_rows_left_out(stabctl, monkeypatch):
    monkeypatch.setattr(powerflow, "MOST", 10)
    code, out, _ = stabctl("powerflow", "ieee39", "--branches")
    assert code == 0
    assert "and 29 more buses; --json prints all of them." in out
    assert "and 36 more branches; --json prints all of them." in out
    assert len(json.loads(stabctl("powerflow", "ieee39", "--json")[1])["buses"]) == 39

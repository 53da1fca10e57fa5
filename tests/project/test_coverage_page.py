"""The page on coverage says of every system what its import report says."""

import shutil
from pathlib import Path

import coverage_page

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def test_systems_kinds_and_what_is_not_supported_are_listed(tmp_path):
    for name in ("whole", "part"):
        (tmp_path / name).mkdir()
        shutil.copy(EXAMPLES / "three.raw", tmp_path / name)
    dyr = (EXAMPLES / "three.dyr").read_text()
    (tmp_path / "whole" / "three.dyr").write_text(dyr)
    (tmp_path / "part" / "other.DYR").write_text(
        dyr + "102 'LOEXR1' 1  1 /\n103 'UFLSBL' 1 59 /\n103 'UFLSBL' 1 58 /\n"
    )
    text = coverage_page.page(tmp_path)
    assert "Complete: 1 of 2 systems.\nSupported: 10 of 13 dynamic records." in text
    assert "| `whole/three` | 3 | 2 | 5 | 5 | yes | 0.00071 | none | 0 |" in text
    assert "| `part/other` | 3 | 2 | 8 | 5 | no | 0.00071 | none | 0 |" in text
    assert "| IEEET1 | exciter | 2 | 2 |" in text
    assert "| UFLSBL | not modeled | 2 | 0 |" in text
    assert "- `part/other`, there is no model of this kind: LOEXR1 (1), UFLSBL (2)" in text


def test_a_system_that_cannot_be_read_is_told(tmp_path):
    shutil.copy(EXAMPLES / "three.raw", tmp_path)
    (tmp_path / "three.dyr").write_text("102 'GENROU' 1 x /\n")
    assert "`three` cannot be read: three.dyr line 1: the record has 1 constants" in coverage_page.page(tmp_path)

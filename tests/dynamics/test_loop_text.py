"""The generated loop of a device, as a file that can be read and a page that shows it."""

import ast
import re
from pathlib import Path

from stabctl import devices
from stabctl.dynamics import _codegen

KEPT = Path(__file__).parent / "golden" / "sexs.txt"
PAGE = Path(__file__).parents[2] / "docs" / "extending.md"


def test_the_loop_of_sexs_is_the_one_that_is_kept_and_shown():
    """After a change of the generator, read the new text, and write it into both files; the page breaks long lines."""
    text = _codegen.write(devices.every()["sexs"], "sexs", float)
    assert text == KEPT.read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python generated_sexs.py\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert ast.dump(ast.parse(shown)) == ast.dump(ast.parse(text))

import subprocess
import sys
from pathlib import Path

import pytest

SIMS = Path(__file__).parents[2] / "sims"


@pytest.mark.parametrize(("script", "pictures"), [("omib.py", 4), ("minimum_time.py", 3)])
def test_script_writes_its_pictures(script, pictures, tmp_path):
    subprocess.run([sys.executable, SIMS / script, tmp_path], check=True, capture_output=True)
    assert len(list(tmp_path.glob("figure*.png"))) == pictures

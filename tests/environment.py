"""The same surroundings for every run of the tests, and for the programs that they start; imported before numpy."""

import os
import signal
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TERMINAL = ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "TTY_COMPATIBLE")

for name in [*os.environ]:
    if name in TERMINAL or name.startswith(("PYTHON", "MPL")):
        del os.environ[name]
os.environ |= {
    "PYTHONPATH": os.pathsep.join(map(str, (ROOT, ROOT / "tools"))),  # this clone, not another that is installed
    "COLUMNS": "80",
    "TZ": "UTC",
    "MPLBACKEND": "agg",
    **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1"),  # one worker, one core
}
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job is started with it ignored

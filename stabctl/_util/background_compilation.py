"""Compilation of an entry point in a second process, while this one compiles other functions."""

import atexit
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from . import jit
from .cores import available

_running: dict[str, subprocess.Popen[bytes]] = {}


def start(where: str, script: str) -> None:
    """Compile an entry point in a separate process, unless it is on disk already or there is only one core.

    Parameters
    ----------
    where
        The entry point, "module:name". It is named rather than imported, because it may be in a higher package.
    script
        Module that calls it once, so that its machine code is written to disk.
    """
    module, _, name = where.partition(":")
    if module in _running or available() < 2 or not sys.executable or getattr(import_module(module), name).on_disk():
        return
    paths = str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "PYTHONSAFEPATH": "1"}
    nothing = subprocess.DEVNULL
    command = [sys.executable, "-m", script]
    _running[module] = subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing, env=environment)
    atexit.register(_stop, _running[module])
    jit.awaited[module] = _running[module].wait


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.terminate()
        process.wait()

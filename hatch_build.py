"""Hook of the build: a wheel for processors that STABCTL_LEVELS names has the machine code of every device.

    STABCTL_LEVELS="x86-64-v2 x86-64-v3" STABCTL_PYTHON=.venv/bin/python python -m build --wheel

Without it the wheel is pure, and compiles what it needs at its first use. STABCTL_PYTHON is a Python in which the
dependencies of stabctl are installed. The levels are compiled side by side, in about 4 minutes of processor time each.
"""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class MachineCode(BuildHookInterface):  # type: ignore[type-arg]
    """Adds a library for each level, and the list of its functions."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, unless the installation is editable; devices may be named in STABCTL_DEVICES."""
        levels, names = (os.environ.get(f"STABCTL_{what}", "").split() for what in ("LEVELS", "DEVICES"))
        if version == "editable" or not levels:
            return
        folder, tool = Path(self.root) / "build" / "machine_code", Path(self.root) / "tools" / "machine_code.py"
        where = os.environ | {"PYTHONPATH": self.root}
        python = os.environ.get("STABCTL_PYTHON", sys.executable)
        running = [subprocess.Popen([python, tool, level, folder, *names], env=where) for level in levels]
        failed = [one.wait() for one in running]
        if any(failed):
            raise RuntimeError("The machine code of a level was not made; see the messages above.")
        made = [folder / f"{level}.{ending}" for level in levels for ending in ("so", "json")]
        build_data["force_include"] |= {str(file): f"stabctl/_machine_code/{file.name}" for file in made}
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"], build_data["tag"] = False, f"py3-none-{platform}"

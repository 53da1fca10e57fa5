"""Where and when something was measured."""

import datetime
import platform
from pathlib import Path


def stated() -> str:
    """Processor and date, in words."""
    info = Path("/proc/cpuinfo")
    names = [k for k in info.read_text().splitlines() if k.startswith("model name")] if info.exists() else []
    name = names[0].partition(":")[2].strip() if names else platform.processor() or platform.machine()
    return f"{name}, one core, {datetime.date.today()}"

"""Atomic writing of files: a file is written completely or not at all."""

import os
import re
import tempfile
from pathlib import Path


def replace(path: Path, content: str | bytes) -> None:
    """Replace a file only when the new one is completely on disk. Raises OSError if it cannot."""
    number, part = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(number, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(part, 0o644)
        os.replace(part, path)
    except BaseException:
        os.unlink(part)
        raise


def safe_name(text: str) -> str:
    """Return text as the name of a file: letters, digits, `-`, `_` and inner dots; anything else is an underscore."""
    return re.sub(r"[^\w.-]+", "_", text).strip("._")[:100] or "unnamed"

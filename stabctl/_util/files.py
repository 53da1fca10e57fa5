"""Atomic writing of files: a file is written completely or not at all."""

import os
import re
import tempfile
from pathlib import Path

from stabctl.errors import StudyError, shown


def path_of(given: object) -> Path:
    """The path that was given. `StudyError` if it is neither text nor a path."""
    if not isinstance(given, str | Path) or not str(given).strip():
        raise StudyError(f"{shown(given)} is not the name of a file or folder; give text, such as 'run.csv'.")
    return Path(given)


def check(path: Path) -> None:
    """Raise `StudyError` if a file cannot be written, before any work is done for it."""
    try:
        number, part = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(number)
        os.unlink(part)
    except OSError as error:
        raise _unwritable(path, error) from None


def replace(path: Path, content: str | bytes) -> None:
    """Replace a file only when the new one is completely on disk. `StudyError` if it cannot; the old one then stays."""
    try:
        _replace(path, content)
    except OSError as error:
        raise _unwritable(path, error) from None


def _unwritable(path: Path, error: OSError) -> StudyError:
    if not path.parent.is_dir():
        return StudyError(f"There is no folder {str(path.parent)!r} to write {path.name!r} to; create it first.")
    kept = "; what it held before is unchanged" if path.is_file() else ""
    return StudyError(f"{path} cannot be written: {error.strerror or error}; choose another file or folder{kept}.")


def _replace(path: Path, content: str | bytes) -> None:
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

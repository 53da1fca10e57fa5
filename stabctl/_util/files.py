"""Atomic writing of files: a file is written completely or not at all."""

import errno
import hashlib
import os
import re
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import StudyError, shown


def path_of(given: object) -> Path:
    """The path that was given. `StudyError` if it is neither text nor a path."""
    if not isinstance(given, str | Path) or not str(given).strip():
        raise StudyError(f"{shown(given)} is not the name of a file or folder; give text, such as 'run.csv'.")
    return Path(given)


def check(path: Path) -> None:
    """Raise `StudyError` if a file cannot be written, before any work is done for it."""
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, "it is a folder")
        with _beside(_target(path)) as (file, part):
            file.close()
            part.unlink()
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


def _target(path: Path) -> Path:
    """The file that a link leads to."""
    return Path(os.path.realpath(path))


@contextmanager
def _beside(path: Path) -> Iterator[tuple[BinaryIO, Path]]:
    """A new file next to `path`, with its permissions, or those of any new file; it is removed after an error."""
    part = path.with_name(f".{path.name[:100]}.{secrets.token_hex(4)}")
    with part.open("xb") as file:
        try:
            with suppress(FileNotFoundError):
                part.chmod(stat.S_IMODE(path.stat().st_mode))
            yield file, part
        except BaseException:
            part.unlink()
            raise


def _replace(path: Path, content: str | bytes) -> None:
    path, data = _target(path), content.encode() if isinstance(content, str) else content
    if path.exists() and not path.is_file() and not path.is_dir():
        path.write_bytes(data)  # a device, which must not be replaced
        return
    with _beside(path) as (file, part):
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
        file.close()  # before it is moved, for Windows
        part.replace(path)


def keep(path: Path, content: bytes) -> None:
    """Write a file that `kept` reads; nothing happens if it cannot be written."""
    with suppress(OSError):
        _replace(path, hashlib.sha256(content).digest() + content)


def kept(path: Path) -> bytes | None:
    """What `keep` has written; None if there is no such file, or it is damaged or cannot be read."""
    try:
        found = path.read_bytes()
    except OSError:
        return None
    content = found[32:]
    return content if hashlib.sha256(content).digest() == found[:32] else None


def safe_name(text: str) -> str:
    """Return text as the name of a file: letters, digits, `-`, `_` and inner dots; anything else is an underscore."""
    return re.sub(r"[^\w.-]+", "_", text).strip("._")[:100] or "unnamed"

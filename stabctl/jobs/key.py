"""The key of a job: the SHA-256 of everything that determines its row."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stabctl import devices
from stabctl.errors import StudyError
from stabctl.model.case import Case
from stabctl.model.tables import TABLES


def sha256(content: object) -> str:
    """SHA-256 of the text of a content."""
    return hashlib.sha256(canonical(content).encode()).hexdigest()


def canonical(content: object) -> str:
    """The unique JSON text of a content."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def text(content: object) -> str:
    """The unique JSON text of records, numbers and texts, such as a control law, with the names of the classes."""
    return canonical(_plain(content))


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else str(value)
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        named = {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"class": type(value).__name__, **named}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    what = getattr(value, "__name__", type(value).__name__)
    raise StudyError(
        f"The Python function or object {what} cannot be kept in a store or sent to a cluster, because a later change "
        "of it would go unnoticed; give a law or a controller with matrices, or leave out the store and the scheduler."
    )


def fingerprint(case: Case) -> str:
    """SHA-256 of the content of a case, wherever it was read from, and of the user's own devices in it."""
    content: dict[str, Any] = {name: [row._asdict() for row in getattr(case, name)] for name in TABLES}
    content |= {name: getattr(case, name) for name in ("name", "base_mva", "frequency_hz")}
    content["devices"] = {
        model: [[number, par._asdict()] for number, par in rows.items()] for model, rows in case.devices.items()
    }
    files = {model: Path(devices.every()[model].file) for model in case.devices}
    known = devices.registered()
    own = {model: file.read_text(encoding="utf-8") for model, file in files.items() if str(file) in known}
    content |= {"device_files": own} if own else {}
    return sha256(content)

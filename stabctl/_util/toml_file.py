"""TOML files checked with pydantic models; every error is one sentence."""

import difflib
import json
import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from . import files
from .errors import StudyError, shown

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

Model = TypeVar("Model", bound="BaseModel")
LARGEST = 1_000_000  # bytes of a file


def read(path: Path, what: str) -> dict[str, Any]:
    """The content of a TOML file; `what` names it in a sentence: "study file".

    Raises StudyError if there is no such file, or if it cannot be read, is too large, or is not TOML.
    """
    try:
        with path.open("rb") as file:
            text = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise StudyError(f"The {what} {str(path)[:200]!r} cannot be read: {reason}.") from None
    if len(text) > LARGEST:
        raise StudyError(f"The {what} {path} has more than {LARGEST} bytes; split it into several files.")
    try:
        return tomllib.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise StudyError(f"The {what} {path} is not valid TOML: {error}.") from None


def target(path: str | Path) -> Path:
    """The path of a file to write. Raises `StudyError` if it does not end in .toml."""
    found = files.path_of(path)
    if found.suffix.lower() != ".toml":
        raise StudyError(f"The file {found.name!r} must end in .toml.")
    return found


def as_text(value: Any) -> str:
    """A value as TOML: that of JSON, but for infinities."""
    if isinstance(value, list):
        return f"[{', '.join(as_text(v) for v in value)}]"
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return json.dumps(value, ensure_ascii=False)


def validated(model: "type[Model]", content: Any, where: str) -> "Model":
    """The content as a model. Raises StudyError with the place, key and value of the first error.

    The description of a field says what is allowed; a `PydanticCustomError` of type "custom" says what is wrong.
    """
    from pydantic import ValidationError

    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise StudyError(_sentence(model, error, content, where)) from None


def unknown(key: str, known: Iterable[str]) -> str:
    """Message about an unknown key, with the most similar known one."""
    known = list(known)
    near = difflib.get_close_matches(key, known, n=1)
    return f"{key!r} is not a known key; " + (
        f"did you mean {near[0]!r}?" if near else f"the keys are {', '.join(known)}."
    )


def _sentence(model: "type[BaseModel]", error: "ValidationError", content: Any, where: str) -> str:
    found = error.errors(include_url=False, include_context=False)
    # a misspelled key also makes the correct one missing
    first = next((e for e in found if e["type"] == "extra_forbidden"), found[0])
    key, *inner = map(str, first["loc"] or [""])
    if first["type"] == "extra_forbidden":
        return f"{where}: {unknown(key, model.model_fields)}"
    field = model.model_fields.get(key)
    allowed = field.description if field else first["msg"]
    if first["type"] == "missing":
        return f"{where}: {key} is missing; it must be {allowed}."
    if inner and isinstance(content[key], dict):
        key = f"{key}.{inner[0]}"
    said = first["msg"] if first["type"] == "custom" else f"it must be {allowed}"
    return f"{where}, {key} = {shown(first['input'], 80)}: {said}."

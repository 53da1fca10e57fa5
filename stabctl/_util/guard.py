"""Check of a frozen dataclass whose fields are written `name: Annotated[float, unit, meaning, constraint]`."""

from typing import Any

from stabctl.errors import StudyError, shown
from stabctl.schema import fields
from stabctl.units import NUMBER, kind_of, quantity

from .validation import fault


def guard(record: Any, *, omitted: bool = True) -> None:
    """Check the annotated fields of a frozen dataclass, called from its `__post_init__`.

    A field that is None was omitted, where this is allowed. Text with a unit ("100mHz") becomes a number in the unit of
    the field.

    Raises
    ------
    StudyError
        For the first value that is not allowed; it names the field, the value and what it must be.
    """
    kind: type = type(record)
    for name, f in fields(kind).items():
        value = getattr(record, name)
        if value is None and omitted:
            continue
        if isinstance(value, str) and f.kind is float and kind_of(f.unit) not in (None, NUMBER):
            value = _number(name, value, f.unit)
            object.__setattr__(record, name, value)
        expected = fault(f, value)
        if expected:
            unit = "" if f.unit == "-" or isinstance(value, str) else f" {f.unit}"
            given = f"{value:g}" if isinstance(value, float) else shown(value)
            raise StudyError(f"{name} = {given}{unit} ({f.meaning}) must be {expected}.")


def _number(name: str, text: str, unit: str) -> float:
    """The number that a text with a unit holds."""
    try:
        return quantity(text, unit, bare=False)
    except StudyError as error:
        raise StudyError(f"{name}: {error}") from None

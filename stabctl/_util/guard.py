"""Guard of a frozen dataclass whose fields are written `name: Annotated[float, unit, meaning, Range]`."""

import math
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from stabctl.errors import StudyError
from stabctl.schema import ANY, Range


def guard(record: Any) -> None:
    """Refuse the first annotated field that is not a finite number in its range.

    A field left out (None) passes. Raises StudyError, which names the field, its value and what is allowed.
    """
    for name, hint in get_type_hints(type(record), include_extras=True).items():
        value = getattr(record, name)
        if get_origin(hint) is not Annotated or value is None:
            continue
        _, unit, meaning, *rest = get_args(hint)
        allowed = next((r for r in rest if isinstance(r, Range)), ANY)
        if value not in allowed or isinstance(value, bool) or not math.isfinite(value):
            wanted = "a finite number" if allowed == ANY else f"a finite number, {allowed}"
            shown = f"{value:g}" if isinstance(value, int | float) else repr(value)
            raise StudyError(f"{name} = {shown}{'' if unit == '-' else ' ' + unit} ({meaning}) must be {wanted}")

"""Commands with options grouped in records."""

import functools
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """The command for typer: a parameter that is a record of options becomes one option per field of the record.

    Parameters
    ----------
    command
        A function; a record is a NamedTuple whose fields are `Annotated` with their `typer.Option`.
    """
    hints, records, parameters = get_type_hints(command, include_extras=True), {}, []
    for name, parameter in inspect.signature(command).parameters.items():
        if not hasattr(hints[name], "_fields"):
            parameters.append(parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=hints[name]))
            continue
        record = records[name] = hints[name]
        for field, hint in get_type_hints(record, include_extras=True).items():
            default = record._field_defaults.get(field, parameter.empty)
            parameters.append(inspect.Parameter(field, parameter.KEYWORD_ONLY, default=default, annotation=hint))

    @functools.wraps(command)
    def flat(**given: Any) -> None:
        made = {name: record(*(given.pop(field) for field in record._fields)) for name, record in records.items()}
        command(**given, **made)

    flat.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    flat.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return flat
